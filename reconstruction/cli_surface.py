"""``mfar study surface`` and ``mfar mesh repair``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress


def repair(
    source: Annotated[Path, typer.Argument(help="Mesh file: .obj .ply .stl .off .vtk .vtu .msh .glb .gltf")],
    target: Annotated[Path, typer.Argument(help="Mesh file to write, in metres; data stored with the mesh is left out.")],
    openings: Annotated[
        int | None, typer.Option(min=0, help="Openings that stay, the longest; other holes are closed. By default all stay.")
    ] = None,
    scale: Annotated[float, typer.Option(help="Metres per file unit: 0.001 for millimetres.")] = 1.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Mend a triangle mesh (holes, turned or repeated triangles, doubled vertices, crossings) and list what was done."""
    from mfar_fem.surface.io import read_mesh, write_mesh
    from reconstruction.surface.repair import repair as mend
    from reconstruction.surface.triangles import TriangleMesh

    read = read_mesh(source, scale)
    made = mend(TriangleMesh(read.vertices, read.triangles), openings)
    written = write_mesh(target, made.mesh.vertices, made.mesh.faces)
    before = {"vertices": len(read.vertices), "faces": len(read.triangles)}
    emit(made.to_dict() | {"before": before, "written": str(written)}, as_json, _show_repair)


def _show_repair(payload: Mapping[str, Any]) -> list[Any]:
    from rich.table import Table

    table = Table(title="What was done")
    for name in ("step", "count", "first ids"):
        table.add_column(name, justify="right" if name == "count" else "left")
    for action in payload["actions"]:
        ids = ", ".join(str(i) for i in action["ids"][:8]) + (" …" if len(action["ids"]) > 8 else "")
        table.add_row(action["what"], str(action["count"]), ids)
    old, new = (f"{p['vertices']} vertices and {p['faces']} triangles" for p in (payload["before"], payload))
    last = f"{old} became {new}; written to {payload['written']}"
    return [table if payload["actions"] else "nothing had to be done", last]


def study_surface(
    points: Annotated[int, typer.Option(min=500, help="Points on every surface.")] = 6000,
    noise: Annotated[str, typer.Option(help="Standard deviations of the points, with commas.")] = "0 mm, 3 mm",
    surfaces: Annotated[str, typer.Option(help="Surfaces, with commas.")] = "sphere,torus,cylinder,frustum,pleats",
    seeds: Annotated[int, typer.Option(min=1, help="Samples of each.")] = 1,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/study-surface"),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Points to surface on known surfaces: distance, rims, curvature, adaptive against uniform subdivision, triangle
    quality."""
    import json

    from mfar_fem import units
    from mfar_fem.cli.console import jsonable
    from reconstruction.surface.analytic import analytic
    from reconstruction.surface.study import steps, study

    names = [name.strip() for name in surfaces.split(",") if name.strip()]
    for name in names:
        analytic(name)
    levels = [units.parse(value.strip(), "m", name="--noise") for value in noise.split(",")]
    folder = check_writable(out)
    with progress("surfaces", total=steps(levels, names, seeds), quiet=as_json) as advance:
        payload = study(folder, points, levels, names, seeds, advance)
    (folder / "study.json").write_text(json.dumps(jsonable(payload), indent=1) + "\n", encoding="utf-8")
    emit(payload | {"out": folder}, as_json, _show)


TABLES = {
    "rows": ("Reconstruction of exact surfaces, mm",
             "surface noise_mm trimming stage faces off_mean off_95 off_max missing_max rim_mean rim_max least_angle seconds"),
    "arms": ("The same without a step (pleats)", "arm faces off_mean off_95 off_max rim_mean least_angle angle_1 below_20 seconds"),
    "calibration": ("Mean curvature: relative error", "surface edge_over_radius noise estimate bias rms largest"),
    "refinement": ("Adaptive against uniform, mm",
                   "edge_mm mesh faces angle mean p95 largest fold_mean limit_mean limit_p95 limit_largest"),
    "quality": ("Triangles, stage by stage", "stage faces least_angle angle_1 median_angle below_20 largest_aspect degenerate"),
}  # fmt: skip
"""Titles and columns of what is shown."""


def _show(payload: Mapping[str, Any]) -> list[Any]:
    shown = [_table(title, payload[key], columns.split()) for key, (title, columns) in TABLES.items()]
    names = ", ".join(Path(path).name for path in payload["files"].values())
    return [*shown, f"written to {payload['out']}: {names}, study.json"]


def _table(title: str, rows, columns) -> Any:
    from rich.table import Table

    table = Table(title=title)
    for column in columns:
        table.add_column(
            column.replace("_", " "), justify="right" if any(isinstance(r.get(column), (int, float)) for r in rows) else "left"
        )
    for row in rows:
        table.add_row(*(_cell(row.get(column)) for column in columns))
    return table


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
