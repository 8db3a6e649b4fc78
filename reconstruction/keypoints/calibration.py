"""From the height of a peak to a probability: isotonic regression and logistic scaling, and how to tell whether they hold.

References
----------
Guo, Pleiss, Sun, Weinberger: On calibration of modern neural networks. ICML 2017 (temperature, expected calibration error).
Zadrozny, Elkan: Transforming classifier scores into accurate multiclass probability estimates. KDD 2002, doi:10.1145/775047.775151.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import optimize

from mfar_fem.errors import ParameterError


@dataclass(frozen=True)
class Isotonic:
    """A monotone piecewise linear map from score to probability: knots `x` (ascending) and values `y`."""

    x: tuple[float, ...]
    y: tuple[float, ...]

    def __call__(self, score: np.ndarray) -> np.ndarray:
        """Probabilities of scores of any shape; constant beyond the knots."""
        return np.interp(score, self.x, self.y)


@dataclass(frozen=True)
class Logistic:
    """1 / (1 + exp(-(slope × score + offset))): temperature scaling with a shift."""

    slope: float
    offset: float

    def __call__(self, score: np.ndarray) -> np.ndarray:
        """Probabilities of scores of any shape."""
        return 1.0 / (1.0 + np.exp(-np.clip(self.slope * np.asarray(score, float) + self.offset, -50, 50)))


def _checked(score, correct) -> tuple[np.ndarray, np.ndarray]:
    score, correct = np.asarray(score, float).ravel(), np.asarray(correct, float).ravel()
    if score.shape != correct.shape or not len(score):
        raise ParameterError(f"{len(score)} scores and {len(correct)} outcomes; as many of both are needed, at least one")
    if not np.isfinite(score).all():
        raise ParameterError("a score is not finite")
    return score, correct


def fit_isotonic(score, correct, prior: float = 1.0) -> Isotonic:
    """Monotone least squares by pooling adjacent violators; a block's value is shrunk by `prior` right and `prior` wrong outcomes.

    Without the shrinking a block at the ends says 0 or 1 from a handful of samples.
    """
    score, correct = _checked(score, correct)
    order = np.argsort(score, kind="stable")
    blocks: list[list[float]] = []  # sum, count, sum of scores
    for s, c in zip(score[order], correct[order], strict=True):
        blocks.append([c, 1.0, s])
        while len(blocks) > 1 and blocks[-2][0] * blocks[-1][1] >= blocks[-1][0] * blocks[-2][1]:
            last = blocks.pop()
            blocks[-1] = [a + b for a, b in zip(blocks[-1], last, strict=True)]
    x = np.maximum.accumulate([b[2] / b[1] for b in blocks])  # means of equal scores differ in the last digit
    y = np.maximum.accumulate([(b[0] + prior) / (b[1] + 2.0 * prior) for b in blocks])
    return Isotonic(tuple(x.tolist()), tuple(y.tolist()))


def fit_logistic(score, correct, ridge: float = 1e-3) -> Logistic:
    """Maximum likelihood with a weak ridge on the slope (separable outcomes have no finite optimum without it)."""
    score, correct = _checked(score, correct)

    def loss(p):
        z = p[0] * score + p[1]
        value = np.mean(np.logaddexp(0.0, z) - correct * z) + 0.5 * ridge * p[0] ** 2
        residual = 1.0 / (1.0 + np.exp(-np.clip(z, -50, 50))) - correct
        return value, np.array([np.mean(residual * score) + ridge * p[0], np.mean(residual)])

    slope, offset = optimize.minimize(loss, np.zeros(2), jac=True, method="BFGS").x
    return Logistic(float(slope), float(offset))


def choose(score, correct, group, folds: int = 5) -> Isotonic | Logistic:
    """The map with the smaller squared error on groups that it was not fitted to, fitted to all.

    Parameters
    ----------
    score, correct : array_like, shape (n,)
    group : array_like, shape (n,)
        What must not be torn apart (identities). Isotonic regression needs many; with few its steps are those of the sample.
    folds : int

    Returns
    -------
    Isotonic or Logistic
        The logistic one if there are not two groups to tell.
    """
    score, correct = _checked(score, correct)
    number = np.unique(np.asarray(group), return_inverse=True)[1].ravel() % folds
    error: dict[Callable[..., Isotonic | Logistic], float] = {fit_logistic: 0.0, fit_isotonic: 0.0}
    if len(np.unique(number)) > 1:
        for fold in np.unique(number):
            out = number == fold
            for fit in error:
                error[fit] += float(np.sum((fit(score[~out], correct[~out])(score[out]) - correct[out]) ** 2))
    return min(error, key=lambda fit: error[fit])(score, correct)


@dataclass(frozen=True)
class Reliability:
    """Reliability diagram: in every non-empty bin the mean confidence, the fraction that was right and the number; and the expected
    calibration error, the mean of |confidence - fraction| over the samples."""

    confidence: np.ndarray
    fraction: np.ndarray
    count: np.ndarray
    error: float


def reliability(confidence, correct, bins: int = 10) -> Reliability:
    """Bin by confidence, in equal steps of [0, 1]."""
    confidence, correct = _checked(confidence, correct)
    if confidence.min() < 0 or confidence.max() > 1:
        raise ParameterError("a confidence is outside [0, 1]")
    which = np.minimum((confidence * bins).astype(int), bins - 1)
    count = np.bincount(which, minlength=bins)
    used = count > 0
    mean = np.bincount(which, confidence, bins)[used] / count[used]
    fraction = np.bincount(which, correct, bins)[used] / count[used]
    error = float(np.sum(count[used] * np.abs(mean - fraction)) / len(confidence))
    return Reliability(mean, fraction, count[used], error)
