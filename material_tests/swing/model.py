r"""The swatch as a rigid plate on a hinge, with quadratic drag along its normal.

A strip of the plate at the distance r from the axis moves at :math:`r\dot\theta` along its normal and feels :math:`\gamma_n
(r\dot\theta)^2` per area. With the areal density σ, moments about the axis (per width) are :math:`\sigma L^3/3\,\ddot\theta =
-\sigma g L^2/2\,\sin\theta - \gamma_n L^4/4\,|\dot\theta|\dot\theta`, that is

.. math:: \ddot\theta = -k\sin\theta - c\,|\dot\theta|\dot\theta, \qquad k = \frac{3g}{2L}, \qquad c = \frac{3\gamma_n L}{4\sigma}.

Between two turning points :math:`\dot\theta^2` obeys a linear equation in θ: with :math:`f_c(\theta) = (\cos\theta + 2c\sin\theta)
e^{-2c\theta}`, downwards from :math:`\theta_0 > 0`,

.. math:: \dot\theta^2 = \frac{2k}{1+4c^2}\,e^{2c\theta}\,[f_c(\theta) - f_c(\theta_0)],

so that the next turning point :math:`-\theta_1` is the other root of :math:`f_c = f_c(\theta_0)`, exactly. For small c the loss of
a half swing is :math:`4ck(\sin\theta_0 - \theta_0\cos\theta_0)` per moment of inertia, and for small angles :math:`1/\theta`
grows by :math:`4c/3 = \gamma_n L/\sigma` every half swing.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import NotConvergedError, ParameterError
from mfar_fem.units import STANDARD_GRAVITY

AIR_DENSITY = 1.204
"""Dry air at 20 °C and 101 325 Pa, kg/m³."""

PAPER_GAMMA = 0.15
"""γ of formula (16) of the silk paper, N·s²/m²."""


@dataclass(frozen=True)
class Pendulum:
    """A plate pendulum with quadratic drag.

    Attributes
    ----------
    k : float
        Squared angular frequency of small swings, 1/s².
    c : float
        Drag, 1/rad: the angular deceleration is ``c |ω| ω``.
    """

    k: float
    c: float

    def __post_init__(self):
        if not (math.isfinite(self.k) and self.k > 0 and math.isfinite(self.c) and self.c >= 0):
            raise ParameterError(f"a pendulum needs k > 0 and c >= 0, got {self.k}, {self.c}")

    @classmethod
    def plate(cls, length: float, areal_density: float, gamma: float, frequency: float = 1.0) -> Pendulum:
        """Plate of ``length`` (m) below the axis, ``areal_density`` (kg/m²), drag ``gamma`` (N·s²/m⁴ along the normal).

        ``frequency`` scales the plate's own frequency: a flexible sheet, or air that swings along, is not quite a plate.
        """
        if not (length > 0 and areal_density > 0):
            raise ParameterError(f"length and areal density must be positive, got {length} m, {areal_density} kg/m²")
        return cls(1.5 * STANDARD_GRAVITY / length * frequency**2, 0.75 * gamma * length / areal_density)

    def trajectory(self, angle: float, times) -> np.ndarray:
        """Angle (m,), rad, at ``times`` (m,), s, increasing, after release at rest from ``angle`` at time 0."""
        from scipy.integrate import solve_ivp

        times = np.asarray(times, dtype=float)
        solution = solve_ivp(lambda t, y: (y[1], -self.k * math.sin(y[0]) - self.c * abs(y[1]) * y[1]), (0.0, float(times[-1])),
                             (angle, 0.0), method="DOP853", t_eval=times, rtol=1e-9, atol=1e-11)
        if not solution.success:
            raise NotConvergedError(f"plate pendulum: {solution.message}", solution)
        return solution.y[0]

    def speed(self, theta, start: float) -> np.ndarray:
        """Angular speed, rad/s, at ``theta`` on the way down from the turning point ``start`` > 0 (rad); closed form."""
        theta = np.asarray(theta, dtype=float)
        c = self.c
        lost = math.cos(start) + 2 * c * math.sin(start)
        square = np.cos(theta) + 2 * c * np.sin(theta) - lost * np.exp(2 * c * (theta - start))
        return np.sqrt(np.maximum(2 * self.k / (1 + 4 * c * c) * square, 0.0))

    def next_amplitude(self, start: float) -> float:
        """Amplitude (rad, > 0) of the turning point after that at ``start`` (rad, 0 to pi); closed form but for one root."""
        from scipy.optimize import brentq

        if not 0 < start < math.pi:
            raise ParameterError(f"a turning point lies between 0 and a half turn, got {start} rad")
        c = self.c
        if c == 0.0:
            return start
        lost = math.cos(start) + 2 * c * math.sin(start)

        def rest(b: float) -> float:
            return math.cos(b) - 2 * c * math.sin(b) - lost * math.exp(-2 * c * (b + start))

        return float(brentq(rest, 0.0, start, xtol=1e-14))

    def amplitudes(self, start: float, count: int) -> np.ndarray:
        """The turning points (count + 1,), rad, first ``start`` itself."""
        out = [float(start)]
        for _ in range(count):
            out.append(self.next_amplitude(out[-1]))
        return np.array(out)

    def period(self, amplitude: float = 0.0) -> float:
        """Period without drag at an amplitude (rad), s."""
        from scipy.special import ellipk

        return 4.0 * float(ellipk(math.sin(0.5 * amplitude) ** 2)) / math.sqrt(self.k)

    def first_order_loss(self, start: float) -> float:
        """Energy over moment of inertia that a half swing from ``start`` (rad) loses, to first order in the drag, 1/s²."""
        return 4.0 * self.c * self.k * (math.sin(start) - start * math.cos(start))


def per_area(total: float, area: float) -> float:
    """Drag per area (N·s²/m⁴) of a coefficient meant for a whole swatch of ``area`` (m²): ``F = total |v| v`` at uniform speed."""
    return total / area


def per_vertex(gamma: float, area: float, vertices: int) -> float:
    """Drag per area (N·s²/m⁴) of formula (16) as printed, ``gamma`` (N·s²/m²) at each of ``vertices`` vertices on ``area`` (m²)."""
    return gamma * vertices / area


def drag_coefficient(gamma: float, density: float = AIR_DENSITY) -> float:
    """Drag coefficient C_D of ``gamma`` (N·s²/m⁴): gamma = C_D density / 2."""
    return 2.0 * gamma / density


def euler_drag(length: float, areal_density: float, dt: float, amplitude: float) -> float:
    """Drag (N·s²/m⁴) that takes as much from a small swing as implicit Euler's own dissipation with steps ``dt`` (s).

    The method keeps (1 + ω²Δt²)^-½ of the amplitude A a step, hence loses π ω Δt A/2 a half swing; drag takes γ L A²/σ.
    """
    omega = math.sqrt(Pendulum.plate(length, areal_density, 0.0).k)
    return math.pi * omega * dt * areal_density / (2.0 * length * amplitude)


def added_mass(length: float, width: float, density: float = AIR_DENSITY) -> float:
    """Mass of air per area (kg/m²) that a plate of this size carries along its normal: that of a disc of the same area.

    Ideal fluid, (8/3) ρ a³ for a disc of radius a: H. Lamb, *Hydrodynamics*, 6th ed., Cambridge 1932, art. 102. An estimate of
    the size, left out of every model here.
    """
    return 8.0 * density / (3.0 * math.pi) * math.sqrt(length * width / math.pi)
