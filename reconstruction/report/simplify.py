"""Fewer triangles for the page: vertices of a cell of a grid become one.

J. Rossignac, P. Borrel, Multi-resolution 3D approximations for rendering complex scenes, in: Modeling in Computer Graphics,
Springer 1993, 455-465, doi:10.1007/978-3-642-78114-8_29. It takes any mesh, also one with defects (what a report shows before
repair), which edge collapses do not. For looking at only.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.surface.triangles import TriangleMesh


def cluster(mesh: TriangleMesh, cell: float) -> tuple[TriangleMesh, np.ndarray]:
    """Join the vertices of every cube of a grid.

    Parameters
    ----------
    mesh : TriangleMesh
    cell : float
        Edge of the cubes, m.

    Returns
    -------
    TriangleMesh
        Vertices are means; faces that fall together or vanish are left out.
    (nv,) array of int
        New vertex of every old one.
    """
    if not cell > 0:
        raise ParameterError(f"the cell must be positive, not {cell}")
    key = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / cell).astype(np.int64)
    _, to = np.unique(key, axis=0, return_inverse=True)
    to = to.reshape(-1)
    number = np.bincount(to)
    vertices = np.column_stack([np.bincount(to, mesh.vertices[:, i]) for i in range(3)]) / number[:, None]
    faces = to[mesh.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return TriangleMesh(vertices, faces[np.sort(first)]), to


def simplified(mesh: TriangleMesh, most: int) -> tuple[TriangleMesh, np.ndarray, float]:
    """A mesh of at most `most` faces.

    Returns
    -------
    TriangleMesh
    (nv,) array of int
        New vertex of every old one.
    float
        Edge of the cells, m: no vertex moved further than its diagonal. 0 where nothing was to be done.

    Raises
    ------
    ParameterError
        No grid leaves between one and `most` faces.
    """
    if len(mesh.faces) <= most:
        return mesh, np.arange(len(mesh.vertices)), 0.0
    low, high = 0.0, float(np.ptp(mesh.vertices, axis=0).max())
    best = None
    for _ in range(12):
        middle = 0.5 * (low + high) if best is not None or low > 0 else 2 * np.sqrt(mesh.areas.sum() / most)
        coarse, to = cluster(mesh, middle)
        if 0 < len(coarse.faces) <= most:
            best, high = (coarse, to, float(middle)), middle
            if len(coarse.faces) > 0.8 * most:
                break
        elif len(coarse.faces):
            low = middle
        else:
            high = middle
    if best is None:
        raise ParameterError(f"{len(mesh.faces)} faces could not be brought below {most}")
    return best


def carried(values, to: np.ndarray) -> np.ndarray:
    """Values (nv,) at the joined vertices: means of those that are finite, NaN where none is."""
    values = np.asarray(values, dtype=float)
    finite = np.isfinite(values)
    n = np.bincount(to, finite)
    total = np.bincount(to, np.where(finite, values, 0.0))
    return np.where(n > 0, total / np.maximum(n, 1), np.nan)
