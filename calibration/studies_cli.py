"""``mfar study``: longer studies of the calibration, each an object of numbers, tables and plain words."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, jsonable, progress

app = typer.Typer(help="Longer studies: synthetic round trip, every law on the cupro curves, sensitivities, meshes.",
                  no_args_is_help=True)

Out = Annotated[Path | None, typer.Option("--out", "-o", help="Output folder; out/study-NAME by default.")]
WorkersOption = Annotated[int, typer.Option(min=1, help="Local worker processes (more than 1 needs the extra 'cluster').")]
Scheduler = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead of local workers.")]
Resume = Annotated[bool, typer.Option("--resume/--fresh", help="Go on from what the folder holds.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]


@app.command("round-trip")
def round_trip(
    seeds: Annotated[int, typer.Option(min=1, help="Noisy repetitions.")] = 20,
    noise: Annotated[float, typer.Option(help="Standard deviation of the noise, fraction of the range.")] = 0.01,
    truth: Annotated[str, typer.Option(help="Mesh that makes the data: draft, standard or reference.")] = "reference",
    fitted: Annotated[str, typer.Option(help="Mesh that fits them.")] = "standard",
    profiles: Annotated[bool, typer.Option(help="Trace the whole profiles of mu and nu for the first seed.")] = True,
    out: Out = None,
    workers: WorkersOption = 1,
    scheduler: Scheduler = None,
    resume: Resume = True,
    as_json: Json = False,
) -> None:
    """Find a known truth again from noisy synthetic strips and overhangs; do the intervals cover it?"""
    folder = _folder(out, "round-trip")
    from calibration.runs import Workers
    from calibration.studies.round_trip import Settings, run

    settings = Settings(noise=noise, truth=_fidelity(truth, "--truth"), fitted=_fidelity(fitted, "--fitted"))
    with _stages(as_json) as stage:
        payload = run(seeds, settings, with_profile=profiles, folder=folder / "runs", resume=resume,
                      where=Workers(workers, scheduler), progress=stage)
    _finish("round-trip", payload, folder, as_json, _show_round_trip)


@app.command()
def cupro(
    law: Annotated[
        list[str] | None, typer.Option("--law", "-l", help="Law (repeatable; 'my_law.py:name' too); all by default.")
    ] = None,
    variant: Annotated[list[str] | None, typer.Option(help="State of the fabric (repeatable); preconditioned and virgin.")] = None,
    level: Annotated[str, typer.Option(help="fe, fe-draft, fe-reference or homogeneous.")] = "fe",
    starts: Annotated[int, typer.Option(min=1, help="Starting points a law without a mesh.")] = 3,
    seed: Annotated[int, typer.Option(help="Of the starting points.")] = 0,
    max_evaluations: Annotated[int, typer.Option(min=1, help="Forward evaluations a fit.")] = 200,
    out: Out = None,
    workers: WorkersOption = 1,
    scheduler: Scheduler = None,
    resume: Resume = True,
    as_json: Json = False,
) -> None:
    """Fit every law by finite elements to the cupro strips in three directions at once; say why one cannot do it."""
    folder = _folder(out, "cupro")
    from calibration.cli import resolve_laws
    from calibration.forward import level as level_factory
    from calibration.runs import Workers
    from calibration.studies.cupro import VARIANTS, run

    laws = resolve_laws(law)
    level_factory(level)
    with _stages(as_json) as stage:
        payload = run(laws, variant or VARIANTS, level, folder=folder / "checkpoints", starts=starts, seed=seed,
                      max_evaluations=max_evaluations, resume=resume, where=Workers(workers, scheduler), progress=stage)
    _finish("cupro", payload, folder, as_json, _show_cupro)


@app.command()
def sensitivities(out: Out = None, as_json: Json = False) -> None:
    """Compare exact sensitivities with central differences, and those reached in 1, 5 and 20 load steps."""
    folder = _folder(out, "sensitivities")
    from calibration.studies.sensitivities import run

    with _stages(as_json) as stage:
        payload = run(progress=stage)
    _finish("sensitivities", payload, folder, as_json, _show_sensitivities)


@app.command()
def mesh(
    refit: Annotated[bool, typer.Option(help="Fit YarnNetwork on several meshes.")] = True,
    variant: Annotated[str, typer.Option(help="State of the fabric the refits use.")] = "preconditioned",
    out: Out = None,
    workers: WorkersOption = 1,
    scheduler: Scheduler = None,
    resume: Resume = True,
    as_json: Json = False,
) -> None:
    """Show what the mesh does to the force of a clamped bias strip and to the parameters fitted on it."""
    folder = _folder(out, "mesh")
    from calibration.runs import Workers
    from calibration.studies.mesh import REFITTED, run

    with _stages(as_json) as stage:
        payload = run(refitted=REFITTED if refit else (), variant=variant, folder=folder / "runs", resume=resume,
                      where=Workers(workers, scheduler), progress=stage)
    _finish("mesh", payload, folder, as_json, _show_mesh)


@app.command()
def drape(
    fabric: Annotated[str, typer.Argument(help="A preset with a measured drape, or a fabric file.")] = "faille",
    fidelity: Annotated[str, typer.Option(help="draft, standard or reference.")] = "draft",
    size: Annotated[list[str] | None, typer.Option(help="Specimen (repeatable); iso-30 and jis-254 by default.")] = None,
    out: Out = None,
    workers: WorkersOption = 2,
    as_json: Json = False,
) -> None:
    """Sweep what is not known of a drape (shear, specimen, hysteresis, twist) and compare the bands with the measurement."""
    folder = _folder(out, f"drape-{Path(fabric).stem}")
    from material_tests.drape.plots import plot_study
    from material_tests.drape.study import STUDY_SIZES, render_study, study
    from mfar_fem.materials import Fabric

    with progress("drape") as advance:
        payload = study(Fabric.load(fabric), fidelity, sizes=size or STUDY_SIZES, out=folder, workers=workers,
                        progress=lambda label, _: advance(1, description=label))
    _finish("drape", payload, folder, as_json, render_study, plot_study(payload))


@app.command("drape-inverse")
def drape_inverse(
    shear: Annotated[list[float] | None, typer.Option(help="Shear stiffness assumed, N/m (repeatable); 5, 15 and 50.")] = None,
    data: Annotated[Path | None, typer.Option(help="CSV of the 618 measured fabrics, for the percentiles.")] = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Find the bending rigidity that explains the measured drape of the named Leeds fabrics, and how usual it is."""
    folder = _folder(out, "drape-inverse")
    from material_tests.drape.inverse import inverse_study, population, render_inverse
    from material_tests.drape.plots import plot_inverse

    with progress("drape, inverse") as advance:
        rows = inverse_study(shear=tuple(shear or (5.0, 15.0, 50.0)), data=data,
                             progress=lambda row: advance(1, description=row["name"]))
    _finish("drape-inverse", {"rows": rows}, folder, as_json, lambda payload: [render_inverse(payload["rows"])],
            plot_inverse(rows, population(data)))


@app.command("drape-mesh")
def drape_mesh(
    fabric: Annotated[str, typer.Argument(help="Preset or fabric file.")] = "faille",
    folds: Annotated[int | None, typer.Option(min=0, help="Start from so many folds; default: nearly flat, carried up.")] = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Refine the mesh under one branch of a drape: how far its coefficient is from converged."""
    folder = _folder(out, "drape-mesh")
    from material_tests.drape import DrapeTest, Seed
    from material_tests.drape.study import mesh_convergence, render_convergence
    from mfar_fem.materials import Fabric

    start = Seed("flat", 1) if folds is None else Seed("folds", folds)
    with progress("drape, meshes") as advance:
        rows = mesh_convergence(Fabric.load(fabric), DrapeTest(), start, carried=folds is None,
                                progress=lambda row: advance(1, description="{} × {}".format(*row["cells"])))
    _finish("drape-mesh", {"fabric": fabric, "start": start.label, "rows": rows}, folder, as_json,
            lambda payload: render_convergence(payload["rows"]))


def _folder(out: Path | None, name: str) -> Path:
    return check_writable(out if out is not None else Path("out") / f"study-{name}")


def _fidelity(name: str, option: str) -> str:
    from material_tests.strip.fe import TRIANGLES
    from mfar_fem.errors import UnknownNameError

    if name not in TRIANGLES:
        raise UnknownNameError(f"{option} {name}: unknown fidelity; known: {', '.join(TRIANGLES)}")
    return name


@contextlib.contextmanager
def _stages(quiet: bool) -> Iterator:
    """A progress bar on stderr that starts again with every stage."""
    with progress("starting", quiet=quiet) as advance:

        def stage(name: str, done: int, total: int) -> None:
            advance(0, description=name, completed=done, total=total)

        yield stage


def _finish(name: str, payload: dict, folder: Path, as_json: bool, render, figure=None) -> None:
    """Write NAME.json and the picture, if there is one, and print the result."""
    file = folder / f"{name}.json"
    payload = {"study": name} | payload | {"files": {"json": str(file)}}
    if figure is not None:
        from calibration.plots import save

        payload["files"]["pictures"] = save(figure, folder, name)
    file.write_text(json.dumps(jsonable(payload), indent=2, allow_nan=False) + "\n", encoding="utf-8")
    emit(payload, as_json, lambda p: [*render(p), f"written: {file}"])


def _table(title: str, columns: Mapping[str, Any], rows) -> Any:
    """A table from a heading -> side mapping and rows of text."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for k, (heading, side) in enumerate(columns.items()):
        table.add_column(heading, justify=side, no_wrap=k == 0)
    for row in rows:
        table.add_row(*(escape(str(cell)) for cell in row))
    return table


def _show_round_trip(p) -> list:
    rows = []
    for r in p["per_seed"]:
        low, high = r["interval"]["mu"]
        covered = "yes" if r["covered_linear"]["mu"] else "no"
        rows.append((r["seed"], f"{r['parameters']['law.mu'] / 1e3:.2f}", f"{low / 1e3:.2f} to {high / 1e3:.2f}", covered,
                     f"{r['parameters']['law.nu']:.3g}", "open" if r["nu_without_upper_bound"] else "bounded"))
    columns = {"seed": "right", "mu kPa": "right", "95 % interval": "right", "covers": "left", "nu": "right", "nu above": "left"}
    verdict = "passed" if p["passed"] else "[bold red]not passed[/bold red]"
    return [_table("Synthetic round trip", columns, rows), *map(_plain, p["words"]), f"{verdict} in {p['wall_s']:.1f} s"]


def _show_cupro(p) -> list:
    shown: list[Any] = []
    columns = {"law": "left", "RMSE %": "right", "each": "left", "p": "right", "AICc": "right", "stable": "left",
               "time": "right", "target": "left"}
    for variant, found in p["variants"].items():
        rows = []
        for r in found["laws"]:
            if r.get("error"):
                rows.append((r["law"], "-", r["error"], "-", "-", "-", "-", "no"))
                continue
            errors = " / ".join(f"{v:.1f}" for v in r["rmse_by_experiment"].values())
            rows.append((r["law"], f"{r['rmse_percent_of_range']:.2f}", errors, r["n_parameters"], f"{r['aicc']:.1f}",
                         "yes" if r["stable"] else "no", f"{r['n_evaluations']} x {r['evaluation_s']:.2f} s",
                         "reached" if r["reaches_target"] else "missed"))
        order = " / ".join(name.split(",")[0] for name in found["experiments"])
        shown.append(_table(f"cupro SU-1098, {variant} ({p['level']}; {order}; {found['wall_s']:.0f} s)", columns, rows))
    return [*shown, *map(_plain, p["words"])]


def _show_sensitivities(p) -> list:
    columns = {"case": "left", "derivatives": "right", "against differences": "right", "against load steps": "right"}
    rows = [(c["case"], len(c["parameters"]), f"{c['max_relative_deviation']:.1e}", f"{c['max_load_step_deviation']:.1e}")
            for c in p["cases"]]
    return [_table("Exact sensitivities: largest relative deviation", columns, rows), *map(_plain, p["words"])]


def _show_mesh(p) -> list:
    columns = {"mesh": "left", "triangles": "right", "pattern": "left"} | {f"{100 * e:g} %": "right" for e in p["strain"]}
    rows = []
    for r in p["forces"]:
        errors = ["-" if e is None else f"{f:.4g} ({e:+.1f} %)" for f, e in
                  zip(r["line_force_N_per_m"], r["error_percent"], strict=True)]
        rows.append((r["mesh"], r["triangles"], r["pattern"], *errors))
    shown = [_table("Bias strip, N/m at fixed parameters (error against the finest mesh)", columns, rows)]
    if p["refits"]:
        names = list(p["refits"][0]["parameters"])
        columns = {"mesh": "left", "RMSE %": "right"} | dict.fromkeys(names, "right")
        rows = [(r["mesh"], f"{r['rmse_percent_of_range']:.2f}", *(f"{r['parameters'][n]:.4g}" for n in names))
                for r in p["refits"]]
        shown.append(_table("yarn-network refitted on each mesh", columns, rows))
    return [*shown, *map(_plain, p["words"])]


def _plain(text: str) -> str:
    from rich.markup import escape

    return escape(text)
