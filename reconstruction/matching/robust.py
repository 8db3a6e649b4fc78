"""Robust models of a set of putative matches: fundamental matrix (formula (3) of the silk paper) and homography."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction.libraries import opencv
from reconstruction.matching.epipolar import epipolar_distance, refined, transfer_distance
from reconstruction.matching.settings import MatchSettings


@dataclass(frozen=True, eq=False)
class Model:
    """A model and the matches that it explains.

    Attributes
    ----------
    matrix : (3, 3) array
        Fundamental matrix (x_B' F x_A = 0) or homography (x_B ~ H x_A).
    inliers : (m,) bool array
        Within the threshold.
    """

    matrix: np.ndarray
    inliers: np.ndarray


def fundamental_matrix(first: np.ndarray, second: np.ndarray, settings: MatchSettings) -> Model | None:
    """The fundamental matrix with the most inliers, refined on them; None if no sample gives one.

    Inliers lie within ``settings.threshold`` pixels of their epipolar line in both pictures. What OpenCV returns rests on few of
    them; twice it is refined on all (:func:`reconstruction.matching.epipolar.refined`) and kept unless it loses one in twenty.

    Parameters
    ----------
    first, second : (m, 2) array
        Putative matches, px; at least 8.
    """
    cv2 = opencv()
    cv2.setRNGSeed(settings.seed)
    method = cv2.USAC_MAGSAC if settings.estimator == "magsac" else cv2.FM_RANSAC
    try:
        matrix, _ = cv2.findFundamentalMat(np.ascontiguousarray(first), np.ascontiguousarray(second), method, settings.threshold,
                                           settings.confidence, settings.iterations)  # fmt: skip
    except cv2.error:  # MAGSAC asserts on some degenerate sets
        return None
    if matrix is None or matrix.shape != (3, 3) or not np.isfinite(matrix).all() or not matrix.any():
        return None
    best = _with_inliers(matrix / np.linalg.norm(matrix), first, second, settings.threshold)
    for _ in range(2):
        chosen = best.inliers
        if chosen.sum() < 9:
            break
        better = _with_inliers(refined(best.matrix, first[chosen], second[chosen]), first, second, settings.threshold)
        if not np.isfinite(better.matrix).all() or better.inliers.sum() < 0.95 * chosen.sum():
            break
        best = better
    return best


def _with_inliers(matrix: np.ndarray, first: np.ndarray, second: np.ndarray, threshold: float) -> Model:
    return Model(matrix, epipolar_distance(matrix, first, second) <= threshold)


def homography(first: np.ndarray, second: np.ndarray, settings: MatchSettings) -> Model | None:
    """The homography with the most inliers (symmetric transfer error within the threshold); None if there is none."""
    if len(first) < 4:
        return None
    cv2 = opencv()
    cv2.setRNGSeed(settings.seed)
    method = cv2.USAC_MAGSAC if settings.estimator == "magsac" else cv2.RANSAC
    try:
        matrix, _ = cv2.findHomography(np.ascontiguousarray(first), np.ascontiguousarray(second), method, settings.threshold,
                                       maxIters=settings.iterations, confidence=settings.confidence)  # fmt: skip
    except cv2.error:
        return None
    if matrix is None or matrix.shape != (3, 3) or not np.isfinite(matrix).all() or abs(np.linalg.det(matrix)) < 1e-12:
        return None
    return Model(matrix, transfer_distance(matrix, first, second) <= settings.threshold)
