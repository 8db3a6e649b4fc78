"""What style alignment does to matching across kinds, scored by a known homography: correct, not merely consistent.

References
----------
Lowe: Distinctive image features from scale-invariant keypoints. IJCV 60 (2004) 91, doi:10.1023/B:VISI.0000029664.99615.94.
Hartley, Zisserman: Multiple view geometry in computer vision, 2nd ed., Cambridge 2004, chapter 4 (homographies by RANSAC).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reconstruction.libraries import opencv

Matcher = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""``matcher(image_a, image_b)``: points (n, 2) in A and in B that it takes for the same; pixels, centre of the first at (0, 0)."""


@dataclass(frozen=True)
class MatchScore:
    """Matches of one pair of pictures against the truth.

    Attributes
    ----------
    proposed, correct : int
        Matches, and those within the tolerance of the true place.
    inliers, correct_inliers : int
        Those that agree with the estimated homography (self-consistent), and how many of them are correct.
    corner_error : float
        Largest distance of the estimated from the true image of a corner of A, px; infinite if nothing was estimated.
    """

    proposed: int
    correct: int
    inliers: int
    correct_inliers: int
    corner_error: float

    @property
    def precision(self) -> float:
        """Share of the matches that is correct; 0 without matches."""
        return self.correct / self.proposed if self.proposed else 0.0

    def registered(self, limit: float = 10.0) -> bool:
        """Whether the estimated homography is right to `limit` px at every corner."""
        return self.corner_error <= limit


def sift_matches(image_a: np.ndarray, image_b: np.ndarray, ratio: float = 0.8) -> tuple[np.ndarray, np.ndarray]:
    """SIFT (contrast threshold 0.03, edge threshold 10) with mutual nearest neighbours and Lowe's ratio (see :data:`Matcher`).

    Raises
    ------
    MissingDependencyError
        OpenCV is not installed.
    """
    cv2 = opencv()
    sift = cv2.SIFT_create(contrastThreshold=0.03, edgeThreshold=10)
    (points_a, a), (points_b, b) = (sift.detectAndCompute(cv2.cvtColor(x, cv2.COLOR_RGB2GRAY), None) for x in (image_a, image_b))
    if a is None or b is None or len(a) < 2 or len(b) < 2:
        return np.empty((0, 2)), np.empty((0, 2))
    square = (a**2).sum(1)[:, None] + (b**2).sum(1) - 2.0 * a @ b.T
    distance = np.sqrt(np.maximum(square, 0))
    nearest = distance.argmin(1)
    two = np.partition(distance, 1, axis=1)[:, :2]
    kept = (two[:, 0] < ratio * two[:, 1]) & (distance.argmin(0)[nearest] == np.arange(len(a)))
    places = [np.array([p.pt for p in points]) for points in (points_a, points_b)]
    return places[0][kept], places[1][nearest[kept]]


def score(image_a: np.ndarray, image_b: np.ndarray, homography: np.ndarray, matcher: Matcher = sift_matches,
          tolerance: float = 3.5, seed: int = 0) -> MatchScore:
    """Match two pictures and compare with the truth.

    Parameters
    ----------
    image_a, image_b : (h, w, 3) uint8 arrays
    homography : (3, 3) array
        True map from pixels of A to pixels of B.
    matcher : callable
        See :data:`Matcher`.
    tolerance : float
        Of RANSAC and of "correct", px (the paper: 3.5).
    seed : int
        Of RANSAC.
    """
    a, b = matcher(image_a, image_b)
    right = np.linalg.norm(transform(homography, a) - b, axis=1) <= tolerance if len(a) else np.zeros(0, dtype=bool)
    if len(a) < 4:
        return MatchScore(len(a), int(right.sum()), 0, 0, np.inf)
    cv2 = opencv()
    cv2.setRNGSeed(seed)
    estimate, mask = cv2.findHomography(a.reshape(-1, 1, 2), b.reshape(-1, 1, 2), cv2.RANSAC, tolerance, maxIters=5000)
    if estimate is None:
        return MatchScore(len(a), int(right.sum()), 0, 0, np.inf)
    inlier = mask.ravel().astype(bool)
    height, width = image_a.shape[:2]
    corners = np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]], dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.linalg.norm(transform(estimate, corners) - transform(homography, corners), axis=1).max()
    return MatchScore(len(a), int(right.sum()), int(inlier.sum()), int((inlier & right).sum()),
                      float(error) if np.isfinite(error) else np.inf)


def transform(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Images (n, 2) of points (n, 2) under a homography."""
    moved = np.column_stack([points, np.ones(len(points))]) @ np.asarray(homography).T
    return moved[:, :2] / moved[:, 2:]

