r"""Time integrators as linear relations between the new position and its velocity and acceleration.

Every method here writes, for the step from :math:`t_n` to :math:`t_{n+1} = t_n + \Delta t`,

.. math:: v_{n+1} = c_v\,(x_{n+1} - x_v), \qquad a_{n+1} = c_a\,(x_{n+1} - x_a)

with known :math:`c` and :math:`x_\cdot`, so that a step is the minimum of one function of :math:`x_{n+1}` (incremental potential).

============== ===== ================================================================================================
method         order what it does to a free vibration
============== ===== ================================================================================================
implicit-euler 1     amplitude :math:`(1 + \omega^2\Delta t^2)^{-1/2}` a step: the method's own damping
bdf2           2     hardly any damping up to :math:`\omega\Delta t \approx 0.2`, strong beyond
generalized    2     :math:`\rho_\infty = 1`: none (trapezoidal rule, Newmark ¼, ½); below 1: high frequencies only
============== ===== ================================================================================================

References
----------
1. J. Chung, G. M. Hulbert, "A time integration algorithm for structural dynamics with improved numerical dissipation: the
   generalized-α method", J. Appl. Mech. 60 (1993) 371–375, doi 10.1115/1.2900803.
2. E. Hairer, G. Wanner, *Solving Ordinary Differential Equations II*, 2nd ed., Springer 1996 (BDF with variable steps, III.5).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import InputError

METHODS = ("implicit-euler", "bdf2", "generalized-alpha")


@dataclass(frozen=True)
class Kinematics:
    """Position, velocity and acceleration (3 nn,) at a time, with what the two-step method remembers of the step before.

    Attributes
    ----------
    x, v, a : (3 nn,) arrays
        m, m/s, m/s².
    x_old, v_old : (3 nn,) arrays or None
        One step earlier; ``dt_old`` that step, s.
    """

    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    x_old: np.ndarray | None = None
    v_old: np.ndarray | None = None
    dt_old: float = 0.0


@dataclass(frozen=True)
class StepRule:
    """The relations of one step; ``force_weight`` of the forces at the new time, ``old_force`` of those at the old one,
    ``mass_weight`` and ``old_mass`` of the accelerations."""

    dt: float
    cv: float
    xv: np.ndarray
    ca: float
    xa: np.ndarray
    force_weight: float = 1.0
    old_force: float = 0.0
    mass_weight: float = 1.0
    old_mass: float = 0.0
    order: int = 1

    def advance(self, k: Kinematics, x: np.ndarray) -> Kinematics:
        """Kinematics at the new time from the new position (3 nn,)."""
        return Kinematics(x, self.cv * (x - self.xv), self.ca * (x - self.xa), k.x, k.v, self.dt)


def step_rule(method: str, k: Kinematics, dt: float, rho: float = 0.8) -> StepRule:
    """The relations of ``method`` for a step ``dt`` (s) from ``k``.

    Parameters
    ----------
    rho : float
        Spectral radius of generalized-α at infinite frequency, 0 to 1.

    Raises
    ------
    InputError
        Unknown method, ``dt`` not positive, ``rho`` outside [0, 1].
    """
    if method not in METHODS:
        raise InputError(f"unknown time integrator '{method}'; choose one of {', '.join(METHODS)}")
    if not (np.isfinite(dt) and dt > 0):
        raise InputError(f"the time step must be positive and finite, got {dt} s")
    if method == "generalized-alpha":
        return _generalized(k, dt, rho)
    if method == "bdf2" and k.x_old is not None and k.v_old is not None:
        w = dt / k.dt_old
        c0, c1, c2 = (1 + 2 * w) / (1 + w) / dt, -(1 + w) / dt, w * w / (1 + w) / dt
        xv = -(c1 * k.x + c2 * k.x_old) / c0
        va = -(c1 * k.v + c2 * k.v_old) / c0  # a = c0 (v - va)
        return StepRule(dt, c0, xv, c0 * c0, xv + va / c0, order=2)
    return StepRule(dt, 1 / dt, k.x, 1 / dt**2, k.x + dt * k.v, order=1)


def _generalized(k: Kinematics, dt: float, rho: float) -> StepRule:
    if not 0.0 <= rho <= 1.0:
        raise InputError(f"the spectral radius of generalized-alpha must lie in [0, 1], got {rho}")
    am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma, beta = 0.5 - am + af, 0.25 * (1 - am + af) ** 2
    ca = 1 / (beta * dt**2)
    xa = k.x + dt * k.v + dt**2 * (0.5 - beta) * k.a
    cv = gamma / (beta * dt)  # v = v_n + dt ((1 - γ) a_n + γ a)
    xv = xa - (k.v + dt * (1 - gamma) * k.a) / cv
    return StepRule(dt, cv, xv, ca, xa, 1 - af, af, 1 - am, am, 2)
