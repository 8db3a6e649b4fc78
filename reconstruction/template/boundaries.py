"""Named edges of a garment in a picture (collar, cuffs, sides, hem, lapel) as B-splines along the contour."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mfar_fem.errors import InputError
from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import INDEX
from reconstruction.measure.frame import Frame, garment_frame, pair
from reconstruction.measure.outline import armpits
from reconstruction.measure.silhouette import between, contour, nearest, read_mask, stretch
from reconstruction.template.bspline import TOLERANCE, BSplineCurve, fit

CORNER_WINDOW = 0.25
"""A corner is searched on the contour within this part of the sleeve's (or hem's) length around the landmark."""


@dataclass(frozen=True)
class Boundary:
    """One edge of a garment in a picture.

    Attributes
    ----------
    name : str
        ``collar``, ``left_cuff``, ``right_cuff``, ``hem``, ``left_side``, ``right_side``, ``left_underarm``, ``right_underarm``,
        or the name of a traced curve such as ``lapel``.
    curve : BSplineCurve
        px.
    metres_per_pixel : float
    """

    name: str
    curve: BSplineCurve
    metres_per_pixel: float

    def to_dict(self) -> dict[str, Any]:
        """Fit errors in pixels and millimetres, length in metres."""
        mm = 1000 * self.metres_per_pixel
        return {
            "name": self.name, "length_m": self.curve.length() * self.metres_per_pixel, "spans": self.curve.spans,
            "rms_px": self.curve.rms, "max_px": self.curve.maximum,
            "rms_mm": self.curve.rms * mm, "max_mm": self.curve.maximum * mm,
        }


def find_boundaries(image: ImageKeypoints, metres_per_pixel: float, tolerance: float = TOLERANCE) -> list[Boundary]:
    """Fit every edge that the mask, the landmarks and the traced curves of an image give.

    Parameters
    ----------
    image : ImageKeypoints
    metres_per_pixel : float
        For the errors in millimetres.
    tolerance : float
        Of the fit, px.

    Raises
    ------
    InputError, DataFileError
        A curve cannot be fitted or the mask cannot be read.
    """
    pieces: dict[str, np.ndarray] = {}
    if image.mask is not None:
        polygon = contour(read_mask(image.mask, image.size))
        pieces |= _pieces(image.points, garment_frame(image.points, image.path, polygon), polygon)
    pieces |= {name: np.asarray(points) for name, points in image.curves.items()}
    found = []
    for name, points in pieces.items():
        try:
            found.append(Boundary(name, fit(points, tolerance), metres_per_pixel))
        except InputError as error:
            raise InputError(f"{image.path}: the edge '{name}' cannot be fitted: {error}") from error
    return found


def _pieces(points: np.ndarray, frame: Frame, polygon: np.ndarray) -> dict[str, np.ndarray]:
    """The contour cut at the neckline points, the corners of the cuffs, the armpits and the corners of the hem."""
    pieces: dict[str, np.ndarray] = {}
    neck = pair(points, "neckline")
    if neck is not None:
        middle = np.mean(neck, axis=0) + 0.25 * np.linalg.norm(neck[0] - neck[1]) * frame.down
        pieces["collar"] = between(polygon, *neck, through=middle)
    corners = {side: hem_corner(points, frame, polygon, side) for side in ("left", "right")}
    if all(corner is not None for corner in corners.values()):
        left, right = corners["left"], corners["right"]
        assert left is not None and right is not None
        pieces["hem"] = between(polygon, left, right, through=(left + right) / 2)
    pits = armpits(points, frame, polygon)
    for side in ("left", "right"):
        ends = cuff_corners(points, polygon, side)
        corner, waist = corners[side], points[INDEX[f"{side}_waist"]]
        if ends is not None:
            upper, lower = sorted(ends, key=lambda end: float((end - frame.origin) @ frame.down))
            pieces[f"{side}_cuff"] = between(polygon, upper, lower, through=(upper + lower) / 2)
            if side in pits:
                pieces[f"{side}_underarm"] = between(polygon, lower, pits[side], through=(lower + pits[side]) / 2)
        if side in pits and corner is not None:
            pieces[f"{side}_side"] = between(polygon, pits[side], corner, through=waist)
    return {name: piece for name, piece in pieces.items() if len(piece) >= 4}


def cuff_corners(points: np.ndarray, polygon: np.ndarray, side: str) -> tuple[np.ndarray, np.ndarray] | None:
    """The two corners of a sleeve's end: the contour's extreme points along (arm ± across the arm) near the wrist.

    None if one is farther from the wrist than the sleeve is long: a sleeve seen end-on has merged with the trunk.
    """
    elbow, wrist = points[INDEX[f"{side}_elbow"]], points[INDEX[f"{side}_wrist"]]
    if not np.isfinite([elbow, wrist]).all():
        return None
    along = (wrist - elbow) / np.linalg.norm(wrist - elbow)
    across = np.array([-along[1], along[0]])
    local = (polygon - wrist) @ np.stack([along, across]).T
    beyond = local[:, 0] > -0.5 * np.linalg.norm(wrist - elbow)  # the outer half of the forearm and what is beyond it
    i = nearest(polygon, wrist)
    piece = _connected(beyond, i)
    if piece is None:
        return None
    part = local[piece]
    first, second = (polygon[piece[int(np.argmax(2 * part[:, 0] + sign * part[:, 1]))]] for sign in (-1, 1))
    shoulder = points[INDEX[f"{side}_shoulder"]]
    reach = np.linalg.norm(wrist - elbow) + (np.linalg.norm(elbow - shoulder) if np.isfinite(shoulder).all() else 0.0)
    if max(np.linalg.norm(first - wrist), np.linalg.norm(second - wrist)) > reach:
        return None
    return first, second


def hem_corner(points: np.ndarray, frame: Frame, polygon: np.ndarray, side: str) -> np.ndarray | None:
    """The corner of the hem on one side: the contour's extreme point along (down and outwards), sleeves left out."""
    ankle, waist = points[INDEX[f"{side}_ankle"]], points[INDEX[f"{side}_waist"]]
    if not np.isfinite([ankle, waist]).all():
        return None
    outwards = frame.across * (1 if side == "left" else -1)
    level = (ankle - frame.origin) @ frame.down - CORNER_WINDOW * abs((ankle - waist) @ frame.down)
    below = (polygon - frame.origin) @ frame.down > level
    piece = _connected(below, nearest(polygon, ankle))
    if piece is None:
        return None
    score = (polygon[piece] - frame.origin) @ (2 * frame.down + outwards)
    return polygon[piece[int(np.argmax(score))]]


def _connected(flags: np.ndarray, start: int) -> np.ndarray | None:
    """Indices of the run of true flags of a closed polygon that contains `start`."""
    if not flags[start]:
        return None
    if flags.all():
        return np.arange(len(flags))
    off = np.flatnonzero(~flags)
    before = off[off < start]
    after = off[off > start]
    first = (before[-1] if len(before) else off[-1]) + 1
    last = (after[0] if len(after) else off[0]) - 1
    return stretch(np.arange(len(flags))[:, None], int(first % len(flags)), int(last % len(flags)))[:, 0]
