"""Mean curvature of a triangle mesh at its vertices, by two estimates.

``cotangent``: the discrete Laplacian over the mixed Voronoi area, H n = −Δx / 2 (M. Meyer, M. Desbrun, P. Schröder, A. Barr,
Discrete differential-geometry operators for triangulated 2-manifolds, VisMath 2002, doi:10.1007/978-3-662-05105-4_2). Exact
in the limit on good meshes, sensitive to noise. ``quadric``: a quadric fitted to the neighbours within ``radius`` mean edges,
libigl's `principal_curvature` (D. Panozzo, E. Puppo, L. Rocca, Efficient multi-scale curvature and crease estimation, 2010);
it averages noise away and reads small spheres too flat. :func:`reconstruction.surface.study_curvature.calibration` tells the
errors of both on spheres and cylinders.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import ParameterError
from reconstruction.libraries import optional
from reconstruction.surface.connectivity import face_edges
from reconstruction.surface.triangles import TriangleMesh

METHODS = ("cotangent", "quadric")
RADIUS = 2
"""Mean edges that the quadric reaches; libigl's default of 5 is 11 % off on a coarse sphere."""


def mean_curvature(mesh: TriangleMesh, method: str = "cotangent", radius: int = RADIUS, smoothing: int = 0) -> np.ndarray:
    """(nv,) mean curvature H, 1/m, positive where the surface is convex seen along its normals (1/R on a sphere of radius R).

    Parameters
    ----------
    mesh : TriangleMesh
    method : str
        ``cotangent`` or ``quadric``.
    radius : int
        Of the quadric, at least 2.
    smoothing : int
        Number of averages over the neighbours, against noise.

    Notes
    -----
    At the boundary the Laplacian sees the edge's own bend; such vertices get the mean of their inner neighbours (0 where
    there are none).

    Raises
    ------
    ParameterError
        An unknown method or a radius below 2.
    """
    if method not in METHODS:
        raise ParameterError(f"curvature estimate '{method}' is unknown: {', '.join(METHODS)}")
    if radius < 2:
        raise ParameterError(f"the quadric needs a radius of 2 mean edges or more, not {radius}")
    value = _cotangent(mesh) if method == "cotangent" else _quadric(mesh, radius)
    value = _from_inside(mesh, value)
    if smoothing:
        from reconstruction.surface.connectivity import vertex_average

        average = vertex_average(mesh.faces, len(mesh.vertices))
        for _ in range(smoothing):
            value = 0.5 * (value + average @ value)
    return value


def cotangents(vertices: np.ndarray, faces: np.ndarray, least_sine: float = 1e-6) -> np.ndarray:
    """(nf, 3) cotangents of the angle at each corner; the area counts as no smaller than ``least_sine`` times the sides'
    product."""
    corner = vertices[faces]
    out = np.empty((len(faces), 3))
    for i in range(3):
        a, b = corner[:, (i + 1) % 3] - corner[:, i], corner[:, (i + 2) % 3] - corner[:, i]
        cross = np.linalg.norm(np.cross(a, b), axis=1)
        out[:, i] = np.einsum("ij,ij->i", a, b) / np.maximum(
            cross, least_sine * np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1) + 1e-300
        )
    return out


def _cotangent(mesh: TriangleMesh) -> np.ndarray:
    v, f = mesh.vertices, mesh.faces
    cot = cotangents(v, f)
    laplace, area = np.zeros_like(v), np.zeros(len(v))
    obtuse = (cot < 0).any(axis=1)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        edge = v[f[:, k]] - v[f[:, j]]
        flow = 0.5 * cot[:, i, None] * edge
        np.add.at(laplace, f[:, j], flow)
        np.add.at(laplace, f[:, k], -flow)
        voronoi = cot[:, i] * (edge**2).sum(axis=1) / 8
        for corner in (j, k):
            np.add.at(area, f[:, corner], np.where(obtuse, 0.0, voronoi))
        np.add.at(area, f[:, i], np.where(obtuse, mesh.areas * np.where(cot[:, i] < 0, 0.5, 0.25), 0.0))
    return -0.5 * np.einsum("ij,ij->i", laplace, mesh.vertex_normals) / np.maximum(area, 1e-300)


def _quadric(mesh: TriangleMesh, radius: int) -> np.ndarray:
    igl = optional("igl", "curvature needs")
    _, _, first, second, bad = igl.principal_curvature(mesh.vertices, mesh.faces, radius, True)
    value = 0.5 * (np.asarray(first) + np.asarray(second))
    ok = np.isfinite(value)
    ok[list(bad)] = False
    return np.where(ok, value, 0.0)


def _from_inside(mesh: TriangleMesh, value: np.ndarray) -> np.ndarray:
    """Boundary vertices get the mean of their inner neighbours, in rounds until all have one."""
    rim = np.zeros(len(value), bool)
    rim[mesh.boundary_vertices] = True
    if not rim.any():
        return value
    edges, _ = face_edges(mesh.faces)
    i, j = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
    out, known = np.where(rim, 0.0, value), ~rim
    for _ in range(3):
        use = known[i] & ~known[j]
        if not use.any():
            break
        count = np.bincount(j[use], minlength=len(out))
        total = np.bincount(j[use], weights=out[i[use]], minlength=len(out))
        got = count > 0
        out[got], known = total[got] / count[got], known | got
    return out
