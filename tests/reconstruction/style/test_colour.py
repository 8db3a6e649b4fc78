"""Colour spaces against published values, and there and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.style import colour

UNIT = st.floats(0.0, 1.0, allow_nan=False)


@pytest.mark.parametrize(("rgb", "lab"), [
    ((1, 1, 1), (100, 0, 0)), ((0, 0, 0), (0, 0, 0)),
    ((1, 0, 0), (53.24, 80.09, 67.20)), ((0, 1, 0), (87.73, -86.18, 83.18)), ((0, 0, 1), (32.30, 79.19, -107.86)),
])
def test_known_colours(rgb, lab):  # the primaries of sRGB under D65, as colour calculators list them
    assert colour.lab_from_srgb(np.array(rgb, dtype=float)) == pytest.approx(lab, abs=0.02)


def test_agrees_with_another_implementation():
    skcolor = pytest.importorskip("skimage.color")
    rgb = np.random.default_rng(0).random((50, 3))
    assert colour.lab_from_srgb(rgb) == pytest.approx(skcolor.rgb2lab(rgb), abs=0.02)


@given(st.tuples(UNIT, UNIT, UNIT))
def test_there_and_back(rgb):
    rgb = np.array(rgb)
    assert colour.srgb_from_lab(colour.lab_from_srgb(rgb)) == pytest.approx(rgb, abs=1e-6)
    if rgb.min() > 0.05:  # lαβ cuts logarithms off at black
        assert colour.srgb_from_lalphabeta(colour.lalphabeta_from_srgb(rgb)) == pytest.approx(rgb, abs=1e-6)


def test_grey_has_no_alpha_beta_in_the_cone_space_of_the_paper():
    grey = colour.lalphabeta_from_srgb(np.full((1, 3), 0.5))[0]
    assert abs(grey[1]) < 0.02 and abs(grey[2]) < 0.02 and grey[0] < -0.5


def test_rounding_is_exact_at_the_ends():
    assert colour.to_uint8(np.array([-0.2, 0.0, 0.5, 1.0, 1.7])).tolist() == [0, 0, 128, 255, 255]
