"""Clamped cubic B-splines through the contour of an edge: formula (8) of the paper.

``S(t) = Σ N_{i,3}(t) P_i`` on t in [0, 1], the parameter being the chord length. The knots follow one rule: start with one span;
as long as the root mean square distance of the points from the curve exceeds the tolerance, halve every span whose own points miss
it, unless a half would hold fewer than :data:`POINTS_PER_SPAN` points. The ends (or for a closed curve nothing) are interpolated.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError

DEGREE = 3
TOLERANCE = 0.35
"""Root mean square distance at which knots are no longer added, px."""
POINTS_PER_SPAN = 6
"""Fewest points in a span, so that noise is not followed."""
MAX_SPANS = 64


@dataclass(frozen=True)
class BSplineCurve:
    """A clamped (or closed periodic) cubic B-spline in the plane.

    Attributes
    ----------
    knots : (n + 4,) array
        Clamped: 0 and 1 four times each.
    control : (n, 2) array
        Control points P_i.
    closed : bool
        The curve is periodic in value, slope and curvature at its (arbitrary) start.
    rms, maximum : float
        Distance of the fitted points from the curve at their parameters, in the unit of the points.
    """

    knots: np.ndarray
    control: np.ndarray
    closed: bool = False
    rms: float = 0.0
    maximum: float = 0.0

    def __call__(self, t) -> np.ndarray:
        """Points (..., 2) at parameters in [0, 1]."""
        from scipy.interpolate import BSpline

        return np.asarray(BSpline(self.knots, self.control, DEGREE)(np.asarray(t, dtype=float)))

    @property
    def spans(self) -> int:
        """Number of polynomial pieces."""
        return len(np.unique(self.knots[(self.knots >= 0) & (self.knots <= 1)])) - 1

    def length(self) -> float:
        """Arc length by Gauss's rule with eight points a span."""
        from scipy.interpolate import BSpline

        breaks = np.unique(self.knots[(self.knots >= 0) & (self.knots <= 1)])
        nodes, weights = np.polynomial.legendre.leggauss(8)
        half = np.diff(breaks) / 2
        t = (breaks[:-1] + half)[:, None] + half[:, None] * nodes
        speed = np.linalg.norm(BSpline(self.knots, self.control, DEGREE).derivative()(t), axis=-1)
        return float(np.sum(speed * weights * half[:, None]))

    def bezier(self) -> np.ndarray:
        """The same curve as cubic Bézier pieces, (spans, 4, 2) (exact)."""
        from scipy.interpolate import BSpline

        breaks = np.unique(self.knots[(self.knots >= 0) & (self.knots <= 1)])
        spline = BSpline(self.knots, self.control, DEGREE)
        slope = spline.derivative()
        a, b, h = spline(breaks[:-1]), spline(breaks[1:]), np.diff(breaks)[:, None] / 3
        return np.stack([a, a + h * slope(breaks[:-1]), b - h * slope(breaks[1:]), b], axis=1)


def basis(knots: np.ndarray, t) -> np.ndarray:
    """Basis functions N_{i,3}(t).

    Parameters
    ----------
    knots : (n + 4,) array
    t : (m,) array
        Parameters inside the base interval ``knots[3] .. knots[-4]``.

    Returns
    -------
    (m, n) array
    """
    from scipy.interpolate import BSpline

    return BSpline.design_matrix(np.atleast_1d(np.asarray(t, dtype=float)), knots, DEGREE).toarray()


def clamped_knots(breaks) -> np.ndarray:
    """Knots of a clamped cubic spline with the given breaks (first and last are the ends)."""
    breaks = np.asarray(breaks, dtype=float)
    return np.concatenate([np.repeat(breaks[0], DEGREE), breaks, np.repeat(breaks[-1], DEGREE)])


def chord_parameters(points: np.ndarray, closed: bool = False) -> np.ndarray:
    """Chord-length parameters in [0, 1] (closed: the last point's is below 1)."""
    loop = np.vstack([points, points[:1]]) if closed else points
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(loop, axis=0), axis=1))])
    return (s / s[-1])[: len(points)]


def fit(points, tolerance: float = TOLERANCE, closed: bool = False, max_spans: int = MAX_SPANS) -> BSplineCurve:
    """Least-squares B-spline along points, knots by the rule of the module.

    Parameters
    ----------
    points : (m, 2) array
        In order along the edge.
    tolerance : float
        In the unit of the points.
    closed : bool
        The last point is joined to the first; otherwise the curve passes through both end points.
    max_spans : int

    Raises
    ------
    InputError
        Fewer than two different points (closed: eight).
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 2 or not np.isfinite(points).all():
        raise InputError(f"a curve needs finite points (m, 2), not {points.shape}")
    keep = np.concatenate([[True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-12])
    points = points[keep]
    fewest = 8 if closed else 2
    if len(points) < fewest:
        raise InputError(f"a {'closed' if closed else 'open'} curve needs at least {fewest} different points, not {len(points)}")
    if not closed and len(points) < 4:  # resample the polyline: a straight or bent line through two or three points
        t = chord_parameters(points)
        fine = np.union1d(np.linspace(0, 1, 7), t)
        points = np.stack([np.interp(fine, t, points[:, k]) for k in range(2)], axis=1)
    t = chord_parameters(points, closed)
    breaks = np.linspace(0, 1, 5) if closed else np.array([0.0, 1.0])
    while True:
        curve = _periodic(t, points, breaks) if closed else _clamped(t, points, breaks)
        miss = np.sum((curve(t) - points) ** 2, axis=1)
        if np.sqrt(miss.mean()) <= tolerance:
            break
        new = _halves(t, miss, breaks, tolerance)
        if not len(new) or len(breaks) - 1 + len(new) > max_spans:
            break
        breaks = np.union1d(breaks, new)
    return BSplineCurve(curve.knots, curve.control, closed, float(np.sqrt(miss.mean())), float(np.sqrt(miss.max())))


def _halves(t: np.ndarray, miss: np.ndarray, breaks: np.ndarray, tolerance: float) -> np.ndarray:
    """Middles of the spans that miss the tolerance and whose halves still hold enough points."""
    found = []
    for a, b in itertools.pairwise(breaks):
        inside = (t >= a) & (t <= b)
        middle = (a + b) / 2
        enough = min(np.sum(inside & (t < middle)), np.sum(inside & (t >= middle))) >= POINTS_PER_SPAN
        if enough and miss[inside].mean() > tolerance**2:
            found.append(middle)
    return np.array(found)


def _clamped(t: np.ndarray, points: np.ndarray, breaks: np.ndarray) -> BSplineCurve:
    """Least squares with both ends interpolated: the first and last control points are the end points."""
    knots = clamped_knots(breaks)
    matrix = basis(knots, t)
    control = np.empty((matrix.shape[1], 2))
    control[0], control[-1] = points[0], points[-1]
    rest = points - matrix[:, :1] * points[0] - matrix[:, -1:] * points[-1]
    control[1:-1] = np.linalg.lstsq(matrix[:, 1:-1], rest, rcond=None)[0]
    return BSplineCurve(knots, control)


def _periodic(t: np.ndarray, points: np.ndarray, breaks: np.ndarray) -> BSplineCurve:
    """Least squares with a periodic basis: the last three control points repeat the first three."""
    step = np.concatenate([breaks[-4:-1] - 1, breaks, breaks[1:4] + 1])
    matrix = basis(step, t)
    n = matrix.shape[1] - DEGREE
    folded = matrix[:, :n].copy()
    folded[:, :DEGREE] += matrix[:, n:]
    control = np.linalg.lstsq(folded, points, rcond=None)[0]
    return BSplineCurve(step, np.vstack([control, control[:DEGREE]]), True)
