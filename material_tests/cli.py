"""``mfar test``: virtual textile tests on a fabric preset or a fabric file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from material_tests import lab_cli
from mfar_fem.cli.console import check_writable, emit
from mfar_fem.errors import InputError, MissingDependencyError, NotConvergedError

app = typer.Typer(help="Virtual textile tests on a fabric preset or a fabric file.", no_args_is_help=True)
lab_cli.register(app)

_FABRIC = Annotated[str, typer.Argument(help="A preset (see `mfar fabrics`) or a fabric file (TOML).")]
_OUT = Annotated[Path | None, typer.Option("--out", help="Folder for the curve or shape (CSV) and the plot (PNG).")]
_FIDELITY = Annotated[str, typer.Option(help="Mesh of the level fe: draft, standard or reference.")]
_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


def length(text: str, option: str) -> float:
    """A positive length option in metres, e.g. '80 mm'.

    Raises
    ------
    InputError
        Unit missing, unknown, of the wrong kind, or the length is not positive.
    """
    from mfar_fem import units

    value = units.parse(text, "m", name=option)
    if not value > 0:
        raise InputError(f"{option} must be positive, not '{text}'")
    return value


def direction(text: str) -> float:
    """Angle from the warp (rad) of 'warp', 'weft', 'bias', '30' (degrees) or '0.5 rad'."""
    from mfar_fem import units
    from mfar_fem.materials.homogeneous import direction_angle

    try:
        return math.radians(float(text))
    except ValueError:
        return direction_angle(text) if text.isalpha() else units.parse(text, "rad", name="direction")


@app.command()
def strip(
    fabric: _FABRIC,
    gauge: Annotated[str, typer.Option(help="Free length between the grips, with its unit.")] = "75 mm",
    width: Annotated[str, typer.Option(help="Width of the strip, with its unit.")] = "25 mm",
    angle: Annotated[str, typer.Option(help="Strip axis from the warp: degrees, or warp, weft, bias.")] = "warp",
    strain: Annotated[float, typer.Option(help="Largest engineering strain.")] = 0.05,
    points: Annotated[int, typer.Option(help="Points on the curve.")] = 41,
    level: Annotated[str, typer.Option(help="homogeneous (no mesh) or fe.")] = "homogeneous",
    fidelity: _FIDELITY = "standard",
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Pull a strip: force by width against elongation (ASTM D5035)."""
    from mfar_fem.materials import Fabric

    inputs = {
        "gauge": length(gauge, "--gauge"),
        "width": length(width, "--width"),
        "angle": direction(angle),
        "strains": _strains(strain, points),
    }
    run = _level(level, "strip")
    folder = check_writable(out) if out is not None else None
    loaded = Fabric.load(fabric)
    payload = run(loaded, **inputs, fidelity=fidelity) if run else _strip_homogeneous(loaded, **inputs)
    if folder is not None:
        from material_tests.output import save_strip

        payload["files"] = save_strip(folder, payload)
        if run:
            from material_tests.strip.plots import save_pictures

            payload["files"] += save_pictures(folder, payload)
    emit(payload, as_json, _render_strip)
    if not payload["converged"]:
        if run:
            raise NotConvergedError(f"'{fabric}': {payload['message']}; the curve ends there")
        raise NotConvergedError(
            f"'{fabric}' cannot be stretched to {strain:g} in this direction: the law locks or loses stability; "
            "the curve ends at the last strain reached"
        )


@app.command()
def cantilever(
    fabric: _FABRIC,
    direction_: Annotated[
        str, typer.Option("--direction", help="Strip axis from the warp: warp, weft, bias, or degrees.")
    ] = "warp",
    level: Annotated[str, typer.Option(help="exact (elastica) or fe.")] = "exact",
    option: Annotated[str, typer.Option(help="A: overhang at 41.5 degrees; B: heart loop.")] = "A",
    loop_length: Annotated[str, typer.Option(help="Option B: length of the loop, with its unit.")] = "200 mm",
    wide: Annotated[bool, typer.Option("--wide", help="Bend into a cylinder (D11), not as a free strip.")] = False,
    fidelity: _FIDELITY = "standard",
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Let a strip droop or hang: bending length and flexural rigidity (ASTM D1388)."""
    from mfar_fem.materials import Fabric

    if option.upper() not in ("A", "B"):
        raise InputError(f"ASTM D1388 has the options A (cantilever) and B (heart loop), not '{option}'")
    inputs = {
        "direction": direction(direction_),
        "option": option.upper(),
        "free": not wide,
        "loop_length": length(loop_length, "--loop-length"),
    }
    run = _level(level, "cantilever")
    folder = check_writable(out) if out is not None else None
    loaded = Fabric.load(fabric)
    payload = run(loaded, **inputs, fidelity=fidelity) if run else _cantilever_exact(loaded, **inputs)
    if folder is not None:
        from material_tests.output import save_cantilever

        payload["files"] = save_cantilever(folder, payload)
    emit(payload, as_json, _render_cantilever)


def _level(level: str, test: str):
    """None for the model without a mesh, the ``run`` of the finite-element module for 'fe'."""
    quick = {"strip": "homogeneous", "cantilever": "exact"}[test]
    if level == quick:
        return None
    if level != "fe":
        raise InputError(f"the {test} test has the levels {quick} and fe, not '{level}'")
    name = f"material_tests.{test}.fe"
    try:
        return import_module(name).run
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        message = f"this installation has no finite-element {test} test; use --level {quick}"
        raise MissingDependencyError(message) from error


def _strains(strain: float, points: int):
    import numpy as np

    if not (math.isfinite(strain) and 0 < strain <= 10):
        raise InputError(f"--strain is the largest engineering strain, above 0 (0.05 is 5 %), not {strain}")
    if not 2 <= points <= 10_000:
        raise InputError(f"--points must be between 2 and 10000, not {points}")
    return np.linspace(0.0, strain, points)


def _strip_homogeneous(fabric, gauge, width, angle, strains) -> dict[str, Any]:
    """The payload of a strip test without a mesh; ``run`` of the finite-element level returns the same keys."""
    from material_tests.strip import homogeneous

    curves = homogeneous.curves(fabric, angle, strains, width)
    return {
        "test": "strip",
        "standard": "ASTM D5035",
        "level": "homogeneous",
        "fabric": fabric.name,
        "law": fabric.law.name,
        "angle_deg": math.degrees(angle),
        "gauge_m": gauge,
        "width_m": width,
        "converged": curves["free"]["converged"],  # the held curve is a bound and may lock long before
        "curves": curves,
    }


def _cantilever_exact(fabric, direction, option, free, loop_length) -> dict[str, Any]:
    """The payload of a cantilever test without a mesh; ``run`` of the finite-element level returns the same keys."""
    from material_tests.cantilever import exact

    result = exact(fabric, direction, option, free, loop_length)
    payload = {
        "test": "cantilever",
        "standard": f"ASTM D1388 option {option}",
        "option": option,
        "level": "exact",
        "fabric": fabric.name,
        "angle_deg": math.degrees(result.angle),
        "edges": "free" if free else "cylinder",
        "weight_N_per_m2": result.weight,
        "rigidity_Nm": result.rigidity,
        "overhang_m" if option == "A" else "loop_height_m": result.reading,
        "bending_length_m": result.bending_length,
        "standard_bending_length_m": result.standard_bending_length,
        "exact_rigidity_Nm": result.exact_rigidity,
        "standard_rigidity_Nm": result.standard_rigidity,
        "standard_rigidity_mg_cm": result.standard_rigidity_mg_cm,
        "standard_error_percent": result.error_percent,
        "shape": {"s_m": result.s, "x_m": result.x, "y_m": result.y},
    }
    if option == "B":
        payload["loop_length_m"] = loop_length
    return payload


def _render_strip(payload: Mapping[str, Any]):
    import numpy as np
    from rich.table import Table

    names = list(payload["curves"])
    table = Table(title=f"{payload['fabric']}: strip at {payload['angle_deg']:.4g}° from the warp, {payload['level']}")
    table.add_column("strain", justify="right")
    for name in names:
        table.add_column(f"{name}: N/m", justify="right")
    longest = max((payload["curves"][name]["strain"] for name in names), key=len)
    for i in np.unique(np.linspace(0, len(longest) - 1, 11).astype(int)):
        row = [f"{longest[i]:.4g}"]
        for name in names:
            force = payload["curves"][name]["line_force_N_per_m"]
            row.append(f"{force[i]:.4g}" if i < len(force) else "–")
        table.add_row(*row)
    costs = [
        f"{name}: {error['force_ratio']:.4g} times the force at strain {error['strain']:.4g}, "
        f"RMSE {error['rmse_percent_of_range']:.3g} % of range"
        for name, error in payload.get("shortcut_error", {}).items()
    ]
    note = [f"[yellow]{payload['mesh_note']}[/yellow]"] if payload.get("mesh_note") else []
    return [table, *note, *([f"shortcut against finite elements, {line}" for line in costs]), *_files(payload)]


def _render_cantilever(payload: Mapping[str, Any]):
    from rich.table import Table

    table = Table(title=f"{payload['fabric']}: {payload['standard']}, {payload['angle_deg']:.4g}° from the warp")
    table.add_column("quantity")
    table.add_column("value", justify="right")
    reading = "overhang_m" if payload["option"] == "A" else "loop_height_m"
    rows = [
        ("rigidity of the strip, µN m", 1e6 * payload["rigidity_Nm"]),
        ("overhang at 41.5°, mm" if payload["option"] == "A" else "height of the loop, mm", 1e3 * payload[reading]),
        ("bending length, mm", 1e3 * payload["bending_length_m"]),
        ("bending length by the standard, mm", 1e3 * payload["standard_bending_length_m"]),
        ("rigidity by the standard, µN m", 1e6 * payload["standard_rigidity_Nm"]),
        ("rigidity by the standard, mg cm", payload["standard_rigidity_mg_cm"]),
        ("error of the standard's rigidity, %", payload["standard_error_percent"]),
    ]
    if payload["level"] == "fe":
        rows += [
            ("rigidity from the reading by the elastica, µN m", 1e6 * payload["exact_rigidity_Nm"]),
            ("rigidity of a narrow strip, µN m", 1e6 * payload["narrow_strip_rigidity_Nm"]),
            ("rigidity of a cylinder, µN m", 1e6 * payload["cylinder_rigidity_Nm"]),
            ("twist at the far end, °", payload["twist_deg"]),
        ]
    for name, value in rows:
        table.add_row(name, f"{value:.4g}")
    return [table, *_files(payload)]


def _files(payload: Mapping[str, Any]) -> list[str]:
    return [f"written: {path}" for path in payload.get("files", [])]
