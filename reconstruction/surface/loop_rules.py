"""Loop's subdivision as sparse matrices, with boundaries and creases, and the limit of every vertex.

C. Loop, Smooth subdivision surfaces based on triangles, thesis, University of Utah 1987, with his weights β(n); boundary and
crease rules and limit masks of H. Hoppe et al., Piecewise smooth surface reconstruction, SIGGRAPH 1994,
doi:10.1145/192161.192233.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from reconstruction.surface.connectivity import edge_faces, face_edges


def loop_beta(valence: np.ndarray) -> np.ndarray:
    """Weight of each neighbour in Loop's vertex mask: (5/8 − (3/8 + cos(2π/n)/4)²) / n."""
    n = np.maximum(np.asarray(valence, dtype=float), 1.0)
    return (0.625 - (0.375 + 0.25 * np.cos(2 * np.pi / n)) ** 2) / n


def sharp_edges(faces: np.ndarray, creases: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Edges, edges of each face, and which edges are boundary, crease, or shared by more than two faces."""
    edges, of_face = face_edges(faces)
    sharp = np.bincount(of_face.ravel(), minlength=len(edges)) != 2
    if creases is not None and len(creases):
        size = int(edges.max()) + 1
        low = np.sort(np.asarray(creases, dtype=np.int64).reshape(-1, 2), axis=1)
        sharp |= np.isin(edges[:, 0] * size + edges[:, 1], low[:, 0] * size + low[:, 1])
    return edges, of_face, sharp


def _vertex_mask(count: int, edges: np.ndarray, sharp: np.ndarray, limit: bool) -> csr_matrix:
    """(nv, nv): vertex rule of one step, or limit position."""
    i, j = np.r_[edges[:, 0], edges[:, 1]], np.r_[edges[:, 1], edges[:, 0]]
    s = np.r_[sharp, sharp]
    valence, crossing = np.bincount(i, minlength=count), np.bincount(i[s], minlength=count)
    crease, corner = crossing == 2, (crossing == 1) | (crossing > 2)  # a lone crease end counts as a corner: it stays
    beta = loop_beta(valence)
    smooth = 1.0 / (3.0 / (8.0 * np.maximum(beta, 1e-300)) + valence) if limit else beta
    along = 1.0 / 6.0 if limit else 1.0 / 8.0
    weight = np.where(crease[i], np.where(s, along, 0.0), np.where(corner[i], 0.0, smooth[i]))
    own = 1.0 - np.bincount(i, weights=weight, minlength=count)
    return coo_matrix((np.r_[weight, own], (np.r_[i, np.arange(count)], np.r_[j, np.arange(count)])), shape=(count, count)).tocsr()


def limit_matrix(faces: np.ndarray, count: int, creases: np.ndarray | None = None) -> csr_matrix:
    """(nv, nv) matrix from control positions to the limit surface."""
    edges, _, sharp = sharp_edges(faces, creases)
    return _vertex_mask(count, edges, sharp, limit=True)


def loop_step(faces: np.ndarray, count: int, creases: np.ndarray | None = None) -> tuple[csr_matrix, np.ndarray, np.ndarray]:
    """One uniform step.

    Returns
    -------
    matrix : (nv + ne, nv) sparse
        From old to new positions.
    faces : (4 nf, 3) array
        Children of face i at 4 i to 4 i + 3, the middle one last; the point of edge e is vertex nv + e
        (edges as in :func:`reconstruction.surface.connectivity.face_edges`).
    creases : (2 nc, 2) array
        Halves of the crease edges.
    """
    from scipy.sparse import vstack

    edges, of_face, sharp = sharp_edges(faces, creases)
    ne = len(edges)
    row = np.arange(ne)
    pair = edge_faces(of_face, ne)
    end = np.where(sharp, 0.5, 0.375)
    rows, cols, data = [row, row], [edges[:, 0], edges[:, 1]], [end, end]
    inner = np.flatnonzero(~sharp)
    for side in range(2):
        f = faces[pair[inner, side]]
        rows.append(inner)
        cols.append(f.sum(axis=1) - edges[inner].sum(axis=1))
        data.append(np.full(len(inner), 0.125))
    points = coo_matrix((np.concatenate(data), (np.concatenate(rows), np.concatenate(cols))), shape=(ne, count))
    matrix = vstack([_vertex_mask(count, edges, sharp, limit=False), points]).tocsr()
    a, b, c = faces.T
    p, q, r = (count + of_face).T
    children = np.stack([np.stack(t, axis=1) for t in ((a, p, r), (p, b, q), (r, q, c), (p, q, r))], axis=1).reshape(-1, 3)
    halves = np.zeros((0, 2), np.int64)
    if creases is not None and len(creases):
        size = int(edges.max()) + 1
        low = np.sort(np.asarray(creases, dtype=np.int64).reshape(-1, 2), axis=1)
        k = np.flatnonzero(np.isin(edges[:, 0] * size + edges[:, 1], low[:, 0] * size + low[:, 1]))
        halves = np.vstack([np.stack([edges[k, 0], count + k], axis=1), np.stack([count + k, edges[k, 1]], axis=1)])
    return matrix, children, halves


def interpolating_controls(vertices: np.ndarray, faces: np.ndarray, creases: np.ndarray | None = None) -> np.ndarray:
    """(nv, 3) control positions whose limit surface passes through the vertices (M. Halstead, M. Kass, T. DeRose, Efficient,
    fair interpolation using Catmull-Clark surfaces, SIGGRAPH 1993, doi:10.1145/166117.166121); without it a Loop surface
    shrinks."""
    from scipy.sparse.linalg import splu

    return splu(limit_matrix(faces, len(vertices), creases).tocsc()).solve(np.ascontiguousarray(vertices))
