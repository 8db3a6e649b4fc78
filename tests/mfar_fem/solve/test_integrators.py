"""The relations of the time integrators, on a single oscillator: amplitude, phase, order, and what they refuse."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mfar_fem.benchmarks.time_integration import INTEGRATORS, measured_root, root
from mfar_fem.errors import InputError
from mfar_fem.solve.integrators import Kinematics, step_rule


def oscillate(method, rho, omega, steps):
    """Positions of q'' = -ω² q, q(0) = 1, by solving the relations of every step."""
    k = Kinematics(np.array([1.0]), np.zeros(1), np.array([-omega**2]))
    out = [1.0]
    for dt in steps:
        rule = step_rule(method, k, dt, rho)
        # mw ca (x - xa) + om a + ω² (fw x + of q) = 0
        right = rule.mass_weight * rule.ca * rule.xa - rule.old_mass * k.a - omega**2 * rule.old_force * k.x
        x = right / (rule.mass_weight * rule.ca + omega**2 * rule.force_weight)
        k = rule.advance(k, x)
        out.append(float(x[0]))
    return np.array(out)


@pytest.mark.parametrize(("method", "rho"), [*INTEGRATORS, ("generalized-alpha", 0.0)])
@given(z=st.floats(0.02, 3.0))
def test_every_step_multiplies_by_the_root_of_the_method(method, rho, z):
    q = oscillate(method, rho, z, np.ones(70))[40:] if method != "implicit-euler" else oscillate(method, rho, z, np.ones(8))
    found, exact = measured_root(q), root(method, z, rho)
    assert abs(abs(found) - abs(exact)) < 1e-6
    if abs(exact.imag) > 1e-3 and np.abs(q).max() > 1e-6:
        assert abs(np.angle(found) - np.angle(exact)) < 1e-5


@given(z=st.floats(1e-3, 1e3))
def test_implicit_euler_and_the_trapezoidal_rule_in_closed_form(z):
    assert abs(root("implicit-euler", z)) == pytest.approx((1 + z * z) ** -0.5, rel=1e-12)
    assert abs(root("generalized-alpha", z, 1.0)) == pytest.approx(1.0, abs=1e-9)
    assert np.angle(root("generalized-alpha", z, 1.0)) == pytest.approx(2 * np.arctan(z / 2), rel=1e-6)


@pytest.mark.parametrize("rho", [0.0, 0.3, 0.8, 1.0])
def test_spectral_radius_at_infinite_frequency(rho):
    """Jumps of a stiff oscillator shrink by ρ a step in the end."""
    q = np.abs(oscillate("generalized-alpha", rho, 1e6, np.ones(40)))
    assert q[-1] <= 3 * max(rho**35, 1e-9) * np.arange(1, 41).max()
    if rho == 1.0:
        assert q[-1] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(("method", "rho", "rate"), [("implicit-euler", 1, 1), ("bdf2", 1, 2), ("generalized-alpha", 1, 2),
                                                     ("generalized-alpha", 0.5, 2)])
def test_order_with_fixed_and_varying_steps(method, rho, rate):
    def error(steps):
        return abs(oscillate(method, rho, 5.0, steps / steps.sum())[-1] - np.cos(5.0))

    patterns = [lambda n: np.ones(n), lambda n: 1 + 0.6 * np.sin(2 * np.pi * np.arange(n) / n)]
    if method != "generalized-alpha" or rho == 1:  # below 1 its acceleration lags by a share of the step: no jumps of it
        patterns += [lambda n: np.tile([1.0, 2.0], n // 2), lambda n: np.tile([1.0, 1.5, 0.5], n // 3)]
    for pattern in patterns:
        assert np.log2(error(pattern(402)) / error(pattern(804))) == pytest.approx(rate, abs=0.12)


def test_bdf2_reproduces_a_parabola_with_any_steps():
    """x = t² exactly, from exact values at two uneven times."""
    k = Kinematics(np.array([0.09]), np.array([0.6]), np.array([2.0]), np.array([0.04]), np.array([0.4]), 0.1)
    new = step_rule("bdf2", k, 0.25).advance(k, np.array([0.55**2]))
    assert new.v == pytest.approx(1.1, rel=1e-12) and new.a == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize(("arguments", "message"), [
    (("runge-kutta", 0.1), "implicit-euler, bdf2, generalized-alpha"), (("bdf2", 0.0), "positive and finite"),
    (("bdf2", np.nan), "positive and finite"), (("generalized-alpha", 0.1, 1.5), r"\[0, 1\]")])
def test_wrong_requests_are_named(arguments, message):
    method, dt, *rho = arguments
    with pytest.raises(InputError, match=message):
        step_rule(method, Kinematics(np.zeros(3), np.zeros(3), np.zeros(3)), dt, *rho)
