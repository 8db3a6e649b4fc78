"""Cut a triangle mesh along the zero line of a function on its vertices: the new edge is the line itself, not a saw of
triangles."""

from __future__ import annotations

import numpy as np

from reconstruction.surface.connectivity import face_edges
from reconstruction.surface.triangles import TriangleMesh

SNAP = 0.25
"""A crossing nearer than this part of its edge to a vertex moves the vertex instead of leaving a sliver."""


def split_at_zero(mesh: TriangleMesh, values: np.ndarray, snap: float = SNAP) -> tuple[TriangleMesh, np.ndarray, np.ndarray]:
    """Mesh with vertices and edges along the zero line.

    Parameters
    ----------
    mesh : TriangleMesh
    values : (nv,) array
        Linear on every face; NaN where nothing is to be cut (a face with a NaN corner stays whole).
    snap : float
        See :data:`SNAP`; 0 moves no vertex.

    Returns
    -------
    cut : TriangleMesh
        The old vertices in their order, then the new ones.
    values : (nv',) array
        Exactly 0 on the line.
    side : (nf',) array of int
        −1, 0 or +1: sign of the function on the face; 0 where it is not known.
    """
    vertices, values = mesh.vertices.copy(), np.array(values, dtype=float)
    if snap > 0:
        vertices, values = _snapped(mesh, vertices, values, snap)
    edges, of_face = face_edges(mesh.faces)
    known = np.isfinite(values[mesh.faces]).all(axis=1)
    crossed = np.zeros(len(edges), bool)
    crossed[of_face[known]] = True
    a, b = values[edges[:, 0]], values[edges[:, 1]]
    crossed &= a * b < 0
    # a crossed edge with a face that is not known would leave a hanging vertex there
    unknown = np.zeros(len(edges), bool)
    unknown[of_face[~known]] = True
    crossed &= ~unknown
    t = a[crossed] / (a[crossed] - b[crossed])
    new = vertices[edges[crossed, 0]] * (1 - t)[:, None] + vertices[edges[crossed, 1]] * t[:, None]
    point = np.full(len(edges), -1)
    point[crossed] = len(vertices) + np.arange(crossed.sum())
    vertices, values = np.vstack([vertices, new]), np.r_[values, np.zeros(len(new))]
    faces = _split_faces(mesh.faces, point[of_face], vertices)
    corner = values[faces]
    total = np.where(np.isfinite(corner), corner, 0.0).sum(axis=1)
    side = np.where(np.isfinite(corner).all(axis=1), np.sign(total), 0).astype(int)
    return TriangleMesh(vertices, faces), values, side


def _snapped(mesh, vertices, values, snap):
    edges, _ = face_edges(mesh.faces)
    start, end = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
    with np.errstate(invalid="ignore"):
        cross = values[start] * values[end] < 0
    start, end = start[cross], end[cross]
    t = values[start] / (values[start] - values[end])
    order = np.argsort(t, kind="stable")
    order = order[t[order] < snap]
    first = order[np.unique(start[order], return_index=True)[1]]
    moved, place = vertices.copy(), vertices[start[first]] + t[first, None] * (vertices[end[first]] - vertices[start[first]])
    moved[start[first]] = place
    chosen = np.zeros(len(vertices), bool)
    chosen[start[first]] = True
    old = mesh.area_vectors
    for _ in range(5):  # a move that turns or squeezes a face is taken back
        now = TriangleMesh(np.where(chosen[:, None], moved, vertices), mesh.faces).area_vectors
        bad = np.einsum("ij,ij->i", now, old) < 0.1 * np.einsum("ij,ij->i", old, old)
        flat = bad & chosen[mesh.faces].any(axis=1)
        if not flat.any():
            break
        chosen[mesh.faces[flat]] = False
    return np.where(chosen[:, None], moved, vertices), np.where(chosen, 0.0, values)


def _split_faces(faces: np.ndarray, point: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Faces split at the points (−1: none) of their edges; at most two edges of a face are crossed."""
    count = (point >= 0).sum(axis=1)
    out = [faces[count == 0]]
    for k in range(3):  # edge k runs from corner k to k + 1
        a, b, c = faces[:, k], faces[:, (k + 1) % 3], faces[:, (k + 2) % 3]
        one = (count == 1) & (point[:, k] >= 0)
        m = point[one, k]
        out += [np.stack([a[one], m, c[one]], axis=1), np.stack([m, b[one], c[one]], axis=1)]
        two = (count == 2) & (point[:, k] < 0)  # edges k + 1 (b to c) and k + 2 (c to a) are crossed
        p, q = point[two, (k + 1) % 3], point[two, (k + 2) % 3]
        a, b, c = a[two], b[two], c[two]
        out.append(np.stack([q, p, c], axis=1))
        shorter = np.linalg.norm(vertices[a] - vertices[p], axis=1) <= np.linalg.norm(vertices[b] - vertices[q], axis=1)
        out.append(np.where(shorter[:, None], np.stack([a, b, p], axis=1), np.stack([a, b, q], axis=1)))
        out.append(np.where(shorter[:, None], np.stack([a, p, q], axis=1), np.stack([b, p, q], axis=1)))
    return np.vstack(out)
