"""``mfar test``: the tests beyond strip and cantilever; each command reads its options and shows what the test returns."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli import console
from mfar_fem.cli.console import check_writable, emit, progress
from mfar_fem.errors import InputError, NotConvergedError

_FABRIC = Annotated[str, typer.Argument(help="A preset (see `mfar fabrics`) or a fabric file (TOML).")]
_OUT = Annotated[Path | None, typer.Option("--out", help="Folder for tables (CSV) and pictures (PNG).")]
_FIDELITY = Annotated[str, typer.Option(help="draft, standard or reference.")]
_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


def register(app: typer.Typer) -> None:
    """Add the commands to ``mfar test``."""
    for command in (drape, swing, shear, wrinkles, inflation, spectrum):
        app.command()(command)


def drape(
    name: Annotated[str | None, typer.Argument(metavar="[FABRIC]", help="A preset or a fabric file (TOML).")] = None,
    fabric: Annotated[str | None, typer.Option("--fabric", help="The same as an option.")] = None,
    size: Annotated[str, typer.Option(help="Specimen and disc: iso-24, iso-30, iso-36 or jis-254.")] = "iso-30",
    fidelity: _FIDELITY = "standard",
    table: Annotated[bool, typer.Option("--table", help="All branches: starts with 2 to 10 folds, and flat falls.")] = False,
    folds: Annotated[
        int | None, typer.Option(help="Folds of the start of the single branch (default: nearly flat).", min=2)
    ] = None,
    self_contact: Annotated[bool, typer.Option("--self-contact", help="The folds may touch, not cross.")] = False,
    error: Annotated[bool, typer.Option("--error/--no-error", help="State the error against the mesh of `reference`.")] = True,
    workers: Annotated[int, typer.Option(help="Processes of the table.", min=1)] = 2,
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Drape a round specimen over a disc (Cusick, ISO 9073-9; JIS L 1096): coefficient, nodes, branches."""
    from material_tests.drape import compare
    from mfar_fem.materials import Fabric

    if (name is None) == (fabric is None):
        raise InputError("name one fabric: `mfar test drape faille` or `mfar test drape --fabric faille`")
    folder = check_writable(out) if out is not None else None
    loaded = Fabric.load(name or fabric)
    with progress(f"drape, {fidelity}", None) as advance:
        payload = compare.run(
            loaded,
            size,
            fidelity,
            table,
            folds,
            self_contact,
            error,
            folder,
            workers,
            lambda done, total, text: advance(0, completed=done, total=total or None, description=text),
        )
    emit(payload, as_json, compare.render)
    if not payload["converged"]:
        raise NotConvergedError(f"drape of '{loaded.name}': {payload.get('message', 'did not come to rest')}")


def swing(
    fabric: _FABRIC,
    angle: Annotated[str, typer.Option(help="Release from the vertical, with its unit.")] = "60 deg",
    hang: Annotated[str, typer.Option(help="Edge it hangs from: short or long.")] = "short",
    gamma: Annotated[str, typer.Option(help="Drag across the sheet, e.g. '0.6 kg/m^3'.")] = "0.6 kg/m^3",
    recover: Annotated[str, typer.Option(help="What recovers the drag from the record: fe, plate or none.")] = "fe",
    noise: Annotated[str, typer.Option(help="Noise of the synthetic record, with its unit.")] = "0.5 deg",
    seed: Annotated[int, typer.Option(help="Of the noise.")] = 0,
    fidelity: _FIDELITY = "draft",
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Let a hanging swatch swing; recover the drag of the air from a noisy record of it."""
    from material_tests.swing import plots, run
    from mfar_fem import units
    from mfar_fem.materials import Fabric

    inputs: dict[str, Any] = {
        "angle": units.parse(angle, "rad", name="--angle"),
        "gamma": units.parse(gamma, "kg/m^3", name="--gamma"),
        "noise": units.parse(noise, "rad", name="--noise"),
    }
    folder = check_writable(out) if out is not None else None
    with progress(f"swing, {fidelity}"):
        payload = run(Fabric.load(fabric), hang=hang, recover=recover, seed=seed, fidelity=fidelity, **inputs)
    if folder is not None:
        payload["files"] = plots.save(folder, payload)
    emit(payload, as_json, plots.render)


def shear(
    fabric: _FABRIC,
    method: Annotated[str, typer.Option(help="frame (picture frame) or bias (bias extension).")] = "frame",
    largest: Annotated[str, typer.Option(help="Largest shear angle, with its unit.")] = "40 deg",
    misalignment: Annotated[str, typer.Option(help="Of the yarns in the frame, with its unit.")] = "0 deg",
    fidelity: _FIDELITY = "standard",
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Shear a fabric in the picture frame or by bias extension: what the test reads, and what it recovers of the law."""
    from material_tests.shear import plots, run
    from mfar_fem import units
    from mfar_fem.materials import Fabric

    inputs: dict[str, Any] = {
        "largest": units.parse(largest, "rad", name="--largest"),
        "misalignment": units.parse(misalignment, "rad", name="--misalignment"),
    }
    with progress(f"shear, {method}"):
        payload = run(Fabric.load(fabric), method, fidelity=fidelity, **inputs)
    _finish(payload, out, plots, as_json)


def wrinkles(
    case: Annotated[str, typer.Argument(help="stretched or sheared.")] = "stretched",
    fidelity: _FIDELITY = "draft",
    strain: Annotated[float | None, typer.Option(help="Engineering strain, or shear displacement by height.")] = None,
    size: Annotated[str | None, typer.Option(help="Length (stretched) or height (sheared), with its unit.")] = None,
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Wrinkle a sheared or stretched sheet and compare wavelength and amplitude with the scaling laws."""
    from material_tests.wrinkles import plots, run
    from mfar_fem import units

    with progress(f"wrinkles, {case}"):
        payload = run(case, fidelity, strain, None if size is None else units.parse(size, "m", name="--size"))
    _finish(payload, out, plots, as_json)


def inflation(
    case: Annotated[str, typer.Argument(help="mylar, hencky or sphere.")] = "mylar",
    order: Annotated[int, typer.Option(help="Of the elements.", min=1, max=2)] = 2,
    fidelity: _FIDELITY = "standard",
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Inflate a membrane (Mylar balloon, Hencky membrane, rubber sphere) and compare with its exact solution."""
    from material_tests.inflation import plots, run

    with progress(f"inflation, {case}"):
        payload = run(case, order, fidelity)
    _finish(payload, out, plots, as_json)


def spectrum(
    first: Annotated[Path, typer.Argument(help="Picture or height field (PNG, JPEG, NPY).")],
    second: Annotated[Path, typer.Argument(help="The other one.")],
    spacing: Annotated[str | None, typer.Option(help="Side of a pixel of the first, with its unit.")] = None,
    second_spacing: Annotated[str | None, typer.Option(help="Of the second; default that of the first.")] = None,
    draws: Annotated[int, typer.Option(help="Fields drawn for each null.", min=20)] = 100,
    seed: Annotated[int, typer.Option(help="Of the nulls.")] = 0,
    out: _OUT = None,
    as_json: _JSON = False,
) -> None:
    """Similarity of two wrinkle spectra, with the null values without which the number means nothing."""
    from material_tests.spectrum import plots, run
    from mfar_fem import units

    if spacing is None and second_spacing is not None:
        raise InputError("--second-spacing needs --spacing: without a scale both pictures are taken as they are")
    one, other = (None if s is None else units.parse(s, "m", name="--spacing") for s in (spacing, second_spacing or spacing))
    with progress("spectrum"):
        payload = run(first, second, one, other, draws=draws, seed=seed)
    _finish(payload, out, plots, as_json)


def _finish(payload: dict[str, Any], out: Path | None, plots, as_json: bool) -> None:
    """Write pictures, show the figures, and leave with code 3 where the computation did not converge."""
    if out is not None:
        payload["files"] = plots.save_pictures(check_writable(out), payload)
    emit(payload, as_json, _render)
    if payload.get("converged") is False:
        reason = payload.get("message", "did not converge")
        raise NotConvergedError(f"{payload.get('test', 'the test')}: {reason}; the figures are of what was reached")


def _render(payload: Mapping[str, Any]):
    """Figures as a table; series and fields are left to the files and to ``--json``."""
    from rich.markup import escape
    from rich.table import Table

    table = Table(show_header=False, title=str(payload.get("test", "")), title_justify="left")
    table.add_column(no_wrap=True)
    table.add_column()
    for key, value in _scalars(payload):
        table.add_row(key.replace("_", " "), escape(value))
    return [table, *_series(payload), *(f"written: {name}" for name in payload.get("files", ()))]


def _series(payload: Mapping[str, Any], longest: int = 16) -> list:
    """The short series of a payload side by side, in as many tables as the width of the screen asks for."""
    import numpy as np
    from rich.table import Table

    columns = {k: np.asarray(v, dtype=float) for k, v in payload.items() if _is_series(v)}
    length = max((len(c) for c in columns.values()), default=0)
    columns = {k: c for k, c in columns.items() if len(c) == length}
    if not 3 < length <= longest:
        return []
    named = [(_heading(k), [f"{v:.4g}" for v in c]) for k, c in columns.items()]
    tables = []
    for group in _groups(named, console.out().width - 1):
        table = Table()
        for column in group:
            table.add_column(column[0], justify="right", min_width=_width(column) - 3)
        for row in zip(*(cells for _, cells in group), strict=True):
            table.add_row(*row)
        tables.append(table)
    return tables


def _heading(key: str) -> str:
    """``force_N`` as 'force N'."""
    return key.replace("_", " ")


def _groups(columns: list[tuple[str, list[str]]], width: int) -> list[list[tuple[str, list[str]]]]:
    """Columns that fit side by side into a width, the first one before each group."""
    groups: list[list[tuple[str, list[str]]]] = []
    used = 0
    for column in columns[1:] or columns:
        need = _width(column)
        if not groups or used + need > width:
            groups.append([columns[0]] if len(columns) > 1 else [])
            used = _width(columns[0]) if len(columns) > 1 else 0
        groups[-1].append(column)
        used += need
    return groups


def _width(column: tuple[str, list[str]]) -> int:
    """Characters of a column in a table whose headings break between words."""
    name, cells = column
    return max(map(len, [*name.split(), *cells])) + 3


def _is_series(value: Any) -> bool:
    import numpy as np

    if not isinstance(value, list | tuple | np.ndarray) or len(value) == 0:
        return False
    array = np.asarray(value)
    return array.ndim == 1 and array.dtype.kind in "fiu"


def _scalars(values: Mapping[str, Any], prefix: str = ""):
    for key, value in values.items():
        name = f"{prefix}{key}"
        if key in ("files", "test"):
            continue
        if isinstance(value, Mapping):
            yield from _scalars(value, f"{name}: ")
        elif isinstance(value, bool | str):
            yield name, str(value)
        elif isinstance(value, int | float) or (hasattr(value, "ndim") and value.ndim == 0):
            yield name, f"{float(value):.6g}"
        elif isinstance(value, list | tuple) and 0 < len(value) <= 3 and all(isinstance(v, int | float) for v in value):
            yield name, ", ".join(f"{v:.6g}" for v in value)
