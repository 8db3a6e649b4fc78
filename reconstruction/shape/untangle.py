"""Sheets that pass through each other are drawn apart: by smoothing where they do, and where that is not enough by spanning the
region anew from its rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.triangles import TriangleMesh


@dataclass(frozen=True)
class Untangled:
    """Vertices (nv, 3), m; crossing pairs before and after; largest movement, m; vertices that were spanned anew."""

    vertices: np.ndarray
    before: int
    after: int
    moved: float
    spanned: int = 0


def untangle(mesh: TriangleMesh, rounds: int = 40, rings: int = 1, regions: int = 14) -> Untangled:
    """Smooth the neighbourhood of triangles that cross each other until none do, or `rounds` are over.

    Only vertices of crossing triangles and `rings` of neighbours about them move; the neighbourhood grows by a ring every ten
    rounds. Free edges are smoothed along themselves. What still crosses then lies in folds that have passed through each other, and
    loses its folds: the region of those triangles becomes the surface that is harmonic between its rims (vertices at the mean of
    their neighbours), larger by a ring or more every time, up to `regions` times.
    """
    links, ring = _graphs(mesh)
    average = links.multiply(1.0 / np.maximum(np.asarray(links.sum(axis=1)), 1.0)).tocsr()
    x = mesh.vertices.copy()
    pairs = self_intersections(mesh)
    before = len(pairs)
    for k in range(rounds):
        if not len(pairs):
            break
        chosen = _touched(mesh, pairs)
        for _ in range(rings + k // 10):
            chosen = np.minimum(chosen + ring @ chosen, 1.0)
        move = chosen > 0
        for _ in range(3):
            x[move] = 0.5 * x[move] + 0.5 * (average @ x)[move]
        pairs = self_intersections(TriangleMesh(x, mesh.faces))
    spanned = 0
    if len(pairs):
        pairs, spanned = _span(mesh, x, pairs, links, ring, regions)
    moved = float(np.linalg.norm(x - mesh.vertices, axis=1).max(initial=0.0))
    return Untangled(x, before, len(pairs), moved, spanned)


def _span(mesh: TriangleMesh, x: np.ndarray, pairs: np.ndarray, links: csr_matrix, ring: csr_matrix,
          regions: int) -> tuple[np.ndarray, int]:  # fmt: skip
    """Span growing regions about crossing triangles anew, in `x`; pairs that still cross, and how many vertices were spanned."""
    region, corners, spanned = np.zeros(len(x)), _corners(mesh), 0
    laplacian = (diags(np.asarray(links.sum(axis=1)).ravel()) - links).tocsr()
    for k in range(regions):
        region = np.minimum(region + _touched(mesh, pairs), 1.0)
        for _ in range(1 + k // 3):
            region = np.minimum(region + ring @ region, 1.0)
        if region.all():
            break
        anew = (region > 0) & ~_whole_rims(mesh, region > 0)
        free, fixed = np.flatnonzero(anew), np.flatnonzero(~anew)
        x[free] = splu(laplacian[free][:, free].tocsc()).solve(-(laplacian[free][:, fixed] @ x[fixed]))
        _put_corners(x, corners, anew)
        pairs, spanned = self_intersections(TriangleMesh(x, mesh.faces)), len(free)
        if not len(pairs):
            break
    return pairs, spanned


def _graphs(mesh: TriangleMesh) -> tuple[csr_matrix, csr_matrix]:
    """What each vertex is smoothed by (those of the rim by the rim), and all neighbours."""
    n, edges, boundary = len(mesh.vertices), mesh.edges, mesh.boundary_edges
    rim = np.zeros(n, dtype=bool)
    rim[mesh.boundary_vertices] = True
    between = np.concatenate([edges, edges[:, ::-1]])
    links = np.concatenate([between[~rim[between[:, 0]]], boundary, boundary[:, ::-1]])
    return tuple(coo_matrix((np.ones(len(e)), (e[:, 0], e[:, 1])), shape=(n, n)).tocsr() for e in (links, between))


def _corners(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices of one triangle only (k,), the edge across it and the vertex behind that edge (k, 3), their height over the edge.

    Spanned along the rim they would end on that edge, and their triangle without area.
    """
    faces = mesh.faces
    alone = np.bincount(faces.ravel(), minlength=len(mesh.vertices)) == 1
    tip, behind, height = [], [], []
    for face in np.flatnonzero(alone[faces].sum(axis=1) == 1):
        k = int(np.flatnonzero(alone[faces[face]])[0])
        a, b = faces[face][[(k + 1) % 3, (k + 2) % 3]]
        other = np.flatnonzero((faces == a).any(axis=1) & (faces == b).any(axis=1))
        other = other[other != face]
        if len(other) == 1:
            third = faces[other[0]]
            tip.append(faces[face][k])
            behind.append([a, b, third[(third != a) & (third != b)][0]])
            height.append(2 * mesh.areas[face] / np.linalg.norm(mesh.vertices[b] - mesh.vertices[a]))
    return np.array(tip, dtype=int), np.array(behind, dtype=int).reshape(-1, 3), np.array(height)


def _put_corners(x: np.ndarray, corners: tuple[np.ndarray, np.ndarray, np.ndarray], moved: np.ndarray) -> None:
    """Put corners that moved where they continue the triangle behind their edge, at their own height."""
    tip, behind, height = corners
    chosen = moved[tip]
    a, b, c = (x[behind[chosen, i]] for i in range(3))
    along = (b - a) / np.maximum(np.linalg.norm(b - a, axis=1), 1e-12)[:, None]
    out = 0.5 * (a + b) - c
    out -= np.einsum("ni,ni->n", out, along)[:, None] * along
    out /= np.maximum(np.linalg.norm(out, axis=1), 1e-12)[:, None]
    x[tip[chosen]] = 0.5 * (a + b) + height[chosen, None] * out


def _touched(mesh: TriangleMesh, pairs: np.ndarray) -> np.ndarray:
    """1.0 at the vertices of crossing triangles."""
    out = np.zeros(len(mesh.vertices))
    out[mesh.faces[np.unique(pairs)].ravel()] = 1.0
    return out


def _whole_rims(mesh: TriangleMesh, region: np.ndarray) -> np.ndarray:
    """Vertices (nv,) bool of free edges that lie in a region altogether: nothing outside says where they would go, so they stay."""
    n, boundary = len(mesh.vertices), mesh.boundary_edges
    loop = connected_components(coo_matrix((np.ones(len(boundary)), (boundary[:, 0], boundary[:, 1])), shape=(n, n)))[1]
    leaves = np.zeros(n, dtype=bool)
    leaves[loop[~region]] = True
    return region & ~leaves[loop] & np.isin(np.arange(n), boundary)
