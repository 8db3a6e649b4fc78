"""``mfar mesh``: check and convert triangle meshes, and make strips, discs and annuli."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import emit

app = typer.Typer(help="Triangle meshes: check one, convert it, make strips, discs and annuli.", no_args_is_help=True)

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
_Scale = Annotated[float, typer.Option(help="Metres per file unit: 0.001 for millimetres.")]


@app.command()
def check(
    path: Annotated[Path, typer.Argument(help="Mesh file: .obj .ply .stl .off .vtk .vtu .msh .glb .gltf")],
    scale: _Scale = 1.0,
    order: Annotated[int, typer.Option(min=1, max=2, help="Order of the shell, for the count of unknowns.")] = 2,
    as_json: _JSON = False,
) -> None:
    """Check a mesh as the solver would take it; exit code 2 and the ids of what is wrong if it would not."""
    from mfar_fem.surface import Surface
    from mfar_fem.surface.io import read_mesh

    mesh = read_mesh(path, scale)
    surface = Surface(mesh.vertices, mesh.triangles, order)
    emit(_summary(surface) | {"file": str(path)}, as_json, _render)


@app.command()
def convert(
    source: Annotated[Path, typer.Argument(help="Mesh file to read.")],
    target: Annotated[Path, typer.Argument(help="Mesh file to write; the extension says the format.")],
    scale: _Scale = 1.0,
) -> None:
    """Read a mesh in one format and write it in another, in metres; the order of its vertices is kept."""
    from mfar_fem.surface.io import read_mesh, write_mesh

    mesh = read_mesh(source, scale)
    emit({"written": str(write_mesh(target, mesh.vertices, mesh.triangles))}, False, lambda p: f"written: {p['written']}")


@app.command()
def make(
    kind: Annotated[str, typer.Argument(help="strip, disc or annulus")],
    out: Annotated[Path, typer.Argument(help="Mesh file to write.")],
    length: Annotated[str, typer.Option(help="Length of a strip.")] = "200 mm",
    width: Annotated[str, typer.Option(help="Width of a strip.")] = "50 mm",
    inner: Annotated[str, typer.Option(help="Inner radius of an annulus.")] = "90 mm",
    outer: Annotated[str, typer.Option(help="Radius of a disc, outer radius of an annulus.")] = "150 mm",
    cells: Annotated[
        str | None, typer.Option(help="Cells: along x across (16x4), radially x around (6x96), one number for a disc (8).")
    ] = None,
) -> None:
    """Make the mesh of a strip, disc or annulus (no other mesher needed)."""
    from mfar_fem.errors import InputError
    from mfar_fem.surface import patterns
    from mfar_fem.surface.io import write_mesh
    from mfar_fem.units import parse

    cells = cells or {"annulus": "6x96", "disc": "8"}.get(kind, "16x4")
    try:
        counts = [int(c) for c in cells.lower().split("x")]
    except ValueError:
        raise InputError(f"--cells '{cells}' is not of the form 16x4") from None
    if len(counts) != (1 if kind == "disc" else 2):
        raise InputError(f"--cells '{cells}': a {kind} takes {'one number' if kind == 'disc' else 'two numbers, 16x4'}")
    if kind == "strip":
        pattern = patterns.strip(parse(length, "m"), parse(width, "m"), counts[0], counts[1])
    elif kind == "annulus":
        pattern = patterns.annulus(parse(inner, "m"), parse(outer, "m"), counts[0], counts[1])
    elif kind == "disc":
        pattern = patterns.disc(parse(outer, "m"), counts[0])
    else:
        raise InputError(f"unknown kind '{kind}'; write strip, disc or annulus")
    emit({"written": str(write_mesh(out, pattern.vertices, pattern.triangles))}, False, lambda p: f"written: {p['written']}")


def _summary(surface) -> dict[str, Any]:
    import numpy as np

    size = np.ptp(surface.nodes, axis=0)
    n = 3 * len(surface.nodes) + surface.order * len(surface.edges)
    return {"vertices": len(surface.vertices), "triangles": len(surface.triangles), "edges": len(surface.edges),
            "boundary_edges": len(surface.boundary_edges), "area_m2": float(surface.areas.sum()), "size_m": size.tolist(),
            "edge_length_m": [float(surface.edge_lengths.min()), float(surface.edge_lengths.max())],
            "order": surface.order, "unknowns": n}


def _render(p) -> list[str]:
    size = " x ".join(f"{s:.4g}" for s in p["size_m"])
    return [f"[bold]{p['file']}[/]: fit for the solver",
            f"{p['triangles']} triangles, {p['vertices']} vertices, {p['boundary_edges']} boundary edges",
            f"area {p['area_m2']:.4g} m², size {size} m, edges {p['edge_length_m'][0]:.3g} to {p['edge_length_m'][1]:.3g} m",
            f"{p['unknowns']} unknowns at order {p['order']}"]
