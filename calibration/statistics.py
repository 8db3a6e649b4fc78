"""How well the data determine the parameters: covariance, correlation, intervals, information criteria.

The linear statistics assume independent residuals of one variance. Curve residuals of a law that does not fit perfectly
are correlated along the curve, so `autocorrelation` is reported with them: where it is high these intervals are too
narrow and the profile and the block bootstrap are the ones to read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from calibration.fit import Fit
from calibration.problem import Problem

STRONG_CORRELATION = 0.95


@dataclass(frozen=True, eq=False)
class Linear:
    """Linearised statistics of a fit.

    Attributes
    ----------
    names : tuple of str
    variance : float
        Residual variance s² = sum r² / (n - p).
    covariance : ndarray, shape (p, p)
        Of the fit's coordinates q (ln theta for log-scaled parameters); entries of undetermined directions are inf.
    correlation : ndarray, shape (p, p)
    condition : float
        Of the Jacobian with columns scaled to length 1; inf if it is rank deficient.
    rank : int
    intervals : dict of str to (low, high)
        t-intervals at `level`, in SI; symmetric in q. Not cut at the bounds.
    level : float
    autocorrelation : dict of str to float
        Lag-1 correlation of the residuals along every curve.
    """

    names: tuple[str, ...]
    variance: float
    covariance: np.ndarray
    correlation: np.ndarray
    condition: float
    rank: int
    intervals: dict[str, tuple[float, float]]
    level: float
    autocorrelation: dict[str, float]

    def strong_pairs(self, limit: float = STRONG_CORRELATION) -> list[tuple[str, str, float]]:
        """Pairs correlated more strongly than `limit`, the strongest first."""
        p = len(self.names)
        pairs = [(self.names[i], self.names[j], float(self.correlation[i, j])) for i in range(p) for j in range(i)]
        return sorted((x for x in pairs if abs(x[2]) > limit), key=lambda x: -abs(x[2]))


def linear_statistics(f: Fit, confidence: float = 0.95) -> Linear:
    """Covariance, correlation, condition and t-intervals from the Jacobian at the optimum."""
    from scipy.stats import t as student

    n, p = f.jacobian.shape
    s2 = f.ssr / max(n - p, 1)
    length = np.linalg.norm(f.jacobian, axis=0)
    scaled = f.jacobian / np.where(length > 0, length, 1.0)
    _, sv, vt = np.linalg.svd(scaled, full_matrices=False)
    rank = int((sv > sv[0] * max(n, p) * np.finfo(float).eps).sum()) if sv[0] > 0 else 0
    condition = float(sv[0] / sv[-1]) if rank == p else math.inf
    if rank == p and (length > 0).all():
        inverse = (vt.T / sv**2) @ vt
        covariance = s2 * inverse / np.outer(length, length)
        sd = np.sqrt(np.diag(covariance))
        unit = np.sqrt(np.diag(inverse))  # correlation from the scaled inverse: also for a perfect fit
        correlation = inverse / np.outer(unit, unit)
        half = student.ppf(0.5 + 0.5 * confidence, n - p) * sd
    else:
        covariance, half = np.full((p, p), np.inf), np.full(p, np.inf)
        correlation = np.where(np.eye(p, dtype=bool), 1.0, np.nan)
    return Linear(
        names=f.problem.names,
        variance=float(s2),
        covariance=covariance,
        correlation=correlation,
        condition=condition,
        rank=rank,
        intervals={u.name: _interval(u, q, h) for u, q, h in zip(f.problem.unknowns, f.q, half, strict=True)},
        level=confidence,
        autocorrelation=autocorrelation(f.problem, f.residuals),
    )


def _interval(u, q: float, half: float) -> tuple[float, float]:
    if u.scale == "log":
        with np.errstate(over="ignore"):
            return float(np.exp(q - half)), float(np.exp(q + half))
    return float(q - half), float(q + half)


def autocorrelation(problem: Problem, residuals: np.ndarray) -> dict[str, float]:
    """Lag-1 correlation of the residuals along every curve (0 where there are fewer than 4 readings)."""
    out = {}
    for e, part in zip(problem.experiments, problem.slices, strict=True):
        r = residuals[part] - residuals[part].mean()
        total = float(r @ r)
        out[e.name] = float(r[1:] @ r[:-1]) / total if r.size > 3 and total > 0 else 0.0
    return out


def information_criteria(ssr: float, n: int, p: int) -> dict[str, float]:
    """AIC, AICc and BIC of a least-squares fit with n readings and p parameters (Gaussian errors of unknown variance).

    The variance counts as a parameter: k = p + 1; ``AIC = n ln(ssr/n) + 2k``, ``AICc = AIC + 2k(k+1)/(n-k-1)``,
    ``BIC = n ln(ssr/n) + k ln n``. Burnham & Anderson, Model Selection and Multimodel Inference, 2nd ed. (2002),
    section 2.4, doi 10.1007/b97636. AICc is inf where n <= k + 1. Only differences on the same data mean anything.
    """
    k = p + 1
    base = n * math.log(max(ssr, np.finfo(float).tiny) / n)
    aic = base + 2 * k
    aicc = aic + 2 * k * (k + 1) / (n - k - 1) if n > k + 1 else math.inf
    return {"aic": aic, "aicc": aicc, "bic": base + k * math.log(n)}


def fit_criteria(f: Fit) -> dict[str, float]:
    """Information criteria of a fit."""
    return information_criteria(f.ssr, f.problem.size, len(f.q))
