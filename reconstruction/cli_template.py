"""``mfar template``: keypoints to cutting template."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress
from reconstruction.measure.vote import DEFAULT_WEIGHTING

KEYPOINTS = "keypoints.json"
"""Name of the keypoints file in a folder."""


def template(
    keypoints: Annotated[Path, typer.Argument(help="Keypoints file (JSON), or a folder with keypoints.json.")],
    out_dir: Annotated[Path, typer.Option("--out", "-o", help="Folder for the template, the tables and the overview.")],
    garment: Annotated[
        str | None,
        typer.Option("--type", help="round-collar-robe, half-sleeve, flying-ribbon, veil-hat; else what the file says, or a robe."),
    ] = None,
    loom: Annotated[str, typer.Option("--loom", help="Width of the cloth.")] = "57.5 cm",
    weighting: Annotated[
        str, typer.Option("--vote", help="Weights of the kinds: precision (inverse variances) or paper (0.5, 0.3, 0.2).")
    ] = DEFAULT_WEIGHTING,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Measure a garment on its images, vote, and write the cutting template at true scale (SVG, DXF, GarmentCode JSON)."""
    from mfar_fem import units
    from reconstruction.keypoints_file import read_keypoints
    from reconstruction.template.pipeline import make_template, write_template

    source = read_keypoints(keypoints / KEYPOINTS if keypoints.is_dir() else keypoints)
    width = units.parse(loom, "m", name="--loom")
    folder = check_writable(out_dir)
    with progress("measuring", total=2 * len(source.images), quiet=as_json) as advance:
        made = make_template(source, garment, width, advance, weighting)
    files = write_template(folder, made, source.images)
    emit(made.to_dict() | {"files": {key: str(path) for key, path in files.items()}}, as_json, _render)


def _render(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title=f"{payload['garment']}: {len(payload['panels'])} panels, {payload['seams']} seams")
    for column in ("length", "vote, cm", "± cm", "spread, cm", "from"):
        table.add_column(column, justify="left" if column in ("length", "from") else "right")
    for v in payload["votes"]:
        kinds = ", ".join(f"{kind} {100 * k['value_m']:.1f}" for kind, k in v["kinds"].items())
        table.add_row(v["name"], f"{100 * v['value_m']:.1f}", f"{100 * v['sigma_m']:.1f}", f"{100 * v['spread_m']:.1f}", kinds)
    shown: list[Any] = [table]
    for c in payload["conflicts"]:
        shown.append(f"conflict: {c['name']}: {c['first']} {100 * c['first_value_m']:.1f} cm, {c['second']} "
                     f"{100 * c['second_value_m']:.1f} cm (z = {c['z']:+.1f})")
    shown += [f"assumed: {name} = {how}" for name, how in payload["assumed"].items()]
    shown += [f"{f['level']}: {f['where']} {f['message']}" for f in payload["findings"]]
    paths = [Path(path) for path in payload["files"].values()]
    shown.append(f"written to {paths[0].parent}: " + ", ".join(path.name for path in paths))
    return shown


def study_template(
    seeds: Annotated[int, typer.Option(min=1, help="Garments of each type.")] = 3,
    types: Annotated[str, typer.Option(help="Types, with commas.")] = "round-collar-robe,half-sleeve,flying-ribbon",
    weights: Annotated[str, typer.Option(help="A trained detector instead of the shipped one.")] = "shipped",
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Output folder; cases and points in it are kept.")
    ] = Path("out/study-template"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Sew, draw, detect, fit: how far templates made from pictures are from the patterns of synthetic garments."""
    import csv

    from reconstruction.template.case_study import study
    from reconstruction.template.dimensions import garment_type

    garments = [garment_type(name.strip()) for name in types.split(",") if name.strip()]
    folder = check_writable(out)
    with progress("garments", total=seeds * len(garments), quiet=as_json) as advance:
        payload = study(folder, garments, seeds, weights, advance)
    for name in ("rows", "summary"):
        with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(payload[name][0]) + (["why"] if name == "rows" else []), restval="")
            writer.writeheader()
            writer.writerows(payload[name])
    emit(payload | {"out": folder}, as_json, _show_study)


def _show_study(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title="Errors of the template's dimensions, median (largest) over the garments, %")
    for column in ("garment", "dimension", "points", "sources", "vote", "error", "≤ 3 %"):
        table.add_column(column, justify="right" if column in ("error", "≤ 3 %") else "left")
    for r in payload["summary"]:
        error = "-" if r["median_error"] is None else f"{100 * r['median_error']:.1f} ({100 * r['largest_error']:.1f})"
        within = f"{r['within_3_percent']}/{r['cases']}"
        table.add_row(r["garment"], r["dimension"], r["points"], r["sources"], r["vote"], error, within)
    return [table, f"written to {payload['out']}: rows.csv, summary.csv"]
