"""Numba kernels of :mod:`mfar_fem.contact.mesh_distance`: a tree of boxes over triangles and the closest point in it."""

from __future__ import annotations

import numpy as np
from numba import njit, prange

jit = njit(cache=True, error_model="numpy")

LEAF = 4
"""Triangles in a leaf at most."""


@jit
def build(corners, order, offset, low, high, child, span):
    """Fill the nodes of a tree over the triangles ``order`` (reordered in place) from node ``offset`` on; first free node.

    ``corners`` (k, 3, 3); ``low``, ``high`` (nodes, 3) the boxes; ``child`` (nodes,) the first of two children or -1; ``span``
    (nodes, 2) the range of ``order``.
    """
    free = offset + 1
    stack = [offset]
    while len(stack) > 0:
        node = stack.pop()
        a, b = span[node]
        for c in range(3):
            low[node, c], high[node, c] = np.inf, -np.inf
        lo, hi = np.full(3, np.inf), np.full(3, -np.inf)
        for k in range(a, b):
            for c in range(3):
                centre = 0.0
                for v in range(3):
                    x = corners[order[k], v, c]
                    low[node, c], high[node, c] = min(low[node, c], x), max(high[node, c], x)
                    centre += x
                lo[c], hi[c] = min(lo[c], centre), max(hi[c], centre)
        child[node] = -1
        if b - a <= LEAF:
            continue
        axis = np.argmax(hi - lo)
        key = np.empty(b - a)
        for k in range(a, b):
            key[k - a] = corners[order[k], 0, axis] + corners[order[k], 1, axis] + corners[order[k], 2, axis]
        order[a:b] = order[a:b][np.argsort(key)]
        middle = (a + b) // 2
        child[node] = free
        span[free, 0], span[free, 1] = a, middle
        span[free + 1, 0], span[free + 1, 1] = middle, b
        stack.append(free)
        stack.append(free + 1)
        free += 2
    return free


@jit
def closest_in_triangle(p0, p1, p2, corners, k):
    """Closest point of triangle k of ``corners`` (k, 3, 3) to p: (squared distance, feature, point).

    The feature is 0 for the face, 1-3 for vertex 0-2, 4-6 for the edge from vertex 0-2.
    """
    a0, a1, a2 = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
    u0, u1, u2 = corners[k, 1, 0] - a0, corners[k, 1, 1] - a1, corners[k, 1, 2] - a2
    w0, w1, w2 = corners[k, 2, 0] - a0, corners[k, 2, 1] - a1, corners[k, 2, 2] - a2
    n0, n1, n2 = u1 * w2 - u2 * w1, u2 * w0 - u0 * w2, u0 * w1 - u1 * w0
    best, feature, inside = np.inf, 0, True
    q0, q1, q2 = p0, p1, p2
    for i in range(3):
        j = (i + 1) % 3
        a0, a1, a2 = corners[k, i, 0], corners[k, i, 1], corners[k, i, 2]
        e0, e1, e2 = corners[k, j, 0] - a0, corners[k, j, 1] - a1, corners[k, j, 2] - a2
        d0, d1, d2 = p0 - a0, p1 - a1, p2 - a2
        # the side of the edge p's projection lies on: (n × e) · d
        if (n1 * e2 - n2 * e1) * d0 + (n2 * e0 - n0 * e2) * d1 + (n0 * e1 - n1 * e0) * d2 > 0.0:
            continue
        inside = False
        along, length = e0 * d0 + e1 * d1 + e2 * d2, e0 * e0 + e1 * e1 + e2 * e2
        if along <= 0.0:
            found = 1 + i
        elif along >= length:
            found = 1 + j
            a0, a1, a2 = corners[k, j, 0], corners[k, j, 1], corners[k, j, 2]
        else:
            found, s = 4 + i, along / length
            a0, a1, a2 = a0 + s * e0, a1 + s * e1, a2 + s * e2
        gap = (p0 - a0) ** 2 + (p1 - a1) ** 2 + (p2 - a2) ** 2
        if gap < best:
            best, feature, q0, q1, q2 = gap, found, a0, a1, a2
    if inside:
        nn = n0 * n0 + n1 * n1 + n2 * n2
        h = (n0 * (p0 - corners[k, 0, 0]) + n1 * (p1 - corners[k, 0, 1]) + n2 * (p2 - corners[k, 0, 2])) / nn
        best, q0, q1, q2 = h * h * nn, p0 - h * n0, p1 - h * n1, p2 - h * n2
    return best, feature, q0, q1, q2


@jit
def box_gap(p0, p1, p2, low, high, node):
    """Squared distance of p to the box of a node."""
    d0 = max(low[node, 0] - p0, 0.0, p0 - high[node, 0])
    d1 = max(low[node, 1] - p1, 0.0, p1 - high[node, 1])
    d2 = max(low[node, 2] - p2, 0.0, p2 - high[node, 2])
    return d0 * d0 + d1 * d1 + d2 * d2


@jit
def closest(p0, p1, p2, root, bound, corners, low, high, child, span, stack, gaps):
    """Nearest triangle below a squared distance ``bound``: (triangle or -1, feature, point)."""
    best, triangle, feature, q0, q1, q2 = bound, -1, 0, p0, p1, p2
    stack[0], gaps[0], top = root, 0.0, 1
    while top > 0:
        top -= 1
        node = stack[top]
        if gaps[top] >= best:
            continue
        near = child[node]
        if near < 0:
            for k in range(span[node, 0], span[node, 1]):
                gap, f, c0, c1, c2 = closest_in_triangle(p0, p1, p2, corners, k)
                if gap < best:
                    best, triangle, feature, q0, q1, q2 = gap, k, f, c0, c1, c2
            continue
        far = near + 1
        gap_near, gap_far = box_gap(p0, p1, p2, low, high, near), box_gap(p0, p1, p2, low, high, far)
        if gap_far < gap_near:
            near, far, gap_near, gap_far = far, near, gap_far, gap_near
        if gap_far < best:
            stack[top], gaps[top] = far, gap_far
            top += 1
        if gap_near < best:
            stack[top], gaps[top] = near, gap_near
            top += 1
    return triangle, feature, q0, q1, q2


@njit(cache=True, error_model="numpy", parallel=True)
def signed_distance(x, roots, corners, normals, low, high, child, span, small, distance, normal):
    """Least signed distance over the parts (trees ``roots``) of the points x (n, 3), and its gradient.

    ``normals`` (k, 7, 3): unit pseudo-normals of face, vertices and edges of the triangles in the trees' order; below the
    distance ``small`` they stand in for the direction to the closest point.
    """
    for i in prange(x.shape[0]):
        stack, gaps = np.empty(128, np.int64), np.empty(128)
        p0, p1, p2 = x[i, 0], x[i, 1], x[i, 2]
        least = np.inf
        for root in roots:
            gap = box_gap(p0, p1, p2, low, high, root)
            if gap > 0.0 and (least <= 0.0 or gap >= least * least):
                continue  # outside this part, and not nearer
            bound = least * least if gap > 0.0 else np.inf
            k, f, q0, q1, q2 = closest(p0, p1, p2, root, bound, corners, low, high, child, span, stack, gaps)
            if k < 0:
                continue
            d0, d1, d2 = p0 - q0, p1 - q1, p2 - q2
            size = np.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
            n0, n1, n2 = normals[k, f, 0], normals[k, f, 1], normals[k, f, 2]
            sign = 1.0 if d0 * n0 + d1 * n1 + d2 * n2 >= 0.0 else -1.0
            if sign * size >= least:
                continue
            least = sign * size
            if size > small:
                n0, n1, n2 = d0 / least, d1 / least, d2 / least
            normal[i, 0], normal[i, 1], normal[i, 2] = n0, n1, n2
        distance[i] = least
