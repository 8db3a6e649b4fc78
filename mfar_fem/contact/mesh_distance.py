"""Signed distance to a closed triangle mesh: exact closest points in a tree of boxes, sign by angle-weighted pseudo-normals.

Source of the sign: Bærentzen and Aanæs, Signed distance computation using the angle weighted pseudonormal, IEEE Transactions on
Visualization and Computer Graphics 11 (2005), doi:10.1109/TVCG.2005.49.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mfar_fem.contact import mesh_distance_kernels as kernels
from mfar_fem.errors import SurfaceError


class BodyMeshError(SurfaceError):
    """The triangle mesh of a body does not enclose a solid; ``ids`` are those of the vertices, triangles or parts concerned."""


class MeshDistance:
    """Signed distance field of a closed mesh.

    Several closed parts count as their union, by the least of their distances: exact outside; deep inside, where parts
    overlap, it is a lower bound of the depth.

    Parameters
    ----------
    vertices : (m, 3) array_like
        Positions, m.
    triangles : (k, 3) array_like of int
        Outward oriented.
    name : str
        For the messages.

    Raises
    ------
    BodyMeshError
        See `check_mesh`.
    """

    def __init__(self, vertices, triangles, name: str = "mesh"):
        self.vertices = np.array(vertices, dtype=float)
        self.triangles = np.array(triangles, dtype=np.int64)
        parts = check_mesh(self.vertices, self.triangles, name)
        corners = self.vertices[self.triangles]
        order = np.argsort(parts, kind="stable")
        nodes = 2 * len(order) + parts.max() + 1
        low, high = np.empty((nodes, 3)), np.empty((nodes, 3))
        child, span = np.empty(nodes, np.int64), np.empty((nodes, 2), np.int64)
        starts = np.concatenate([[0], np.cumsum(np.bincount(parts))])
        roots, free = np.empty(len(starts) - 1, np.int64), 0
        for i in np.argsort(-np.diff(starts)):  # largest part first: the others then seldom matter
            roots[i], span[free] = free, starts[i : i + 2]
            free = kernels.build(corners, order, free, low, high, child, span)
        self._tree = (np.sort(roots), np.ascontiguousarray(corners[order]), feature_normals(self.vertices, self.triangles)[order],
                      low[:free].copy(), high[:free].copy(), child[:free].copy(), span[:free].copy())
        self._small = 1e-10 * float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def signed_distance(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distance (n,), m, positive outside, and its outward unit gradient (n, 3) at the points x (n, 3)."""
        x = np.ascontiguousarray(x, dtype=float)
        distance, normal = np.full(len(x), np.nan), np.full((len(x), 3), np.nan)
        kernels.signed_distance(x, *self._tree, self._small, distance, normal)
        return distance, normal


def check_mesh(vertices: np.ndarray, triangles: np.ndarray, name: str = "mesh") -> np.ndarray:
    """Part (k,) every triangle belongs to (connected closed surfaces, numbered from 0).

    Raises
    ------
    BodyMeshError
        Coordinates that are not finite, ids out of range, triangles without area, edges that do not belong to exactly two
        triangles or are run along twice in the same sense, parts whose volume is not positive (cavities are not supported).
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
        raise BodyMeshError(f"{name}: vertices must have shape (m, 3) and triangles (k, 3), k > 0; got {vertices.shape} and "
                            f"{triangles.shape}")
    bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
    if len(bad):
        raise BodyMeshError(f"{name}: {len(bad)} of {len(vertices)} vertices are not finite, the first is vertex {bad[0]}", bad)
    bad = np.flatnonzero((triangles < 0).any(axis=1) | (triangles >= len(vertices)).any(axis=1))
    if len(bad):
        raise BodyMeshError(f"{name}: {len(bad)} triangles name vertices outside 0..{len(vertices) - 1}, first {bad[0]}", bad)
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    longest = np.max(np.sum((corners - np.roll(corners, -1, axis=1)) ** 2, axis=2), axis=1)
    bad = np.flatnonzero(area <= 1e-12 * longest)
    if len(bad):
        raise BodyMeshError(f"{name}: {len(bad)} triangles have no area, the first is {bad[0]}; remove or merge them", bad)

    half = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    edges, edge, counts = np.unique(np.sort(half, axis=1), axis=0, return_inverse=True, return_counts=True)
    edge = edge.ravel()
    owner = np.tile(np.arange(len(triangles)), 3)
    if np.any(counts != 2):
        bad = np.unique(owner[counts[edge] != 2])
        raise BodyMeshError(f"{name}: not closed: {np.sum(counts == 1)} of {len(edges)} edges belong to one triangle and "
                            f"{np.sum(counts > 2)} to more than two; every edge must belong to exactly two (merge double "
                            "vertices, fill the holes)", bad)
    sense = np.bincount(edge, np.where(half[:, 0] < half[:, 1], 1, -1), len(edges))
    if np.any(sense != 0):
        bad = np.unique(owner[sense[edge] != 0])
        raise BodyMeshError(f"{name}: inconsistent orientation: across {np.sum(sense != 0)} of {len(edges)} edges the triangles "
                            "turn opposite ways; flip them to face outward", bad)

    graph = coo_array((np.ones(len(half)), (half[:, 0], half[:, 1])), (len(vertices), len(vertices)))
    label = connected_components(graph, directed=False)[1][triangles[:, 0]]
    parts = np.unique(label, return_inverse=True)[1].ravel()
    local = corners - vertices[triangles[0, 0]]
    volume = np.bincount(parts, np.einsum("kc,kc->k", local[:, 0], np.cross(local[:, 1], local[:, 2])) / 6.0)
    bad = np.flatnonzero(volume <= 0.0)
    if len(bad):
        raise BodyMeshError(f"{name}: inverted: {len(bad)} of {len(volume)} parts ({np.isin(parts, bad).sum()} of {len(parts)} "
                            f"triangles) enclose no positive volume (least {volume.min():.3g} m³); flip their triangles to face "
                            "outward, remove cavities", bad)
    return parts


def feature_normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit pseudo-normals (k, 7, 3) of every triangle's face, its vertices, and its edges from vertex 0, 1 and 2."""
    corners = vertices[triangles]
    along = np.roll(corners, -1, axis=1) - corners
    along /= np.linalg.norm(along, axis=2, keepdims=True)
    face = np.cross(along[:, 0], along[:, 1])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    angle = np.arccos(np.clip(-np.einsum("kvc,kvc->kv", along, np.roll(along, 1, axis=1)), -1.0, 1.0))
    vertex = np.zeros((len(vertices), 3))
    np.add.at(vertex, triangles, angle[:, :, None] * face[:, None, :])
    pairs = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    edge = np.unique(pairs, axis=0, return_inverse=True)[1].ravel()
    edge_normal = np.zeros((edge.max() + 1, 3))
    np.add.at(edge_normal, edge, np.repeat(face, 3, axis=0))
    normals = np.concatenate([face[:, None, :], vertex[triangles], edge_normal[edge].reshape(-1, 3, 3)], axis=1)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    return np.ascontiguousarray(normals / np.where(length > 0.0, length, 1.0))
