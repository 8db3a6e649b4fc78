"""Numba kernels of :mod:`mfar_fem.contact.separating_axis`: axes between two triangles and what the projections on them say.

Triangles are (3, 3) arrays, corners first. Axes are not normalised before the signs are taken, so that integer coordinates up to
1000 in size give exact signs in double precision (every number stays below 2^53).
"""

from __future__ import annotations

import numpy as np
from numba import njit

jit = njit(cache=True, error_model="numpy")

PRODUCTS = np.array([(0, 1), (3, 4)] + [(i, j) for i in range(3) for j in range(3, 6)])
"""Pairs of edges (0-2 of the first triangle, 3-5 of the second): two face normals, nine edge-edge products."""

SIDES = 2 + len(PRODUCTS) + 6
"""Axes that decide overlap: 2 + 9 + 6 of the paper, and line of centres and longest edge for degenerate triangles."""

GAPS = 18
"""Axes from corners to edges: with the former they attain the distance of separate triangles."""


@jit
def cross(a, b, out):
    """a × b."""
    out[0], out[1], out[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@jit
def square(a):
    """a · a."""
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]


@jit
def side_axes(a, b, edges, axes):
    """Fill ``edges`` (6, 3), those of a and of b, and the first SIDES rows of ``axes``; an axis may be zero, which says nothing.

    The six in-plane axes lie across the edges in a plane whose normal is the clearest (by the sine of the angle) of all the
    products: for coplanar triangles these agree, and where triangles degenerate one that is not zero is left.
    """
    longest = 0
    for v in range(3):
        w = (v + 1) % 3
        for c in range(3):
            edges[v, c], edges[3 + v, c] = a[w, c] - a[v, c], b[w, c] - b[v, c]
    for c in range(3):
        axes[0, c] = (a[0, c] + a[1, c] + a[2, c]) - (b[0, c] + b[1, c] + b[2, c])
    for e in range(1, 6):
        if square(edges[e]) > square(edges[longest]):
            longest = e
    axes[1] = edges[longest]
    plane, best = np.empty(3), 0.0
    cross(axes[0], edges[longest], plane)
    scale = square(axes[0]) * square(edges[longest])
    if scale > 0.0:
        best = square(plane) / scale
    for k in range(len(PRODUCTS)):
        i, j = PRODUCTS[k]
        cross(edges[i], edges[j], axes[2 + k])
        scale = square(edges[i]) * square(edges[j])
        if square(axes[2 + k]) > best * scale:
            best = square(axes[2 + k]) / scale
            plane[:] = axes[2 + k]
    for e in range(6):
        cross(plane, edges[e], axes[2 + len(PRODUCTS) + e])


@jit
def gap_axes(a, b, edges, axes):
    """Fill the rows of ``axes`` from SIDES on with the ways from the corners of each triangle to the nearest points on the edges
    of the other.
    """
    k = SIDES
    for v in range(3):
        for e in range(6):
            p, q = (a[v], b[e - 3]) if e >= 3 else (b[v], a[e])
            length, along = square(edges[e]), 0.0
            for c in range(3):
                along += (p[c] - q[c]) * edges[e, c]
            s = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
            for c in range(3):
                axes[k, c] = p[c] - q[c] - s * edges[e, c]
            k += 1


@jit
def ways(axis, a, b):
    """How far a must move along the axis, and against it, to leave b; times the axis' length. Negative where they are apart."""
    low_a = low_b = np.inf
    high_a = high_b = -np.inf
    for v in range(3):
        x = axis[0] * a[v, 0] + axis[1] * a[v, 1] + axis[2] * a[v, 2]
        y = axis[0] * b[v, 0] + axis[1] * b[v, 1] + axis[2] * b[v, 2]
        low_a, high_a = min(low_a, x), max(high_a, x)
        low_b, high_b = min(low_b, y), max(high_b, y)
    return high_b - low_a, high_a - low_b


@jit
def shift(A, B, a, b):
    """The triangles about the first corner of A, to ``a`` and ``b``."""
    for v in range(3):
        for c in range(3):
            a[v, c], b[v, c] = A[v, c] - A[0, c], B[v, c] - A[0, c]


@jit
def least_way(a, b, axes, first, last, facing, limit, depth, out):
    """Least of ``depth`` and the normalised ways along axes[first:last]; its unit direction to ``out``.

    Directions whose product with ``facing`` is below ``limit`` do not count (a zero ``facing`` lets all pass).
    """
    for k in range(first, last):
        length = np.sqrt(square(axes[k]))
        if length == 0.0:
            continue
        forth, back = ways(axes[k], a, b)
        toward = (axes[k, 0] * facing[0] + axes[k, 1] * facing[1] + axes[k, 2] * facing[2]) / length
        if forth / length < depth and toward >= limit:
            depth = forth / length
            for c in range(3):
                out[c] = axes[k, c] / length
        if back / length < depth and -toward >= limit:
            depth = back / length
            for c in range(3):
                out[c] = -axes[k, c] / length
    return depth


@jit
def overlap(A, B, out):
    """Whether the closed triangles A, B (n, 3, 3) have a point in common, to ``out`` (n,)."""
    a, b, edges, axes = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3)), np.empty((SIDES, 3))
    for i in range(len(A)):
        shift(A[i], B[i], a, b)
        side_axes(a, b, edges, axes)
        out[i] = True
        for k in range(SIDES):
            forth, back = ways(axes[k], a, b)
            if forth < 0.0 or back < 0.0:
                out[i] = False
                break


@jit
def penetration(A, B, depth, axis):
    """Depth (n,) and unit axis (n, 3) of the least translation of A that makes A and B touch; minus the distance where apart."""
    a, b, edges, axes = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3)), np.empty((SIDES + GAPS, 3))
    free = np.zeros(3)
    for i in range(len(A)):
        shift(A[i], B[i], a, b)
        side_axes(a, b, edges, axes)
        axis[i, 0], axis[i, 1], axis[i, 2] = 0.0, 0.0, 1.0
        depth[i] = least_way(a, b, axes, 0, SIDES, free, 0.0, np.inf, axis[i])
        if depth[i] < 0.0:
            gap_axes(a, b, edges, axes)
            depth[i] = least_way(a, b, axes, SIDES, SIDES + GAPS, free, 0.0, depth[i], axis[i])
        elif depth[i] == np.inf:  # twice the same point
            depth[i] = 0.0
