r"""The inverse Langevin function to machine precision, and the energy of a chain of limited extension."""

from __future__ import annotations

import numpy as np

_SMALL = 0.15


def langevin(beta):
    r"""Langevin function :math:`L(\beta) = \coth\beta - 1/\beta` and its derivative, for ``beta >= 0``.

    Below 0.15 a series replaces the difference, which would lose digits.
    """
    beta = np.asarray(beta, dtype=float)
    small = beta < _SMALL
    b = np.where(small, 1.0, np.minimum(beta, 350.0))
    tanh, sinh = np.tanh(b), np.sinh(b)
    inverse = 1.0 / np.where(small, 1.0, beta)
    value = 1.0 / tanh - inverse
    slope = inverse * inverse - 1.0 / (sinh * sinh)
    if small.any():
        c = beta * beta
        series = beta * (1 / 3 - c * (1 / 45 - c * (2 / 945 - c * (1 / 4725 - c * 2 / 93555))))
        series_slope = 1 / 3 - c * (1 / 15 - c * (2 / 189 - c * (1 / 675 - c * 2 / 10395)))
        value, slope = np.where(small, series, value), np.where(small, series_slope, slope)
    return value, slope


def inverse_langevin(x):
    r"""Inverse Langevin function :math:`\beta(x)` and its derivative, for ``0 <= x < 1``.

    A rational start (maximal relative error 1.5 %) [1] and three Newton steps; the relative error is below 1e-12.

    Parameters
    ----------
    x : (n,) array
        Relative chain extension in [0, 1).

    Returns
    -------
    beta, slope : (n,) arrays

    References
    ----------
    1. R. Jedynak, "Approximation of the inverse Langevin function revisited", Rheol. Acta 54 (2015) 29–39,
       doi 10.1007/s00397-014-0802-2.
    """
    x = np.asarray(x, dtype=float)
    beta = x * (3.0 - 2.6 * x + 0.7 * x * x) / ((1.0 - x) * (1.0 + 0.1 * x))
    for _ in range(3):
        value, slope = langevin(beta)
        # Newton in 1/(1 - L), which is nearly linear in beta at both ends, so that no step overshoots
        beta = np.maximum(beta + (x - value) / slope * (1.0 - value) / (1.0 - x), 0.0)
    return beta, 1.0 / langevin(beta)[1]


def log_beta_over_sinh(beta):
    r""":math:`\ln(\beta/\sinh\beta)` without overflow or cancellation, for ``beta >= 0``."""
    beta = np.asarray(beta, dtype=float)
    small = beta < 0.2
    b = np.where(small, 1.0, beta)
    full = np.log(2.0 * b) - b - np.log1p(-np.exp(-2.0 * b))
    c = beta * beta
    series = -c * (1 / 6 - c * (1 / 180 - c * (1 / 2835 - c * (1 / 37800 - c / 467775))))
    return np.where(small, series, full)
