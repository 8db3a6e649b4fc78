"""The shape of the front neckline from a fitted collar edge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.measure.frame import garment_frame, pair
from reconstruction.measure.outline import BACK_NECK
from reconstruction.template.boundaries import Boundary
from reconstruction.template.dimensions import QUARTER

Shape = tuple[tuple[float, float], tuple[float, float]]
LIMITS = (0.0, 1.2)
"""A control point outside these would make a neckline that loops or bulges: the fit is then refused."""


def neckline_shape(image: ImageKeypoints, boundaries: Sequence[Boundary]) -> tuple[Shape, float] | None:
    """Inner Bézier control points of a quarter of the neckline, (across, down) over (half width, depth).

    Both halves of the ``collar`` edge are laid over each other; a cubic with fixed ends is fitted by least squares, its parameters
    projected three times.

    Returns
    -------
    (shape, rms) or None
        With the root mean square distance in units of the half width; None if there is no collar edge, it is as shallow as the
        back's, or the fit leaves :data:`LIMITS`.
    """
    collar = next((b for b in boundaries if b.name == "collar"), None)
    neck = pair(image.points, "neckline")
    if collar is None or neck is None:
        return None
    local = garment_frame(image.points, image.path).coordinates(collar.curve(np.linspace(0, 1, 201)))
    half, depth = np.ptp(local[[0, -1], 0]) / 2, local[:, 1].max()
    if depth < 2 * BACK_NECK * half:
        return None
    centre = local[[0, -1], 0].mean()
    points = np.stack([abs(local[:, 0] - centre) / half, local[:, 1] / depth], axis=1)
    points = points[(points[:, 1] > 0) & (points[:, 0] < 1)]
    angle = np.arctan2(points[:, 1], points[:, 0])
    points = points[np.argsort(angle)]
    t = np.sort(angle) / (np.pi / 2)
    ends = np.array([(1.0, 0.0), (0.0, 1.0)])
    inner = np.array(QUARTER)
    for _ in range(4):
        b = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
        inner = np.linalg.lstsq(b[:, 1:3], points - b[:, [0, 3]] @ ends, rcond=None)[0]
        t = _nearest(np.vstack([ends[:1], inner, ends[1:]]), points)
    b = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    rms = float(np.sqrt(np.mean(np.sum((b @ np.vstack([ends[:1], inner, ends[1:]]) - points) ** 2, axis=1))))
    if (inner < LIMITS[0]).any() or (inner > LIMITS[1]).any():
        return None
    (a, b0), (c, d) = inner.tolist()
    return ((a, b0), (c, d)), rms


def _nearest(control: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Parameters of the points of a cubic nearest to given ones, to 1/800."""
    from reconstruction.template.panel import bezier_points

    t = np.linspace(0, 1, 401)
    curve = bezier_points(control, t)
    return t[np.argmin(np.sum((points[:, None] - curve) ** 2, axis=-1), axis=1)]
