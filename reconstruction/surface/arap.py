r"""As-rigid-as-possible deformation to handles, formula (10) of the silk paper.

.. math:: E(V') = \sum_i \sum_{j \in N(i)} w_{ij} \lVert (v'_i - v'_j) - R_i (v_i - v_j) \rVert^2

O. Sorkine, M. Alexa, As-rigid-as-possible surface modeling, SGP 2007, doi:10.2312/SGP/SGP07/109-116. The paper writes
R_i (v_j − v_i) − (v'_j − v'_i), which is the same sum, as a function E(V) of V; but the edges that R_i turns are those of the
rest shape v, and the unknown is V'. It also speaks of a sum "of each triangle face" while (10) runs over the vertices' stars:
the stars are taken. Without handles the minimum is the rest shape itself (E = 0): (10) alone moves nothing and betters no triangle.
Handles bend a mesh to given places; :mod:`reconstruction.surface.improve` betters triangles.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from mfar_fem.errors import NotConvergedError, ParameterError, SurfaceError
from reconstruction.surface.connectivity import face_edges
from reconstruction.surface.curvature import cotangents
from reconstruction.surface.triangles import TriangleMesh

TOLERANCE = 1.5e-5
"""Relative change of the energy at which iteration stops (the paper's Table 1)."""
LEAST_WEIGHT = 1e-3
"""Weights below this part of their mean (an edge across two obtuse corners has a negative one) are raised to it: the global
step then has a minimum and the energy cannot rise."""


@dataclass(frozen=True, eq=False)
class ArapResult:
    """A deformed mesh.

    Attributes
    ----------
    mesh : TriangleMesh
        Same faces.
    energies : tuple of float
        (10) after every iteration, m² (weights have no unit); never rising. With weighted handles their term is included.
    iterations : int
    converged : bool
    raised : int
        Weights raised, see :data:`LEAST_WEIGHT`.
    """

    mesh: TriangleMesh
    energies: tuple[float, ...]
    iterations: int
    converged: bool
    raised: int


def edge_weights(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, int]:
    """Edges (ne, 2), their weights ½ (cot α + cot β) with the least of :data:`LEAST_WEIGHT`, and how many were raised."""
    edges, of_face = face_edges(mesh.faces)
    cot = cotangents(mesh.vertices, mesh.faces)
    weight = np.zeros(len(edges))
    for k in range(3):  # edge k lies opposite corner k + 2
        np.add.at(weight, of_face[:, k], 0.5 * cot[:, (k + 2) % 3])
    least = LEAST_WEIGHT * float(np.abs(weight).mean())
    return edges, np.maximum(weight, least), int((weight < least).sum())


def arap(
    mesh: TriangleMesh, handles: Mapping[int, np.ndarray], weight: float | None = None, tolerance: float = TOLERANCE,
    iterations: int = 500, start=None, strict: bool = False,
) -> ArapResult:  # fmt: skip
    """Bend a mesh so that some vertices come to given places and every star keeps its shape as far as it can.

    Parameters
    ----------
    mesh : TriangleMesh
        The rest shape.
    handles : mapping of int to (3,) array
        Vertex ids and their places, m. Every piece of the mesh needs one at least.
    weight : float, optional
        Stiffness of the handles against the edges' weights (which are about 1); None holds them exactly.
    tolerance : float
        Relative change of the energy.
    iterations : int
        Most of them.
    start : (nv, 3) array, optional
        Where to begin, m; default the rest shape (with hard handles in place). The energy has several minima.
    strict : bool
        Raise when the tolerance is not reached instead of returning ``converged=False``.

    Raises
    ------
    ParameterError
        A handle that is no vertex or has no finite place; a tolerance or weight that is not positive.
    SurfaceError
        A piece of the mesh without a handle; a vertex without faces.
    NotConvergedError
        See ``strict``; its ``result`` is the ArapResult.
    """
    ids, places = _handles(mesh, handles)
    if not tolerance > 0 or (weight is not None and not weight > 0) or iterations < 1:
        raise ParameterError(f"tolerance {tolerance}, weight {weight} and iterations {iterations} must be positive")
    edges, w, raised = edge_weights(mesh)
    n = len(mesh.vertices)
    _check_pieces(edges, n, ids)
    i, j = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
    ww = np.r_[w, w]
    rest = mesh.vertices[i] - mesh.vertices[j]
    links = coo_matrix((ww, (i, j)), shape=(n, n)).tocsr()
    laplace = (diags(np.asarray(links.sum(axis=1)).ravel()) - links).tocsc()
    gather = coo_matrix((np.ones(len(i)), (i, np.arange(len(i)))), shape=(n, len(i))).tocsr()
    x = np.array(mesh.vertices if start is None else start, dtype=float)
    if x.shape != mesh.vertices.shape or not np.isfinite(x).all():
        raise ParameterError(f"start has shape {x.shape}; {mesh.vertices.shape} finite coordinates are needed (m)")
    solve = _hard(laplace, ids, places, x) if weight is None else _soft(laplace, ids, places, weight)

    def local(x):
        now = x[i] - x[j]
        covariance = (gather @ (ww[:, None, None] * rest[:, :, None] * now[:, None, :]).reshape(-1, 9)).reshape(-1, 3, 3)
        u, _, vt = np.linalg.svd(covariance)
        turn = np.einsum("nji,nkj->nik", vt, u)
        flip = np.linalg.det(turn) < 0
        vt[flip, 2] *= -1
        turn[flip] = np.einsum("nji,nkj->nik", vt[flip], u[flip])
        value = float((ww * ((now - np.einsum("nij,nj->ni", turn[i], rest)) ** 2).sum(axis=1)).sum())
        return turn, value + (0.0 if weight is None else float(2 * weight * ((x[ids] - places) ** 2).sum()))

    scale = float((ww * (rest**2).sum(axis=1)).sum())
    turn, energy = local(x)
    energies, converged = [energy], False
    for _ in range(iterations):
        right = gather @ (0.5 * ww[:, None] * np.einsum("nij,nj->ni", turn[i] + turn[j], rest))
        x = solve(right)
        turn, energy = local(x)
        energies.append(energy)
        if abs(energies[-2] - energy) <= tolerance * energies[-2] or energy <= 1e-24 * scale:
            converged = True
            break
    result = ArapResult(TriangleMesh(x, mesh.faces), tuple(energies), len(energies) - 1, converged, raised)
    if strict and not converged:
        raise NotConvergedError(f"ARAP: energy still changes by more than {tolerance:g} after {iterations} iterations", result)
    return result


def _handles(mesh: TriangleMesh, handles: Mapping[int, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    ids = np.array(sorted(handles), dtype=np.int64)
    if not len(ids):
        raise ParameterError("ARAP needs handles: without them the rest shape is the minimum and nothing moves")
    if ids[0] < 0 or ids[-1] >= len(mesh.vertices):
        raise ParameterError(f"handle {ids[0] if ids[0] < 0 else ids[-1]} is no vertex; there are 0 to {len(mesh.vertices) - 1}")
    places = np.array([np.asarray(handles[int(k)], dtype=float) for k in ids]).reshape(len(ids), -1)
    if places.shape[1] != 3 or not np.isfinite(places).all():
        raise ParameterError("every handle needs a place of three finite coordinates (m)")
    return ids, places


def _check_pieces(edges: np.ndarray, count: int, ids: np.ndarray) -> None:
    _, label = connected_components(coo_matrix((np.ones(len(edges)), tuple(edges.T)), shape=(count, count)), directed=False)
    without = np.setdiff1d(label, label[ids])
    if len(without):
        bad = np.flatnonzero(np.isin(label, without))
        raise SurfaceError(
            f"{len(without)} pieces of the mesh have no handle ({len(bad)} vertices): their place is not determined", bad
        )


def _hard(laplace: csc_matrix, ids: np.ndarray, places: np.ndarray, x: np.ndarray):
    free = np.setdiff1d(np.arange(laplace.shape[0]), ids)
    x[ids] = places
    factor = splu(laplace[free][:, free].tocsc()) if len(free) else None
    known = laplace[free][:, ids] @ places

    def solve(right):
        out = np.empty_like(right)
        out[ids] = places
        if factor is not None:
            out[free] = factor.solve(right[free] - known)
        return out

    return solve


def _soft(laplace: csc_matrix, ids: np.ndarray, places: np.ndarray, weight: float):
    extra = np.zeros(laplace.shape[0])
    extra[ids] = weight
    factor = splu((laplace + diags(extra)).tocsc())

    def solve(right):
        pulled = right.copy()
        pulled[ids] += weight * places
        return factor.solve(pulled)

    return solve
