"""Lengths of the flying ribbon and of the veil hat."""

from __future__ import annotations

import logging

import numpy as np

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import INDEX
from reconstruction.measure.frame import garment_frame, pair
from reconstruction.measure.outline import CONTOUR_SIGMA
from reconstruction.measure.quantity import Measurement
from reconstruction.measure.scale import image_scale
from reconstruction.measure.silhouette import contour, crossings, read_mask
from reconstruction.measure.spread import model_spread

log = logging.getLogger(__name__)


def smallest_rectangle(points: np.ndarray) -> tuple[float, float]:
    """Long and short side of the smallest rectangle around points (n, 2); one side lies on the convex hull."""
    from scipy.spatial import ConvexHull

    hull = points[ConvexHull(points).vertices]
    sides = np.roll(hull, -1, axis=0) - hull
    sides = sides / np.linalg.norm(sides, axis=1)[:, None]
    along = np.ptp(hull @ sides.T, axis=0)
    across = np.ptp(hull @ np.stack([-sides[:, 1], sides[:, 0]]), axis=0)
    best = int(np.argmin(along * across))
    long, short = sorted((float(along[best]), float(across[best])), reverse=True)
    return long, short


def measure_ribbon(image: ImageKeypoints) -> list[Measurement]:
    """Length and width of a ribbon from the mask of a textile laid flat.

    A worn ribbon turns and folds: neither length can be read off a figure, and nothing is returned for one (logged).
    """
    if image.kind != "textile" or image.mask is None:
        log.info("%s: a ribbon is measured on the mask of a textile laid flat only; nothing measured here", image.name)
        return []
    scale = image_scale(image)
    sides = smallest_rectangle(contour(read_mask(image.mask, image.size)))
    return [_measurement(name, length, CONTOUR_SIGMA * np.sqrt(2), scale, image, "smallest rectangle")
            for name, length in zip(("ribbon_length", "ribbon_width"), sides, strict=True)]


def measure_hat(image: ImageKeypoints) -> list[Measurement]:
    """Crown, brim and veil of a hat on a figure; round parts are seen at their diameter from any side, so there is no correction.

    A hat taken apart and laid flat as a textile shows no distance between two of its parts: nothing is returned for one (logged).
    """
    if image.kind == "textile":
        log.info("%s: a hat is measured on figures only, its parts laid flat are not; nothing measured here", image.name)
        return []
    scale = image_scale(image)
    points, found = image.points, []
    for name, part in (("crown_width", "neckline"), ("brim_width", "shoulder")):
        ends = pair(points, part)
        if ends is not None:
            sigma = float(np.hypot(*image.sigma[[INDEX[f"left_{part}"], INDEX[f"right_{part}"]]]))
            found.append(_measurement(name, float(np.linalg.norm(ends[0] - ends[1])), sigma, scale, image, "points"))
    neck, hem = pair(points, "neckline"), pair(points, "ankle")
    if neck is None:
        return found
    spread = float(np.sqrt(np.mean(image.sigma**2)))
    if hem is not None:
        drop = float(np.linalg.norm(np.mean(neck, axis=0) - np.mean(hem, axis=0)))
        found.append(_measurement("veil_length", drop, spread, scale, image, "points"))
    if image.mask is not None:
        local = garment_frame(points, image.path).coordinates(contour(read_mask(image.mask, image.size)))
        up = crossings(local, (0.0, 0.0), (0.0, -1.0))
        if len(up) and up[-1] > 0:
            sigma = float(np.hypot(spread, CONTOUR_SIGMA))
            found.append(_measurement("crown_height", float(up[-1]), sigma, scale, image, "contour"))
    return found


def _measurement(name, pixels, sigma, scale, image, method) -> Measurement:
    value = pixels * scale.metres_per_pixel
    model_sigma = model_spread(image.kind, name) * value
    return Measurement(name, value, sigma * scale.metres_per_pixel, value * scale.relative_sigma, model_sigma, image.name,
                       image.kind, f"{method}; {scale.method}")
