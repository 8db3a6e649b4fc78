"""``mfar materials``: list, show, check, treloar."""

from __future__ import annotations

import json

import pytest
from typer.testing import CliRunner

from mfar_fem.cli.materials import app
from mfar_fem.errors import InputError, ParameterError, UnknownNameError
from mfar_fem.materials import law_names

runner = CliRunner()


def run(*arguments):
    return runner.invoke(app, list(arguments), catch_exceptions=True)


@pytest.mark.parametrize("arguments", [("--json",), ("list", "--json")])
def test_list(arguments):
    out = run(*arguments)
    assert out.exit_code == 0
    laws = json.loads(out.stdout)["laws"]
    assert [law["name"] for law in laws] == law_names()
    assert all({"name", "unit", "lower", "upper", "source"} <= set(p) for law in laws for p in law["parameters"])


def test_list_for_people():
    out = run()
    assert out.exit_code == 0 and "yarn-network" in out.stdout


def test_show_writes_a_picture(tmp_path):
    path = tmp_path / "plots" / "silk.png"
    out = run("show", "eight-chain-silk", "--set", "mu=90e3", "--out", str(path), "--json")
    assert out.exit_code == 0, out.output
    payload = json.loads(out.stdout)
    assert payload["values"]["mu"] == 90e3 and set(payload["curves"]) == {"warp", "weft", "bias", "shear"}
    assert path.read_bytes().startswith(b"\x89PNG")


def test_show_stops_short_of_locking():
    curves = json.loads(run("show", "yarn-network", "--json").stdout)["curves"]
    assert 0.03 < curves["warp"]["strain"][-1] < 0.066 < curves["bias"]["strain"][-1]


def test_check_passes_and_fails_by_exit_code(tmp_path):
    good = run("check", "st-venant-kirchhoff", "--json")
    assert good.exit_code == 0 and json.loads(good.stdout)["passed"] is True
    path = tmp_path / "own.py"
    path.write_text("def w(C11, C22, C12, k=2.0):\n    return k * (C11 - 1) + k * (C22 - 1)**2 + k * C12**2\n")
    bad = run("check", f"{path}:w", "--json")
    assert bad.exit_code == 1
    assert "stress-free reference" in [c["name"] for c in json.loads(bad.stdout)["checks"] if not c["passed"]]
    assert "FAILED" in run("check", f"{path}:w").stdout


def test_treloar():
    payload = json.loads(run("treloar", "--json").stdout)
    assert payload["mu_MPa"] == pytest.approx(0.294, rel=0.01) and "doi" in payload["source"]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("check", "no-such"), UnknownNameError),
        (("show", "eight-chain-silk", "--set", "nu=0.3"), ParameterError),
        (("show", "neo-hookean", "--set", "mu"), InputError),
        (("show", "neo-hookean", "--set", "mu=stiff"), InputError),
        (("show", "neo-hookean", "--strain", "-1"), InputError),
        (("show", "neo-hookean", "--out", "picture.bmp"), InputError),
    ],
)
def test_bad_input_is_an_input_error(arguments, error):
    out = run(*arguments)
    assert isinstance(out.exception, error) and out.exception.exit_code == 2
