"""Reading and writing triangle meshes: .obj .ply .vtu .vtk .msh .off through meshio, .stl .glb .gltf through trimesh.

The order of vertices and triangles is kept in both directions; .stl has no vertices of its own, so equal corners are
merged in the order of first appearance. .stl and .glb store single precision. Lengths are metres unless `scale` says
otherwise.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mfar_fem.errors import DataFileError

MESHIO = {".obj": "obj", ".ply": "ply", ".vtu": "vtu", ".vtk": "vtk", ".msh": "gmsh", ".off": "off"}
TRIMESH = {".stl": "stl", ".glb": "glb", ".gltf": "gltf"}
_IGNORED = {"vertex", "line", "line3"}  # boundary markers that mesh generators write beside the surface


class TriangleMesh(NamedTuple):
    """Vertices (n, 3) float64 in metres, triangles (m, 3) int64, and the data stored with them, by name."""

    vertices: np.ndarray
    triangles: np.ndarray
    vertex_data: dict[str, np.ndarray]
    triangle_data: dict[str, np.ndarray]


def read_mesh(path: str | os.PathLike, scale: float = 1.0) -> TriangleMesh:
    """Read a triangle mesh.

    Parameters
    ----------
    path : path
        The file; its extension says the format.
    scale : float
        Metres per file unit (0.001 for millimetres).

    Returns
    -------
    TriangleMesh

    Raises
    ------
    DataFileError
        No such file, unknown extension, unreadable contents, no triangles, or cells other than three-node triangles.
    """
    path = Path(path)
    suffix = _suffix(path)
    if not path.is_file():
        raise DataFileError("no such file", path)
    mesh = _read_trimesh(path, suffix) if suffix in TRIMESH else _read_meshio(path, suffix)
    if not len(mesh.triangles):
        raise DataFileError("no triangles in it", path)
    if not np.isfinite(mesh.vertices).all():
        bad = int(np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))[0])
        raise DataFileError(f"vertex {bad} (counted from 0) has coordinates that are not finite", path)
    low, high = int(mesh.triangles.min()), int(mesh.triangles.max())
    if low < 0 or high >= len(mesh.vertices):
        bad = high if low >= 0 else low
        raise DataFileError(f"a triangle names vertex {bad}, there are {len(mesh.vertices)}", path)
    return mesh._replace(vertices=mesh.vertices * scale)


def write_mesh(
    path: str | os.PathLike,
    vertices: np.ndarray,
    triangles: np.ndarray,
    vertex_data: Mapping[str, np.ndarray] | None = None,
    triangle_data: Mapping[str, np.ndarray] | None = None,
) -> Path:
    """Write a triangle mesh; data by vertex and by triangle go along where the format has a place (.vtu, .vtk, .msh).

    Parameters
    ----------
    path : path
        Its extension says the format.
    vertices : (n, 3) array
        Metres.
    triangles : (m, 3) array of int
    vertex_data, triangle_data : mapping of str to (n, ...) or (m, ...) array, optional

    Returns
    -------
    Path

    Raises
    ------
    DataFileError
        Unknown extension, or the file cannot be written.
    """
    path = Path(path)
    suffix = _suffix(path)
    vertices, triangles = np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    try:
        if suffix in TRIMESH:
            _write_trimesh(path, suffix, vertices, triangles)
        else:
            _write_meshio(path, suffix, vertices, triangles, vertex_data or {}, triangle_data or {})
    except OSError as error:
        raise DataFileError(f"cannot be written: {error.strerror or error}", path) from error
    return path


def _suffix(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in MESHIO and suffix not in TRIMESH:
        known = " ".join([*MESHIO, *TRIMESH])
        raise DataFileError(f"unknown mesh format '{path.suffix}': one of {known}", path)
    return suffix


def _read_meshio(path: Path, suffix: str) -> TriangleMesh:
    import meshio

    chatter = io.StringIO()  # meshio reports on the console and exits
    try:
        with contextlib.redirect_stdout(chatter), contextlib.redirect_stderr(chatter):
            mesh = meshio.read(path, file_format=MESHIO[suffix])
    except (Exception, SystemExit) as error:
        said = chatter.getvalue().strip().splitlines()
        reason = said[0] if said else f"{type(error).__name__}: {error}"
        raise DataFileError(f"not a readable {suffix} mesh ({reason})", path) from error
    other = {block.type: len(block.data) for block in mesh.cells if block.type not in _IGNORED | {"triangle"}}
    if other:
        kinds = ", ".join(f"{count} {kind}" for kind, count in other.items())
        raise DataFileError(f"only three-node triangles can be used, the file has {kinds}: triangulate it first", path)
    blocks = [i for i, block in enumerate(mesh.cells) if block.type == "triangle"]
    triangles = [mesh.cells[i].data for i in blocks] or [np.empty((0, 3))]
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    data = {
        name: np.concatenate([values[i] for i in blocks]) for name, values in mesh.cell_data.items() if len(blocks)
    }
    return TriangleMesh(points, np.vstack(triangles).astype(np.int64), dict(mesh.point_data), data)


def _read_trimesh(path: Path, suffix: str) -> TriangleMesh:
    import trimesh

    from mfar_fem.surface.quality import merge_duplicates

    try:
        mesh: Any = trimesh.load(path, file_type=TRIMESH[suffix], force="mesh", process=False)
        vertices, triangles = np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)
    except Exception as error:
        raise DataFileError(f"not a readable {suffix} mesh ({type(error).__name__}: {error})", path) from error
    if suffix == ".stl" and len(triangles):
        vertices, triangles = merge_duplicates(vertices, triangles, tolerance=0.0)
    return TriangleMesh(vertices.reshape(-1, 3), triangles.reshape(-1, 3), {}, {})


def _write_meshio(path, suffix, vertices, triangles, vertex_data, triangle_data):
    import meshio

    keep = suffix in (".vtu", ".vtk", ".msh")
    mesh = meshio.Mesh(
        vertices,
        [("triangle", triangles.astype(np.int32) if suffix == ".ply" else triangles)],
        point_data={name: np.asarray(values) for name, values in vertex_data.items()} if keep else {},
        cell_data={name: [np.asarray(values)] for name, values in triangle_data.items()} if keep else {},
    )
    chatter = io.StringIO()
    with contextlib.redirect_stdout(chatter), contextlib.redirect_stderr(chatter):
        mesh.write(path, file_format=MESHIO[suffix])


def _write_trimesh(path, suffix, vertices, triangles):
    import trimesh

    if suffix == ".gltf":  # one text file beside its buffers
        files = trimesh.exchange.gltf.export_gltf(trimesh.Scene(trimesh.Trimesh(vertices, triangles, process=False)))
        for name, content in files.items():
            target = path if name.endswith(".gltf") else path.with_name(name)
            target.write_bytes(content)
        return
    path.write_bytes(trimesh.Trimesh(vertices, triangles, process=False).export(file_type=TRIMESH[suffix]))
