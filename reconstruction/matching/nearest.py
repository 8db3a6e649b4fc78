"""Putative matches, formula (2) of the silk paper: nearest descriptors closer than tau.

tau "is set dynamically according to the descriptor distribution". Here the distances from every descriptor of A to its
*second*-nearest neighbour in B stand for the distribution of wrong matches (at most one of the two nearest can be right), and
tau is a low quantile of them. The nearest is nearer than the second: of wrong nearest neighbours the share 1 - exp(-l) passes,
where 1 - (1 + l) exp(-l) is the quantile (neighbours taken as a Poisson process): 30 % at a quantile of 0.05, 62 % at 0.25. On its
own formula (2) is therefore a weak test (see :mod:`reconstruction.matching.study`); the ratio of distances does the work.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reconstruction.libraries import opencv
from reconstruction.matching.features import Features
from reconstruction.matching.settings import MatchSettings

_KDTREE = 1  # cvflann::FLANN_INDEX_KDTREE


@dataclass(frozen=True, eq=False)
class Putative:
    """The set M_0.

    Attributes
    ----------
    index : (m, 2) int array
        Point of A, point of B.
    distance : (m,) array
        Between their descriptors.
    tau : float
        Threshold of formula (2); infinite if it is switched off, NaN without descriptors.
    """

    index: np.ndarray
    distance: np.ndarray
    tau: float

    def __len__(self) -> int:
        return len(self.index)


def putative(a: Features, b: Features, settings: MatchSettings) -> Putative:
    """Match two pictures by formula (2), the ratio of distances and mutuality, as the settings say.

    Matches between the same two places (SIFT describes one place several times, once an orientation) are counted once: the votes
    that RANSAC counts must be independent.
    """
    if len(a) < 2 or len(b) < 2:  # a second-nearest neighbour is needed
        return Putative(np.zeros((0, 2), int), np.zeros(0), float("nan"))
    index, distance = two_nearest(a.descriptors, b.descriptors, settings)
    tau = threshold(distance[:, 1], settings.quantile)
    keep = distance[:, 0] < tau
    if settings.largest_ratio < 1:
        keep &= distance[:, 0] < settings.largest_ratio * distance[:, 1]
    if settings.mutual:
        back = two_nearest(b.descriptors, a.descriptors, settings)[0][:, 0]
        keep &= back[index[:, 0]] == np.arange(len(a))
    chosen = np.flatnonzero(keep)
    chosen = chosen[np.argsort(distance[chosen, 0], kind="stable")]
    pairs = np.column_stack([chosen, index[chosen, 0]])
    places = np.rint(np.column_stack([a.points[pairs[:, 0]], b.points[pairs[:, 1]]])).astype(int)
    first = np.sort(np.unique(places, axis=0, return_index=True)[1])  # of twins the closest
    return Putative(pairs[first], distance[chosen, 0][first], tau)


def threshold(second: np.ndarray, quantile: float) -> float:
    """tau of formula (2) from the distances to the second-nearest neighbours (see the head of this module)."""
    return float("inf") if quantile >= 1 else float(np.quantile(second, quantile))


def two_nearest(queries: np.ndarray, descriptors: np.ndarray, settings: MatchSettings) -> tuple[np.ndarray, np.ndarray]:
    """Two approximate nearest neighbours by FLANN's randomised k-d trees, the same ones every time.

    Parameters
    ----------
    queries, descriptors : (n, d), (m, d) float32 array
        m at least 2.
    settings : MatchSettings
        Trees, checks and seed.

    Returns
    -------
    (n, 2) int array, (n, 2) array
        Indices and Euclidean distances, nearest first.
    """
    cv2 = opencv()
    cv2.setRNGSeed(settings.seed)  # the trees split at random dimensions drawn from OpenCV's generator
    matcher = cv2.FlannBasedMatcher({"algorithm": _KDTREE, "trees": settings.trees}, {"checks": settings.checks})
    index = np.zeros((len(queries), 2), dtype=int)
    distance = np.full((len(queries), 2), np.inf)
    for row, found in enumerate(matcher.knnMatch(np.ascontiguousarray(queries), np.ascontiguousarray(descriptors), k=2)):
        for column, match in enumerate(found):
            index[row, column], distance[row, column] = match.trainIdx, match.distance
    return index, distance


def flann_precision(queries: np.ndarray, descriptors: np.ndarray, settings: MatchSettings) -> float:
    """Share of queries whose nearest neighbour by FLANN is the true one (or as near): what the paper calls precision, measured."""
    found = two_nearest(queries, descriptors, settings)[1][:, 0]
    right = 0
    target = descriptors.astype(np.float64)
    for start in range(0, len(queries), 512):
        block = queries[start : start + 512].astype(np.float64)
        squares = (block**2).sum(1)[:, None] + (target**2).sum(1)[None] - 2 * block @ target.T
        least = np.sqrt(np.maximum(squares.min(axis=1), 0))
        right += int((found[start : start + 512] <= least + 1e-3 * np.maximum(least, 1e-6)).sum())
    return right / len(queries)
