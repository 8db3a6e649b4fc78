"""Commands of scenes, dynamics and the laboratory: what they print, exit codes, errors that help."""

from __future__ import annotations

import json

import pytest

from mfar_fem.cli.main import main

SCENE = """
fabric = "silk-charmeuse"
duration = "10 ms"
[[sheet]]
kind = "rectangle"
size = ["0.1 m", "0.1 m"]
[[support]]
where = "left"
[numerics]
cells = 2
[output]
pictures = false
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return str(path)


def run(capsys, *arguments):
    code = main(list(arguments))
    out = capsys.readouterr().out
    return code, json.loads(out) if "--json" in arguments and out else out


def test_plan(capsys, scene):
    code, payload = run(capsys, "plan", scene, "--quick", "--json")
    assert code == 0 and payload["order"] == 1 and payload["seconds"] is None
    assert {t["name"]: t["on"] for t in payload["terms"]}["contact with bodies"] is False
    code, text = run(capsys, "plan", scene, "--order", "2")
    assert code == 0 and "expected time about" in text and "membrane : bending : inertia" in text


def test_simulate_and_resume(capsys, scene, tmp_path):
    out = str(tmp_path / "out")
    code, payload = run(capsys, "simulate", scene, "--out", out, "--json")
    assert code == 0 and payload["status"] == "converged" and payload["steps"] == 5 and payload["wall_s_per_simulated_s"] > 0
    code, payload = run(capsys, "simulate", scene, "--out", out, "--resume", "--json")
    assert code == 2 and "nothing to resume" in payload["error"]["message"]


def test_a_run_that_fails_exits_with_3_and_leaves_its_state(capsys, tmp_path):
    path = tmp_path / "locked.toml"
    text = SCENE.replace("silk-charmeuse", "cupro-su1098") + '[schedule]\ntimes = ["0 s", "5 ms"]\nfactors = [0, 1]\n'
    text = text.replace('[numerics]', '[[support]]\nwhere = "right"\nmove = ["30 mm", "0 m", "0 m"]\n[numerics]')
    path.write_text(text, encoding="utf-8")
    code, payload = run(capsys, "simulate", str(path), "--out", str(tmp_path / "out"), "--json")
    assert code == 3 and payload["status"] != "converged" and (tmp_path / "out" / "last.vtu").exists()


@pytest.mark.parametrize("arguments, message", [
    (("plan", "drape-spher", "--json"), "did you mean 'drape-sphere'"),
    (("simulate", "swing", "--dt", "2", "--json"), "unit missing"),
    (("simulate", "swing", "--fidelity", "fine", "--json"), "unknown fidelity"),
    (("test", "drape", "--json"), "name one fabric"),
    (("test", "drape", "faille", "--size", "iso-31", "--json"), "iso-30"),
    (("test", "swing", "silk-charmeuse", "--angle", "60", "--json"), "unit missing"),
    (("test", "spectrum", "a.png", "b.png", "--json"), "a.png"),
    (("test", "inflation", "ball", "--json"), "mylar"),
])
def test_bad_input_exits_with_2_and_says_what_would_be_right(capsys, arguments, message):
    code, payload = run(capsys, *arguments)
    assert code == 2 and message in payload["error"]["message"], payload


def test_drape_of_the_fabric_by_its_other_name(capsys, monkeypatch):
    from material_tests.drape import geometry

    monkeypatch.setitem(geometry.CELLS, "draft", (2, 24))
    options = ("--fidelity", "draft", "--folds", "4", "--no-error", "--json")
    code, payload = run(capsys, "test", "drape", "--fabric", "polyester-faille", *options)
    assert code == 0 and payload["fabric"] == "polyester faille"
    assert 5 < payload["drape_coefficient_percent"] < 95 and payload["nodes"] >= 1 and payload["wall_s"] > 0


def test_benchmarks_and_stress_test_print_their_keys(capsys):
    code, payload = run(capsys, "benchmark", "drape-sphere", "--fidelity", "draft", "--duration", "0.01", "--cells", "6", "--json")
    assert code == 0 and payload["wall_s_per_simulated_s"] > 0 and payload["public"]
    code, payload = run(capsys, "benchmark", "drape-cylinder", "--duration", "0.01", "--cells", "4", "--json")
    assert code == 0 and payload["intersects"] is False
    code, payload = run(capsys, "stress-test", "--count", "1", "--seed", "3", "--workers", "1", "--json")
    assert code == 0 and payload["cases"] == 1 and {"converged", "named_failures", "nan", "hangs", "unverified"} <= set(payload)


def test_shear_shows_its_curve(capsys):
    code, text = run(capsys, "test", "shear", "faille", "--fidelity", "draft")
    assert code == 0 and "frame" in text and "angle" in text
