"""Triangulations of the integer rectangle [0, nx] x [0, ny]: the combinatorial half of the structured patterns.

Every function returns ``(points, triangles)``: points (n, 2) in units of one cell, triangles (m, 3) int64
counter-clockwise. Nothing here knows lengths, surfaces or boundary names; `mfar_fem.surface.patterns` adds those.
"""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError

PATTERNS = ("right", "left", "union", "criss", "equilateral", "jitter")


def triangulate(nx: int, ny: int, pattern: str = "right", jitter: float | None = None, seed: int = 0):
    """Triangulate the rectangle of nx by ny cells.

    Parameters
    ----------
    nx, ny : int
        Cells in each direction, at least 1.
    pattern : {'right', 'left', 'union', 'criss', 'equilateral', 'jitter'}
        ``right``/``left``: one diagonal a cell, all rising or all falling; ``union``: alternating diagonals (union
        jack); ``criss``: both diagonals (four triangles a cell); ``equilateral``: every second row shifted by half a
        cell; ``jitter``: grid points moved at random, then Delaunay.
    jitter : float, optional
        Each coordinate is moved by up to this fraction of a cell, corners fixed, side points along their side only. The
        connectivity is kept (except for ``jitter``, whose default is 0.4): where a triangle would lose more than 85 %
        of its area the move of its points is halved until it does not.
    seed : int
        Of the random moves.

    Returns
    -------
    points : (n, 2) float64
    triangles : (m, 3) int64

    Raises
    ------
    InputError
        Fewer than one cell, unknown pattern, or jitter outside [0, 0.5).
    """
    if int(nx) != nx or int(ny) != ny or nx < 1 or ny < 1:
        raise InputError(f"a pattern needs at least 1 x 1 whole cells, not {nx} x {ny}")
    if pattern not in PATTERNS:
        raise InputError(f"unknown triangle pattern '{pattern}': one of {', '.join(PATTERNS)}")
    if jitter is not None and not 0.0 <= jitter < 0.5:
        raise InputError(f"jitter must be at least 0 and below 0.5 of a cell, not {jitter}")
    nx, ny = int(nx), int(ny)
    if pattern == "jitter":
        return _delaunay(nx, ny, 0.4 if jitter is None else jitter, seed)
    points, triangles = _equilateral(nx, ny) if pattern == "equilateral" else _cells(nx, ny, pattern)
    if jitter:
        points = _move(points, triangles, nx, ny, jitter, seed)
    return points, triangles


def signed_areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed areas (m,) of plane triangles; positive when counter-clockwise. `points` (n, 2), `triangles` (m, 3)."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))


def _cells(nx: int, ny: int, pattern: str):
    x, y = np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0))
    points = np.column_stack([x.ravel(), y.ravel()])
    columns, rows = np.meshgrid(np.arange(nx), np.arange(ny))
    i, j = columns.ravel(), rows.ravel()
    a = j * (nx + 1) + i
    b, c, d = a + 1, a + nx + 2, a + nx + 1  # counter-clockwise corners a, b, c, d
    if pattern == "criss":
        m = len(points) + np.arange(nx * ny)
        points = np.vstack([points, np.column_stack([i + 0.5, j + 0.5])])
        tri = np.stack([(a, b, m), (b, c, m), (c, d, m), (d, a, m)])  # (4, 3, cells)
    else:
        rising = np.stack([(a, b, c), (a, c, d)])
        falling = np.stack([(a, b, d), (b, c, d)])
        up = {"right": np.ones(len(i), bool), "left": np.zeros(len(i), bool), "union": (i + j) % 2 == 0}[pattern]
        tri = np.where(up, rising, falling)
    return points, np.ascontiguousarray(tri.transpose(2, 0, 1).reshape(-1, 3), dtype=np.int64)


def _equilateral(nx: int, ny: int):
    rows, start, points = [], 0, []
    for j in range(ny + 1):
        x = np.arange(nx + 1.0) if j % 2 == 0 else np.r_[0.0, np.arange(nx) + 0.5, nx]
        points.append(np.column_stack([x, np.full(len(x), float(j))]))
        rows.append(start + np.arange(len(x)))
        start += len(x)
    tri: list[np.ndarray] = []
    for j in range(ny):
        even, odd = (rows[j], rows[j + 1]) if j % 2 == 0 else (rows[j + 1], rows[j])
        one = np.column_stack([even, odd[1:], odd[:-1]])  # between two odd points
        two = np.column_stack([even[:-1], even[1:], odd[1:-1]])  # between two even points
        tri += [one, two] if j % 2 == 0 else [one[:, ::-1], two[:, ::-1]]
    return np.vstack(points), np.vstack(tri).astype(np.int64)


def _freedom(points: np.ndarray, nx: int, ny: int) -> np.ndarray:
    """1 where a coordinate may move: not off a side, not a corner (n, 2)."""
    inside = np.column_stack([(points[:, 0] > 0) & (points[:, 0] < nx), (points[:, 1] > 0) & (points[:, 1] < ny)])
    return inside.astype(float)


def _opposite(points, nx, ny):
    """Pairs of ids on opposite sides, (k, 2): they move alike, so that a pattern can be closed into a ring."""
    pairs = []
    for axis, end in ((0, nx), (1, ny)):
        sides = [np.flatnonzero(points[:, axis] == value) for value in (0, end)]
        first, last = (side[np.argsort(points[side, 1 - axis])] for side in sides)
        if len(first) == len(last):
            pairs.append(np.column_stack([first, last]))
    return np.vstack(pairs) if pairs else np.empty((0, 2), np.int64)


def _random(points, nx, ny, jitter, seed):
    move = np.random.default_rng(seed).uniform(-jitter, jitter, points.shape) * _freedom(points, nx, ny)
    pairs = _opposite(points, nx, ny)
    move[pairs[:, 1]] = move[pairs[:, 0]]
    return move


def _move(points, triangles, nx, ny, jitter, seed):
    move = _random(points, nx, ny, jitter, seed)
    pairs = _opposite(points, nx, ny)
    least = 0.15 * signed_areas(points, triangles)
    share = np.ones(len(points))
    for _ in range(60):
        bad = signed_areas(points + share[:, None] * move, triangles) < least
        if not bad.any():
            break
        share[np.unique(triangles[bad])] *= 0.5
        share[pairs] = share[pairs].min(axis=1)[:, None]
    return points + share[:, None] * move


def _delaunay(nx, ny, jitter, seed):
    from scipy.spatial import Delaunay

    points = _cells(nx, ny, "right")[0]
    points = points + _random(points, nx, ny, jitter, seed)
    triangles = Delaunay(points).simplices.astype(np.int64)
    area = signed_areas(points, triangles)
    triangles, area = triangles[np.abs(area) > 1e-9], area[np.abs(area) > 1e-9]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    return points, triangles
