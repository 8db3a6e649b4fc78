"""Collapse short edges: the only cure for slivers, which no movement of vertices opens, and it changes the connectivity (the
paper's ARAP does not)."""

from __future__ import annotations

import numpy as np

from reconstruction.surface.triangles import TriangleMesh

TURN = 0.5
"""Cosine of the most by which a triangle may turn in one collapse."""


def collapse_short_edges(mesh: TriangleMesh, below: float, rounds: int = 5) -> tuple[TriangleMesh, int]:
    """Mesh without edges shorter than a length, where they can go, and the number of edges collapsed.

    An edge stays if the surface would not be a manifold of the same kind afterwards (link condition), if it joins two
    boundaries, or if a triangle would turn by more than 60° or become a worse sliver than the worst around. A vertex of the
    boundary stays in its place and takes the other in; of two, that where the boundary turns more.

    Parameters
    ----------
    mesh : TriangleMesh
        Manifold.
    below : float
        m.
    rounds : int
        Passes over the edges.
    """
    work = _Collapser(mesh)
    total = 0
    for _ in range(rounds):
        done = work.sweep(below)
        total += done
        if not done:
            break
    faces = np.array([f for f in work.faces if f is not None], dtype=np.int64).reshape(-1, 3)
    return (TriangleMesh(np.array(work.place), faces).submesh(slice(None)) if total else mesh), total


class _Collapser:
    def __init__(self, mesh: TriangleMesh):
        self.place = list(mesh.vertices.copy())
        self.faces: list[tuple[int, int, int] | None] = [(a, b, c) for a, b, c in mesh.faces.tolist()]
        self.around: list[set[int]] = [set() for _ in self.place]
        for k, f in enumerate(self.faces):
            for v in f or ():
                self.around[v].add(k)
        self.rim = np.zeros(len(self.place), bool)
        self.rim[mesh.boundary_vertices] = True
        self.turn = np.zeros(len(self.place))
        self.turn[mesh.boundary_vertices] = _turning(mesh)

    def sweep(self, below: float) -> int:
        faces = np.array([f for f in self.faces if f is not None], dtype=np.int64)
        place = np.array(self.place)
        edges = np.unique(np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        length = np.linalg.norm(place[edges[:, 0]] - place[edges[:, 1]], axis=1)
        order = np.argsort(length, kind="stable")
        return sum(self.collapse(int(a), int(b), below) for a, b in edges[order[: int((length < below).sum())]])

    def ring(self, v: int) -> set[int]:
        return {w for k in self.around[v] for w in self.faces[k] or ()} - {v}

    def collapse(self, a: int, b: int, below: float) -> bool:
        shared = self.around[a] & self.around[b]
        if not shared or np.linalg.norm(self.place[a] - self.place[b]) >= below:
            return False
        if self.rim[a] and self.rim[b] and len(shared) != 1:
            return False
        if len(self.ring(a) & self.ring(b)) != len(shared) or len(self.ring(a) | self.ring(b)) < 5:
            return False
        if (self.rim[b], self.turn[b]) > (self.rim[a], self.turn[a]):
            a, b = b, a
        target = self.place[a] if self.rim[a] else 0.5 * (self.place[a] + self.place[b])
        changed = (self.around[a] | self.around[b]) - shared
        if not self._fair(changed, shared, (a, b), target):
            return False
        self.place[a] = target
        for k in shared:
            for v in self.faces[k] or ():
                self.around[v].discard(k)
            self.faces[k] = None
        for k in list(self.around[b]):
            f = self.faces[k]
            assert f is not None
            self.faces[k] = tuple(a if v == b else v for v in f)  # type: ignore[assignment]
            self.around[a].add(k)
        self.around[b].clear()
        return True

    def _fair(self, changed: set[int], shared: set[int], pair: tuple[int, int], target: np.ndarray) -> bool:
        if not changed:
            return False
        old = np.array([[self.place[v] for v in self.faces[k] or ()] for k in changed])
        new = np.array([[target if v in pair else self.place[v] for v in self.faces[k] or ()] for k in changed])
        gone = np.array([[self.place[v] for v in self.faces[k] or ()] for k in shared])
        (n0, q0), (n1, q1), (_, q2) = _shape(old), _shape(new), _shape(gone)
        if q1.min() < min(q0.min(), q2.min(), 0.3):
            return False
        valid = q0 > 1e-3  # the normal of a sliver says nothing
        return bool((np.einsum("ij,ij->i", n0, n1)[valid] > TURN).all())


def _shape(corner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals and mean ratios, 4 √3 area / sum of squared sides."""
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(cross, axis=1)
    sides = ((corner - np.roll(corner, 1, axis=1)) ** 2).sum(axis=(1, 2))
    return cross / np.maximum(size, 1e-300)[:, None], 2 * np.sqrt(3) * size / np.maximum(sides, 1e-300)


def _turning(mesh: TriangleMesh) -> np.ndarray:
    """Of each boundary vertex (ascending ids): 1 − cos of the angle of its boundary edges, in steps so that noise decides
    nothing; 2 at a junction."""
    rim = mesh.boundary_edges
    vertices = mesh.boundary_vertices
    i, j = np.r_[rim[:, 0], rim[:, 1]], np.r_[rim[:, 1], rim[:, 0]]
    d = mesh.vertices[j] - mesh.vertices[i]
    d /= np.maximum(np.linalg.norm(d, axis=1, keepdims=True), 1e-300)
    total = np.stack([np.bincount(i, weights=d[:, k], minlength=len(mesh.vertices)) for k in range(3)], axis=1)[vertices]
    degree = np.bincount(i, minlength=len(mesh.vertices))[vertices]
    cosine = 1 - 0.5 * (total**2).sum(axis=1)  # |d1 + d2|² = 2 + 2 d1·d2, straight: d1 = −d2
    return np.where(degree == 2, np.round(1 - np.clip(cosine, -1, 1), 1), 2.0)
