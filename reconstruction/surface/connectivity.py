"""Edges, pieces and boundary loops of a triangle list."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from reconstruction.surface.triangles import TriangleMesh


def face_edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Edges, and those of each face.

    Returns
    -------
    edges : (ne, 2) array of int
        Vertex ids, low then high, sorted.
    of_face : (nf, 3) array of int
        Edge from corner i to corner i + 1.
    """
    directed = np.sort(np.asarray(faces)[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    size = int(directed.max(initial=0)) + 1
    key, inverse = np.unique(directed[:, 0] * size + directed[:, 1], return_inverse=True)  # faster than rows by far
    return np.stack([key // size, key % size], axis=1), inverse.reshape(-1, 3)


def neighbours(faces: np.ndarray) -> np.ndarray:
    """(n, 2) pairs of faces that share an edge of exactly two faces."""
    edges, of_face = face_edges(faces)
    return _pairs_by_edge(of_face, np.bincount(of_face.ravel(), minlength=len(edges)) == 2)


def _pairs_by_edge(of_face: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    flat = of_face.ravel()
    order = np.argsort(flat, kind="stable")
    order = order[chosen[flat[order]]]
    return (order // 3).reshape(-1, 2)


def edge_faces(of_face: np.ndarray, count: int) -> np.ndarray:
    """(ne, 2) faces of every edge of a manifold mesh, −1 where there is no second one."""
    flat = of_face.ravel()
    order = np.argsort(flat, kind="stable")
    first = np.searchsorted(flat[order], np.arange(count))
    out = np.full((count, 2), -1)
    out[:, 0] = order[first] // 3
    second = np.minimum(first + 1, len(flat) - 1)
    same = (first + 1 < len(flat)) & (flat[order[second]] == np.arange(count))
    out[same, 1] = order[second[same]] // 3
    return out


def face_pieces(mesh: TriangleMesh, blocked: np.ndarray | None = None) -> np.ndarray:
    """(nf,) number of the piece of every face, joined over edges; piece 0 has the largest area.

    Parameters
    ----------
    mesh : TriangleMesh
    blocked : (nv,) array of bool, optional
        Edges between two such vertices do not join.
    """
    faces, n = mesh.faces, len(mesh.faces)
    if not n:
        return np.zeros(0, int)
    edges, of_face = face_edges(faces)
    flat = of_face.ravel()
    order = np.argsort(flat, kind="stable")
    same = flat[order][1:] == flat[order][:-1]
    if blocked is not None:
        same &= ~blocked[edges].all(axis=1)[flat[order][1:]]
    a, b = order[:-1][same] // 3, order[1:][same] // 3
    _, label = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(n, n)), directed=False)
    area = np.bincount(label, weights=mesh.areas)
    rank = np.empty(len(area), int)
    rank[np.argsort(-area, kind="stable")] = np.arange(len(area))
    return rank[label]


def boundary_loops(faces: np.ndarray) -> list[np.ndarray]:
    """Closed chains of boundary edges in the direction of the faces (the surface lies on the left), the longest first.

    A vertex where two openings touch is part of two loops. Chains that do not close (inconsistent orientation) are left out.
    """
    faces = np.asarray(faces)
    directed = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges, of_face = face_edges(faces)
    open_ = directed[(np.bincount(of_face.ravel(), minlength=len(edges)) == 1)[of_face.ravel()]]
    following: dict[int, list[int]] = {}
    for a, b in open_.tolist():
        following.setdefault(a, []).append(b)
    loops: list[np.ndarray] = []
    for start in open_[:, 0].tolist():
        chain: list[int] = []
        place: dict[int, int] = {}
        here = start
        while True:
            if here in place:  # a loop closed; what led to it goes on
                k = place[here]
                loops.append(np.array(chain[k:]))
                for v in chain[k:]:
                    del place[v]
                del chain[k:]
            if not following.get(here):
                break
            place[here] = len(chain)
            chain.append(here)
            here = following[here].pop(0)
    return sorted(loops, key=len, reverse=True)


def loop_lengths(mesh: TriangleMesh, loops: list[np.ndarray] | None = None) -> list[float]:
    """Lengths of boundary loops, m."""
    loops = boundary_loops(mesh.faces) if loops is None else loops
    return [float(np.linalg.norm(np.diff(mesh.vertices[np.r_[c, c[0]]], axis=0), axis=1).sum()) for c in loops]


def vertex_average(faces: np.ndarray, count: int):
    """(nv, nv) sparse matrix: mean over the neighbours of each vertex (itself where it has none)."""
    from scipy.sparse import diags

    edges, _ = face_edges(faces)
    i, j = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
    lone = np.setdiff1d(np.arange(count), i)
    ones = coo_matrix((np.ones(len(i) + len(lone)), (np.r_[i, lone], np.r_[j, lone])), shape=(count, count)).tocsr()
    return diags(1.0 / np.asarray(ones.sum(axis=1)).ravel()) @ ones
