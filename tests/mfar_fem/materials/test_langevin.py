"""The inverse Langevin function against its definition in extended precision."""

from __future__ import annotations

from decimal import Decimal, getcontext

import numpy as np
import pytest

from mfar_fem.materials.langevin import inverse_langevin, langevin, log_beta_over_sinh

getcontext().prec = 50


def _exact_langevin(beta: float) -> Decimal:
    b = Decimal(beta)
    down = (-2 * b).exp()
    return (1 + down) / (1 - down) - 1 / b


@pytest.mark.parametrize("x", [1e-9, 1e-4, 0.03, 0.0499, 0.0501, 0.1, 0.3, 0.5, 0.8, 0.95, 0.99, 0.9999, 1 - 1e-9])
def test_inverse_is_exact_to_rounding(x):
    beta, slope = (float(v[0]) for v in inverse_langevin(np.array([x])))
    target = Decimal(x)
    assert abs(_exact_langevin(beta) / target - 1) < Decimal("5e-13")
    assert abs((1 - _exact_langevin(beta)) / (1 - target) - 1) < Decimal("1e-6")
    h = Decimal("1e-9") * Decimal(beta)
    b = Decimal(beta)
    derivative = (_exact_langevin(b + h) - _exact_langevin(b - h)) / (2 * h)
    assert float(derivative) * slope == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize("beta", [1e-5, 0.1, 0.1499, 0.1501, 0.1999, 0.2001, 1.0, 30.0])
def test_langevin_and_logarithm(beta):
    assert float(langevin(np.array([beta]))[0][0]) == pytest.approx(float(_exact_langevin(beta)), rel=1e-12)
    b = Decimal(beta)
    exact = (2 * b / (b.exp() - (-b).exp())).ln()
    assert float(log_beta_over_sinh(np.array([beta]))[0]) == pytest.approx(float(exact), rel=1e-10)


def test_large_arguments_do_not_overflow():
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(langevin(np.array([1e3, 1e9]))).all()
        assert np.isfinite(log_beta_over_sinh(np.array([1e3, 1e9]))).all()
