r"""The exact heavy elastica of a horizontally clamped strip: inextensible, bent by its own weight.

With :math:`\theta(s)` the slope below the horizontal, w the weight by area (N/m²) and B the bending rigidity by width
(N m),

.. math:: B\,\theta'' = -w\,(L - s)\cos\theta, \qquad \theta(0) = 0, \quad \theta'(L) = 0 .

In units of the bending length :math:`c = (B/w)^{1/3}` and measured from the tip the equation holds no number at all,
so that one angle :math:`\psi_0 = \pi/2 - \theta_\mathrm{tip}` at the tip says everything: the strip is followed from
there to the clamp, where the slope vanishes for the first time (the stable branch). :math:`\Gamma = w L^3 / B =
(L/c)^3`.

A moment law that softens, :math:`M = \alpha\kappa + \beta\kappa^2` (Feng, Huang, Xu, Wang, ACM Trans. Graph. 41(6),
2022, doi:10.1145/3550454.3555464), enters through the one number :math:`b = \beta / (\alpha c)`, with :math:`c =
(\alpha/w)^{1/3}`. For :math:`\beta < 0` the moment has a maximum at :math:`\kappa = -\alpha / 2\beta`; a strip that
asks for more has no such shape, which is a `MomentLimitError`.

Angles are radians, lengths metres. The chord angle is that of the line from the clamp to the tip, below the horizontal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mfar_fem.errors import ParameterError

STANDARD_ANGLE = math.radians(41.5)
"""Slope of the plane of ASTM D1388 option A, at which the overhang is read, rad."""

GAMMA_RANGE = (1e-6, 1e5)
_RTOL = 1e-13
_LIMIT = "the moment alpha kappa + beta kappa^2 has its maximum at kappa = -alpha / (2 beta) and the strip reaches it"


class MomentLimitError(ParameterError):
    """The strip asks for more moment than the softening law can carry (beyond kappa = -alpha / (2 beta))."""


@dataclass(frozen=True)
class Arc:
    """One strip in units of c, from the tip to the clamp.

    ``length`` L/c, ``reach`` and ``drop`` of the tip (/c), ``root_curvature`` (*c), ``tip_angle`` (rad), and the
    derivatives (by ln psi0, by b) of length, reach and drop.
    """

    length: float
    reach: float
    drop: float
    root_curvature: float
    tip_angle: float
    d_length: tuple[float, float]
    d_reach: tuple[float, float]
    d_drop: tuple[float, float]

    @property
    def chord_angle(self) -> float:
        """Chord angle, rad."""
        return math.atan2(self.drop, self.reach)

    @property
    def d_chord_angle(self) -> tuple[float, float]:
        """Its derivatives by ln psi0 and by b."""
        square = self.reach**2 + self.drop**2
        pairs = zip(self.d_drop, self.d_reach, strict=True)
        first, second = ((self.reach * dh - self.drop * dx) / square for dh, dx in pairs)
        return first, second


@dataclass(frozen=True)
class Shape:
    """A strip in units of its overhang: arrays (n,) from the clamp to the tip."""

    gamma: float
    s: np.ndarray
    x: np.ndarray
    drop: np.ndarray
    angle: np.ndarray
    curvature: np.ndarray

    @property
    def chord_angle(self) -> float:
        """Chord angle, rad."""
        return math.atan2(self.drop[-1], self.x[-1])


def _rates(t: float, y, b: float) -> list[float]:
    """d/dt of (psi, M, X, H) and of their derivatives by ln psi0 and by b; t is the distance from the tip over c."""
    psi, moment = y[0], y[1]
    root = math.sqrt(max(1.0 + 4.0 * b * moment, 1e-12))
    kappa = 2.0 * moment / (1.0 + root)
    sine, cosine = math.sin(psi), math.cos(psi)
    rates = [kappa, t * sine, sine, cosine]
    for i, direct in ((4, 0.0), (8, -kappa * kappa / root)):
        d_psi = y[i]
        rates += [y[i + 1] / root + direct, t * cosine * d_psi, cosine * d_psi, -sine * d_psi]
    return rates


def integrate(log_psi0: float, b: float = 0.0, dense: bool = False):
    """Follow a strip from its tip, where psi = exp(log_psi0), to the clamp, where psi = pi/2.

    Parameters
    ----------
    log_psi0 : float
        Logarithm of pi/2 minus the slope of the tip, below log(pi/2).
    b : float
        beta / (alpha c) of the moment law, 0 for the linear one.
    dense : bool
        Return the pair (Arc, solution) with scipy's continuous solution of the first of the two passes.

    Raises
    ------
    MomentLimitError
        The moment reaches the maximum of the law before the clamp.
    """
    from scipy.integrate import solve_ivp

    psi0 = math.exp(log_psi0)
    start = [psi0, 0.0, 0.0, 0.0, psi0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]

    def clamp(t, y):
        return y[0] - math.pi / 2

    def exhausted(t, y):
        return 1.0 + 4.0 * b * y[1] - 1e-9

    for event in (clamp, exhausted):
        event.terminal = True  # type: ignore[attr-defined]
    options = {"method": "DOP853", "rtol": _RTOL, "atol": 1e-15 * min(psi0, 1.0)}
    events = [clamp, exhausted] if b < 0 else [clamp]
    found = solve_ivp(lambda t, y: _rates(t, y, b), (0.0, 200.0), start, events=events, dense_output=dense, **options)
    if b < 0 and len(found.t_events[1]):
        raise MomentLimitError(
            f"the strip has no shape at beta / (alpha c) = {b:.4g}: {_LIMIT} before the clamp; a shorter one has"
        )
    # The event is only as good as the interpolant: take the last step again with psi as the independent variable.
    t, y = found.t[-2], found.y[:, -2]

    def by_psi(psi, z):
        rates = _rates(z[12], [psi, *z[1:12]], b)
        return [rate / rates[0] for rate in rates] + [1.0 / rates[0]]

    last = solve_ivp(by_psi, (y[0], math.pi / 2), [*y, t], **options).y[:, -1].tolist()
    kappa = 2.0 * last[1] / (1.0 + math.sqrt(1.0 + 4.0 * b * last[1]))
    d_length = tuple(-last[i] / kappa for i in (4, 8))
    arc = Arc(
        length=last[12],
        reach=last[2],
        drop=last[3],
        root_curvature=kappa,
        tip_angle=math.pi / 2 - psi0,
        d_length=d_length,
        d_reach=tuple(last[i] + d for i, d in zip((6, 10), d_length, strict=True)),
        d_drop=(last[7], last[11]),
    )
    return (arc, found) if dense else arc


def _solve(target: float, value, guess: float, b: float) -> float:
    """ln psi0 at which ``value(arc) -> (v, dv / d ln psi0)`` is `target`: Newton in a bracket; v falls with it."""
    low, high = -700.0, math.log(math.pi / 2)
    p = min(max(guess, low), high - 1e-14)
    for _ in range(80):
        try:
            v, slope = value(integrate(p, b))
        except MomentLimitError:
            low = p  # too long an overhang: stiffer is to the right
            if high - low < 1e-12:
                raise
            p = 0.5 * (low + high)
            continue
        if v > target:
            low = p
        else:
            high = p
        step = (target - v) / slope
        new = p + step
        if abs(step) <= 4e-16 * max(abs(p), 1.0) or abs(v - target) <= 2e-15 * abs(target):
            return p
        p = new if low < new < high else 0.5 * (low + high)
        if high - low < 1e-15 * max(abs(p), 1.0):
            return p
    return p


def _guess(gamma: float) -> float:
    """ln psi0 near the solution: the linear beam below Gamma = 8, the decay of the hanging tail above."""
    if gamma < 8.0:
        return math.log(math.pi / 2 - gamma / 6 / (1 + 0.06 * gamma**1.6))
    return math.log(1.1) - 0.6667 * (math.sqrt(gamma) - math.sqrt(8.0)) - 0.5


@lru_cache(maxsize=512)
def _arc_of_gamma(gamma: float, b: float) -> tuple[float, Arc]:
    if not GAMMA_RANGE[0] <= gamma <= GAMMA_RANGE[1]:
        low, high = GAMMA_RANGE
        raise ParameterError(f"Gamma = w L^3 / B must lie within {low:g} and {high:g}, not {gamma:g}")
    p = _solve(math.log(gamma) / 3, lambda a: (math.log(a.length), a.d_length[0] / a.length), _guess(gamma), b)
    arc = integrate(p, b)
    if abs(arc.length**3 / gamma - 1) > 1e-8:
        raise MomentLimitError(
            f"no strip with beta / (alpha c) = {b:.4g} is as long as Gamma = {gamma:.6g}: {_LIMIT}, here Gamma = "
            f"{arc.length**3:.6g} at most"
        )
    return p, arc


@lru_cache(maxsize=512)
def _arc_of_angle(angle: float, b: float) -> tuple[float, Arc]:
    if not 0.0 < angle < math.radians(89.5):
        raise ParameterError(f"the chord angle must lie between 0 and 89.5 degrees, not {math.degrees(angle):g}")
    if angle < 1e-5:
        raise ParameterError(f"a chord angle of {math.degrees(angle):g} degrees is too small to say anything")
    guess = _guess(8 * angle * (1 + 0.6 * angle**2) if angle < 1.0 else 8.0 / (math.pi / 2 - angle) ** 1.6)
    p = _solve(angle, lambda a: (a.chord_angle, a.d_chord_angle[0]), guess, b)
    arc = integrate(p, b)
    if abs(arc.chord_angle - angle) > 1e-9:
        raise MomentLimitError(
            f"no strip with beta / (alpha c) = {b:.4g} droops to a chord angle of {math.degrees(angle):.4g} degrees: "
            f"{_LIMIT}, at {math.degrees(arc.chord_angle):.4g} degrees"
        )
    return p, arc


def shape(gamma: float, b: float = 0.0, n: int = 201) -> Shape:
    """Shape of the strip with ``gamma = w L^3 / B`` (B = alpha if the law is not linear), at n points.

    Raises
    ------
    ParameterError
        gamma outside `GAMMA_RANGE`.
    MomentLimitError
        See the class.
    """
    p, arc = _arc_of_gamma(float(gamma), float(b))
    arc, found = integrate(p, b, dense=True)
    length = arc.length
    t = length * np.linspace(1.0, 0.0, n)
    psi, moment, reach, drop = found.sol(np.minimum(t, found.t[-1]))[:4]
    kappa = 2 * moment / (1 + np.sqrt(1 + 4 * b * moment))
    x, y = (arc.reach - reach) / length, (arc.drop - drop) / length
    x[0] = y[0] = 0.0
    return Shape(float(gamma), 1 - t / length, x, y, math.pi / 2 - psi, kappa * length)


def chord_angle(gamma: float, b: float = 0.0) -> float:
    """Chord angle (rad) of the strip with ``gamma = w L^3 / B``."""
    return _arc_of_gamma(float(gamma), float(b))[1].chord_angle


def gamma_at_chord_angle(angle: float = STANDARD_ANGLE, b: float = 0.0) -> float:
    """``w L^3 / B`` at which the chord has drooped to `angle` (rad): 8.004197033 at 41.5 degrees for the linear law."""
    return _arc_of_angle(float(angle), float(b))[1].length ** 3


def overhang(rigidity: float, weight: float, angle: float = STANDARD_ANGLE, beta: float = 0.0) -> float:
    """Overhang L (m) of a strip whose chord has drooped to `angle`.

    Parameters
    ----------
    rigidity : float
        B (or alpha), N m.
    weight : float
        Areal density times gravity, N/m².
    angle : float
        rad.
    beta : float
        Of M = alpha kappa + beta kappa², N m².
    """
    c = bending_length(rigidity, weight)
    return c * _arc_of_angle(float(angle), beta / (rigidity * c))[1].length


def overhang_sensitivity(rigidity: float, weight: float, angle: float = STANDARD_ANGLE, beta: float = 0.0) -> dict:
    """Exact derivatives of `overhang`: keys ``rigidity`` (m/(N m)), ``weight``, ``angle`` (m/rad), ``beta``."""
    c = bending_length(rigidity, weight)
    b = beta / (rigidity * c)
    arc = _arc_of_angle(float(angle), b)[1]
    by_angle = arc.d_length[0] / arc.d_chord_angle[0]
    by_b = arc.d_length[1] - by_angle * arc.d_chord_angle[1]
    return {
        "rigidity": c / rigidity * (arc.length / 3 - 4 * b / 3 * by_b),
        "weight": c / weight * (-arc.length / 3 + b / 3 * by_b),
        "angle": c * by_angle,
        "beta": by_b / rigidity,
    }


def rigidity(length: float, weight: float, angle: float = STANDARD_ANGLE) -> float:
    """Bending rigidity B (N m) of a strip with a linear moment law from its overhang (m) at the chord angle (rad)."""
    _positive(length=length, weight=weight)
    return weight * length**3 / gamma_at_chord_angle(angle)


def bending_length(rigidity: float, weight: float) -> float:
    """c = (B / w)^(1/3), m."""
    _positive(rigidity=rigidity, weight=weight)
    return (rigidity / weight) ** (1 / 3)


def peirce_bending_length(length: float, angle: float = STANDARD_ANGLE) -> float:
    """Peirce's c = L (cos(angle/2) / (8 tan(angle)))^(1/3), m (1930, doi:10.1080/19447023008661529)."""
    return length * (math.cos(angle / 2) / (8 * math.tan(angle))) ** (1 / 3)


def standard_bending_length(length: float) -> float:
    """ASTM D1388 option A: c = L / 2, the overhang being read at 41.5 degrees, m."""
    return 0.5 * length


def _positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ParameterError(f"{name} must be positive, not {value}")
