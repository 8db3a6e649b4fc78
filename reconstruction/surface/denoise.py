"""Spacing of points on a surface, and their smoothing where standard deviations are known."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

NEIGHBOURS = 8
"""Of the spacing."""


def local_spacing(points: np.ndarray, tree: cKDTree | None = None) -> np.ndarray:
    """(n,) side of the square each point has to itself, m: r √(π / k) with r the distance of the k-th neighbour, k = 8."""
    k = min(NEIGHBOURS, len(points) - 1)
    distance, _ = (tree or cKDTree(points)).query(points, k=k + 1)
    return distance[:, -1] * np.sqrt(np.pi / k)


def point_spacing(points: np.ndarray) -> float:
    """Median of :func:`local_spacing`, m."""
    return float(np.median(local_spacing(points)))


def denoised(points: np.ndarray, normals: np.ndarray, sigma: np.ndarray, spacing: float, reach: float = 4.0) -> np.ndarray:
    """Points moved along their normals to a quadric through their neighbours, each weighted by its inverse variance.

    One step of moving least squares (M. Alexa et al., Computing and rendering point set surfaces, IEEE TVCG 9 (2003) 3-15,
    doi:10.1109/TVCG.2003.1175093) with a polynomial of second degree over the plane of the point's normal. Neighbours whose
    normals differ by more than 60° (the other side of a thin fold) are left out; a point with fewer than 12 neighbours stays.

    Parameters
    ----------
    points, normals : (n, 3) arrays
        m; unit.
    sigma : (n,) array
        m; a point with 0 stays.
    spacing : float
        m.
    reach : float
        Radius of the neighbourhood in spacings.

    Returns
    -------
    (n, 3) array
        m.
    """
    tree = cKDTree(points)
    radius = reach * spacing
    near, index = tree.query(points, k=min(len(points), int(np.pi * reach**2) + 1), distance_upper_bound=radius)
    there = np.isfinite(near)
    index = np.where(there, index, 0)
    seed = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    t1 = np.cross(normals, seed)
    t1 /= np.linalg.norm(t1, axis=1)[:, None]
    t2 = np.cross(normals, t1)
    offset = points[index] - points[:, None]
    u, v, w = (np.einsum("nki,ni->nk", offset, axis) / radius for axis in (t1, t2, normals))
    floor = max(1e-3 * float(np.median(sigma)), 1e-9)
    weight = np.exp(-((near / (0.6 * radius)) ** 2), where=there, out=np.zeros_like(near)) / np.maximum(sigma[index], floor) ** 2
    weight *= there & (np.einsum("nki,ni->nk", normals[index], normals) > 0.5)
    weight /= np.maximum(weight.max(axis=1, keepdims=True), 1e-300)
    basis = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=2)
    matrix = np.einsum("nk,nki,nkj->nij", weight, basis, basis) + 1e-9 * np.eye(6)
    height = np.linalg.solve(matrix, np.einsum("nk,nki,nk->ni", weight, basis, w)[..., None])[:, 0, 0]
    height = np.clip(height * radius, -3 * sigma, 3 * sigma)
    height[(weight > 1e-6).sum(axis=1) < 12] = 0.0
    return points + height[:, None] * normals
