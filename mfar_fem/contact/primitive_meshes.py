"""Closed triangle meshes of the simple bodies, with every vertex on the surface and the triangles facing outward."""

from __future__ import annotations

import math

import numpy as np


def spaced(start: float, stop: float, size: float) -> np.ndarray:
    """Equally spaced numbers from start to stop, both included, at most ``size`` apart."""
    return np.linspace(start, stop, max(1, math.ceil((stop - start) / size - 1e-9)) + 1)


def square(extent: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Square sheet in the plane z = 0 about the origin, facing up: vertices (m, 3) and triangles (k, 3)."""
    s = spaced(-0.5 * extent, 0.5 * extent, size)
    n = len(s)
    x, y = np.meshgrid(s, s, indexing="ij")
    ids = np.arange(n * n).reshape(n, n)
    a, b, c, d = ids[:-1, :-1].ravel(), ids[1:, :-1].ravel(), ids[1:, 1:].ravel(), ids[:-1, 1:].ravel()
    vertices = np.column_stack([x.ravel(), y.ravel(), np.zeros(n * n)])
    return vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])


def sphere(radius: float, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Icosahedron with its faces cut into n² triangles, on the sphere about the origin: vertices (m, 3), triangles (k, 3)."""
    g = 0.5 * (1.0 + math.sqrt(5.0))
    corners = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0], [0, -1, g], [0, 1, g], [0, -1, -g], [0, 1, -g],
                        [g, 0, -1], [g, 0, 1], [-g, 0, -1], [-g, 0, 1]], dtype=float) / math.sqrt(1.0 + g * g)
    faces = np.array([[0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4], [11, 10, 2], [10, 7, 6],
                      [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8], [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10],
                      [8, 6, 7], [9, 8, 1]])
    n = max(1, math.ceil(radius * math.acos(1.0 / math.sqrt(5.0)) / size))
    grid = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)])
    ids = {(int(i), int(j)): k for k, (i, j) in enumerate(grid)}
    small = [(ids[i, j], ids[i + 1, j], ids[i, j + 1]) for i in range(n) for j in range(n - i)]
    small += [(ids[i + 1, j], ids[i + 1, j + 1], ids[i, j + 1]) for i in range(n) for j in range(n - i - 1)]
    weights = np.column_stack([n - grid.sum(axis=1), grid]) / n
    points = np.einsum("pk,fkc->fpc", weights, corners[faces]).reshape(-1, 3)
    _, first, same = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    vertices = points[first]
    triangles = same.ravel()[(np.arange(20)[:, None, None] * len(grid) + np.array(small)).reshape(-1, 3)]
    return radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True), triangles


def ring_counts(radii: np.ndarray, size: float) -> np.ndarray:
    """Vertices (m,) on rings of these radii, about ``size`` apart: one on the axis, six or more elsewhere, 24 on the widest."""
    counts = np.maximum(6, np.ceil(2.0 * np.pi * radii / size).astype(int))
    counts[radii >= radii.max() * (1 - 1e-12)] = max(24, counts.max())
    return np.where(radii == 0.0, 1, counts)


def revolve(profile: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closed surface of revolution about z from rings.

    Parameters
    ----------
    profile : (m, 2)
        Radius and height of the rings, from the lower pole (radius 0) to the upper one (radius 0), m.
    counts : (m,)
        Vertices on each ring (1 at the poles).

    Returns
    -------
    vertices (n, 3), triangles (k, 3)
    """
    starts = np.concatenate([[0], np.cumsum(counts)])
    vertices = np.empty((starts[-1], 3))
    for (r, z), n, s in zip(profile, counts, starts, strict=False):
        angle = 2.0 * np.pi * np.arange(n) / n
        vertices[s : s + n] = np.column_stack([r * np.cos(angle), r * np.sin(angle), np.full(n, z)])
    bands = [_band(starts[i], counts[i], starts[i + 1], counts[i + 1]) for i in range(len(counts) - 1)]
    return vertices, np.vstack(bands)


def _band(lower: int, n: int, upper: int, m: int) -> np.ndarray:
    """Triangles between two rings of n and m vertices (first ids ``lower``, ``upper``): always the step that ends first."""
    if n == 1:
        ring = np.arange(m)
        return np.column_stack([np.full(m, lower), upper + (ring + 1) % m, upper + ring])
    if m == 1:
        ring = np.arange(n)
        return np.column_stack([lower + ring, lower + (ring + 1) % n, np.full(n, upper)])
    triangles, i, j = [], 0, 0
    while i < n or j < m:
        if (i + 1) * m <= (j + 1) * n:
            triangles.append((lower + i, lower + (i + 1) % n, upper + j % m))
            i += 1
        else:
            triangles.append((lower + i % n, upper + (j + 1) % m, upper + j))
            j += 1
    return np.array(triangles)
