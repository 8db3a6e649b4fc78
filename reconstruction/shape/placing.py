"""Where a sewn pattern is put before it hangs."""

from __future__ import annotations

import numpy as np

from reconstruction.landmarks import INDEX
from reconstruction.shape.mannequin import Mannequin
from reconstruction.shape.polyline import along
from reconstruction.shape.sewn import BACK, FRONT, Sewn
from reconstruction.template.dimensions import TDimensions

SHOULDER = 0.122
"""Shoulder point from the middle along the fold, over the stature (half the biacromial breadth, Drillis & Contini 1966)."""


def folds(points, neck_width: float, stature: float) -> tuple[np.ndarray, np.ndarray]:
    """The lines from the neckline along the top of both sleeves, (n, 3), m, from landmarks (12, 3) in the wearer's axes.

    Missing points are mirrored from the other side, or put where a spread arm would have them.
    """
    points = np.asarray(points, dtype=float)
    lines = []
    for side, other, sign in (("left", "right", 1.0), ("right", "left", -1.0)):
        found = []
        for part in ("neckline", "shoulder", "elbow", "wrist"):
            p, q = points[INDEX[f"{side}_{part}"]], points[INDEX[f"{other}_{part}"]]
            if np.isfinite(p).all():
                found.append(p)
            elif np.isfinite(q).all():
                found.append(q * (-1, 1, 1))
        if len(found) < 2:
            found = [np.array([sign * 0.5 * neck_width, 0.0, 0.0]), np.array([sign * SHOULDER * stature, 0.0, -0.03])]
        lines.append(np.array(found))
    return lines[0], lines[1]


def place_tunic(sewn: Sewn, d: TDimensions, lines: tuple[np.ndarray, np.ndarray], body: Mannequin) -> np.ndarray:
    """Vertices (nv, 3), m, of a garment with sleeves around a figure: folds on the arms, both layers down from them."""
    u, v = sewn.uv.T
    out = np.zeros((len(u), 3))
    for side, line in zip((1.0, -1.0), lines, strict=True):
        mine = side * u >= 0
        s = np.abs(u[mine]) - 0.5 * d.neck_width
        top = along(line, np.maximum(s, 0.0))
        step = 1e-3
        direction = (along(line, np.maximum(s, 0.0) + step) - top) / step
        middle = np.minimum(s, 0.0)  # between the ends of the neckline
        top[:, 0] += side * middle
        direction[s < 0] = (side, 0.0, 0.0)
        blend = np.clip((np.abs(u[mine]) - 0.35 * d.body_width) / (0.3 * d.body_width), 0, 1)[:, None]
        down = np.array([0.0, 0.0, -1.0])
        square = down - direction * (direction @ down)[:, None]
        square /= np.maximum(np.linalg.norm(square, axis=1), 0.2)[:, None]
        down = (1 - blend) * down + blend * square
        down /= np.linalg.norm(down, axis=1)[:, None]
        out[mine] = top + v[mine, None] * down
    away = np.where(sewn.layer == FRONT, -1.0, np.where(sewn.layer == BACK, 1.0, 0.0))
    thick = 0.03 + 0.09 * np.clip(1 - (np.abs(u) - 0.3 * d.body_width) / (0.4 * d.body_width), 0, 1)
    out[:, 1] += away * thick * np.sqrt(np.clip(v / 0.12, 0, 1))
    for _ in range(3):
        depth = body.distance(out) - 5e-3
        inside = depth < 0
        out[inside] -= depth[inside, None] * body.outwards(out[inside])
    return out
