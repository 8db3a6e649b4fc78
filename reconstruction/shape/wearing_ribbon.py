"""A ribbon (shawl) across the back, over both shoulders and arms to the hands; what is left of it hangs from them."""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX
from reconstruction.shape.frame import body_frame
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.placing import folds
from reconstruction.shape.polyline import along, lengths
from reconstruction.shape.sewn import sew
from reconstruction.shape.wearing import Worn, arms_of
from reconstruction.template.dimensions import RibbonDimensions

NECK = 0.14
"""Breadth of a neck, m: where a neckline is not known (assumption)."""
REACH = 0.16
"""A strip that hangs free is less certain than what lies about a figure, m."""
SLACK = 1.05
"""Cloth between shoulder and hand over their distance (assumption)."""


def put_on_ribbon(d: RibbonDimensions, points: SpacePoints, stature: float, edge: float) -> Worn:
    """Lay a strip along the landmarks of its upper edge.

    Raises
    ------
    InputError
        The strip is too short for the points it is to reach.
    """
    sewn = sew("flying-ribbon", d, edge)
    frame = body_frame(points)
    places = frame.to_body(points.points)
    lines = folds(places, NECK, stature)
    body = arms_of(lines, stature)
    u, v = sewn.uv[:, 0], sewn.uv[:, 1] + 0.5 * d.width  # from the upper edge down
    start, known, pinned = np.zeros((len(u), 3)), [], []
    for side, line in zip((1.0, -1.0), lines, strict=True):
        mine = side * u >= 0
        stations = _stations(line)
        if stations[-1] > 0.5 * d.length:
            raise InputError(
                f"a ribbon {d.length:.2f} m long does not reach from the nape to the hand and back: its points need "
                f"{2 * stations[-1]:.2f} m; check its scale and points"
            )
        s = np.abs(u[mine])
        start[mine] = _laid(line, stations, s, v[mine], side, d.width)
        name = "left" if side > 0 else "right"
        for part, at in (*zip(("neckline", "shoulder", "elbow", "wrist")[-len(line) :], stations, strict=True),
                         ("ankle", 0.5 * d.length)):  # fmt: skip
            k = INDEX[f"{name}_{part}"]
            if np.isfinite(places[k]).all():
                vertex = sewn.nearest((side * at, (0.5 if part == "ankle" else -0.5) * d.width))
                known.append((vertex, places[k], float(points.sigma[k])))
                if part in ("shoulder", "wrist"):
                    pinned.append(vertex)
    for _ in range(3):
        depth = body.distance(start) - 5e-3
        inside = depth < 0
        start[inside] -= depth[inside, None] * body.outwards(start[inside])
    firm = np.where(v < 1e-9, 20.0, 0.0)
    return Worn(sewn, start, frame, body, known, firm, reach=REACH, pinned=np.unique(pinned).astype(int))


def _stations(line: np.ndarray) -> np.ndarray:
    """Cloth from the nape along the upper edge to each point of a side's line, m."""
    step = lengths(line)
    slack = np.where(np.arange(len(line)) >= len(line) - 2, SLACK, 1.0)  # beyond the shoulder
    return abs(line[0, 0]) + np.concatenate([[0.0], np.cumsum(np.diff(step) * slack[1:])])


def _laid(line, stations, s, v, side: float, width: float) -> np.ndarray:
    """Places (n, 3) of points s along and v below the upper edge of one side."""
    at = np.interp(s, [0.0, *stations], [0.0, *(abs(line[0, 0]) + lengths(line))])
    top = along(np.concatenate([[line[0] * (0, 1, 1)], line]), at)
    end = s - stations[-1]
    hanging = end > 0
    top[hanging] = line[-1] - np.maximum(end[hanging], 0.0)[:, None] * np.array([0.0, 0.0, 1.0])
    # down on the back and along the arm; on the hanging end across it, towards the body
    turn = np.clip(0.5 + end / width, 0.0, 1.0) * np.pi / 2
    down = np.stack([-side * np.sin(turn), np.full(len(s), 0.35), -np.cos(turn)], axis=1)
    down /= np.linalg.norm(down, axis=1)[:, None]
    return top + v[:, None] * down
