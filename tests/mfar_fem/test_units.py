"""Units: published conversions, textile habits, and errors that help."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem import units
from mfar_fem.errors import DataFileError


@pytest.mark.parametrize(
    ("text", "target", "value"),
    [
        ("0.1046 mm", "m", 1.046e-4),
        ("105.6 g/m^2", "kg/m^2", 0.1056),
        # Matsudaira et al. 2015, doi 10.4188/jte.61.69: faille and cotton broad, KES-FB2
        ("0.019 gf*cm^2/cm", "N*m", 1.86326e-6),
        ("0.118 gf cm2/cm", "N*m", 1.15718e-5),
        ("12.38 mg/cm^2", "kg/m^2", 0.1238),
        # nylon ripstop certificate: 1.12 oz/yd2 is 38 g/m2, 48 lbf/in is 8.41 kN/m
        ("1.12 oz/yd^2", "kg/m^2", 0.0379744),
        ("48 lbf/in", "N/m", 8406.09),
        ("19 momme", "kg/m^2", 0.08246),
        ("20 denier", "kg/m", 20e-3 / 9000),
        ("30 tex", "kg/m", 30e-6),
        ("10.02 µN·m", "N*m", 1.002e-5),
        ("10.02 uN*m", "N*m", 1.002e-5),
        ("100 gf/cm", "N/m", 98.0665),
        ("0.356 cN*cm", "N*m", 35.6e-6),
        ("4 %", "-", 0.04),
        ("5.2", "-", 5.2),
        (5.2, "-", 5.2),
        ("45 deg", "rad", 0.7853981633974483),
    ],
)
def test_published_conversions(text, target, value):
    assert units.parse(text, target) == pytest.approx(value, rel=1e-5)


def test_d1388_rigidity_in_mg_cm_is_a_weight():
    # D1388: G[mg cm] = W[mg/cm2] c^3[cm3]; the same in SI is the weight per area times c^3.
    mass_mg_cm2, c_cm = 8.3, 1.8
    weight = units.parse(f"{mass_mg_cm2} mg/cm^2", "kg/m^2") * units.STANDARD_GRAVITY
    expected = weight * units.parse(f"{c_cm} cm", "m") ** 3
    assert units.parse(f"{mass_mg_cm2 * c_cm**3} mg*cm", "N*m") == pytest.approx(expected, rel=1e-12)
    assert units.factor("mg*cm", "N*m") == pytest.approx(9.80665e-8, rel=1e-12)
    assert units.factor("mgf*cm", "N*m") == pytest.approx(9.80665e-8, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "target", "words"),
    [
        ("0.1", "m", "unit missing: write e.g. '0.1 mm'"),
        (0.1, "m", "unit missing"),
        ("0.1 mm", "kg/m^2", "'mm' is a length but a mass per area is needed"),
        ("100 g/cm", "N/m", "write 'gf'"),
        ("0.1 millimoter", "m", "unknown unit 'millimoter'"),
        ("1,5 mm", "m", "decimal point"),
        ("mm", "m", "not a number"),
        ("nan mm", "m", "not a number"),
        ("", "m", "not a number"),
        (True, "m", "not a quantity"),
        (None, "m", "not a quantity"),
        (["1 mm"], "m", "not a quantity"),
        ("5 mm", "-", "a length but a pure number"),
        ("1 mm )", "m", "unknown unit"),
        ("1 mm + 1 mm", "m", "unknown unit"),
        ("1 2 mm", "m", "unknown unit"),
        ("1e999 mm", "m", "too large"),
    ],
)
def test_what_cannot_be_read_is_said(value, target, words):
    with pytest.raises(DataFileError) as caught:
        units.parse(value, target, name="thickness", path="f.toml", line=3)
    assert words in str(caught.value)
    assert str(caught.value).startswith("f.toml, line 3, key 'thickness': ")
    assert caught.value.exit_code == 2


@settings(deadline=None, max_examples=50)
@given(st.floats(allow_nan=False, allow_infinity=False), st.sampled_from(["m", "kg/m^2", "N*m", "Pa", "N/m", "-"]))
def test_written_quantity_reads_back_exactly(value, unit):
    assert units.parse(units.write(value, unit), unit) == value
