"""Numba kernel of :mod:`mfar_fem.contact.position_correction`."""

from __future__ import annotations

import numpy as np

from mfar_fem.contact.separating_axis_kernels import GAPS, SIDES, gap_axes, jit, least_way, shift, side_axes


@jit
def sweep(x, triangles, free, corners, normals, limits, pairs, tolerance, thickness, move):
    """One pass over the pairs in order: (number too deep, the largest depth).

    The depth of triangles that meet is the least translation within the outward cone of the body's face (``normals`` (k, 3)
    and least cosines ``limits`` (k,)): it does not vanish where the sheet touches the face from within. Apart, it is minus
    the distance. A pair is too deep where depth plus ``thickness`` is above ``tolerance``; with ``move`` those corners of the
    sheet's triangle that are ``free`` (n,) and short of the clear side of the axis are then moved there.
    """
    a, b, edges, axes = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3)), np.empty((SIDES + GAPS, 3))
    A, axis, all_ways = np.empty((3, 3)), np.zeros(3), np.zeros(3)
    count, largest = 0, 0.0
    for k in range(len(pairs)):
        triangle, B = triangles[pairs[k, 0]], corners[pairs[k, 1]]
        normal, limit = normals[pairs[k, 1]], limits[pairs[k, 1]]
        for v in range(3):
            A[v] = x[triangle[v]]
        shift(A, B, a, b)
        side_axes(a, b, edges, axes)
        depth = least_way(a, b, axes, 0, SIDES, all_ways, 0.0, np.inf, axis)
        if depth > -tolerance:
            depth = least_way(a, b, axes, 0, SIDES, normal, limit, np.inf, axis)
        elif thickness > 0.0:
            gap_axes(a, b, edges, axes)
            depth = least_way(a, b, axes, SIDES, SIDES + GAPS, all_ways, 0.0, depth, axis)
        if not tolerance < depth + thickness < np.inf:
            continue
        count, largest = count + 1, max(largest, depth + thickness)
        if not move:
            continue
        support = -np.inf
        for v in range(3):
            support = max(support, axis[0] * b[v, 0] + axis[1] * b[v, 1] + axis[2] * b[v, 2])
        for v in range(3):
            lack = support + thickness - (axis[0] * a[v, 0] + axis[1] * a[v, 1] + axis[2] * a[v, 2])
            if lack > 0.0 and free[triangle[v]]:
                for c in range(3):
                    x[triangle[v], c] += lack * axis[c]
    return count, largest
