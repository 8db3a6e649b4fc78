"""How each type of garment is worn before it is drawn to the pictures: a figure, a start, and what holds it.

A rule for every type: :func:`put_on`. What a rule assumes (a belt, hanging ends, a hat that sits level) is prior, not evidence.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from reconstruction.landmarks import INDEX
from reconstruction.measure.ellipse import perimeter
from reconstruction.shape.frame import BodyFrame, body_frame
from reconstruction.shape.landmarks3d import SpacePoints
from reconstruction.shape.mannequin import Mannequin, mannequin
from reconstruction.shape.placing import SHOULDER, folds, place_tunic
from reconstruction.shape.sewn import BACK, FRONT, Sewn, sew
from reconstruction.template.dimensions import Dimensions, HatDimensions, RibbonDimensions, TDimensions

NOBODY = np.zeros(0, dtype=int)


@dataclass(frozen=True, eq=False)
class Worn:
    """A garment put on, in the wearer's axes.

    Attributes
    ----------
    sewn : Sewn
    start : (nv, 3) array
        m.
    frame : BodyFrame
    body : Mannequin
    known : list of (vertex, (3,) place, sigma)
        Landmarks on the garment, m.
    firm : (nv,) array
        Weights that hold the start while the worst distortion goes, N/m.
    stiff : (k,) array of int
        Vertices that keep their start: crown and brim of a hat.
    belt : (k,) array of int
        Vertices under a belt.
    gathered : float
        Girth worn over girth cut, at most 1.
    reach : float
        How far the shape that landmarks and outlines give may lie from the true one, m: depths are sought so far about it.
    pinned : (k,) array of int
        Vertices that hands or pins hold when the solver settles the garment; empty: the figure carries it.
    """

    sewn: Sewn
    start: np.ndarray
    frame: BodyFrame
    body: Mannequin
    known: list[tuple[int, np.ndarray, float]]
    firm: np.ndarray
    stiff: np.ndarray = field(default_factory=lambda: NOBODY)
    belt: np.ndarray = field(default_factory=lambda: NOBODY)
    gathered: float = 1.0
    reach: float = 0.08
    pinned: np.ndarray = field(default_factory=lambda: NOBODY)


def put_on(garment: str, dimensions: Dimensions, points: SpacePoints, stature: float, edge: float) -> Worn:
    """Sew a template and put it on a figure made from the landmarks.

    Parameters
    ----------
    garment : str
    dimensions : Dimensions
    points : SpacePoints
        World, m.
    stature : float
        Of the wearer, m.
    edge : float
        Of the mesh, m.

    Raises
    ------
    InputError
        Too few landmarks for the wearer's axes, or for this type.
    """
    if isinstance(dimensions, RibbonDimensions):
        from reconstruction.shape.wearing_ribbon import put_on_ribbon

        return put_on_ribbon(dimensions, points, stature, edge)
    if isinstance(dimensions, HatDimensions):
        from reconstruction.shape.wearing_hat import put_on_hat

        return put_on_hat(dimensions, points, stature, edge)
    return _put_on_tunic(garment, dimensions, points, stature, edge)


def arms_of(lines: tuple[np.ndarray, np.ndarray], stature: float) -> Mannequin:
    """The figure whose arms lie under two folds that begin at the neckline."""
    middle = np.mean([line[min(1, len(line) - 1)][1] for line in lines])
    return mannequin(stature, tuple(line[1:] if len(line) > 2 else line for line in lines), (0.0, middle))


def _put_on_tunic(garment: str, d: TDimensions, points: SpacePoints, stature: float, edge: float) -> Worn:
    frame = body_frame(points)
    places = frame.to_body(points.points)
    lines = folds(places, d.neck_width, stature)
    body = arms_of(lines, stature)
    sewn = sew(garment, d, edge)
    belted = garment in BELTED
    return Worn(
        sewn,
        place_tunic(sewn, d, lines, body),
        frame,
        body,
        _landmarks(sewn, d, places, points.sigma, stature),
        np.where((sewn.layer < 0) & (sewn.uv[:, 1] < 1e-9), 20.0, 0.0),
        belt=_belt(sewn, d, places) if belted else NOBODY,
        gathered=gathering(d, places) if belted else 1.0,
    )


def _landmarks(sewn: Sewn, d: TDimensions, places, sigma, stature: float) -> list[tuple[int, np.ndarray, float]]:
    """Vertices of the landmarks with their places; of the waist the height on the garment is not known."""
    shoulder = SHOULDER * stature
    cuff = 0.5 * d.cross_sleeve_width
    flat = {
        "neckline": (0.5 * d.neck_width, 0.0),
        "shoulder": (shoulder, 0.0),
        "elbow": (0.5 * (shoulder + cuff), 0.0),
        "wrist": (cuff, 0.0),
        "ankle": (0.5 * d.hem_width, d.length),
    }
    out = []
    for part, (u, v) in flat.items():
        for side, sign in (("left", 1.0), ("right", -1.0)):
            k = INDEX[f"{side}_{part}"]
            if np.isfinite(places[k]).all():
                ids = {sewn.nearest((sign * u, v), layer) for layer in (FRONT, BACK)}
                out += [(vertex, places[k], float(sigma[k])) for vertex in sorted(ids)]
    return out


FLAT = 0.75
"""Depth over width of a garment about a figure that hangs without being gathered, at most (assumption)."""
BELTED = ("round-collar-robe",)
"""Types that are worn with a belt (as the robes of Tang figures are)."""
LEAST_GATHERED = 0.8
"""No more than this is believed of gathering."""


def gathering(d: TDimensions, places) -> float:
    """Girth that the waist's width allows over the girth that was cut; at most 1.

    The garment's girth at the height of the waist is twice its flat width; an ellipse as wide as the waist's landmarks are apart
    and :data:`FLAT` as deep is the most that an ungathered garment shows.
    """
    left, right = (places[INDEX[f"{side}_waist"]] for side in ("left", "right"))
    if not (np.isfinite(left).all() and np.isfinite(right).all()):
        return 1.0
    width = float(np.linalg.norm(left - right))
    down = -0.5 * (left + right)[2]
    flat = np.interp(down, [d.armhole_depth, d.length], [d.body_width, d.hem_width])
    return float(min(1.0, perimeter(width, FLAT * width) / (2 * flat)))


def _belt(sewn: Sewn, d: TDimensions, places) -> np.ndarray:
    """Vertices under a belt: those of the trunk at the height of the waist's landmarks, flat."""
    down = -0.5 * (places[INDEX["left_waist"]] + places[INDEX["right_waist"]])[2]
    wide = np.interp(sewn.uv[:, 1], [d.armhole_depth, d.length], [d.body_width, d.hem_width]) / 2
    return np.flatnonzero((np.abs(sewn.uv[:, 1] - down) < 0.02) & (np.abs(sewn.uv[:, 0]) < wide + 1e-6))
