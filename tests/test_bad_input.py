"""Bad input through the command line: exit code 2, one clear message, one JSON object, no traceback, nothing computed."""

from __future__ import annotations

import json

import pytest

from mfar_fem.cli.main import main
from mfar_fem.errors import SurfaceError

DESCRIPTOR = """\
kind = "strip"
data = "curve.csv"
direction = "warp"
gauge = "80 mm"
width = "50 mm"

[columns]
extension = { name = "extension", unit = "mm" }
force = { name = "force", unit = "N" }
"""
CURVE = "extension,force\n0,0\n0.4,0.5\n0.8,1.2\n1.2,2.2\n1.6,3.6\n"
FABRIC = """\
name = "test cloth"
thickness = "0.18 mm"
areal_density = "83 g/m^2"

[law]
name = "eight-chain-silk"

[law.parameters]
mu = "87.5 kPa"
nu = 5.2

[bending]
warp = "0.6 uN*m"
weft = "0.4 uN*m"

[sources]
thickness = "made up"
areal_density = "made up"
law = "made up"
bending = "made up"
"""
CALIBRATE = ["--fabric", "paper-silk", "--law", "neo-hookean", "--starts", "1", "--no-profiles", "--no-cross-validation"]


@pytest.fixture
def rejected(capsys, monkeypatch):
    """``rejected(*arguments)``: run the command, check how it was refused, return the error of the JSON object."""

    def check(*arguments) -> dict:
        capsys.readouterr()
        code = main([*map(str, arguments), "--json"])
        shown = capsys.readouterr()
        assert code == 2, shown.err
        payload = json.loads(shown.out)  # exactly one object, or this fails
        assert list(payload) == ["error"] and payload["error"]["exit_code"] == 2
        assert "Traceback" not in shown.err and "unexpected" not in shown.err
        assert len(payload["error"]["message"]) > 20
        if payload["error"]["type"] != "UsageError":  # typer frames and wraps its own
            assert " ".join(payload["error"]["message"].split()) in " ".join(shown.err.split())
        return payload["error"]

    return check


@pytest.fixture
def data(tmp_path):
    """``data(descriptor, curve)``: a folder with one experiment."""

    def make(descriptor=DESCRIPTOR, curve=CURVE):
        folder = tmp_path / "data"
        folder.mkdir()
        (folder / "warp.toml").write_text(descriptor)
        (folder / "curve.csv").write_text(curve)
        return folder

    return make


@pytest.fixture
def calibrated(rejected, data, tmp_path):
    """The error of ``mfar calibrate`` on a folder with this descriptor and this curve."""
    return lambda *files, **named: rejected("calibrate", data(*files, **named), "--out", tmp_path / "out", *CALIBRATE)


def fabric_file(tmp_path, old, new):
    assert old in FABRIC
    path = tmp_path / "cloth.toml"
    path.write_text(FABRIC.replace(old, new))
    return path, FABRIC[: FABRIC.index(old)].count("\n") + 1


# -- that good input passes, so that each test below is about its own change ----------------------------------------------
def test_the_unchanged_files_are_accepted(data, tmp_path, capsys):
    assert main(["calibrate", str(data()), "--out", str(tmp_path / "out"), *CALIBRATE, "--json"]) == 0
    assert "error" not in json.loads(capsys.readouterr().out)
    cloth, _ = fabric_file(tmp_path, "made up", "made up")
    assert main(["test", "strip", str(cloth), "--points", "3", "--json"]) == 0


# -- curves ----------------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize(("curve", "words"), [("", "empty"), ("# a comment\n\n", "empty"), ("extension,force\n", "no reading")])
def test_empty_csv(calibrated, curve, words):
    error = calibrated(curve=curve)
    assert error["path"].endswith("curve.csv") and words in error["message"]


def test_wrong_column(calibrated):
    error = calibrated(descriptor=DESCRIPTOR.replace('name = "extension"', 'name = "extention"'))
    assert error["path"].endswith("curve.csv") and error["column"] == "extention"
    assert "did you mean 'extension'" in error["message"] and "extension, force" in error["message"]


@pytest.mark.parametrize("cell", ["nan", "inf", "", "1,2", "much"])
def test_cell_that_is_no_finite_number(calibrated, cell):
    error = calibrated(curve=CURVE.replace("0.8,1.2", f'0.8,"{cell}"'))
    assert error["path"].endswith("curve.csv")
    assert (error["line"], error["column"]) == (4, "force")
    assert "finite" in error["message"] or "not a number" in error["message"] or "empty" in error["message"]


def test_extension_that_runs_back(calibrated):
    error = calibrated(curve=CURVE.replace("1.2,2.2", "0.3,2.2"))
    assert error["path"].endswith("curve.csv")
    assert (error["line"], error["column"]) == (5, "extension")
    assert "back" in error["message"] or "increas" in error["message"] or "decreas" in error["message"]


@pytest.mark.parametrize(
    ("old", "new", "key", "line"),
    [
        ('unit = "mm"', "", "extension", 8),
        ('gauge = "80 mm"', 'gauge = "80"', "gauge", 4),
        ('gauge = "80 mm"', "gauge = 80", "gauge", 4),
        ('unit = "N"', 'unit = "mm"', "force", 9),
        ('width = "50 mm"', 'width = "50 g"', "width", 5),
    ],
)
def test_units_missing_or_wrong(calibrated, old, new, key, line):
    text = DESCRIPTOR.replace(', unit = "mm"', "") if not new else DESCRIPTOR.replace(old, new)
    error = calibrated(descriptor=text)
    assert error["path"].endswith("warp.toml")
    assert (error["line"], error["column"]) == (line, key)
    assert "unit" in error["message"] or "needed" in error["message"]
    assert "write" in error["message"]  # and what would be right


# -- strips and grips ------------------------------------------------------------------------------------------------------
def test_strip_without_grips_in_a_dataset(calibrated):
    error = calibrated(descriptor=DESCRIPTOR.replace('gauge = "80 mm"\n', ""))
    assert error["path"].endswith("warp.toml") and error["column"] == "gauge"
    assert 'gauge = "80 mm"' in error["message"]


@pytest.mark.parametrize("level", ["homogeneous", "fe"])
@pytest.mark.parametrize("gauge", ["0 mm", "-80 mm", "80"])
def test_strip_whose_grips_leave_no_gauge(rejected, gauge, level):
    error = rejected("test", "strip", "paper-silk", "--gauge", gauge, "--level", level)
    assert "--gauge" in error["message"] and ("positive" in error["message"] or "unit" in error["message"])


def test_grip_on_a_side_the_mesh_does_not_have():
    from mfar_fem.materials import Fabric
    from mfar_fem.solve import Problem
    from mfar_fem.supports import Hinge
    from mfar_fem.surface import Surface, patterns

    disc = Surface.from_pattern(patterns.disc(0.05, 2), 2, (1.0, 0.0, 0.0))
    with pytest.raises(SurfaceError, match=r"'left'.*outer"):
        Problem(disc, Fabric.load("paper-silk"), [Hinge("left"), Hinge("right")], bending=False)


# -- fabrics and laws ------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("command", ["strip", "cantilever"])
@pytest.mark.parametrize("thickness", ["-0.18 mm", "0 mm"])
def test_negative_thickness(rejected, tmp_path, command, thickness):
    path, line = fabric_file(tmp_path, 'thickness = "0.18 mm"', f'thickness = "{thickness}"')
    error = rejected("test", command, path)
    assert error["path"].endswith("cloth.toml") and (error["line"], error["column"]) == (line, "thickness")
    assert "positive" in error["message"] and thickness in error["message"]


def test_negative_thickness_in_a_calibration(rejected, data, tmp_path):
    path, _ = fabric_file(tmp_path, 'thickness = "0.18 mm"', 'thickness = "-0.18 mm"')
    error = rejected("calibrate", data(), "--fabric", path, "--out", tmp_path / "out", "--law", "neo-hookean")
    assert error["column"] == "thickness" and "positive" in error["message"]


def test_fabric_without_units(rejected, tmp_path):
    path, line = fabric_file(tmp_path, 'areal_density = "83 g/m^2"', "areal_density = 0.083")
    error = rejected("test", "cantilever", path)
    assert (error["line"], error["column"]) == (line, "areal_density") and "unit" in error["message"]


@pytest.mark.parametrize(
    ("old", "new", "name", "words"),
    [
        ('mu = "87.5 kPa"', 'mu = "-87.5 kPa"', "mu", "0.001"),
        ('mu = "87.5 kPa"', "mu = nan", "mu", "finite"),
        ("nu = 5.2", "nu = 5.2\neta = -1.0", "eta", "0"),
        ("nu = 5.2", "nu = 0.3", "nu", "0.333"),
        ("nu = 5.2", "nu = 0.3333333333333333", "nu", "1/3"),
    ],
)
def test_parameter_out_of_bounds(rejected, tmp_path, old, new, name, words):
    path, _ = fabric_file(tmp_path, old, new)
    error = rejected("test", "strip", path)
    assert error["path"].endswith("cloth.toml") and error["line"] >= 8
    assert name in error["message"] and words in error["message"]


@pytest.mark.parametrize("nu", ["0.3", "0.3333333333333333", "-2"])
def test_unstable_nu_given_to_materials(rejected, nu):
    error = rejected("materials", "check", "eight-chain-silk", "--set", f"nu={nu}")
    assert "nu" in error["message"] and ("1/3" in error["message"] or "0.333" in error["message"])


def test_unknown_law(rejected, data, tmp_path):
    error = rejected("calibrate", data(), "--out", tmp_path / "out", "--law", "yarn-netwrok")
    assert error["type"] == "UnknownNameError" and "yarn-netwrok" in error["message"] and "yarn-network" in error["message"]
    error = rejected("materials", "show", "neohook")
    assert "neohook" in error["message"] and "neo-hookean" in error["message"]
    path, line = fabric_file(tmp_path, 'name = "eight-chain-silk"', 'name = "eight-chain"')
    error = rejected("test", "strip", path)
    assert error["line"] == line and "eight-chain-silk" in error["message"]
    error = rejected("study", "cupro", "--law", "rubber", "--out", tmp_path / "out")
    assert "rubber" in error["message"] and "neo-hookean" in error["message"]


# -- meshes ----------------------------------------------------------------------------------------------------------------
def test_mesh_with_a_degenerate_triangle(rejected, tmp_path):
    path = tmp_path / "sliver.obj"
    path.write_text("v 0 0 0\nv 0.1 0 0\nv 0.1 0.1 0\nv 0 0.1 0\nv 0.05 0.05 0\nf 1 2 3\nf 1 3 4\nf 1 5 3\n")
    error = rejected("mesh", "check", path)
    assert error["type"] == "DegenerateTriangleError" and error["ids"] == [2]
    assert "area" in error["message"] and "2" in error["message"]


# -- output folders --------------------------------------------------------------------------------------------------------
WRITERS = {
    "calibrate": ["calibrate", "cupro-su1098"],
    "calibrate by finite elements": ["calibrate", "cupro-su1098", "--level", "fe"],
    "validate": ["validate", "cupro-su1098", "cupro-su1098"],
    "strip": ["test", "strip", "cupro-su1098"],
    "strip by finite elements": ["test", "strip", "cupro-su1098", "--level", "fe"],
    "cantilever": ["test", "cantilever", "cupro-su1098"],
    "bending directions": ["benchmark", "bending-directions"],
    "round trip": ["study", "round-trip"],
    "cupro": ["study", "cupro"],
    "sensitivities": ["study", "sensitivities"],
    "mesh study": ["study", "mesh"],
}


@pytest.fixture
def nothing_is_computed(monkeypatch):
    """Any evaluation of a law or assembly of a shell from now on is an error that is not the user's."""
    from mfar_fem.materials import law_names
    from mfar_fem.materials.law import law_class
    from mfar_fem.shell import Shell

    def computed(*arguments, **named):
        raise AssertionError("computed before the output folder was checked")

    for cls in map(law_class, law_names()):
        monkeypatch.setattr(cls, "evaluate", computed)
    monkeypatch.setattr(Shell, "__init__", computed)


def test_the_guard_notices_a_computation(nothing_is_computed, tmp_path, capsys):
    assert main(["test", "strip", "cupro-su1098", "--out", str(tmp_path / "fine"), "--json"]) == 1
    assert "before the output folder was checked" in capsys.readouterr().out


@pytest.mark.parametrize("below", ["", "deeper/still"], ids=["a file in its place", "below a file"])
@pytest.mark.parametrize("command", WRITERS.values(), ids=WRITERS)
def test_unwritable_output_folder_before_anything_is_computed(rejected, nothing_is_computed, tmp_path, command, below):
    blocked = tmp_path / "taken"
    blocked.write_text("a regular file")
    out = blocked / below if below else blocked
    error = rejected(*command, "--out", out)
    assert str(out) in error["message"] and "--out" in error["message"]
    assert blocked.read_text() == "a regular file" and list(tmp_path.iterdir()) == [blocked]
