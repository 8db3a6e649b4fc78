"""Exact intersection of closed triangles with integer corners, degenerate ones included, by orientation signs alone (int64).

Independent of separating axes: triangles meet if and only if an edge of one meets the other; a segment meets a triangle where
its ends lie on both sides of the plane and it passes all edges on the same side, in the plane by 2-D tests; a triangle without
area is its three edges. Exact while coordinates stay below 1e5 (volumes below 2^63).
"""

from __future__ import annotations

import numpy as np

KINDS = ("generic", "small", "large", "touching", "shared vertex", "shared edge", "coplanar", "coplanar tilted", "parallel planes",
         "segment", "two segments", "point", "two points", "collinear", "equal", "needles")


def orient3(a, b, c, d):
    """Sign (n,) of the volume of (n, 3) points a, b, c, d."""
    return np.sign(np.einsum("ni,ni->n", np.cross(b - a, c - a), d - a))


def orient2(a, b, c):
    """Sign (n,) of the area of (n, 2) points a, b, c."""
    u, v = b - a, c - a
    return np.sign(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])


def flatten(normal, *points):
    """The points (n, 3) without the coordinate in which the normal is largest: (n, 2) each."""
    drop = np.argmax(np.abs(normal), axis=1)
    keep = np.array([[1, 2], [0, 2], [0, 1]])[drop]
    return [np.take_along_axis(p, keep, axis=1) for p in points]


def between(a, b, p):
    """Whether p lies in the box of a and b, any dimension."""
    return np.all((np.minimum(a, b) <= p) & (p <= np.maximum(a, b)), axis=1)


def segments_meet_2(p, q, r, s):
    """Closed 2-D segments pq and rs."""
    a, b, c, d = orient2(p, q, r), orient2(p, q, s), orient2(r, s, p), orient2(r, s, q)
    proper = (a * b < 0) & (c * d < 0)
    ends = ((a == 0) & between(p, q, r)) | ((b == 0) & between(p, q, s))
    return proper | ends | ((c == 0) & between(r, s, p)) | ((d == 0) & between(r, s, q))


def segments_meet(p, q, r, s):
    """Closed 3-D segments pq and rs, points among them."""
    n = np.cross(q - p, s - r)
    crossing = np.any(n != 0, axis=1)
    planar = np.einsum("ni,ni->n", n, r - p) == 0
    meet = crossing & planar & segments_meet_2(*flatten(n, p, q, r, s))
    # parallel, or a point: on one line, and one holds an end of the other
    def on(a, b, c):
        return np.all(np.cross(b - a, c - a) == 0, axis=1) & between(a, b, c)

    return meet | (~crossing & (on(p, q, r) | on(p, q, s) | on(r, s, p) | on(r, s, q)))


def in_triangle_2(t, p):
    """2-D point in a closed triangle of three (n, 2) corners, area not zero."""
    signs = np.array([orient2(t[i], t[(i + 1) % 3], p) for i in range(3)])
    return np.all(signs >= 0, axis=0) | np.all(signs <= 0, axis=0)


def segment_meets_triangle(p, q, t):
    """Closed segment pq and triangle of three (n, 3) corners."""
    n = np.cross(t[1] - t[0], t[2] - t[0])
    area = np.any(n != 0, axis=1)
    above, below = np.sign(np.einsum("ni,ni->n", n, p - t[0])), np.sign(np.einsum("ni,ni->n", n, q - t[0]))
    edges = [segments_meet(p, q, t[i], t[(i + 1) % 3]) for i in range(3)]
    signs = np.array([orient3(p, q, t[i], t[(i + 1) % 3]) for i in range(3)])
    through = (above * below <= 0) & ((above != 0) | (below != 0)) & (np.all(signs >= 0, axis=0) | np.all(signs <= 0, axis=0))
    flat = flatten(n, p, *t)
    inside = (above == 0) & (below == 0) & in_triangle_2(flat[1:], flat[0])
    return np.where(area, through | inside | np.any(edges, axis=0), np.any(edges, axis=0))


def triangles_meet(A, B):
    """Whether closed triangles A, B (n, 3, 3) of integers meet: (n,) bool."""
    a, b = [A[:, i] for i in range(3)], [B[:, i] for i in range(3)]
    hits = [segment_meets_triangle(x[i], x[(i + 1) % 3], y) for x, y in ((a, b), (b, a)) for i in range(3)]
    return np.any(hits, axis=0)


def random_pairs(kind: str, n: int, rng: np.random.Generator):
    """n pairs (n, 3, 3) of integer triangles of a kind, coordinates up to 1000 in size."""
    size = {"small": 2, "large": 1000, "generic": 20, "needles": 30}.get(kind, 8)
    A, B = rng.integers(-size, size + 1, (2, n, 3, 3))
    rows = np.arange(n)
    i, j = rng.integers(0, 3, (2, n))
    if kind == "touching":  # a corner of B on A: its corners, edges (midpoints) or inside (third points)
        A *= 6
        weights = np.array([[6, 0, 0], [3, 3, 0], [2, 4, 0], [2, 2, 2], [1, 2, 3], [4, 1, 1]])[rng.integers(0, 6, n)]
        B *= 6
        B[rows, j] = np.einsum("nv,nvc->nc", weights, A // 6)
        B[rows, j] += np.where(rng.random(n) < 0.3, 1, 0)[:, None] * rng.integers(-1, 2, (n, 3))
    elif kind in ("shared vertex", "shared edge"):
        B[rows, j] = A[rows, i]
        if kind == "shared edge":
            B[rows, (j + 1) % 3] = A[rows, (i + 1) % 3]
    elif kind in ("coplanar", "coplanar tilted", "parallel planes", "collinear"):
        axes = rng.integers(-4, 5, (n, 2, 3))
        if kind == "coplanar":
            axes[:] = [[1, 0, 0], [0, 1, 0]]
        coordinates = rng.integers(-6, 7, (2, n, 3, 2))
        if kind == "collinear":
            coordinates[..., 1] = 0
        A, B = np.einsum("pnvk,nkc->pnvc", coordinates, axes)
        if kind == "parallel planes":
            B = B + rng.integers(-1, 2, (n, 1, 3))
    elif kind in ("segment", "two segments"):
        line = rng.integers(-3, 4, (2, n, 3, 1)) * rng.integers(-3, 4, (2, n, 1, 3))
        A = line[0] + rng.integers(-2, 3, (n, 1, 3))
        if kind == "two segments":
            B = line[1] + rng.integers(-2, 3, (n, 1, 3))
    elif kind in ("point", "two points"):
        A = np.repeat(rng.integers(-1, 2, (n, 1, 3)), 3, axis=1)
        if kind == "two points":
            B = np.repeat(rng.integers(-1, 2, (n, 1, 3)), 3, axis=1)
        else:
            B //= 4
    elif kind == "equal":
        B = A[rows[:, None], rng.permuted(np.tile(np.arange(3), (n, 1)), axis=1)]
        B = B + (rng.random(n) < 0.5)[:, None, None] * rng.integers(-1, 2, (n, 1, 3))
    elif kind == "needles":
        A[:, 2] = A[:, 1] + rng.integers(-1, 2, (n, 3))
        B[:, 2] = B[:, 1] + rng.integers(-1, 2, (n, 3))
    swap = rng.random(n) < 0.5
    A, B = np.where(swap[:, None, None], B, A), np.where(swap[:, None, None], A, B)
    return A, B
