"""Bending: closed forms, directions, and matrices that are refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError
from mfar_fem.materials import Bending, get_law


def test_isotropic_plate_is_the_same_in_every_direction():
    bending = Bending.isotropic(E=2e6, nu=0.3, h=1e-4)
    d = 2e6 * 1e-12 / (12 * 0.91)
    assert np.allclose(bending.matrix, d * np.array([[1, 0.3, 0], [0.3, 1, 0], [0, 0, 0.35]]), rtol=1e-12)
    for angle in np.linspace(0.0, math.pi, 7):
        assert bending.along(angle, free=False) == pytest.approx(d, rel=1e-12)
        assert bending.along(angle) == pytest.approx(d * (1 - 0.09), rel=1e-12)  # E h^3 / 12: a free strip


def test_huber_twist_makes_equal_rigidities_isotropic():
    bending = Bending.from_rigidities(2e-6, 2e-6, coupling=0.6e-6)
    assert bending.twist == pytest.approx(0.7e-6)
    assert bending.along(0.7, free=False) == pytest.approx(2e-6, rel=1e-12)


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-8, 1e-4), st.floats(1e-8, 1e-4), st.floats(-0.9, 0.9), st.floats(0.0, math.pi))
def test_direction_rotates_like_a_tensor(warp, weft, share, angle):
    """A strip along the weft of a fabric is one along the warp of the fabric turned by 90 degrees."""
    coupling = share * math.sqrt(warp * weft)
    one, other = (Bending.from_rigidities(*pair, coupling=coupling) for pair in ((warp, weft), (weft, warp)))
    for free in (True, False):
        assert one.along(angle, free) == pytest.approx(other.along(angle + math.pi / 2, free), rel=1e-8)
    assert one.along(0.0, free=False) == pytest.approx(warp)
    assert one.along(0.0) == pytest.approx(warp - coupling**2 / weft, rel=1e-8)
    assert one.along(angle) <= one.along(angle, free=False) * (1 + 1e-12)


def test_derived_from_membrane_per_volume_and_per_area():
    h = 2e-4
    film = get_law("st-venant-kirchhoff", Ew=3e6, Ef=3e6, nu=0.25, G=1.2e6)
    derived = Bending.derived(film, h)
    assert np.allclose(derived.matrix, Bending.isotropic(3e6, 0.25, h).matrix, rtol=1e-12)
    assert derived.ratio_to(derived) == {"warp": 1.0, "weft": 1.0, "twist": 1.0}
    cloth = get_law("yarn-network")
    per_area = Bending.derived(cloth, h)
    assert np.allclose(per_area.matrix, cloth.tangent_at_rest() * h**2 / 12, rtol=1e-12)
    assert Bending.from_rigidities(1e-6, 1e-6).ratio_to(per_area)["warp"] == pytest.approx(1e-6 / per_area.warp)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"warp": -1e-6, "weft": 1e-6, "twist": 1e-6}, "warp = -1e-06"),
        ({"warp": 1e-6, "weft": 0.0, "twist": 1e-6}, "weft"),
        ({"warp": 1e-6, "weft": 1e-6, "twist": -1e-9}, "twist"),
        ({"warp": 1e-6, "weft": math.nan, "twist": 1e-6}, "not a finite"),
        ({"warp": 1e-6, "weft": 1e-6, "twist": 1e-6, "coupling": 1e-6}, "indefinite"),
    ],
)
def test_inadmissible_rigidities_are_refused(values, words):
    with pytest.raises(ParameterError, match=words):
        Bending(**values)


def test_derived_needs_a_thickness():
    with pytest.raises(ParameterError, match="thickness"):
        Bending.derived(get_law("yarn-network"), -1e-4)
