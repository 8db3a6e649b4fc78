"""``mfar benchmark``: shell benchmarks against exact, published or independent references, and timings."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.benchmarks import BENCHMARKS
from mfar_fem.cli import benchmark_time
from mfar_fem.cli.console import check_writable, emit, progress
from mfar_fem.errors import InputError

app = typer.Typer(help="Shell benchmarks with exact or published references, and timings.", no_args_is_help=True)
benchmark_time.register(app)

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
_ORDER = Annotated[int, typer.Option(help="Order of the shell: 1 or 2.", min=1, max=2)]
_MESH = Annotated[str | None, typer.Option(help="Cells AxB, such as 8x1; the benchmark's own by default.")]
_OUT = Annotated[Path | None, typer.Option("--out", help="Folder for the table (CSV) and the picture (PNG).")]


def mesh_cells(text: str | None) -> tuple[int, int] | None:
    """Cells (a, b) of a mesh option such as '8x1'.

    Raises
    ------
    InputError
        Not of that form, or not positive.
    """
    if text is None:
        return None
    found = re.fullmatch(r"(\d+)[x×](\d+)", text.strip())
    if not found or min(int(n) for n in found.groups()) < 1:
        raise InputError(f"--mesh must be two positive whole numbers of cells such as 8x1, not '{text}'")
    return int(found[1]), int(found[2])


@app.command("list")
def list_benchmarks(as_json: _JSON = False) -> None:
    """List the benchmarks."""
    from mfar_fem.benchmarks import benchmark

    rows = []
    for name, text in BENCHMARKS.items():
        a, b = benchmark(name).DEFAULT_MESH
        rows.append({"name": name, "description": text, "default_mesh": f"{a}x{b}"})
    emit({"benchmarks": rows}, as_json, _render_list)


def _command(name: str):
    def command(order: _ORDER = 2, mesh: _MESH = None, jitter: Annotated[float, typer.Option(help="Random move of the "
                "mesh points, fraction of a cell, below 0.5.")] = 0.0, slenderness: Annotated[float, typer.Option(
                help="Thickness over length, cantilever-shear only: the thin limit at the same P L²/EI.")] = 0.01,
                as_json: _JSON = False) -> None:
        from mfar_fem.benchmarks import run
        from mfar_fem.errors import InputError

        if slenderness != 0.01 and name != "cantilever-shear":
            raise InputError(f"--slenderness belongs to cantilever-shear, not to {name}")
        if not slenderness > 0:
            raise InputError(f"--slenderness must be positive, got {slenderness}")

        cells = mesh_cells(mesh)
        options = {"jitter": jitter} if jitter else {}
        if slenderness != 0.01:
            options["slenderness"] = slenderness
        with progress(name, 1.0) as advance:
            payload = run(name, order, cells, lambda lam: advance(0, completed=lam), **options)
        emit(payload, as_json, _render)
        if not payload["converged"]:
            raise typer.Exit(3)

    command.__doc__ = BENCHMARKS[name] + "."
    return command


for _name in BENCHMARKS:
    app.command(_name)(_command(_name))


@app.command()
def assembly(
    cells: Annotated[int, typer.Option(help="Cells along each side of the square.", min=1)] = 71,
    repeats: Annotated[int, typer.Option(help="Repetitions of every measurement.", min=1)] = 15,
    as_json: _JSON = False,
) -> None:
    """Cost of one tangent and residual an element, and the membrane against scikit-fem's BilinearForm."""
    from mfar_fem.benchmarks.assembly import run_assembly

    with progress("assembly", 4.0) as advance:
        payload = run_assembly(cells, repeats, lambda key: advance(1, description=key))
    emit(payload, as_json, _render_assembly)


@app.command("bending-directions")
def bending_directions(out: _OUT = None, as_json: _JSON = False) -> None:
    """Bending energy of a cylinder in any direction on five meshes over the exact one: orders 1, 2 and a hinge model."""
    from mfar_fem.benchmarks.bending_directions import run_directions, save_directions

    folder = check_writable(out) if out is not None else None
    with progress("bending directions", 15.0) as advance:
        payload = run_directions(lambda: advance(1))
    if folder is not None:
        payload["files"] = save_directions(folder, payload)
    emit(payload, as_json, _render_directions)


@app.command("hinge-cantilever")
def hinge_cantilever(out: _OUT = None, as_json: _JSON = False) -> None:
    """What accuracy costs: error against wall time of the heavy elastica, orders 1 and 2 beside a hinge model."""
    from mfar_fem.benchmarks.hinge_cantilever import run_comparison, save_comparison

    folder = check_writable(out if out is not None else Path("out/hinge-cantilever"))
    with progress("hinge cantilever") as advance:
        payload = run_comparison(lambda text: advance(1, description=text))
    payload["files"] = save_comparison(folder, payload)
    emit(payload, as_json, _render_comparison)
    if not payload["converged"]:
        raise typer.Exit(3)


# -- what people see -------------------------------------------------------------------------------------------------------


def _render_list(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table()
    for heading in ("benchmark", "what", "mesh"):
        table.add_column(heading, no_wrap=heading == "benchmark")
    for row in payload["benchmarks"]:
        table.add_row(row["name"], row["description"], row["default_mesh"])
    others = ("assembly", "bending-directions", "hinge-cantilever", "drape-sphere", "drape-cylinder", "dynamics", "drag",
              "linear-solvers", "scaling")
    more = "also: " + ", ".join(f"`{name}`" for name in others)
    return [table, "`mfar benchmark NAME --order 2 --mesh AxB --json` runs one;", more]


def _render(payload: Mapping[str, Any]):
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=f"{payload['benchmark']}, order {payload['order']}, mesh {payload['mesh']}", title_justify="left")
    for heading in ("quantity", "value", "reference", "error %"):
        table.add_column(heading, justify="left" if heading == "quantity" else "right")
    for name, value in payload["values"].items():
        error = "" if payload["error_percent"] is None else f"{payload['error_percent'][name]:+.4f}"
        table.add_row(name, f"{value:.7g}", f"{payload['reference'][name]:.7g}", error)
    shown: list[Any] = [table, f"reference: {escape(payload['source'])}"]
    for source, values in payload["other_references"].items():
        shown.append(f"  also {escape(source)}: " + ", ".join(f"{k} {v:.6g}" for k, v in values.items()))
    shown.append(f"{payload['elements']} elements, {payload['unknowns']} unknowns, {payload['load_steps']} load steps, "
                 f"{payload['newton_iterations']} Newton iterations (+ {payload['wasted_iterations']} in steps that were cut), "
                 f"{payload['wall_s']:.2f} s ({payload['assembly_ms_per_iteration']:.2f} ms assembly and "
                 f"{payload['solve_ms_per_iteration']:.2f} ms solution an iteration), "
                 f"residual {payload['residual_relative']:.1e} of the load")
    if payload["model"]:
        shown.append(escape(payload["model"]))
    if not payload["converged"]:
        shown.append(f"[bold red]not converged[/bold red]: {escape(payload['message'])}")
    return shown


def _render_assembly(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(title=f"one tangent + residual with the law {payload['law']}, {payload['elements']} triangles, one core",
                  title_justify="left")
    for heading in ("what", "best, µs an element", "median"):
        table.add_column(heading, justify="left" if heading == "what" else "right")
    names = {"order1": "order 1, exact", "order1_safe": "order 1, safe", "order2": "order 2, exact", "order2_safe": "order 2, safe"}
    for key, text in names.items():
        table.add_row(text, *(f"{payload[f'{key}_us_per_element{end}']:.2f}" for end in ("", "_median")))
    table.add_row("P2 membrane alone", f"{payload['membrane_us_per_element']:.2f}", "")
    table.add_row("the same by BilinearForm", f"{payload['bilinearform_us_per_element']:.1f}", "")
    ratios = (payload["membrane_ratio_to_bilinearform"], payload["membrane_ratio_same_points"])
    text = f"membrane: {ratios[0]:.0f} times as fast as BilinearForm with its own quadrature, {ratios[1]:.0f} at our points"
    return [table, text]


def _render_directions(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(title="bending energy of a cylinder over the exact one, by the direction of bending", title_justify="left")
    for heading in ("mesh", "model", "least", "mean", "most"):
        table.add_column(heading, justify="left" if heading in ("mesh", "model") else "right")
    for row in payload["rows"]:
        table.add_row(row["mesh"], row["model"], *(f"{row[key]:.4f}" for key in ("min", "mean", "max")))
    return [table, payload["note"]]


def _render_comparison(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(title=f"heavy elastica, chord {payload['reference']:g}°", title_justify="left")
    for heading in ("model", "mesh", "elements", "chord °", "error °", "iterations", "wall s"):
        table.add_column(heading, justify="left" if heading in ("model", "mesh") else "right")
    for row in payload["rows"]:
        table.add_row(row["model"], row["mesh"], str(row["elements"]), f"{row['chord']:.4f}", f"{row['error']:+.4f}",
                      str(row["iterations"]), f"{row['wall_s']:.3f}")
    return [table, *(f"written: {name}" for name in payload["files"])]
