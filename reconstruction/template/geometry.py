"""Plane polygons: simplicity, offset, extent across a direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reconstruction.measure.silhouette import signed_area

MITRE_LIMIT = 3.0
"""A corner of an offset outline may reach this many allowances out; beyond it is cut off square."""
FOLD_LIMIT = 6.0
"""The same where one of both distances is zero (a fold), along which an outline ends rather than steps."""


def self_crossings(polygon: np.ndarray) -> list[tuple[int, int]]:
    """Pairs of sides (by the index of their first vertex) of a closed polygon that cross or touch, neighbours left out.

    Parameters
    ----------
    polygon : (n, 2) array
    """
    a, b = polygon, np.roll(polygon, -1, axis=0)
    n = len(polygon)

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    first = side(a[:, None], b[:, None], a[None]) * side(a[:, None], b[:, None], b[None])
    apart = (np.maximum(a, b)[:, None] < np.minimum(a, b)[None]).any(axis=-1)
    cross = (first <= 0) & (first.T <= 0) & ~apart & ~apart.T
    i, j = np.nonzero(np.triu(cross, 2))
    return [(int(p), int(q)) for p, q in zip(i, j, strict=True) if not (p == 0 and q == n - 1)]


def is_simple(polygon: np.ndarray) -> bool:
    """Whether a closed polygon (n, 2) has no two sides that cross or touch, and a non-zero area."""
    return len(polygon) >= 3 and signed_area(polygon) != 0 and not self_crossings(polygon)


def offset(pieces: Sequence[np.ndarray], distances: Sequence[float]) -> np.ndarray:
    """Outline outside a closed anticlockwise loop of pieces, each moved outwards by its own distance.

    Neighbours are cut off or extended (straight on) to where they meet; corners that would reach out farther than
    :data:`MITRE_LIMIT` are cut off square, or stepped if the distances differ.

    Parameters
    ----------
    pieces : sequence of (n, 2) array
        Polylines; each begins where the one before it ends.
    distances : sequence of float
        Of each piece; zero leaves it in place.

    Returns
    -------
    (m, 2) array
        Loops, which arise where a hollow is narrower than its distance, are cut out.
    """
    moved = [_moved(piece, distance) for piece, distance in zip(pieces, distances, strict=True)]
    joints = [_joint(moved[i - 1], moved[i], pieces[i][0], distances[i - 1], distances[i]) for i in range(len(moved))]
    corners = []
    for i, line in enumerate(moved):
        _, points, first = joints[i]
        last, _, _ = joints[(i + 1) % len(joints)]
        corners += [points, line[first : last + 1]]
    outline = np.vstack(corners)
    return without_loops(outline[np.linalg.norm(outline - np.roll(outline, 1, axis=0), axis=1) > 1e-12])


def _moved(line: np.ndarray, distance: float) -> np.ndarray:
    """A polyline moved to its right, corners inside it mitred."""
    direction = np.diff(line, axis=0)
    direction = direction / np.linalg.norm(direction, axis=1)[:, None]
    normal = np.stack([direction[:, 1], -direction[:, 0]], axis=1)
    n0, n1 = np.vstack([normal[:1], normal]), np.vstack([normal, normal[-1:]])
    return line + distance * (n0 + n1) / np.maximum(1 + np.sum(n0 * n1, axis=1), 0.1)[:, None]


def _joint(before: np.ndarray, after: np.ndarray, vertex: np.ndarray, a: float, b: float) -> tuple[int, np.ndarray, int]:
    """Where two moved polylines meet: last index kept of the first, the points between, first index kept of the second."""
    reach = (MITRE_LIMIT if min(a, b) > 0 else FOLD_LIMIT) * max(a, b)
    d0, d1 = (v / np.linalg.norm(v) for v in (before[-1] - before[-2], after[1] - after[0]))
    first, second = np.vstack([before, before[-1] + reach * d0]), np.vstack([after[0] - reach * d1, after])
    p, u, q, v = first[:-1, None], np.diff(first, axis=0)[:, None], second[None, :-1], np.diff(second, axis=0)[None]
    cross = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    w = q - p
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (w[..., 0] * v[..., 1] - w[..., 1] * v[..., 0]) / cross
        t = (w[..., 0] * u[..., 1] - w[..., 1] * u[..., 0]) / cross
    meet = (abs(cross) > 1e-12) & (s >= -1e-9) & (s <= 1 + 1e-9) & (t >= -1e-9) & (t <= 1 + 1e-9)
    if meet.any():
        found = np.argwhere(meet)
        points = np.array([first[i] + s[i, j] * (first[i + 1] - first[i]) for i, j in found])
        best = int(np.argmin(np.linalg.norm(points - vertex, axis=1)))
        i, j = found[best]
        # an end that is extended lies on the way to the meeting point and is dropped
        return int(min(i, len(before) - 2)), points[best : best + 1], int(max(j, 1))
    square = max(a, b) if a == b and d0[0] * d1[1] - d0[1] * d1[0] > 0 else 0.0
    return len(before) - 1, np.stack([before[-1] + square * d0, after[0] - square * d1]), 0


def without_loops(polygon: np.ndarray) -> np.ndarray:
    """A closed polygon (n, 2) without the loops in which it crosses itself: of both parts at a crossing the larger one stays."""
    while True:
        found = self_crossings(polygon)
        if not found:
            return polygon
        i, j = min(found, key=lambda pair: min(pair[1] - pair[0], len(polygon) - pair[1] + pair[0]))
        n = len(polygon)
        a, b, c, d = polygon[i], polygon[(i + 1) % n], polygon[j], polygon[(j + 1) % n]
        matrix = np.stack([b - a, c - d], axis=1)
        cross = a + np.linalg.lstsq(matrix, c - a, rcond=None)[0][0] * (b - a)
        inner, outer = polygon[i + 1 : j + 1], np.vstack([polygon[j + 1 :], polygon[: i + 1]])
        keep = max((inner, outer), key=lambda part: abs(signed_area(np.vstack([part, cross]))))
        polygon = np.vstack([keep, cross])
        if len(polygon) >= n:  # parts that only touch
            return polygon


def extent(points: np.ndarray, direction: np.ndarray) -> float:
    """Extent of points (n, 2) along a direction."""
    return float(np.ptp(points @ (direction / np.linalg.norm(direction))))
