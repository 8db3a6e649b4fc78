"""The commands on stick figures: train, find, study."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

torch = pytest.importorskip("torch")
pytest.importorskip("cv2")
pytest.importorskip("rdflib")

import stick_figures  # noqa: E402

from mfar_fem.errors import ParameterError  # noqa: E402
from reconstruction import cli_keypoints  # noqa: E402
from reconstruction.keypoints import hrnet  # noqa: E402
from reconstruction.keypoints.samples_file import write_index  # noqa: E402
from reconstruction.keypoints.study import constraint_rates, split  # noqa: E402
from reconstruction.keypoints_file import read_keypoints  # noqa: E402
from reconstruction.landmarks import INDEX, PARTS  # noqa: E402


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    samples = [s for name, n in (("train", 6), ("validation", 4), ("test", 4)) for s in stick_figures.make(folder, n, split=name)]
    write_index(samples, folder / "samples.json")
    return folder, samples


@pytest.fixture(scope="module")
def run():
    app = typer.Typer()
    for name, command in (("keypoints", cli_keypoints.keypoints), ("train", cli_keypoints.train_keypoints),
                          ("study", cli_keypoints.study_keypoints), ("detector", cli_keypoints.study_detector)):
        app.command(name)(command)

    def call(*args):
        result = CliRunner().invoke(app, [str(a) for a in args], catch_exceptions=False)
        assert result.exit_code == 0, result.output
        return result.stdout

    return call


@pytest.fixture(autouse=True)
def tiny(monkeypatch):
    monkeypatch.setitem(hrnet.ARCHITECTURES, "tiny", hrnet.Architecture(4, (1, 1, 1), 1, 8, 1))


def test_train_then_find(folder, run, tmp_path):
    where, samples = folder
    out = tmp_path / "run"
    options = ("--arch", "tiny", "--epochs", 1, "--batch", 3, "--threads", 1, "--precision", "bfloat16")
    payload = json.loads(run("train", "--data", where, "--out", out, *options, "--json"))
    assert payload["epochs"] == 1 and payload["reason"] == "all epochs done"
    assert {g["value"] for g in payload["groups"]} >= {"all", "visible", "hidden", "mural", "figurine", "left_wrist"}
    pictures = [s.image_path for s in samples[:2]]
    found = tmp_path / "found"
    shown = run("keypoints", *pictures, "--weights", out / "detector.pt", "--out", found, "--heatmaps")
    assert pictures[0].name in shown
    back = read_keypoints(found / "keypoints.json")
    assert len(back.images) == 2 and back.images[0].kind == "mural" and tuple(back.images[0].size) == (144, 192)
    assert (found / "predictions.png").exists() and len(list(found.glob("heatmaps_*.png"))) == 2


def test_study(folder, run, tmp_path):
    where, _ = folder
    options = ("--arch", "tiny", "--epochs", 1, "--batch", 6, "--seeds", 1, "--threads", 1, "--arms", "graph,none")
    args = ("study", "--data", where, "--out", tmp_path, *options, "--json")
    payload = json.loads(run(*args))
    names = [r["method"] for r in payload["rows"]]
    assert names[:3] == ["network, graph", "network, none", "mean pose"]
    assert payload["rows"][4]["method"].startswith("oracle")
    assert payload["rows"][4]["rmse_px"] < payload["rows"][2]["rmse_px"]
    assert set(payload["differences"]) == {"none"}
    with (tmp_path / "study.csv").open() as file:
        assert [r["method"] for r in csv.DictReader(file)] == names
    assert (tmp_path / "study.png").stat().st_size > 1000
    before = (tmp_path / "graph-seed0" / "best.pt").stat().st_mtime_ns
    again = json.loads(run(*args))
    assert again["rows"] == payload["rows"]
    assert (tmp_path / "graph-seed0" / "best.pt").stat().st_mtime_ns == before


def test_a_detector_is_scored_beside_what_does_not_look(folder, run, tmp_path):
    where, samples = folder
    options = ("--arch", "tiny", "--epochs", 1, "--batch", 6, "--threads", 1)
    run("train", "--data", where, "--out", tmp_path / "run", *options, "--json")
    weights = tmp_path / "run" / "detector.pt"
    payload = json.loads(run("detector", "--data", where, "--weights", weights, "--out", tmp_path / "out", "--json"))
    rows = {(r["method"], r["group"]): r for r in payload["rows"]}
    seen = rows["detector", "in sight"]
    parts = [rows["detector", f"in sight, {part}"]["n"] for part in PARTS]
    assert seen["n"] == sum(parts) == sum(s.visible.sum() for s in samples if s.split == "test")
    apart = seen["rmse_input_px"] - rows["mean pose", "in sight"]["rmse_input_px"]
    assert payload["differences"]["mean pose"]["difference"] == pytest.approx(apart)
    assert payload["trained"]["trained_by"] == "mfar train keypoints"
    with (tmp_path / "out" / "detector.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(payload["rows"])
    shown = run("detector", "--data", where, "--weights", weights, "--out", tmp_path / "out")
    assert "detector minus mean pose" in shown


def test_the_truth_obeys_the_graph_but_not_the_literal_formula(folder):
    _, samples = folder
    rates = constraint_rates(samples)
    assert max(v for k, v in rates.items() if not k.startswith("literal")) == 0
    assert rates["literal: wrist"] > 0.3
    upside_down = samples[0].keypoints.copy()
    upside_down[[INDEX["left_ankle"], INDEX["left_neckline"]]] = upside_down[[INDEX["left_neckline"], INDEX["left_ankle"]]]
    from dataclasses import replace

    wrong = constraint_rates([replace(samples[0], keypoints=upside_down)])
    assert wrong["waist_above_ankle_left"] == 1 and np.nansum(list(wrong.values())) > 3


def test_splits_are_checked(folder):
    from dataclasses import replace

    _, samples = folder
    held_out = replace(samples[-1], split="test-type", identity="new")
    assert held_out in split([*samples, held_out])[2]
    with pytest.raises(ParameterError, match="none of train, validation, test"):
        split([*samples, replace(samples[0], split="holdout")])
    with pytest.raises(ParameterError, match="no sample is in the split 'validation'"):
        split([s for s in samples if s.split != "validation"])
    with pytest.raises(ParameterError, match="both train and test"):
        split([*samples, replace(samples[0], split="test")])
