"""The drag coefficient from a record of the chord angle, with its confidence interval: by the rigid plate or by finite elements."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from material_tests.swing.fe import Level, Specimen, Swing, swing
from mfar_fem.errors import InputError, NotConvergedError

LEVEL = 0.95
"""Confidence level of the intervals."""


@dataclass(frozen=True)
class Estimate:
    """A recovered drag coefficient.

    Attributes
    ----------
    gamma : float
        Along the normal, N·s²/m⁴.
    low, high : float
        95 % confidence interval from the scatter of the residuals. It knows noise, not a wrong model: see ``residual``.
    frequency : float
        Frequency over that of the rigid plate (1 where it was not fitted).
    residual : float
        Standard deviation of the residuals, rad: well above the record's noise, the model does not describe the motion and the
        interval is too narrow.
    runs : int
        Evaluations of the model.
    """

    gamma: float
    low: float
    high: float
    frequency: float
    residual: float
    runs: int

    def contains(self, gamma: float) -> bool:
        """Whether a coefficient lies within the interval."""
        return self.low <= gamma <= self.high


def noisy(times, angle, sd: float, seed: int) -> np.ndarray:
    """The record (m,), rad, with independent normal errors of standard deviation ``sd`` (rad)."""
    return np.asarray(angle) + sd * np.random.default_rng(seed).standard_normal(len(times))


def fit_plate(specimen: Specimen, times, angle, free_frequency: bool = False, start: float | None = None) -> Estimate:
    """Fit the rigid plate to a record.

    Parameters
    ----------
    specimen : Specimen
        Size, weight and angle of release.
    times, angle : (m,) array_like
        s (increasing) and rad.
    free_frequency : bool
        Fit the frequency too; else it is the plate's.
    start : float, optional
        First guess of the coefficient, N·s²/m⁴; default 1.

    Raises
    ------
    InputError, NotConvergedError
    """
    from scipy.optimize import least_squares

    times, angle = _record(times, angle)

    def residual(p):
        return specimen.plate(math.exp(p[0]), math.exp(p[1]) if free_frequency else 1.0).trajectory(specimen.angle, times) - angle

    first = [math.log(start or 1.0)] + [0.0] * free_frequency
    bounds = ([-14.0, -1.5][: len(first)], [7.0, 1.5][: len(first)])
    found = least_squares(residual, first, bounds=bounds, x_scale=[1.0, 0.1][: len(first)], diff_step=1e-5)
    if not found.success:
        raise NotConvergedError(f"fit of the plate to the record: {found.message}", found)
    scatter = math.sqrt(2.0 * found.cost / (len(times) - len(first)))
    gamma = math.exp(found.x[0])
    error = gamma * scatter * math.sqrt(np.linalg.inv(found.jac.T @ found.jac)[0, 0])
    low, high = _interval(gamma, error, len(times) - len(first))
    return Estimate(gamma, low, high, math.exp(found.x[1]) if free_frequency else 1.0, scatter, int(found.nfev))


def fit_fe(specimen: Specimen, times, angle, fidelity: str | Level = "standard", start: float | None = None,
           max_runs: int = 8) -> tuple[Estimate, Swing]:
    """Fit the finite-element swing to a record: Gauss–Newton in one unknown, the derivative by the secant of the last two runs.

    Parameters
    ----------
    specimen, times, angle
        As for :func:`fit_plate`.
    fidelity : str or Level
    start : float, optional
        First guess, N·s²/m⁴; default that of the plate.
    max_runs : int

    Returns
    -------
    Estimate
        ``frequency`` is 1.
    Swing
        The last run, at (nearly) that coefficient.

    Raises
    ------
    InputError
    NotConvergedError
        After ``max_runs`` the coefficient still moves by more than a tenth of its standard error and 0.1 %.
    """
    from scipy.interpolate import CubicSpline

    times, angle = _record(times, angle)
    duration, history = float(times[-1]), []

    def run(gamma: float) -> Swing:
        motion = swing(specimen, gamma, duration, fidelity)
        history.append((math.log(gamma), CubicSpline(motion.time, motion.angle)(times) - angle))
        return motion

    gamma = start or fit_plate(specimen, times, angle).gamma
    run(gamma)
    motion = run(1.1 * gamma)
    while True:
        (q0, r0), (q, r) = history[-2:]
        slope = (r - r0) / (q - q0)
        step = -float(slope @ r) / float(slope @ slope)
        error = float(np.sqrt(np.mean(r**2) / (slope @ slope)))
        if abs(step) < max(0.1 * error, 1e-3) or len(history) >= max_runs:
            break
        motion = run(math.exp(q + float(np.clip(step, -1.0, 1.0))))
    if abs(step) >= max(0.1 * error, 1e-3):
        raise NotConvergedError(f"fit of the swing: after {len(history)} runs the drag still changes by {100 * step:.3g} %", motion)
    gamma, rest = math.exp(q + step), r + step * slope
    scatter = float(np.sqrt(rest @ rest / (len(times) - 1)))
    low, high = _interval(gamma, gamma * scatter / float(np.linalg.norm(slope)), len(times) - 1)
    return Estimate(gamma, low, high, 1.0, scatter, len(history)), motion


def _record(times, angle) -> tuple[np.ndarray, np.ndarray]:
    times, angle = (np.asarray(v, dtype=float).ravel() for v in (times, angle))
    if len(times) != len(angle) or len(times) < 8:
        raise InputError(f"a record needs as many angles as times, 8 or more, got {len(times)} times and {len(angle)} angles")
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(angle)) and np.all(np.diff(times) > 0) and times[0] >= 0):
        raise InputError("the times of a record must be finite, increase and start at the release (0) or later; angles be finite")
    return times, angle


def _interval(gamma: float, error: float, freedom: int) -> tuple[float, float]:
    from scipy.stats import t

    reach = float(t.ppf(0.5 + 0.5 * LEVEL, freedom)) * error
    return gamma - reach, gamma + reach
