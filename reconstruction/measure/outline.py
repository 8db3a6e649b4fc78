"""Lengths of a T-shaped garment from its contour, in the garment's own axes."""

from __future__ import annotations

import numpy as np

from reconstruction.landmarks import INDEX
from reconstruction.measure.frame import Frame, pair
from reconstruction.measure.silhouette import between, chord, crossings

CONTOUR_SIGMA = 0.5
"""Standard deviation of a point of the contour, px (half a pixel of the mask: assumption)."""
BACK_NECK = 0.25
"""An opening shallower than this part of its width is the edge of the back, seen because the mask covers the back's inside."""
STRAIGHT = 0.01
"""The upper edge counts as a straight line if it is one to this part of its length (standard deviation)."""
SHALLOW = 0.02
"""An armpit must lie deeper than this part of the line from wrist to hem, else the sleeve has merged with the trunk."""


def lengths(points: np.ndarray, frame: Frame, polygon: np.ndarray, flat: bool) -> dict[str, float]:
    """Lengths that the contour shows, px.

    Parameters
    ----------
    points : (12, 2) array
        Landmarks, px; NaN where absent.
    frame : Frame
    polygon : (n, 2) array
        Contour, px.
    flat : bool
        A textile laid flat with its sleeves across: only then are the cuffs, cuff to cuff and the neckline's opening measured.

    Returns
    -------
    dict of str to float
        A length that cannot be seen (sleeve merged with the trunk, point absent) is left out.
    """
    if flat:
        frame = refine_frame(points, frame, polygon)
    local = frame.coordinates(polygon)
    found: dict[str, float] = {}
    hem = _hem(points, frame, local)
    if hem is not None:
        found["garment_length"], found["hem_width"] = hem
    waist = pair(points, "waist")
    if waist is not None:
        level = float(frame.coordinates(np.array(waist))[:, 1].mean())
        width = _width_near(local, level)
        if width is not None:
            found["waist_width"] = width
    corners = armpits(points, frame, polygon)
    if len(corners) == 2:
        ends = frame.coordinates(np.array(list(corners.values())))
        found["body_width"] = float(abs(ends[0, 0] - ends[1, 0]))
        found["armhole_depth"] = float(ends[:, 1].mean())
    if not flat:
        return found
    sleeves = {side: end for side in ("left", "right") if (end := sleeve_end(points, frame, polygon, side)) is not None}
    if sleeves:
        found["cuff_width"] = float(np.mean([width for _, width in sleeves.values()]))
    if len(sleeves) == 2:
        ends = frame.coordinates(np.array([middle for middle, _ in sleeves.values()]))
        found["cross_sleeve_width"] = float(abs(ends[0, 0] - ends[1, 0]))
    depth = _neck_depth(points, frame, polygon)
    neck = pair(points, "neckline")
    if depth is not None and neck is not None and depth < BACK_NECK * np.linalg.norm(neck[0] - neck[1]):
        found["back_neck_depth"] = depth
    elif depth is not None:
        found["neck_depth"] = depth
    return found


def neck_width(points: np.ndarray, frame: Frame, polygon: np.ndarray, depth: float) -> tuple[float, float] | None:
    """Opening of the neckline of a garment laid flat, and its standard deviation, px (see :func:`lengths` for the parameters).

    Its square is a quadratic in the depth both for an ellipse and for a V; one is laid through levels below the shoulder line and
    evaluated there. The standard deviation is twice that of the fit (neighbouring residuals are correlated).
    """
    return _neck_width(refine_frame(points, frame, polygon).coordinates(polygon), depth)


def refine_frame(points: np.ndarray, frame: Frame, polygon: np.ndarray) -> Frame:
    """Axes of a garment laid flat from its upper edge (the fold over the shoulders), which the contour gives better than points do.

    A line is laid by least squares through the contour between neckline and wrist on both sides, the outer tenths left out. If that
    edge is no straight line (:data:`STRAIGHT`) or the points are missing, the frame stays as it is.
    """
    pieces = []
    for side in ("left", "right"):
        neck, shoulder, wrist = (points[INDEX[f"{side}_{part}"]] for part in ("neckline", "shoulder", "wrist"))
        if not np.isfinite([neck, shoulder, wrist]).all():
            return frame
        way = frame.coordinates(between(polygon, neck, wrist, through=shoulder))
        ends = frame.coordinates(np.stack([neck, wrist]))[:, 0]
        part = (way[:, 0] - ends[0]) / (ends[1] - ends[0])
        pieces.append(way[(part > 0.1) & (part < 0.9)])
    edge = np.vstack(pieces)
    if min(len(piece) for piece in pieces) < 10:
        return frame
    slope, level = np.polyfit(edge[:, 0], edge[:, 1], 1)
    if np.std(edge[:, 1] - slope * edge[:, 0] - level) > STRAIGHT * np.ptp(edge[:, 0]):
        return frame
    across = frame.across + slope * frame.down
    across = across / np.linalg.norm(across)
    down = frame.down - slope * frame.across
    return Frame(across, down / np.linalg.norm(down), frame.origin + level * frame.down)


def armpits(points: np.ndarray, frame: Frame, polygon: np.ndarray) -> dict[str, np.ndarray]:
    """The concave corner between sleeve and trunk on each side, px.

    On the way along the contour from the wrist to the hem's corner it is the vertex farthest from the straight line between them,
    on the side of the trunk. Sides on which it is nearer than :data:`SHALLOW` of that line are left out.
    """
    found = {}
    for side in ("left", "right"):
        wrist, waist, ankle = (points[INDEX[f"{side}_{part}"]] for part in ("wrist", "waist", "ankle"))
        if not np.isfinite([wrist, waist, ankle]).all():
            continue
        way = between(polygon, wrist, ankle, through=waist)
        line = way[-1] - way[0]
        length = float(np.linalg.norm(line))
        if length == 0:
            continue
        normal = np.array([-line[1], line[0]]) / length
        normal = normal * np.sign((frame.origin - way[0]) @ normal)
        depth = (way - way[0]) @ normal
        if depth.max() > SHALLOW * length:
            found[side] = way[int(np.argmax(depth))]
    return found


def _width(local: np.ndarray, level: float) -> float | None:
    """Width of the trunk at a level (along `down`), the chord about the axis."""
    ends = chord(local, (0.0, level), (1.0, 0.0))
    return None if ends is None else ends[1] - ends[0]


def _width_near(local: np.ndarray, level: float) -> float | None:
    """Median width over seven levels around one, 6 % of the garment's height in all."""
    step = 0.01 * np.ptp(local[:, 1])
    widths = [w for k in range(-3, 4) if (w := _width(local, level + k * step)) is not None]
    return float(np.median(widths)) if len(widths) == 7 else None


def _at_end(places: np.ndarray, widths: list[float | None], end: float) -> float | None:
    """Width at the end of a piece, by a robust line (Theil and Sen) through widths measured before it."""
    from scipy.stats import theilslopes

    good = [(x, w) for x, w in zip(places, widths, strict=True) if w is not None]
    if len(good) < len(places) / 2:
        return None
    x, w = np.array(good).T
    slope, intercept, *_ = theilslopes(w, x)
    return float(intercept + slope * end)


def _hem(points: np.ndarray, frame: Frame, local: np.ndarray) -> tuple[float, float] | None:
    """Distance from the neckline to the hem (median over columns about the axis), and the hem's width."""
    down = crossings(local, (0.0, 0.0), (0.0, 1.0))
    if not len(down) or down[-1] <= 0:
        return None
    width = _width(local, 0.85 * float(down[-1]))
    if width is None:
        return None
    columns = (crossings(local, (x, 0.0), (0.0, 1.0)) for x in np.linspace(-0.35, 0.35, 15) * width)
    end = float(np.median([hits[-1] for hits in columns if len(hits)]))
    levels = np.linspace(0.6, 0.96, 25) * end
    hem = _at_end(levels, [_width(local, level) for level in levels], end)
    return None if hem is None else (end, hem)


def sleeve_end(points: np.ndarray, frame: Frame, polygon: np.ndarray, side: str) -> tuple[np.ndarray, float] | None:
    """Middle of the end of a sleeve laid flat (px) and its opening (px).

    Chords across the sleeve along the outer half of the forearm are extrapolated to the end; the end is the median of lines along
    the sleeve between the tenths of the outermost chord.

    Parameters
    ----------
    points, frame, polygon
        As for :func:`lengths`.
    side : str
        ``left`` or ``right``.
    """
    elbow, wrist = points[INDEX[f"{side}_elbow"]], points[INDEX[f"{side}_wrist"]]
    if not np.isfinite([elbow, wrist]).all():
        return None
    along = frame.across * (1 if side == "left" else -1)
    across = np.array([-along[1], along[0]])
    reach = float((wrist - elbow) @ along)
    places = np.linspace(0.5, 0.93, 15) * reach
    chords = [chord(polygon, elbow + x * (wrist - elbow) / reach, across) for x in places]
    last = next((i for i in range(len(chords) - 1, -1, -1) if chords[i] is not None), None)
    if last is None or reach <= 0:
        return None
    base, ends = elbow + places[last] * (wrist - elbow) / reach, chords[last]
    assert ends is not None
    reached = []
    for part in np.linspace(0.15, 0.85, 9):
        start = base + (ends[0] + part * (ends[1] - ends[0])) * across
        ahead = crossings(polygon, start, along)
        ahead = ahead[ahead > 0]
        if len(ahead):
            reached.append(places[last] + ahead[-1])
    if not reached:
        return None
    end = float(np.median(reached))
    width = _at_end(places, [None if c is None else c[1] - c[0] for c in chords], end)
    if width is None or width <= 0:
        return None
    return elbow + end * along + ((base - elbow) @ across + sum(ends) / 2) * across, width


def _neck_width(local: np.ndarray, depth: float) -> tuple[float, float] | None:
    levels, gaps = np.linspace(min(max(0.1, 2.0 / depth), 0.4), 0.8, 15) * depth, []
    for level in levels:
        hits = crossings(local, (0.0, level), (1.0, 0.0))
        left, right = hits[hits > 0], hits[hits < 0]
        gaps.append(left[0] - right[-1] if len(left) and len(right) else np.nan)
    gap = np.array(gaps)
    good = gap < 2 * np.nanmedian(gap) if np.isfinite(gap).any() else np.zeros(len(gap), bool)
    if good.sum() < 8:
        return None
    fitted, covariance = np.polyfit(levels[good], gap[good] ** 2, 2, cov=True)
    if fitted[-1] <= 0:
        return None
    width = float(np.sqrt(fitted[-1]))
    return width, float(np.sqrt(covariance[-1, -1]) / width)  # twice d(width) = d(width²) / (2 width)


def _neck_depth(points: np.ndarray, frame: Frame, polygon: np.ndarray) -> float | None:
    """Depth of the opening between the neckline points, if the mask is open there."""
    neck = pair(points, "neckline")
    if neck is None:
        return None
    left, right = neck
    middle = np.mean(neck, axis=0) + 0.25 * np.linalg.norm(left - right) * frame.down
    way = frame.coordinates(between(polygon, left, right, through=middle))
    span = frame.coordinates(np.array(neck))[:, 0]
    inside = way[(way[:, 0] > span.min()) & (way[:, 0] < span.max())]
    if not len(inside):
        return None
    depth = float(inside[:, 1].max())
    return depth if depth > 0.05 * abs(span[0] - span[1]) else None
