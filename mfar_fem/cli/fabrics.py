"""``mfar fabrics``: list the fabric presets, and show every number of a fabric with its source."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import emit

app = typer.Typer(help="Fabric presets and fabric files, with the source of every number.", invoke_without_command=True)

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


@app.callback()
def list_fabrics(ctx: typer.Context, as_json: _JSON = False) -> None:
    """List the fabric presets; `mfar fabrics show NAME` shows one with its sources."""
    if ctx.invoked_subcommand is not None:
        ctx.obj = as_json
        return
    from mfar_fem.materials.fabric import Fabric, fabric_names

    rows = []
    for preset in fabric_names():
        fabric = Fabric.load(preset)
        values: dict[str, Any] = {"name": preset, "fabric": fabric.name, "law": fabric.law.name}
        values |= {"description": fabric.description}
        values |= {"areal_density_kg_m2": fabric.areal_density, "thickness_m": fabric.thickness}
        values |= {"bending_warp_Nm": fabric.bending.warp, "bending_weft_Nm": fabric.bending.weft}
        rows.append(values)
    emit({"fabrics": rows}, as_json, _render_list)


@app.command()
def show(
    ctx: typer.Context,
    name: Annotated[str, typer.Argument(help="A preset (see `mfar fabrics`) or a fabric file (TOML).")],
    as_json: _JSON = False,
) -> None:
    """Show every number of a fabric with its unit and its source."""
    from mfar_fem.materials.fabric import Fabric

    emit(summary(Fabric.load(name)), as_json or bool(ctx.obj), _render_fabric)


def summary(fabric) -> dict[str, Any]:
    """Everything about a fabric as plain data.

    Parameters
    ----------
    fabric : Fabric

    Returns
    -------
    dict
        ``name``, ``description``, ``law`` (name and basis), ``quantities`` (each with ``key``, ``symbol``, ``value`` in
        SI, ``unit``, ``source``) and ``bending_over_derived`` (rigidities over those of a solid sheet; None if the law
        at rest has none).
    """
    from mfar_fem.errors import ParameterError
    from mfar_fem.materials.bending import Bending

    rows = [("thickness", "h", fabric.thickness, "m"), ("areal_density", "ρh", fabric.areal_density, "kg/m^2")]
    rows += [(f"law.{p.name}", p.symbol, fabric.law.values[p.name], p.unit) for p in fabric.law.parameters]
    symbols = {"warp": "B_w", "weft": "B_f", "twist": "D_33", "coupling": "D_12"}
    rows += [(f"bending.{key}", symbol, getattr(fabric.bending, key), "N*m") for key, symbol in symbols.items()]
    try:
        ratio = fabric.bending.ratio_to(Bending.derived(fabric.law, fabric.thickness))
    except ParameterError:
        ratio = None
    columns = ("key", "symbol", "value", "unit", "source")
    return {
        "name": fabric.name,
        "description": fabric.description,
        "law": {"name": fabric.law.name, "basis": fabric.law.basis},
        "quantities": [dict(zip(columns, (*row, fabric.source_of(row[0])), strict=True)) for row in rows],
        "bending_over_derived": ratio,
    }


def _render_list(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(title="fabric presets", title_justify="left")
    for heading in ("name", "law"):
        table.add_column(heading, no_wrap=True, overflow="fold")
    for heading in ("g/m²", "mm", "B warp\nµN·m", "B weft\nµN·m"):
        table.add_column(heading, justify="right")
    for row in payload["fabrics"]:
        numbers = [row["areal_density_kg_m2"] * 1e3, row["thickness_m"] * 1e3]
        numbers += [row["bending_warp_Nm"] * 1e6, row["bending_weft_Nm"] * 1e6]
        table.add_row(row["name"], row["law"], *(f"{number:.4g}" for number in numbers))
    return [table, "`mfar fabrics show NAME` shows every number with its source."]


def _render_fabric(payload: Mapping[str, Any]):
    from rich.markup import escape
    from rich.table import Table

    table = Table(show_lines=True)
    for heading in ("quantity", "value", "unit", "source"):
        table.add_column(heading, justify="right" if heading == "value" else "left", overflow="fold")
    before = None
    for row in payload["quantities"]:
        unit = row["unit"].replace("dimensionless", "–").replace("N*m", "N·m").replace("^2", "²")
        source = "as above" if row["source"] and row["source"] == before else escape(row["source"]) or "not stated"
        table.add_row(row["key"], f"{row['value']:.6g}", unit, source)
        before = row["source"]
    law = payload["law"]
    shown: list[Any] = [f"[bold]{escape(payload['name'])}[/bold]  (law {law['name']}, per {law['basis']})"]
    if payload["description"]:
        shown.append(escape(payload["description"]))
    shown.append(table)
    ratio = payload["bending_over_derived"]
    if ratio is not None:
        text = ", ".join(f"{key} {value:.3g}" for key, value in ratio.items())
        shown.append(f"bending rigidity over that of a solid sheet with the membrane's tangent at rest: {text}")
    return shown
