"""The commands ``mfar calibrate`` and ``mfar validate``."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from mfar_fem.errors import NotConvergedError

Out = Annotated[Path | None, typer.Option("--out", "-o", help="Output folder; out/DATASET by default.")]
Variant = Annotated[str | None, typer.Option(help="State of the fabric, e.g. preconditioned, virgin, envelope.")]
WorkersOption = Annotated[
    int, typer.Option(min=0, help="Local worker processes; 0: one a core where the extra 'cluster' is installed, else 1.")
]
Scheduler = Annotated[str | None, typer.Option(help="Address of a Dask scheduler to use instead of local workers.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
Level = Annotated[str, typer.Option(help="Forward model: homogeneous (no mesh), fe, fe-draft or fe-reference (meshes).")]


def calibrate(
    dataset: Annotated[str, typer.Argument(help="Shipped dataset (cupro-su1098), folder, dataset.toml or U3M .json file.")],
    out: Out = None,
    law: Annotated[
        list[str] | None, typer.Option("--law", "-l", help="Law to compare (repeatable; 'my_law.py:name' too); all by default.")
    ] = None,
    fabric: Annotated[
        str | None, typer.Option(help="Fabric file or preset for thickness, areal density and bending; else the dataset's.")
    ] = None,
    variant: Variant = None,
    level: Level = "fe",
    fe_laws: Annotated[str, typer.Option(help="Laws refitted at the second level: best or all.")] = "best",
    starts: Annotated[int, typer.Option(min=1, help="Starting points a law at the homogeneous level.")] = 3,
    bootstrap: Annotated[int, typer.Option(min=0, help="Bootstrap replicates of the final fit; 0 for none.")] = 0,
    bootstrap_method: Annotated[str, typer.Option(help="residual, case, block or specimen.")] = "block",
    profiles: Annotated[bool, typer.Option(help="Profile likelihood of every parameter.")] = True,
    cross_validation: Annotated[bool, typer.Option(help="Refit on part of the curves, predict the rest.")] = True,
    seed: Annotated[int, typer.Option(help="Of the starting points and the bootstrap.")] = 0,
    max_evaluations: Annotated[int, typer.Option(min=1, help="Forward evaluations a start.")] = 200,
    workers: WorkersOption = 0,
    scheduler: Scheduler = None,
    resume: Annotated[bool, typer.Option("--resume/--fresh", help="Go on from the checkpoints in the folder.")] = True,
    json: Json = False,
) -> None:
    """Fit laws to measured curves and write calibration.json, parameters.toml, plots and report.html."""
    from calibration.forward import level as level_factory
    from calibration.runs import Workers
    from mfar_fem.cli.console import check_writable

    folder = check_writable(out if out is not None else Path("out") / Path(dataset).stem)
    laws = resolve_laws(law)
    level_factory(level)
    data = _dataset(dataset, variant)
    base = _fabric(fabric)
    from calibration.report import write
    from calibration.study import calibrate as run

    checkpoints = folder / "checkpoints"
    with _stages(quiet=json) as progress:
        study = run(
            data,
            laws,
            fabric=base,
            level=level,
            fe_laws=fe_laws,
            starts=starts,
            seed=seed,
            max_evaluations=max_evaluations,
            replicates=bootstrap,
            bootstrap_method=bootstrap_method,
            with_profiles=profiles,
            cross_validation=cross_validation,
            checkpoints=checkpoints,
            resume=resume,
            where=Workers.choose(workers, scheduler),
            progress=progress,
        )
        files = write(study, folder, extra=cantilever_in_words(study.calibrated()))
    _show_calibration(study, files, json)
    if not study.fit.converged:
        raise typer.Exit(NotConvergedError.exit_code)


def validate(
    fabric: Annotated[str, typer.Argument(help="Fabric file or preset.")],
    dataset: Annotated[str, typer.Argument(help="Shipped dataset, folder, dataset.toml or U3M .json file.")],
    out: Out = None,
    variant: Variant = None,
    level: Level = "fe",
    cross_validation: Annotated[bool, typer.Option(help="Also refit the fabric's law on part, predict the rest.")] = True,
    workers: WorkersOption = 0,
    scheduler: Scheduler = None,
    json: Json = False,
) -> None:
    """Compare a fabric's prediction with measurement by strain interval and direction; nothing of it is fitted."""
    from calibration.forward import level as level_factory
    from calibration.runs import Workers
    from mfar_fem.cli.console import check_writable

    folder = check_writable(out if out is not None else Path("out") / f"validate-{Path(dataset).stem}")
    level_factory(level)
    cloth, data = _fabric(fabric), _dataset(dataset, variant)
    from calibration.validation import by_interval, cross_validate, predict_all
    from calibration.validation_report import write

    with _stages(quiet=json) as progress:
        checks = predict_all(cloth, data.experiments, level)
        cross = []
        if cross_validation:
            where = Workers.choose(workers, scheduler)
            cross = cross_validate(
                cloth, data.experiments, level, where=where, progress=lambda a, b: progress("cross-validation", a, b)
            )
        values, files = write(folder, cloth, data, level, checks, by_interval(checks), cross)
    _show_validation(values, files, json)


def cantilever_in_words(fabric) -> dict:
    """What the calibrated fabric would do in the cantilever test (ASTM D1388, exact elastica), for the report."""
    from material_tests.cantilever import exact

    words, values = [], {}
    for direction in ("warp", "weft", "bias"):
        r = exact(fabric, direction)
        values[direction] = {"overhang_m": r.reading, "bending_length_m": r.bending_length, "rigidity_Nm": r.rigidity}
        words.append(f"Cantilever (ASTM D1388, 41.5°), {direction}: overhang {1e3 * r.reading:.1f} mm, bending length "
                     f"{1e3 * r.bending_length:.1f} mm, from a rigidity of {1e6 * r.rigidity:.3g} µN·m.")
    words.append(f"Source of the bending: {fabric.sources.get('bending', 'not stated')}. The tensile curves do not determine it.")
    return {"predictions_in_words": words, "cantilever": values}


def resolve_laws(names: list[str] | None) -> list:
    """Laws by registry name or 'file.py:name'; all registered ones by default."""
    from mfar_fem.materials import get_law, law_from_file, law_names

    return [law_from_file(n) if ".py:" in n else get_law(n) for n in (names or law_names())]


def _dataset(text: str, variant: str | None):
    from calibration.datasets import resolve

    return resolve(text, variant)


def _fabric(text: str | None):
    from mfar_fem.materials.fabric import Fabric

    return None if text is None else Fabric.load(text)


@contextlib.contextmanager
def _stages(quiet: bool) -> Iterator:
    """A progress bar that starts again with every stage."""
    from mfar_fem.cli.console import progress

    with progress("reading", quiet=quiet) as advance:

        def stage(name: str, done: int, total: int) -> None:
            advance(0, description=name, completed=done, total=total)

        yield stage


def _show_calibration(study, files, as_json: bool) -> None:
    from calibration.report import payload
    from mfar_fem.cli.console import emit

    values = payload(study) | {"files": files}
    emit(values, as_json, lambda v: _calibration_text(study, files))


def _calibration_text(study, files) -> list:
    from rich.markup import escape
    from rich.table import Table

    tables = []
    for level, results in study.levels.items():
        table = Table(title=f"Laws on {study.dataset.name} ({level})", title_justify="left")
        for name, side in (("law", "left"), ("RMSE %", "right"), ("parameters", "right"), ("AICc", "right"), ("stable", "left")):
            table.add_column(name, justify="right" if side == "right" else "left")
        for r in results:
            if r.fit is None:
                table.add_row(r.law, "-", "-", "-", escape(f"not fitted: {r.error}"))
            else:
                stable = "yes" if r.stability.stable else "no"
                table.add_row(r.law, f"{r.fit.rmse_percent_of_range:.2f}", str(len(r.fit.q)), f"{r.aicc:.1f}", stable)
        tables.append(table)
    curves = ", ".join(f"{k} {v:.2f} %" for k, v in study.fit.rmse_by_experiment.items())
    lines = [*tables, f"[bold]{study.best.law}[/bold] ({study.level}): {escape(curves)}"]
    lines += [f"  {escape(text)}" for text in study.words["parameters"].values()]
    lines += [f"[yellow]{escape(text)}[/yellow]" for text in study.words["warnings"]]
    lines.append("time: " + ", ".join(f"{k} {v:.1f} s" for k, v in study.timings.items()))
    lines += [f"{name}: {escape(str(path))}" for name, path in files.items()]
    return lines


def _show_validation(values, files, as_json: bool) -> None:
    from mfar_fem.cli.console import emit

    emit(values | {"files": files}, as_json, lambda v: _validation_text(values, files))


def _validation_text(values, files) -> list:
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=f"{values['fabric']} against {values['dataset']} ({values['level']})", title_justify="left")
    for name in ("experiment", "RMSE % of range", "reached", "status"):
        table.add_column(name, justify="left" if name in ("experiment", "status") else "right")
    for c in values["predictions"]:
        rmse = f"{c['rmse_percent_of_range']:.2f}"
        table.add_row(escape(c["experiment"]), rmse, f"{100 * c['reached']:.0f} %", escape(c["status"]))
    warned = [f"[yellow]{escape(text)}[/yellow]" for text in values["warnings"]]
    return [table, *warned, *(f"{name}: {escape(str(path))}" for name, path in files.items())]


