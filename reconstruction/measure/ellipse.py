"""From the width of a body that is seen to the flat width of the cloth around it, by the assumption of an elliptic section."""

from __future__ import annotations

import math

DEPTH_RATIO, DEPTH_RATIO_SIGMA = 0.7, 0.1
"""Depth over width of a clothed trunk and its spread: an assumption (a circle is 1, two layers laid flat are 0)."""


def perimeter(width: float, depth: float) -> float:
    """Perimeter of an ellipse with full axes `width` and `depth`.

    Ramanujan's second approximation, Modular equations and approximations to π, Q. J. Math. 45 (1914) 350-372; its relative
    error is below 4e-4 down to the flat ellipse and below 2e-7 for ratios above 0.3.
    """
    a, b = width / 2, depth / 2
    if a + b == 0:
        return 0.0
    h = ((a - b) / (a + b)) ** 2
    return math.pi * (a + b) * (1 + 3 * h / (10 + math.sqrt(4 - 3 * h)))


def flat_factor(ratio: float = DEPTH_RATIO) -> float:
    """Flat width (half the perimeter) over the width seen from the front, for a ratio of depth to width."""
    return perimeter(1.0, ratio) / 2


def flat_factor_sigma(ratio: float = DEPTH_RATIO, sigma: float = DEPTH_RATIO_SIGMA) -> float:
    """Standard deviation of :func:`flat_factor` for that of the ratio (central difference)."""
    return abs(flat_factor(ratio + sigma) - flat_factor(ratio - sigma)) / 2
