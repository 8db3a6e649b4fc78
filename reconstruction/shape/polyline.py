"""Points along polylines (n, k), by arc length."""

from __future__ import annotations

import itertools

import numpy as np


def lengths(line) -> np.ndarray:
    """Arc length (n,) from the start to each point."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])


def along(line: np.ndarray, s) -> np.ndarray:
    """Points (..., k) at arc lengths (...) from the start, straight on beyond the ends."""
    at, s = lengths(line), np.asarray(s, dtype=float)
    out = np.stack([np.interp(s, at, line[:, i]) for i in range(line.shape[1])], axis=-1)
    for end, before, excess in ((line[-1], line[-2], s - at[-1]), (line[0], line[1], -s)):
        out = out + np.maximum(excess, 0.0)[..., None] * (end - before) / np.linalg.norm(end - before)
    return out


def evenly(line: np.ndarray, step: float) -> np.ndarray:
    """Points evenly along a curve, no further apart than a step; an even number of pieces."""
    whole = lengths(line)[-1]
    return along(line, np.linspace(0.0, whole, 2 * max(1, int(np.ceil(0.5 * whole / step))) + 1))


def with_corners(corners, step: float) -> np.ndarray:
    """Points along a polyline, its corners among them, no further apart than a step."""
    corners = np.asarray(corners, dtype=float)
    pieces = [corners[:1]]
    for a, b in itertools.pairwise(corners):
        n = max(1, int(np.ceil(np.linalg.norm(b - a) / step - 1e-9)))
        pieces.append(a + (b - a) * np.arange(1, n + 1)[:, None] / n)
    return np.concatenate(pieces)
