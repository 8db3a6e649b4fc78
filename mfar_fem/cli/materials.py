"""``mfar materials``: list the laws, plot one, check one, refit Treloar's rubber."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli import console
from mfar_fem.errors import InputError

app = typer.Typer(no_args_is_help=False, help="Constitutive laws: list them, plot one, check one (also your own).")

LawArgument = Annotated[str, typer.Argument(metavar="NAME", help="A law's name, or path.py:object for your own.")]
SetOption = Annotated[
    list[str] | None, typer.Option("--set", metavar="NAME=VALUE", help="Parameter value, SI; may be repeated.")
]
JsonOption = Annotated[bool, typer.Option("--json", help="One JSON object on standard output.")]


@app.callback(invoke_without_command=True)
def materials(context: typer.Context, as_json: JsonOption = False) -> None:
    """Constitutive laws; without a command, list them."""
    if context.invoked_subcommand is None:
        list_laws(as_json)


@app.command("list")
def list_laws(as_json: JsonOption = False) -> None:
    """List the laws with their basis and parameters."""
    from mfar_fem.materials import law_class, law_names

    payload = {"laws": [_describe(law_class(name)) for name in law_names()]}
    console.emit(payload, as_json, _table_of_laws)


@app.command()
def show(
    name: LawArgument,
    values: SetOption = None,
    out: Annotated[Path | None, typer.Option(help="Where to write the plot (.png, .svg or .pdf).")] = None,
    strain: Annotated[float | None, typer.Option(help="Largest strain of the curves, e.g. 0.25; found if omitted.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Show a law: parameters, stiffness at rest and stress-strain curves in warp, weft, bias and shear."""
    from mfar_fem.materials.plot import curves, plot_curves

    law = load_law(name, values)
    if strain is not None and not 0.0 < strain <= 10.0:
        raise InputError(f"--strain is {strain:g}; give a largest strain between 0 and 10, such as 0.25")
    if out is not None:
        console.check_writable(out.parent)
        if out.suffix.lower() not in (".png", ".svg", ".pdf"):
            raise InputError(f"--out is '{out}'; the name must end in .png, .svg or .pdf")
    drawn = curves(law, strain)
    payload = _describe(law) | {
        "values": dict(law.values),
        "stress_unit": law.stress_unit,
        "tangent_at_rest": law.tangent_at_rest(),
        "curves": {label: {"strain": c.strain, "nominal_stress": c.stress} for label, c in drawn.items()},
        "plot": None,
    }
    if out is not None:
        plot_curves(law, drawn, out)
        payload["plot"] = str(out)
    console.emit(payload, as_json, _render_show)


@app.command()
def check(
    name: LawArgument,
    values: SetOption = None,
    as_json: JsonOption = False,
) -> None:
    """Check a law, built in or your own: derivatives, symmetry, rest state, frame indifference, stability, locking.

    Exit code 0 if every check passes, 1 otherwise.
    """
    from mfar_fem.materials.check import check_law

    law = load_law(name, values)
    checks = check_law(law)
    passed = all(c.passed for c in checks)
    payload = {"law": law.name, "values": dict(law.values), "passed": passed, "checks": checks}
    console.emit(payload, as_json, _render_checks)
    if not passed:
        raise typer.Exit(1)


@app.command()
def treloar(as_json: JsonOption = False) -> None:
    """Refit the eight-chain law of Arruda and Boyce to Treloar's rubber (1944) in three modes at once."""
    from mfar_fem.materials.treloar import refit

    console.emit(refit(), as_json, _render_treloar)


def load_law(name: str, settings: list[str] | None):
    """The law of a registry name or of ``path.py:object``, with ``NAME=VALUE`` settings."""
    from mfar_fem.materials import get_law, law_from_file

    values = {}
    for item in settings or []:
        key, equals, text = item.partition("=")
        try:
            values[key.strip()] = float(text)
        except ValueError:
            equals = ""
        if not equals:
            raise InputError(f"--set {item}: give NAME=VALUE with a number in SI, such as --set mu=87.5e3")
    return law_from_file(name, **values) if ":" in name else get_law(name, **values)


def _describe(law) -> dict[str, Any]:
    doc = (law.__doc__ or "").strip().splitlines()
    return {
        "name": law.name,
        "basis": law.basis,
        "summary": doc[0] if doc else "",
        "parameters": [
            {
                "name": p.name,
                "symbol": p.symbol,
                "unit": p.unit,
                "default": p.default,
                "lower": p.lower,
                "upper": p.upper,
                "scale": p.scale,
                "fit": p.fit,
                "description": p.description,
                "source": p.source,
            }
            for p in law.parameters
        ],
    }


def _unit(unit: str) -> str:
    return "" if unit == "dimensionless" else f" {unit}"


def _table_of_laws(payload):
    from rich.table import Table

    table = Table(title="Laws (energy per volume: stress in Pa; per area: N/m)", title_justify="left")
    for head in ("name", "basis", "parameters (defaults)", "what it is"):
        table.add_column(head, overflow="fold")
    for law in payload["laws"]:
        parameters = ", ".join(f"{p['name']} {p['default']:g}{_unit(p['unit'])}" for p in law["parameters"])
        table.add_row(law["name"], law["basis"], parameters, law["summary"])
    return table


def _render_show(payload):
    from rich.table import Table

    table = Table(title=f"{payload['name']}: {payload['summary']}", title_justify="left")
    for head in ("parameter", "value", "bounds", "meaning", "source"):
        table.add_column(head, overflow="fold")
    for p in payload["parameters"]:
        value = f"{payload['values'][p['name']]:.6g}{_unit(p['unit'])}"
        table.add_row(p["name"], value, f"{p['lower']:g} .. {p['upper']:g}", p["description"], p["source"])
    curves = Table(title=f"Nominal (engineering) stress, {payload['stress_unit']}", title_justify="left")
    curves.add_column("curve")
    for fraction in ("25 %", "50 %", "75 %", "100 %"):
        curves.add_column(f"at {fraction} of the range", justify="right")
    for label, c in payload["curves"].items():
        at = [round(f * (len(c["strain"]) - 1)) for f in (0.25, 0.5, 0.75, 1.0)]
        curves.add_row(label, *(f"{c['nominal_stress'][i]:.4g} (strain {c['strain'][i]:.3g})" for i in at))
    note = "Values are the law's defaults where --set gave none; those of a fabric are its own: `mfar fabrics show NAME`."
    return [table, curves, note] + ([f"plot: {payload['plot']}"] if payload["plot"] else [])


def _render_checks(payload):
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=f"Checks of {payload['law']}", title_justify="left")
    for head in ("check", "value", "tolerance", "", "meaning"):
        table.add_column(head, overflow="fold")
    for c in payload["checks"]:
        mark = "[green]passed[/]" if c.passed else "[bold red]FAILED[/]"
        table.add_row(escape(c.name), f"{c.value:.3g}", f"{c.tolerance:.3g}", mark, escape(c.detail))
    return table


def _render_treloar(payload):
    from rich.table import Table

    table = Table(title="Arruda-Boyce refit to Treloar 1944, three modes at once", title_justify="left")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    table.add_row("mu", f"{payload['mu_MPa']:.4f} MPa")
    table.add_row("N", f"{payload['N']:.3f}")
    table.add_row("RMSE, all modes", f"{payload['rmse_MPa']:.4f} MPa")
    for mode, value in payload["rmse_by_mode_MPa"].items():
        table.add_row(f"RMSE, {mode}", f"{value:.4f} MPa")
    table.add_row("points", str(payload["points"]))
    return [table, payload["source"]]
