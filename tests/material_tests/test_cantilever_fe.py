"""Cantilever test by finite elements against the exact elastica, and what the elastica leaves out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from material_tests import elastica
from material_tests.cantilever.fe import CELLS, option_a, option_b, run
from mfar_fem.errors import InputError, UnknownNameError
from mfar_fem.materials import Bending, Fabric, get_law

STIFF = get_law("st-venant-kirchhoff", Ew=1e9, Ef=1e9, nu=0.0, G=5e8)
WOVEN = Bending.from_rigidities(1.0e-5, 1.6e-5)


def fabric(bending, law=STIFF):
    return Fabric("test", law, 1e-4, 0.1, bending)


@pytest.mark.parametrize("angle, name", [(0.0, "warp"), (0.5 * math.pi, "weft")])
def test_overhang_of_a_woven_strip_is_that_of_the_elastica(angle, name):
    r = option_a(fabric(WOVEN), angle, cells=(8, 2))
    B = getattr(WOVEN, name)
    exact = elastica.overhang(B, r.weight)
    assert r.reading == pytest.approx(exact, rel=2e-4)
    assert math.degrees(r.chord_angle) == pytest.approx(41.5, abs=2e-4)
    # 8 x 2 elements at the exact overhang: the chord is within 0.01 degrees
    slope = elastica.overhang_sensitivity(B, r.weight)["angle"]
    assert abs(math.degrees((r.reading - exact) / slope)) < 0.01
    assert r.rigidity == pytest.approx(B, rel=6e-4)
    assert r.standard_rigidity == pytest.approx(r.rigidity * (1 + 0.00052), rel=1e-4)  # what the formula costs
    assert r.x[0] == 0.0 and r.y[-1] < 0.0 and abs(r.lateral_sag) < 1e-4


def test_error_falls_with_the_mesh():
    errors = [abs(option_a(fabric(WOVEN), cells=cells).elastica_error_percent) for cells in ((4, 2), (8, 2), (16, 2))]
    assert errors[0] > 4 * errors[1] > 16 * errors[2]


def test_strip_with_lateral_coupling_lies_between_narrow_and_cylinder():
    bending = Bending.isotropic(1e9, 0.3, 1e-4)
    r = option_a(fabric(bending), fidelity="draft")
    assert r.narrow_rigidity < r.rigidity < r.wide_rigidity
    assert r.rigidity > r.narrow_rigidity + 0.5 * (r.wide_rigidity - r.narrow_rigidity)  # 25 mm is wide
    narrow = option_a(fabric(bending), width=0.002, fidelity="draft")
    assert narrow.rigidity == pytest.approx(narrow.narrow_rigidity, rel=0.02)
    assert narrow.lateral_sag > 2 * r.lateral_sag > 0  # in widths: the narrow strip curves across freely
    cylinder = option_a(fabric(bending), fidelity="draft", free=False)
    assert cylinder.rigidity == pytest.approx(bending.warp, rel=2e-3)
    assert abs(cylinder.lateral_sag) < 0.1 * r.lateral_sag


def test_bias_strip_twists():
    soft = get_law("st-venant-kirchhoff", Ew=1e7, Ef=1e7, nu=0.0, G=2e6)
    r = option_a(fabric(WOVEN, soft), 0.25 * math.pi, fidelity="draft")
    assert abs(r.twist) > 0.005
    assert 0.9 * r.narrow_rigidity < r.rigidity < 1.2 * r.wide_rigidity


@pytest.mark.parametrize("angle", [0.0, 0.5 * math.pi])
def test_heart_loop(angle):
    r = option_b(fabric(WOVEN), angle)
    assert r.reading == pytest.approx(r.elastica_reading, rel=1e-3)
    assert r.rigidity == pytest.approx(r.narrow_rigidity, rel=5e-3)
    assert r.x[0] == r.x[-1] == 0.0 and np.max(r.x) > 0.02 and np.max(r.y) > 0.0
    with pytest.raises(InputError, match="warp or weft"):
        option_b(fabric(WOVEN), 0.3)


@pytest.mark.parametrize("option", ["A", "B"])
def test_payload_has_the_keys_of_the_exact_level(option):
    from material_tests.cli import _cantilever_exact

    cloth = fabric(WOVEN)
    payload = run(cloth, 0.0, option, fidelity="draft")
    assert set(_cantilever_exact(cloth, 0.0, option, True, 0.2)) <= set(payload)
    assert payload["level"] == "fe"


def test_bad_input():
    assert set(CELLS) == {"draft", "standard", "reference"}
    with pytest.raises(UnknownNameError, match="fidelity"):
        option_a(fabric(WOVEN), fidelity="best")
    with pytest.raises(InputError, match="options A"):
        run(fabric(WOVEN), 0.0, "C")
