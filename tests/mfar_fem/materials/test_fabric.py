"""Fabric files: presets, exact round trip, and errors that name file, line and key."""

from __future__ import annotations

import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import DataFileError, InputError, ParameterError, UnknownNameError
from mfar_fem.materials import Bending, Fabric, fabric_names, get_law

GOOD = """name = "cloth"
thickness = "0.1 mm"
areal_density = "80 g/m^2"
[law]
name = "st-venant-kirchhoff"
[law.parameters]
Ew = "2 kN/m"
Ef = "30 MPa"
nu = 0.3
G = 2e5
[bending]
warp = "45 mg*cm"
weft = "0.019 gf*cm^2/cm"
[sources]
thickness = "measured"
"""


def written(tmp_path, text):
    path = tmp_path / "cloth.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_units_of_every_kind_end_in_si(tmp_path):
    fabric = Fabric.load(written(tmp_path, GOOD))
    assert fabric.thickness == 1e-4
    assert fabric.areal_density == pytest.approx(0.08)
    assert fabric.density == pytest.approx(800.0)
    assert fabric.law.Ew == pytest.approx(20e6)  # a stiffness per width is divided by the thickness
    assert fabric.law.Ef == pytest.approx(30e6)
    assert fabric.law.G == 2e5
    assert fabric.bending.warp == pytest.approx(45 * 9.80665e-8)
    assert fabric.bending.weft == pytest.approx(1.86326e-6, rel=1e-5)
    assert fabric.membrane_scale == fabric.thickness
    assert fabric.replace(law=get_law("yarn-network")).membrane_scale == 1.0
    assert fabric.source_of("thickness") == "measured"
    assert fabric.source_of("law.G") == ""


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ('"0.1 mm"', '"0.1"', 2, "key 'thickness': unit missing: write e.g. '0.1 mm'"),
        ('"0.1 mm"', "0.1", 2, "unit missing"),
        ('"0.1 mm"', '"-0.1 mm"', 2, "must be positive"),
        ('"0.1 mm"', '"80 g/m^2"', 2, "a mass per area but a length is needed"),
        ("areal_density", "areal_densiti", 3, "did you mean 'areal_density'"),
        ('"80 g/m^2"', '"0 g/m^2"', 3, "must be positive"),
        ("st-venant-kirchhoff", "saint-venant-kirchhoff", 5, "did you mean 'st-venant-kirchhoff'"),
        ("Ew =", "EW =", 7, "has no parameter 'EW'; did you mean 'Ew'"),
        ("Ew =", "stiffness =", 7, "has no parameter 'stiffness'; known: Ew, Ef, nu, G"),
        ("nu = 0.3", "nu = 3.0", 9, "outside its bounds"),
        ("nu = 0.3", "nu = nan", 9, "not finite"),
        ("nu = 0.3", 'nu = "3 mm"', 9, "a length but a pure number"),
        ("nu = 0.3", "nu = true", 9, "must be a number"),
        ('"30 MPa"', '"30 N*m"', 8, "a rigidity .* but a stress is needed"),
        ('warp = "45 mg*cm"', 'warp = "-45 mg*cm"', 11, "must be positive"),
        ('warp = "45 mg*cm"', "", 11, "'warp' is missing"),
        ('warp = "45 mg*cm"', "derived = true", 11, "one or the other"),
        ('warp = "45 mg*cm"', 'wrap = "45 mg*cm"', 12, "did you mean 'warp'"),
        ('warp = "45 mg*cm"', 'warp = "45 mg*cm"\ncoupling = "5 uN*m"', 11, "indefinite"),
        ('thickness = "measured"', 'thicknes = "measured"', 15, "did you mean 'thickness'"),
        ('thickness = "measured"', "thickness = 3", 15, "must be a string"),
        ('name = "cloth"', "name = 3", 1, "must be a string"),
        ('name = "cloth"', "", None, "'name' is missing"),
        ('"80 g/m^2"', '"80 g/m^2', 3, "not valid TOML"),
        ("[law]\n", "", 4, "not valid TOML"),
    ],
)
def test_what_is_wrong_is_named_with_file_line_and_key(tmp_path, old, new, line, words):
    assert old in GOOD
    path = written(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(DataFileError) as caught:
        Fabric.load(path)
    assert re.search(words, str(caught.value)), str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert caught.value.exit_code == 2
    assert caught.value.line == line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[bending]", "[bendings]", "unknown key 'bendings'"),
        (GOOD[GOOD.index("[bending]") : GOOD.index("[sources]")], "", "the table \\[bending\\] is missing"),
        (GOOD[GOOD.index("[law]") : GOOD.index("[bending]")], "", "'law' is missing"),
        (GOOD[GOOD.index("[law]") : GOOD.index("[bending]")], "law = 3\n", "must be a table"),
    ],
)
def test_missing_tables(tmp_path, old, new, words):
    with pytest.raises(DataFileError, match=words):
        Fabric.load(written(tmp_path, GOOD.replace(old, new, 1)))


def test_unstable_nu_is_refused(tmp_path):
    text = GOOD[: GOOD.index("[law]")] + '[law]\nname = "eight-chain-silk"\n[law.parameters]\nnu = 0.33\n'
    with pytest.raises(DataFileError, match=r"line 7.*nu"):
        Fabric.load(written(tmp_path, text + "[bending]\nderived = true\n"))


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(UnknownNameError, match="did you mean 'faille'"):
        Fabric.load("fail")
    with pytest.raises(DataFileError, match="no such file"):
        Fabric.load(tmp_path / "absent.toml")
    with pytest.raises(DataFileError, match="cannot be read"):
        Fabric.load(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataFileError, match="UTF-8"):
        Fabric.load(tmp_path / "binary.toml")
    with pytest.raises(InputError, match="cannot write"):
        Fabric.load("faille").save(tmp_path / "absent" / "f.toml")


@pytest.mark.parametrize("values", [{"thickness": -1e-4}, {"areal_density": 0.0}, {"thickness": float("nan")}])
def test_constructor_refuses_what_is_not_physical(values):
    with pytest.raises(ParameterError, match="must be positive and finite"):
        Fabric.load("faille").replace(**values)


positive = st.floats(1e-9, 1e3)


@settings(deadline=None, max_examples=15)
@given(positive, positive, positive, positive, positive, st.floats(-0.9, 0.9))
def test_round_trip_is_exact(tmp_path_factory, h, rho, b1, b2, modulus, nu):
    law = get_law("st-venant-kirchhoff", Ew=1e7 + modulus, Ef=2e6, nu=nu, G=1e5)
    sources = {"law.nu": 'a "quoted" source'}
    fabric = Fabric("näme", law, h, rho, Bending.from_rigidities(b1, b2), sources, "two\nlines")
    path = fabric.save(tmp_path_factory.mktemp("fabric") / "f.toml")
    assert Fabric.load(path) == fabric
    assert Fabric.from_dict(fabric.to_dict()) == fabric


def test_value_semantics():
    fabric = Fabric.load("faille")
    assert hash(fabric) == hash(Fabric.load("faille"))
    assert pickle.loads(pickle.dumps(fabric)) == fabric
    assert fabric.replace(thickness=1e-4) != fabric
    with pytest.raises(TypeError):
        fabric.sources["law"] = "changed"


@pytest.mark.parametrize("name", fabric_names())
def test_presets_are_physical_and_say_where_each_number_comes_from(name, tmp_path):
    fabric = Fabric.load(name)
    assert 10e-6 < fabric.thickness < 2e-3
    assert 0.01 < fabric.areal_density < 1.0
    assert 20.0 < fabric.density < 1600.0  # no fabric is denser than its fibre (cellulose 1.5)
    assert np.linalg.eigvalsh(fabric.law.tangent_at_rest())[0] > 0.0
    assert np.linalg.eigvalsh(fabric.bending.matrix)[0] > 0.0
    assert 1e-8 < fabric.bending.warp < 1e-4
    keys = ["thickness", "areal_density", *(f"law.{p}" for p in fabric.law.values)]
    for key in [*keys, *(f"bending.{c}" for c in ("warp", "weft", "twist", "coupling"))]:
        source = fabric.source_of(key)
        assert re.search(r"doi 10\.\d{4}|github\.com|ASTM|ASSUMED|DERIVED|PROVISIONAL|the silk paper", source), key
    assert Fabric.load(fabric.save(tmp_path / "copy.toml")) == fabric


def test_preset_figures_against_their_sources():
    charmeuse = Fabric.load("silk-charmeuse")
    stiffness = charmeuse.membrane_scale * charmeuse.law.tangent_at_rest()  # N/m
    assert stiffness[[0, 0, 1], [0, 1, 1]] == pytest.approx([774.0, 894.78, 1789.56], rel=1e-6)
    assert 2 * stiffness[2, 2] == pytest.approx(102.6)  # energy G12 E12^2: the shear modulus is G12 / 2
    faille = Fabric.load("faille")
    assert faille.bending.warp == pytest.approx(1.86326e-6, rel=1e-5)
    assert (faille.membrane_scale * faille.law.tangent_at_rest())[2, 2] == pytest.approx(30.0)
    assert Fabric.load("cotton-broad").bending.warp == pytest.approx(1.15718e-5, rel=1e-5)
    assert Fabric.load("nylon-ripstop").areal_density == pytest.approx(0.03797, rel=1e-3)
    assert Fabric.load("cupro-su1098").thickness == 1.046e-4
    assert Fabric.load("paper-silk").law == get_law("eight-chain-silk", mu=87.5e3, nu=5.2, eta=1.8)
