"""Perimeters of ellipses against quadrature."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ellipe

from reconstruction.measure.ellipse import flat_factor, flat_factor_sigma, perimeter


@given(st.floats(0.05, 2.0), st.floats(0.3, 1.0))
def test_perimeter_is_the_elliptic_integral(width, ratio):
    exact = 2 * width * ellipe(1 - ratio**2)
    assert perimeter(width, ratio * width) == pytest.approx(exact, rel=2e-7 * 4)


def test_limits():
    assert perimeter(1.0, 1.0) == pytest.approx(np.pi, rel=1e-12)
    assert perimeter(1.0, 0.0) == pytest.approx(2.0, rel=5e-4)  # two layers laid flat
    assert perimeter(0.0, 0.0) == 0
    assert flat_factor(1.0) == pytest.approx(np.pi / 2)
    assert 0.04 < flat_factor_sigma() / flat_factor() < 0.06
