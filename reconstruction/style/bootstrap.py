"""Percentile intervals by resampling whole scenes, because pairs of one scene are not independent.

Reference: Efron, Tibshirani: An introduction to the bootstrap. Chapman & Hall 1993, chapters 8 (clusters) and 13 (percentiles).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Interval:
    """An estimate with the bounds of its 95 % interval."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3g} [{self.low:.3g}, {self.high:.3g}]"


def ratio_interval(numerator: np.ndarray, denominator: np.ndarray, groups: np.ndarray, rounds: int = 2000,
                   seed: int = 0) -> Interval:
    """Interval of Σ numerator / Σ denominator over resampled groups; a mean if the denominator is all ones.

    Parameters
    ----------
    numerator, denominator : (n,) arrays
    groups : (n,) array
        Which observations are drawn together.
    rounds, seed : int

    Returns
    -------
    Interval
        NaN if the denominators sum to zero.
    """
    _, index = np.unique(groups, return_inverse=True)
    count = int(index.max()) + 1
    top, bottom = np.bincount(index, numerator, count), np.bincount(index, denominator, count)
    if bottom.sum() <= 0:
        return Interval(np.nan, np.nan, np.nan)
    drawn = np.random.default_rng(seed).integers(count, size=(rounds, count))
    below = bottom[drawn].sum(1)
    values = top[drawn].sum(1)[below > 0] / below[below > 0]
    low, high = np.quantile(values, [0.025, 0.975])
    return Interval(float(top.sum() / bottom.sum()), float(low), float(high))


def mean_interval(values: np.ndarray, groups: np.ndarray, rounds: int = 2000, seed: int = 0) -> Interval:
    """Interval of a mean; of paired differences give the differences (see :func:`ratio_interval`)."""
    values = np.asarray(values, dtype=float)
    return ratio_interval(values, np.ones(len(values)), groups, rounds, seed)
