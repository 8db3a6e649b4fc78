"""``mfar plan``, ``mfar simulate``, ``mfar tradeoff``: scenes from a TOML file."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress
from mfar_fem.errors import NotConvergedError

_EXAMPLES = "cusick, drape-body, drape-cylinder, drape-sphere, swing"
_SCENE = Annotated[str, typer.Argument(help=f"A scene file (TOML), or an example: {_EXAMPLES}.")]
_FIDELITY = Annotated[str | None, typer.Option(help="draft, standard or reference, instead of the file's.")]
_ORDER = Annotated[int | None, typer.Option(help="0 position-based, 1 or 2 shell elements.", min=0, max=2)]
_CELLS = Annotated[int | None, typer.Option(help="Mesh cells along the longest side.", min=1)]
_DT = Annotated[str | None, typer.Option(help="Time step with its unit, e.g. '2 ms'.")]
_METHOD = Annotated[str | None, typer.Option(help="implicit-euler, bdf2 or generalized-alpha.")]
_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


def _load(source: str, fidelity: str | None, order: int | None, cells: int | None, dt: str | None, method: str | None):
    from mfar_fem import units
    from mfar_fem.scene_file import load_scene

    step = None if dt is None else units.parse(dt, "s", name="--dt")
    return load_scene(source, fidelity, order=order, cells=cells, dt=step, method=method)


def plan(
    scene: _SCENE,
    fidelity: _FIDELITY = None,
    order: _ORDER = None,
    cells: _CELLS = None,
    dt: _DT = None,
    method: _METHOD = None,
    quick: Annotated[bool, typer.Option("--quick", help="Do not time an iteration: no expected time.")] = False,
    as_json: _JSON = False,
) -> None:
    """Say what a scene computes and why, what is left out and what that costs, and what the run will take."""
    from mfar_fem.plan import plan as make

    emit(make(_load(scene, fidelity, order, cells, dt, method), measure=not quick), as_json, _render_plan)


def simulate(
    scene: _SCENE,
    out: Annotated[
        Path | None, typer.Option("--out", help="Folder for history, frames, pictures, checkpoint and result; default out/NAME.")
    ] = None,
    fidelity: _FIDELITY = None,
    order: _ORDER = None,
    cells: _CELLS = None,
    dt: _DT = None,
    method: _METHOD = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a run that was killed.")] = False,
    restart: Annotated[bool, typer.Option("--restart", help="Throw away an unfinished run in the folder.")] = False,
    pictures: Annotated[bool, typer.Option("--pictures/--no-pictures", help="PNG frames and the animation.")] = True,
    as_json: _JSON = False,
) -> None:
    """Run a scene: motion in time, or to rest."""
    from dataclasses import replace

    from mfar_fem.simulation import simulate as run

    loaded = _load(scene, fidelity, order, cells, dt, method)
    if not pictures:
        loaded = replace(loaded, output=replace(loaded.output, pictures=False))
    folder = check_writable(out or Path("out") / re.sub(r"[^\w.-]+", "-", loaded.name))
    with progress(f"{loaded.name}, {loaded.level.name}", None if loaded.to_rest else loaded.duration) as advance:
        result = run(loaded, folder, resume, restart, _reporter(advance))
    emit(result.payload, as_json, _render_run)
    if not result.converged:
        raise NotConvergedError(f"scene '{loaded.name}': {result.message}; what was reached is in '{folder}'")


def tradeoff(
    scene: _SCENE,
    tolerance: Annotated[str, typer.Option(help="Distance from the finest run that is acceptable, with its unit.")] = "5 mm",
    out: Annotated[Path, typer.Option("--out", help="Folder for the table (CSV), the plot (PNG) and finished runs.")] = Path(
        "out/tradeoff"
    ),
    cells: _CELLS = None,
    dt: _DT = None,
    duration: Annotated[str | None, typer.Option(help="Simulated time instead of the file's, with its unit.")] = None,
    as_json: _JSON = False,
) -> None:
    """Run the ladder of levels, meshes and time steps; measure time, memory and error against the finest; recommend one."""
    import csv
    from dataclasses import replace

    from mfar_fem import units
    from mfar_fem.simulation import tradeoff as study

    loaded = _load(scene, None, None, cells, dt, None)
    if duration is not None:
        loaded = replace(loaded, duration=units.parse(duration, "s", name="--duration"))
    folder = check_writable(out)
    with progress("tradeoff", len(study.ladder(loaded))) as advance:
        payload = study.tradeoff(
            loaded,
            units.parse(tolerance, "m", name="--tolerance"),
            progress=lambda text: advance(1, description=text),
            cache=folder / "runs",
        )
    with (folder / "tradeoff.csv").open("w", newline="", encoding="utf-8") as f:
        writer = csv.DictWriter(f, list(dict.fromkeys(k for row in payload["rows"] for k in row)))
        writer.writeheader()
        writer.writerows(payload["rows"])
    payload["files"] = [str(folder / "tradeoff.csv"), str(study.plot(payload, folder / "tradeoff.png"))]
    emit(payload, as_json, _render_tradeoff)


def _reporter(advance):
    def report(row: Mapping[str, Any]) -> None:
        contacts = f", {row['contacts']:.0f} contacts" if row.get("contacts") else ""
        if row.get("until") is None:
            text = (
                f"residual {row['residual_relative']:.1e}, energy {row['energy']:.4e} J{contacts}"
                if "energy" in row
                else f"kinetic energy {row['kinetic']:.1e} J"
            )
            advance(0, description=text)
            return
        total = sum(row.get(k, 0.0) for k in ("kinetic", "membrane", "bending", "potential", "contact"))
        advance(0, completed=row["time"], description=f"{row['time']:.3f} of {row['until']:g} s, energy {total:.3e} J{contacts}")

    return report


# -- what people see -----------------------------------------------------------------------------------------------------
def _render_plan(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(
        title=f"{payload['scene']} ({payload['fabric']}), {payload['fidelity']}: {payload['analysis']}", title_justify="left"
    )
    for heading in ("term", "", "because", "estimate"):
        table.add_column(heading, no_wrap=heading == "term")
    for term in payload["terms"]:
        on = "[green]on[/green]" if term["on"] else "[dim]off[/dim]"
        table.add_row(term["name"], on, term["why"].replace("[", "\\["), term["estimate"].replace("[", "\\["))
    s, m = payload["scales"], payload["mesh"]
    moves = payload["analysis"] != "to rest"
    names = ["membrane", "bending", "inertia" if moves else "gravity"]
    parts = [s["membrane_energy"], s["bending_energy"], s["kinetic_energy" if moves else "gravity_energy"]]
    ratio = " : ".join(f"{p / s['bending_energy']:.2g}" for p in parts)
    shown: list[Any] = [
        table,
        f"{' : '.join(names)} energy about {ratio}",
        f"{m['vertices']} vertices, {m['triangles']} triangles of {1e3 * m['size_m']:.3g} mm, {payload['unknowns']} free unknowns "
        f"({payload['edge_unknowns']} edge rotations), {payload['matrix_entries']} matrix entries",
        f"memory about {payload['memory_MB']:.0f} MB besides 250 MB of libraries",
    ]
    if payload.get("iteration_error"):
        share = payload["iteration_error"]
        shown.append(f"steps are solved to {share:g} of their own time error (iteration_error; 0: to the residual)")
    if payload["seconds"] is not None:
        shown.append(f"expected time about {payload['seconds']:.0f} s ({payload['seconds_from']})")
    return shown


def _render_run(payload: Mapping[str, Any]):
    from rich.markup import escape

    seconds = payload["seconds"] if "seconds" in payload else {}
    state = "[green]done[/green]" if payload["converged"] else f"[bold red]{payload['status']}[/bold red]"
    shown = [f"{payload['scene']} ({payload['fabric']}), {payload['fidelity']}: {state}, {escape(payload['message'])}"]
    if payload.get("wall_s_per_simulated_s"):
        rate = f"{payload['wall_s_per_simulated_s']:.1f} s per simulated s"
        times = f"{seconds['compute']:.1f} s of computing ({rate}), {seconds['output']:.1f} s of writing"
        shown.append(f"{payload['steps']} steps, {times}")
    if "energy" in payload:
        stable = {True: "stable", False: "unstable", None: "stability not known"}[payload["stable"]]
        residual = f"static residual {payload['residual']:.1e} N ({payload['residual_relative']:.1e} of the load)"
        shown.append(f"energy {payload['energy']:.6e} J, {residual}, {stable}, {payload['iterations']} iterations")
    shown += [f"note: {escape(n)}" for n in payload.get("notes", ())]
    return [*shown, *(f"written: {name}" for name in payload["files"])]


def _render_tradeoff(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(title=f"{payload['scene']}: distances from {payload['reference']}", title_justify="left")
    for heading in ("level", "cells", "dt ms", "unknowns", "wall s", "memory MB", "error mm", "worst mm", "mean height mm"):
        table.add_column(heading, justify="left" if heading == "level" else "right")
    for row in payload["rows"]:
        errors = [f"{1e3 * row[k]:.2f}" if k in row else row["status"] for k in ("error_m", "worst_m", "height_error_m")]
        table.add_row(
            row["level"],
            str(row["cells"]),
            f"{1e3 * row['dt']:g}",
            str(row["unknowns"]),
            f"{row['wall_s']:.3g}",
            f"{row['memory_MB']:.0f}",
            *errors,
        )
    chosen = payload["recommended"]
    text = f"for {1e3 * payload['tolerance_m']:g} mm: {chosen['label']} ({chosen['wall_s']:.3g} s)"
    return [table, text, *(f"written: {name}" for name in payload["files"])]
