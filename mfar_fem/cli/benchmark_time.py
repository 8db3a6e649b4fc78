"""``mfar benchmark``: time integration, drag, linear solvers, scaling, and cloth that falls on a body."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
_OUT = Annotated[Path | None, typer.Option("--out", help="Folder for the table (CSV) and the picture (PNG).")]
_QUICK = Annotated[bool, typer.Option("--quick", help="Fewer and coarser runs: a minute instead of many.")]


def register(app: typer.Typer) -> None:
    """Add the commands to ``mfar benchmark``."""
    app.command()(dynamics)
    app.command()(drag)
    app.command("linear-solvers")(linear_solvers)
    app.command()(scaling)
    for name in ("drape-sphere", "drape-cylinder"):
        app.command(name)(_drape_command(name))
    app.command("iteration-error")(iteration_error)


def dynamics(quick: _QUICK = False, as_json: _JSON = False) -> None:
    """Time integrators: orders, amplitude, momentum, energy drift, damping, frequencies, pendulum against exact answers."""
    from mfar_fem.benchmarks.time_integration import run

    with progress("dynamics"):
        payload = run(not quick)
    emit(payload, as_json, _tables)


def drag(quick: _QUICK = False, as_json: _JSON = False) -> None:
    """Drag per area and per vertex: fall, coast, wind, meshes; and where implicit Euler's own damping hides the air's."""
    from mfar_fem.benchmarks.drag_study import run

    with progress("drag"):
        payload = run(not quick)
    emit(payload, as_json, _tables)


def linear_solvers(full: Annotated[bool, typer.Option("--full", help="Also 100k and 300k unknowns: minutes, some GB.")] = False,
                   out: _OUT = None, as_json: _JSON = False) -> None:
    """Direct and AMG solvers by unknowns and time step, and where one overtakes the other."""
    from mfar_fem.benchmarks.linear_solvers import render_linear_solvers, run_linear_solvers, save_linear_solvers

    folder = check_writable(out) if out is not None else None
    with progress("linear solvers") as advance:
        payload = run_linear_solvers(full, progress=lambda text: advance(1, description=text))
    if folder is not None:
        payload["files"] = save_linear_solvers(folder, payload)
    emit(payload, as_json, render_linear_solvers)


def scaling(triangles: Annotated[str | None, typer.Option(help="Sizes, e.g. '1000,10000'; default 1k to 100k.")] = None,
            out: _OUT = None, as_json: _JSON = False) -> None:
    """One implicit step at order 1 from 1k to 100k triangles: time, memory, slope."""
    from mfar_fem.benchmarks.scaling import TRIANGLES, render_scaling, run_scaling, save_scaling

    folder = check_writable(out) if out is not None else None
    sizes = TRIANGLES if triangles is None else [int(n) for n in triangles.split(",")]
    with progress("scaling", len(sizes)) as advance:
        payload = run_scaling(sizes, progress=lambda text: advance(1, description=text))
    if folder is not None:
        payload["files"] = save_scaling(folder, payload)
    emit(payload, as_json, render_scaling)


def iteration_error(scene: Annotated[str, typer.Option(help="Scene file, or drape-cylinder, drape-sphere.")] = "drape-cylinder",
                    cells: Annotated[int | None, typer.Option(help="Cells along a side.", min=2)] = None,
                    until: Annotated[float, typer.Option(help="Simulated time, s.", min=0.01)] = 0.3,
                    as_json: _JSON = False) -> None:
    """What steps accepted by the error left in them cost in accuracy, beside what half the time step changes."""
    from mfar_fem.benchmarks.drape_scenes import error_study

    with progress("iteration error", 5) as advance:
        payload = error_study(scene, until=until, cells=cells, progress=lambda text: advance(1, description=text))
    emit(payload, as_json, _tables)


def _drape_command(name: str):
    def command(fidelity: Annotated[str, typer.Option(help="draft, standard or reference.")] = "standard",
                duration: Annotated[float, typer.Option(help="Simulated time, s.", min=1e-3)] = 1.0,
                cells: Annotated[int | None, typer.Option(help="Cells along a side (39: 40 x 40 vertices).", min=2)] = None,
                iteration_error: Annotated[float | None, typer.Option(help="Error Newton's method may leave in a step, as a share "
                                           "of the step's local error (0: solve to the residual).", min=0)] = None,
                bodies: Annotated[str, typer.Option(help="How bodies are met: exact (by their distance), mesh, auto.")] = "auto",
                self_contact: Annotated[bool, typer.Option("--self-contact", help="The cloth may touch itself.")] = False,
                as_json: _JSON = False) -> None:
        from mfar_fem.benchmarks.drape_scenes import run

        with progress(f"{name}, {fidelity}", duration) as advance:
            payload = run(name, fidelity, duration, self_contact, lambda t: advance(0, completed=t), bodies, cells=cells,
                          iteration_error=iteration_error)
        emit(payload, as_json, _render_drape)
        if not payload["converged"]:
            raise typer.Exit(3)

    command.__doc__ = f"Silk, 0.3 m square, that falls on a {name.split('-')[1]}: wall time per simulated second."
    return command


# -- what people see -----------------------------------------------------------------------------------------------------
def _tables(payload: Mapping[str, Any]) -> list:
    """Every part of a payload as a table: lists of rows, groups of figures."""
    from rich.table import Table

    shown: list[Any] = []
    for name, value in payload.items():
        rows = value if isinstance(value, list) else [value]
        if not rows or not all(isinstance(row, Mapping) for row in rows):
            shown.append(f"{name.replace('_', ' ')}: {_text(value)}")
            continue
        columns = [k for k in dict.fromkeys(k for row in rows for k in row) if any(_plain(row.get(k)) for row in rows)]
        table = Table(title=name.replace("_", " "), title_justify="left")
        for column in columns:
            table.add_column(column.replace("_", " "), justify="right")
        for row in rows:
            table.add_row(*(_text(row.get(k)) for k in columns))
        shown.append(table)
    return shown


def _plain(value: Any) -> bool:
    if isinstance(value, list | tuple):
        return 0 < len(value) <= 6 and all(_plain(v) for v in value)
    return isinstance(value, str | bool | int | float) or (hasattr(value, "ndim") and value.ndim == 0)


def _text(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list | tuple):
        return ", ".join(_text(v) for v in value)
    if isinstance(value, str | bool):
        return str(value)
    return f"{value:.5g}" if _plain(value) else "…"


def _render_drape(payload: Mapping[str, Any]):
    from rich.table import Table

    level = f"{payload['fidelity']} (order {payload['order']})"
    title = f"{payload['benchmark']}, {level}, {payload['elements']} triangles, {1e3 * payload['dt']:g} ms"
    table = Table(title=title, title_justify="left")
    for heading in ("code", "wall s per simulated s"):
        table.add_column(heading, justify="left" if heading == "code" else "right")
    if payload["wall_s_per_simulated_s"] is not None:
        table.add_row("this one", f"{payload['wall_s_per_simulated_s']:.1f} (aim {payload['aim_s']:g})")
    for row in payload["public"]:
        span = f"{row['from_s']:g}" if row["from_s"] == row["to_s"] else f"{row['from_s']:g}–{row['to_s']:g}"
        table.add_row(row["code"], span)
    iterations = f", {payload['newton_iterations']} Newton iterations" if payload["newton_iterations"] else ""
    if payload["inexact_steps"]:
        iterations += f", {payload['inexact_steps']} steps accepted by the error left in them"
    distance = "" if payload["least_distance_m"] is None else f"; least distance {1e3 * payload['least_distance_m']:.3g} mm"
    touching = {None: "", True: "; it INTERSECTS", False: "; no intersection"}[payload["intersects"]]
    return [table, f"{payload['steps']} steps{iterations}, {payload['simulated_s']:g} s simulated{distance}{touching}",
            "the public figures are for other materials and say what a step costs, no more"]
