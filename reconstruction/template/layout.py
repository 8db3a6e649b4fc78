"""Where panels lie on the sheet, and the marks that every writer draws: cut line, sewing line, grain, notches, label."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction.measure.silhouette import chord, crossings, signed_area
from reconstruction.template.checks import cut_line
from reconstruction.template.panel import Panel, Pattern

GAP = 0.04
"""Distance between panels on the sheet, m."""
SHEET_WIDTH = 2.4
"""Panels are put in rows of about this width, m."""
NOTCH = 0.006
"""Length of a notch, m."""


@dataclass(frozen=True)
class Placed:
    """A panel on the sheet; everything in metres, y up.

    Attributes
    ----------
    panel : Panel
    sew, cut : (n, 2) array
        Closed polygons of the sewing line and the cut line.
    grain : (2, 2) array
        Ends of the grain arrow.
    notches : (k, 2, 2) array
        Strokes from the sewing line outwards.
    text : (2,) array
        Where the label stands: its middle below the grain arrow, or its left end beyond the arrow's head if that lies flat.
    text_height : float
        m; small enough for the label to stay inside.
    text_centred : bool
    shift : (2,) array
        From panel coordinates to the sheet.
    """

    panel: Panel
    sew: np.ndarray
    cut: np.ndarray
    grain: np.ndarray
    notches: np.ndarray
    text: np.ndarray
    text_height: float
    text_centred: bool
    shift: np.ndarray


def arrange(pattern: Pattern, width: float = SHEET_WIDTH) -> list[Placed]:
    """Put the panels in rows, in their order, lower left corner of the first row at the origin.

    Parameters
    ----------
    pattern : Pattern
    width : float
        Of the sheet, m (a wider panel has a row of its own).
    """
    placed, x, y, row = [], 0.0, 0.0, 0.0
    for panel in pattern.panels.values():
        cut = cut_line(panel)
        low, size = cut.min(axis=0), np.ptp(cut, axis=0)
        if x > 0 and x + size[0] > width:
            x, y, row = 0.0, y + row + GAP, 0.0
        placed.append(_place(panel, cut, np.array([x, y]) - low))
        x, row = x + size[0] + GAP, max(row, size[1])
    return placed


def _place(panel: Panel, cut: np.ndarray, shift: np.ndarray) -> Placed:
    sew = panel.outline() + shift
    middle = _inside(sew)
    ends = chord(sew, middle, panel.warp) or (-0.01, 0.01)
    middle, half = middle + sum(ends) / 2 * panel.warp, 0.3 * min(ends[1] - ends[0], 0.6) * panel.warp
    strokes = [np.array(notch_stroke(panel, i, part)) + shift for i, edge in enumerate(panel.edges) for part in edge.notches]
    grain = np.stack([middle - half, middle + half])
    height, centred = _label(panel, sew, grain)
    text = grain[0] - (0, 1.5 * height) if centred else grain[1] + (0.015, -0.35 * height)
    return Placed(panel, sew, cut + shift, grain, np.reshape(strokes, (-1, 2, 2)), text, height, centred, shift)


def _label(panel: Panel, sew: np.ndarray, grain: np.ndarray) -> tuple[float, bool]:
    """Height of the label's letters (about 0.6 of it wide each), and whether it stands centred below the arrow."""
    centred = abs(panel.warp[1]) > 0.5
    level = grain[0, 1] - 0.02 if centred else grain[1, 1]
    hits = crossings(sew, (0.0, level), (1.0, 0.0))
    spans = hits[: len(hits) // 2 * 2].reshape(-1, 2)
    x = grain[0, 0] if centred else grain[1, 0]
    inside = spans[(spans[:, 0] <= x) & (spans[:, 1] >= x)]
    room = 0.05 if not len(inside) else 2 * min(x - inside[0, 0], inside[0, 1] - x) if centred else inside[0, 1] - x - 0.02
    return float(np.clip(0.9 * room / (0.6 * len(panel.name)), 0.003, 0.016)), centred


def _inside(polygon: np.ndarray) -> np.ndarray:
    """A point well inside a polygon: the middle of the longest horizontal chord through the upper part or the middle."""
    low, high = polygon[:, 1].min(), polygon[:, 1].max()
    best, found = -1.0, polygon.mean(axis=0)
    for part in (0.5, 0.4, 0.6):
        level = low + part * (high - low)
        hits = crossings(polygon, (0.0, level), (1.0, 0.0))
        for a, b in hits[: len(hits) // 2 * 2].reshape(-1, 2):
            if b - a > best + 1e-9:
                best, found = b - a, np.array([(a + b) / 2, level])
    return found


def notch_stroke(panel: Panel, index: int, part: float) -> tuple[np.ndarray, np.ndarray]:
    """Both ends of a notch at a part of an edge's length, panel coordinates, m."""
    points = panel.edge_points(index)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    s = part * at[-1]
    i = min(int(np.searchsorted(at, s, side="right")) - 1, len(steps) - 1)
    direction = (points[i + 1] - points[i]) / steps[i]
    foot = points[i] + (s - at[i]) * direction
    outwards = np.sign(signed_area(panel.outline())) * np.array([direction[1], -direction[0]])
    return foot, foot + NOTCH * outwards
