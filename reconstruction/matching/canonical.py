"""The silk paper's two-stage matching: pictures of different kinds compared in the frame of the canonical body."""

from __future__ import annotations

import numpy as np

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.landmarks import STATURE
from reconstruction.libraries import opencv
from reconstruction.matching.features import Features, detect
from reconstruction.matching.settings import MatchSettings
from reconstruction.measure.canonical import PIXELS_PER_METRE, canonical_map
from reconstruction.measure.skeleton import Skeleton

REACH = 0.12
"""Distance on the canonical body within which two pictures may show the same point, m."""
RATIO = 0.8
"""Of the nearest to the second nearest descriptor (Lowe 2004)."""


def canonical_features(rgb: np.ndarray, image: ImageKeypoints, settings: MatchSettings, stature: float = STATURE["male"]):
    """Features found on the unwarped picture.

    Parameters
    ----------
    rgb : (h, w, 3) uint8 array
    image : ImageKeypoints
        Its landmarks.
    settings : MatchSettings
    stature : float
        Of the canonical body of all pictures, m.

    Returns
    -------
    features : Features
        In canonical pixels.
    pixels : (n, 2) array
        The same points in the picture.

    Raises
    ------
    TooFewPointsError
        Too few landmarks.
    """
    way = canonical_map(image, Skeleton.canonical(stature))
    flat = way.unwarp(rgb)
    found = detect(opencv().cvtColor(flat, opencv().COLOR_RGB2GRAY), settings, flat)
    return found, way.to_picture(found.points) if len(found) else np.zeros((0, 2))


def matches(a: Features, b: Features, reach: float | None = None, ratio: float = RATIO) -> np.ndarray:
    """Mutual nearest neighbours that pass the ratio test, (m, 2) indices.

    Parameters
    ----------
    a, b : Features
    reach : float, optional
        Only neighbours so near on the canonical body count, for the ratio too, m; both must then be in canonical pixels.
    ratio : float
    """
    if len(a) < 2 or len(b) < 2:
        return np.zeros((0, 2), dtype=int)
    distance = np.sqrt(np.maximum((a.descriptors**2).sum(1)[:, None] + (b.descriptors**2).sum(1)
                                  - 2.0 * a.descriptors @ b.descriptors.T, 0.0))  # fmt: skip
    typical = float(np.median(distance))
    if reach is not None:
        far = np.linalg.norm(a.points[:, None] - b.points, axis=2) > reach * PIXELS_PER_METRE
        distance = np.where(far, np.inf, distance)
    nearest = distance.argmin(axis=1)
    best = distance[np.arange(len(a)), nearest]
    second = np.partition(distance, 1, axis=1)[:, 1]
    # a lone candidate within reach has no rival: it is compared with a typical second one, or with a typical pair
    usual = np.median(second[np.isfinite(second)]) if np.isfinite(second).any() else typical
    rival = np.where(np.isfinite(second), second, usual)
    kept = np.isfinite(best) & (best < ratio * rival) & (distance.argmin(axis=0)[nearest] == np.arange(len(a)))
    return np.stack([np.flatnonzero(kept), nearest[kept]], axis=1)
