r"""The heart loop (ASTM D1388 option B): a strip whose two ends are clamped together and that hangs by them.

The ends leave the clamp upwards, side by side, and the loop falls over on both sides: the shape of a heart. Half of
it, of length S = L / 2, from the clamp (heading straight up) to the lowest point (heading back to the middle), with
heading :math:`\varphi(s)` and an unknown horizontal force H in the lowest section:

.. math:: B\,\varphi'' = w\,(S - s)\cos\varphi + H \sin\varphi, \quad \varphi(0) = \pi/2, \quad \varphi(S) = -\pi,
          \quad \int_0^S \cos\varphi\, ds = 0 .

Inextensible, weight w by area (N/m²), rigidity B by width (N m); solved by Chebyshev collocation, which converges to
rounding. The standard reads the distance l from the clamp to the lowest point and takes (F. T. Peirce, J. Text. Inst.
21, T377, 1930, doi:10.1080/19447023008661529; ASTM D1388 option B)

.. math:: l_0 = 0.1337\,L, \quad d = l - l_0, \quad \theta = 32.85^\circ\, d / l_0, \quad
          c = l_0\, (\cos\theta / \tan\theta)^{1/3}.

What that costs is tabulated by `formula_error`: for c / L between 0.06 and 0.31 c comes out too large by up to 4.1 %
(B by 12.8 %, at c / L = 0.139), for stiffer strips too small (1.9 % at c / L = 0.5). The exact height of the loop
without weight is 0.133860 L (the standard's 0.1337 is 0.12 % less), and the factor that is exact for small d is 31.91
degrees. The two halves never touch (x >= 0 up to L / c = 60), so no contact is missing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mfar_fem.errors import NotConvergedError, ParameterError

FLAT_LENGTH = 0.1337
"""l0 / L of the standard: the height of the loop without weight."""

ANGLE_FACTOR = math.radians(32.85)
"""theta l0 / d of the standard, rad."""

LENGTH_RANGE = (0.0, 60.0)
"""Loop length over bending length L / c that `solve` accepts."""


@dataclass(frozen=True)
class Loop:
    """Exact heart loop in units of its length L, half of it from the clamp to the lowest point.

    ``length_over_c`` L/c; arrays (n,): ``s``, ``x`` (outwards), ``y`` (upwards), ``heading`` (rad); ``height`` l/L of
    the lowest point below the clamp; ``force`` H L²/B; ``d_height`` the derivative of l/L by (L/c)³.
    """

    length_over_c: float
    s: np.ndarray
    x: np.ndarray
    y: np.ndarray
    heading: np.ndarray
    height: float
    force: float
    d_height: float


@lru_cache(maxsize=8)
def chebyshev(n: int):
    """Points, differentiation matrix and integration matrix of n + 1 Chebyshev points on [0, 1], ascending.

    Returns
    -------
    points : (n+1,)
    derivative : (n+1, n+1)
        Values to values of the derivative.
    integral : (n+1, n+1)
        Values to values of the integral from 0.
    """
    k = np.arange(n + 1)
    z = -np.cos(np.pi * k / n)
    weight = np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
    difference = z[:, None] - z + np.eye(n + 1)
    derivative = np.outer(weight, 1 / weight) / difference
    derivative -= np.diag(derivative.sum(axis=1))
    chebyshev_values = np.polynomial.chebyshev.chebvander(z, n)
    raised = np.polynomial.chebyshev.chebvander(z, n + 1)
    antiderivative = np.zeros((n + 1, n + 1))
    for m in range(n + 1):
        coefficients = np.polynomial.chebyshev.chebint(np.eye(n + 1)[m], lbnd=-1)
        antiderivative[:, m] = raised[:, : len(coefficients)] @ coefficients
    integral = antiderivative @ np.linalg.inv(chebyshev_values)
    return 0.5 * (z + 1), 2 * derivative, 0.5 * integral


def solve(length_over_c: float, n: int = 80) -> Loop:
    """Exact heart loop with L / c = `length_over_c` (0 is the loop without weight).

    Raises
    ------
    ParameterError
        Outside `LENGTH_RANGE`.
    NotConvergedError
        The collocation does not converge.
    """
    if not LENGTH_RANGE[0] <= length_over_c <= LENGTH_RANGE[1]:
        raise ParameterError(f"L / c of a heart loop must lie within {LENGTH_RANGE}, not {length_over_c}")
    return _solve(float(length_over_c), int(n))


@lru_cache(maxsize=512)
def _solve(length_over_c: float, n: int) -> Loop:
    s, _, integral = chebyshev(n)
    phi, force = _start(n)
    wanted, reached, step = length_over_c**3 / 8, 0.0, 4.0  # w S^3 / B
    while reached < wanted:
        load = min(wanted, reached + step)
        try:
            phi_new, force_new = _newton(phi, force, load, n)
        except NotConvergedError:
            step *= 0.5
            if step < 1e-3:
                raise
            continue
        phi, force, reached, step = phi_new, force_new, load, 1.6 * step
    # derivative of the height by the load, from the same linear system
    matrix = _jacobian(phi, force, wanted, n)
    right = np.zeros(n + 2)
    right[1:n] = ((1 - s) * np.cos(phi))[1:n]
    d_phi = np.linalg.solve(matrix, right)[: n + 1]
    d_height = -(integral[-1] @ (np.cos(phi) * d_phi))
    x, y = integral @ np.cos(phi), integral @ np.sin(phi)
    return Loop(
        length_over_c=length_over_c,
        s=0.5 * s,
        x=0.5 * x,
        y=0.5 * y,
        heading=phi,
        height=-0.5 * float(y[-1]),
        force=4.0 * force,
        d_height=0.5 * float(d_height) / 8,
    )


@lru_cache(maxsize=8)
def _start(n: int):
    """The loop without weight, from a rough heart by damped Newton steps."""
    s = chebyshev(n)[0]
    phi = np.pi / 2 - 1.5 * np.pi * (s + 0.16 * np.sin(np.pi * s) ** 2 * (s - 0.2))
    return _newton(phi, 10.0, 0.0, n, damped=True)


def _residual(phi, force, load, n):
    s, derivative, integral = chebyshev(n)
    residual = np.empty(n + 2)
    residual[: n + 1] = derivative @ (derivative @ phi) - load * (1 - s) * np.cos(phi) - force * np.sin(phi)
    residual[0], residual[n] = phi[0] - np.pi / 2, phi[n] + np.pi
    residual[n + 1] = integral[-1] @ np.cos(phi)
    return residual


def _jacobian(phi, force, load, n):
    s, derivative, integral = chebyshev(n)
    matrix = np.zeros((n + 2, n + 2))
    matrix[: n + 1, : n + 1] = derivative @ derivative + np.diag(load * (1 - s) * np.sin(phi) - force * np.cos(phi))
    matrix[: n + 1, n + 1] = -np.sin(phi)
    matrix[[0, n]] = 0.0
    matrix[0, 0] = matrix[n, n] = 1.0
    matrix[n + 1, : n + 1] = -integral[-1] * np.sin(phi)
    return matrix


def _newton(phi, force, load, n, damped=False):
    last = np.inf
    for iteration in range(200 if damped else 25):
        step = np.linalg.solve(_jacobian(phi, force, load, n), -_residual(phi, force, load, n))
        size = np.abs(step[: n + 1]).max()
        if not np.isfinite(size) or (iteration > 4 and size > 10.0):
            break
        share = min(1.0, 0.3 / size) if damped else 1.0
        phi, force = phi + share * step[: n + 1], force + share * step[n + 1]
        if size < 1e-10 or (size < 1e-7 and size >= 0.5 * last):
            return phi, force
        last = size
    raise NotConvergedError(f"the heart loop at w S^3 / B = {load:g} did not converge")


def height(length: float, rigidity: float, weight: float) -> float:
    """Exact distance l (m) from the clamp to the lowest point of a loop of `length` (m), B (N m), w (N/m²)."""
    _positive(length=length, rigidity=rigidity, weight=weight)
    return length * solve(length * (weight / rigidity) ** (1 / 3)).height


def height_sensitivity(length: float, rigidity: float, weight: float) -> dict[str, float]:
    """Exact derivatives of `height`: keys ``rigidity`` and ``weight``."""
    load = weight * length**3 / rigidity
    slope = length * solve(load ** (1 / 3)).d_height
    return {"rigidity": -slope * load / rigidity, "weight": slope * load / weight}


def bending_length(length: float, measured: float) -> float:
    """Exact c (m) of a loop of `length` (m) whose lowest point was measured `measured` (m) below the clamp.

    Raises
    ------
    ParameterError
        No heart loop of that length hangs so high or so low.
    """
    from scipy.optimize import brentq

    _positive(length=length, measured=measured)
    low, high = solve(0.0).height, solve(40.0).height
    if not low < measured / length < high:
        raise ParameterError(
            f"the lowest point of a heart loop of {length:g} m lies between {low * length:.4g} m (no weight) and "
            f"{high * length:.4g} m (quite limp) below the clamp, not at {measured:g} m"
        )
    return length / brentq(lambda v: solve(v).height - measured / length, 1e-6, 40.0, xtol=1e-12, rtol=1e-14)


def standard_bending_length(length: float, measured: float) -> float:
    """c (m) by the standard's formula.

    Raises
    ------
    ParameterError
        The loop hangs no lower than l0, or so low that theta is 90 degrees or more: the formula has no value.
    """
    _positive(length=length, measured=measured)
    flat = FLAT_LENGTH * length
    theta = ANGLE_FACTOR * (measured - flat) / flat
    if not 0 < theta < math.pi / 2:
        raise ParameterError(
            f"the heart-loop formula needs 0 < theta < 90 degrees, not {math.degrees(theta):.4g}: "
            f"l = {measured:g} m must lie between l0 = {flat:.4g} m and "
            f"{flat * (1 + math.pi / 2 / ANGLE_FACTOR):.4g} m for a loop of {length:g} m"
        )
    return flat * (math.cos(theta) / math.tan(theta)) ** (1 / 3)


def formula_error(c_over_l) -> list[dict[str, float]]:
    """What the standard's formula costs: one row for each c / L, the loop being solved exactly.

    Returns
    -------
    list of dict
        ``c_over_L``, ``l_over_L`` (exact), ``theta_deg``, ``c_formula_over_L``, ``error_in_c_percent``,
        ``error_in_B_percent`` (NaN where the formula has no value), ``halves_touch``.
    """
    rows = []
    for ratio in c_over_l:
        loop = solve(1 / ratio)
        theta = ANGLE_FACTOR * (loop.height - FLAT_LENGTH) / FLAT_LENGTH
        try:
            c = standard_bending_length(1.0, loop.height)
        except ParameterError:
            c = math.nan
        rows.append(
            {
                "c_over_L": float(ratio),
                "l_over_L": loop.height,
                "theta_deg": math.degrees(theta),
                "c_formula_over_L": c,
                "error_in_c_percent": 100 * (c / ratio - 1),
                "error_in_B_percent": 100 * ((c / ratio) ** 3 - 1),
            }
        )
    return rows


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ParameterError(f"{name} must be positive, not {value}")
