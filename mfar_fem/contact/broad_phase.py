"""Broad phase: pairs of triangles whose boxes are near, by trees of box centres."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from mfar_fem.errors import InputError


def candidate_pairs(vertices, triangles, other_vertices=None, other_triangles=None, margin: float = 0.0) -> np.ndarray:
    """Pairs of triangles whose axis-parallel boxes are at most ``margin`` apart along every axis.

    No pair of triangles within the distance ``margin`` of each other is missing. Triangles are sorted into classes of size, each
    with a tree of its own, so that a few large triangles among small ones do not make everything near.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Positions, m.
    triangles : (k, 3) array_like of int
        Triangles of the first mesh.
    other_vertices, other_triangles : array_like, optional
        The second mesh; without it pairs of the first with itself, those that share a vertex left out.
    margin : float
        m, >= 0.

    Returns
    -------
    (m, 2) array of int
        Sorted pairs (triangle of the first, triangle of the second); with itself the lesser first.

    Raises
    ------
    InputError
        Positions that are not finite, a negative margin.
    """
    if not 0.0 <= margin < np.inf:
        raise InputError(f"broad phase: margin must be finite and >= 0 m, got {margin}")
    triangles = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    low, high = _boxes(vertices, triangles)
    own = other_vertices is None
    other_low, other_high = low, high
    trees = other_trees = _trees(low, high)
    if not own:
        other_low, other_high = _boxes(other_vertices, np.asarray(other_triangles, dtype=np.int64).reshape(-1, 3))
        other_trees = _trees(other_low, other_high)
    found = [np.zeros((0, 2), dtype=np.int64)]
    for ids, tree, radius in trees:
        for other_ids, other_tree, other_radius in other_trees:
            reach = (radius + other_radius + np.sqrt(3.0) * margin) * (1.0 + 1e-9)
            near = tree.sparse_distance_matrix(other_tree, reach, output_type="ndarray")
            pairs = np.column_stack([ids[near["i"]], other_ids[near["j"]]])
            a, b = pairs.T
            if own:
                pairs = pairs[a < b]
                a, b = pairs.T
            near = np.all((low[a] <= other_high[b] + margin) & (other_low[b] <= high[a] + margin), axis=1)
            found.append(pairs[near])
    pairs = np.concatenate(found)
    if own:
        pairs = pairs[~(triangles[pairs[:, 0], :, None] == triangles[pairs[:, 1], None, :]).any(axis=(1, 2))]
    return pairs[np.lexsort(pairs.T[::-1])]


def _boxes(vertices, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    corners = np.asarray(vertices, dtype=float)[triangles]
    if not np.all(np.isfinite(corners)):
        bad = np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))
        raise InputError(f"broad phase: {len(bad)} triangles have corners that are not finite, the first is triangle {bad[0]}")
    return corners.min(axis=1), corners.max(axis=1)


def _trees(low: np.ndarray, high: np.ndarray) -> list[tuple[np.ndarray, cKDTree, float]]:
    """Per class of size (factors of two): ids, tree of the box centres, largest half diagonal."""
    radius = 0.5 * np.linalg.norm(high - low, axis=1)
    largest = radius.max(initial=0.0)
    sizes = np.floor(np.log2(np.maximum(radius, 1e-6 * largest) / largest)) if largest > 0.0 else np.zeros(len(radius))
    classes = [np.flatnonzero(sizes == size) for size in np.unique(sizes)]
    return [(ids, cKDTree(0.5 * (low[ids] + high[ids])), radius[ids].max()) for ids in classes]
