"""Could so many inliers come about by chance? The a-contrario test of Moisan and Stival.

Inliers alone prove nothing: any seven matches fit some fundamental matrix exactly, and a few wrong ones always lie near its lines.
"""

from __future__ import annotations

import math

import numpy as np

from reconstruction.matching.epipolar import epipolar_distance


def log10_nfa(distance: np.ndarray, sizes: tuple[tuple[int, int], tuple[int, int]], farthest: float) -> float:
    """Number of false alarms of a fundamental matrix, its decimal logarithm.

    NFA = 3 (n - 7) C(n, k) C(k, 7) (alpha d_k)^(k-7), least over k with d_k <= `farthest`: the expected number of models with k
    points as near as the k-th, d_k, if all n matches were random. alpha d is the probability of a random point to lie within d of a
    line: 2 d diagonal / area. Below 1 the model is not explained by chance (Moisan & Stival, IJCV 57 (2004) 201,
    doi:10.1023/B:VISI.0000013094.38752.54). It takes matches as independent: clusters of them on one detail make it optimistic
    (two views of the Buddha 101 degrees apart: 35 ALIKED inliers of 165 at 10^-11.7, all wrong by the cameras).

    Parameters
    ----------
    distance : (n,) array
        Distances of all putative matches to their epipolar lines, px.
    sizes : ((int, int), (int, int))
        Width and height of the two pictures, px.
    farthest : float
        Largest distance of an inlier, px.

    Returns
    -------
    float
        Large positive (chance) to very negative; infinite with fewer than 8 inliers.
    """
    n = len(distance)
    near = np.sort(distance[distance <= farthest])
    if len(near) < 8:
        return math.inf
    alpha = max(2 * math.hypot(w, h) / (w * h) for w, h in sizes)
    k = np.arange(8, len(near) + 1)
    log_choose = _log_choose(n, k) + _log_choose(k, 7)
    probability = np.minimum(alpha * np.maximum(near[7:], 0.05), 1.0)  # positions are not better than 1/20 px
    logs = math.log(3 * (n - 7)) + log_choose + (k - 7) * np.log(probability)
    return float(logs.min() / math.log(10))


def of_model(matrix: np.ndarray, first: np.ndarray, second: np.ndarray, sizes: tuple, farthest: float) -> float:
    """:func:`log10_nfa` of a fundamental matrix and all putative matches."""
    return log10_nfa(epipolar_distance(matrix, first, second), sizes, farthest)


def _log_choose(n, k) -> np.ndarray:
    from scipy.special import gammaln

    n, k = np.asarray(n, float), np.asarray(k, float)
    return gammaln(n + 1) - gammaln(k + 1) - gammaln(n - k + 1)
