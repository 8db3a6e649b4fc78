"""Sheets that pass through each other are drawn apart by smoothing where they do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix

from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.triangles import TriangleMesh


@dataclass(frozen=True)
class Untangled:
    """Vertices (nv, 3), m; crossing pairs before and after; largest movement, m."""

    vertices: np.ndarray
    before: int
    after: int
    moved: float


def untangle(mesh: TriangleMesh, rounds: int = 40, rings: int = 1) -> Untangled:
    """Smooth the neighbourhood of triangles that cross each other until none do, or `rounds` are over.

    Only vertices of crossing triangles and `rings` of neighbours about them move; the neighbourhood grows by a ring every ten
    rounds. Free edges are smoothed along themselves.
    """
    n = len(mesh.vertices)
    edges = mesh.edges
    rim = np.zeros(n, dtype=bool)
    rim[mesh.boundary_vertices] = True
    between = np.concatenate([edges, edges[:, ::-1]])
    boundary = mesh.boundary_edges
    keep = ~rim[between[:, 0]]
    links = np.concatenate([between[keep], boundary, boundary[:, ::-1]])
    graph = coo_matrix((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(n, n)).tocsr()
    average = graph.multiply(1.0 / np.maximum(np.asarray(graph.sum(axis=1)), 1.0)).tocsr()
    ring = coo_matrix((np.ones(len(between)), (between[:, 0], between[:, 1])), shape=(n, n)).tocsr()
    x = mesh.vertices.copy()
    pairs = self_intersections(mesh)
    before = after = len(pairs)
    for k in range(rounds):
        if not after:
            break
        chosen = np.zeros(n)
        chosen[mesh.faces[np.unique(pairs)].ravel()] = 1.0
        for _ in range(rings + k // 10):
            chosen = np.minimum(chosen + ring @ chosen, 1.0)
        move = chosen > 0
        for _ in range(3):
            x[move] = 0.5 * x[move] + 0.5 * (average @ x)[move]
        pairs = self_intersections(TriangleMesh(x, mesh.faces))
        after = len(pairs)
    return Untangled(x, before, after, float(np.linalg.norm(x - mesh.vertices, axis=1).max()))
