"""Triangles of a mesh that pass through each other."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from reconstruction.surface.triangles import TriangleMesh

CLEAR = 1e-9
"""A crossing nearer than this part of the triangle to its rim counts as touching, not as passing through."""


def self_intersections(mesh: TriangleMesh) -> np.ndarray:
    """(n, 2) pairs of faces, low then high, where an edge of one passes through the other.

    Faces that share an edge are not tested, and faces that overlap in one plane are not found (their edges do not pass
    through).
    """
    pairs = _near(mesh)
    if not len(pairs):
        return pairs
    a, b = mesh.faces[pairs[:, 0]], mesh.faces[pairs[:, 1]]
    same = (a[:, :, None] == b[:, None, :]).sum(axis=(1, 2))
    pairs, a, b = pairs[same < 2], a[same < 2], b[same < 2]
    hit = np.zeros(len(pairs), bool)
    for first, second in ((a, b), (b, a)):
        for i in range(3):
            p, q = first[:, i], first[:, (i + 1) % 3]
            free = ~((second == p[:, None]) | (second == q[:, None])).any(axis=1)
            hit[free] |= _pierces(mesh.vertices, p[free], q[free], second[free])
    return np.sort(pairs[hit], axis=1)


def _near(mesh: TriangleMesh) -> np.ndarray:
    """Pairs of faces whose boxes overlap; faces are taken in classes of size so that a few large ones do no harm."""
    corner = mesh.vertices[mesh.faces]
    low, high = corner.min(axis=1), corner.max(axis=1)
    centre = corner.mean(axis=1)
    radius = np.linalg.norm(corner - centre[:, None], axis=2).max(axis=1)
    size = np.floor(np.log2(np.maximum(radius, 1e-12))).astype(int)
    found = []
    groups = [(k, np.flatnonzero(size == k)) for k in np.unique(size)]
    trees = [cKDTree(centre[ids]) for _, ids in groups]
    for i, (ki, ids) in enumerate(groups):
        for j in range(i + 1):
            kj, others = groups[j]
            close = trees[i].sparse_distance_matrix(trees[j], 2.0 ** (ki + 1) + 2.0 ** (kj + 1), output_type="ndarray")
            a, b = ids[close["i"]], others[close["j"]]
            ok = (a < b) if i == j else np.ones(len(a), bool)
            a, b = a[ok], b[ok]
            over = ((low[a] <= high[b]) & (low[b] <= high[a])).all(axis=1)
            found.append(np.stack([a[over], b[over]], axis=1))
    return np.vstack(found) if found else np.zeros((0, 2), int)


def _pierces(x: np.ndarray, p: np.ndarray, q: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Whether segments p q pass through triangles (T. Möller, B. Trumbore, 1997, doi:10.1080/10867651.1997.10487468)."""
    start, direction = x[p], x[q] - x[p]
    corner = x[faces[:, 0]]
    e1, e2 = x[faces[:, 1]] - corner, x[faces[:, 2]] - corner
    h = np.cross(direction, e2)
    det = np.einsum("ij,ij->i", e1, h)
    scale = np.linalg.norm(e1, axis=1) * np.linalg.norm(e2, axis=1) * np.linalg.norm(direction, axis=1)
    ok = np.abs(det) > 1e-10 * np.maximum(scale, 1e-300)
    inverse = 1.0 / np.where(ok, det, 1.0)
    s = start - corner
    u = np.einsum("ij,ij->i", s, h) * inverse
    g = np.cross(s, e1)
    v = np.einsum("ij,ij->i", direction, g) * inverse
    t = np.einsum("ij,ij->i", e2, g) * inverse
    inside = (u > CLEAR) & (v > CLEAR) & (u + v < 1 - CLEAR) & (t > CLEAR) & (t < 1 - CLEAR)
    return ok & inside
