"""The commands: files written, JSON, resumption, bad input."""

from __future__ import annotations

import json
import math
import os

import pytest

from calibration.datasets import load
from calibration.study import calibrate, template_fabric
from calibration.validation import by_interval, predict_all, splits
from mfar_fem.cli.main import main
from mfar_fem.errors import InputError
from mfar_fem.materials import get_law
from mfar_fem.materials.fabric import Fabric

QUICK = ["--law", "st-venant-kirchhoff", "--law", "neo-hookean", "--starts", "1", "--json"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cupro")
    assert main(["calibrate", "cupro-su1098", "--out", str(folder), "--bootstrap", "3", *QUICK]) == 0
    return folder


def test_calibrate_writes_everything(run):
    values = json.loads((run / "calibration.json").read_text())
    assert values["best_law"] == "st-venant-kirchhoff" and 0 < values["rmse_percent_of_range"] < 30
    assert set(values["rmse_by_experiment"]) == {f"{d}, 8 cm gauge" for d in ("warp", "weft", "bias")}
    assert [r["law"] for r in values["laws"]["homogeneous"]] == ["st-venant-kirchhoff", "neo-hookean"]
    assert set(values["parameters"]["law.Ew"]) >= {"value", "profile_interval", "bootstrap_interval", "words"}
    fabric = Fabric.load(run / "parameters.toml")
    assert fabric.law.Ew == pytest.approx(values["parameters"]["law.Ew"]["value"])
    assert "cupro-su1098" in fabric.sources["law"] and "7ea8941" in fabric.sources["law"]
    for name in ("fit", "residuals", "laws", "correlation", "profiles", "intervals", "check"):
        assert (run / f"{name}.png").stat().st_size > 3000 and (run / f"{name}.svg").exists()


def test_report_is_one_self_contained_page(run):
    page = (run / "report.html").read_text()
    assert page.count("data:image/png;base64,") >= 7
    assert "<script" not in page and 'src="http' not in page and "url(" not in page
    for text in ("Profile likelihood", "Cross-validation", "In words", "st-venant-kirchhoff", "Homogeneous model against"):
        assert text in page


def test_resume_uses_the_checkpoints_and_fresh_does_not(run, capsys):
    state = json.loads((run / "checkpoints" / "homogeneous-neo-hookean.json").read_text())
    assert state["starts"]["0"]["done"]
    plain = ["calibrate", "cupro-su1098", "--out", str(run), *QUICK, "--no-profiles", "--no-cross-validation"]
    capsys.readouterr()
    assert main(plain) == 0
    out = json.loads(capsys.readouterr().out)
    assert out["best_law"] == "st-venant-kirchhoff" and out["files"]["json"].endswith("calibration.json")
    assert main([*plain, "--variant", "virgin"]) == 2
    assert "--fresh" in capsys.readouterr().err
    assert main([*plain, "--variant", "virgin", "--fresh"]) == 0


def test_validate_writes_its_study(run, tmp_path, capsys):
    code = main(["validate", str(run / "parameters.toml"), "cupro-su1098", "--out", str(tmp_path), "--json"])
    out = json.loads(capsys.readouterr().out)
    assert code == 0 and len(out["predictions"]) == 6
    intervals = {(r["direction"], r["interval"]) for r in out["error_by_strain_interval"]}
    assert ("bias", "0.15-0.20") in intervals and ("warp", "0.00-0.05") in intervals
    labels = [c["label"] for c in out["cross_validation"]]
    assert any("predict bias" in x for x in labels) and any("gauge" in x for x in labels)
    assert (tmp_path / "validation.html").read_text().count("data:image") >= 3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["calibrate", "cupro-su1098", "--law", "rubber"], "rubber"),
        (["calibrate", "nothing-here"], "cupro-su1098"),
        (["calibrate", "cupro-su1098", "--variant", "torn"], "preconditioned"),
        (["calibrate", "cupro-su1098", "--level", "exact"], "homogeneous"),
        (["calibrate", "no/such/file.toml"], "no such file"),
        (["calibrate", "cupro-su1098", "--law", "neo-hookean", "--fe-laws", "some"], "all"),
        (["calibrate", "cupro-su1098", "--law", "neo-hookean", "--bootstrap-method", "x", "--bootstrap", "2"], "known"),
        (["validate", "no-such-fabric", "cupro-su1098"], "no-such-fabric"),
    ],
)
def test_bad_input_exits_with_2(arguments, message, tmp_path, capsys):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert message in capsys.readouterr().err.replace("\n", " ")


def test_unwritable_output_is_noticed_before_computing(tmp_path, capsys, monkeypatch):
    blocker = tmp_path / "file"
    blocker.write_text("not a folder")
    monkeypatch.setattr("calibration.study.calibrate", lambda *a, **k: pytest.fail("computed before checking"))
    assert main(["calibrate", "cupro-su1098", "--out", str(blocker / "out")]) == 2
    assert "output folder" in capsys.readouterr().err
    if os.geteuid() != 0:
        (tmp_path / "locked").mkdir(mode=0o500)
        assert main(["calibrate", "cupro-su1098", "--out", str(tmp_path / "locked")]) == 2


def test_unconverged_calibration_exits_with_3_and_writes(tmp_path):
    code = main(["calibrate", "cupro-su1098", "--out", str(tmp_path), *QUICK[:2], "--max-evaluations", "1", "--no-profiles"])
    values = json.loads((tmp_path / "calibration.json").read_text())
    assert code == 3 and not values["converged"] and any("did not converge" in w for w in values["warnings"])


def test_second_level_starts_from_the_homogeneous_answer():
    from calibration import forward, homogeneous

    seen = []

    class Softer:
        def __init__(self, experiment):
            self.inner = homogeneous.model(experiment)

        def predict(self, fabric, x, names=()):
            from dataclasses import replace

            p = self.inner.predict(fabric, x, names)
            seen.append(fabric.law.Ew)
            return replace(p, y=0.8 * p.y, jacobian=None if p.jacobian is None else 0.8 * p.jacobian)

    forward.register("softer", Softer)
    laws = [get_law("st-venant-kirchhoff"), get_law("neo-hookean")]
    study = calibrate(
        load("cupro-su1098"), laws, level="softer", starts=1, with_profiles=False, cross_validation=False
    )
    first = study.levels["homogeneous"][0].fit
    assert seen[0] == pytest.approx(first.law.Ew) and len(study.levels["softer"]) == 1
    assert study.fit.law.Ew == pytest.approx(first.law.Ew / 0.8, rel=1e-3)
    assert study.fit.law.G == pytest.approx(first.law.G / 0.8, rel=1e-3)
    both = study.level_pairs()[0]
    assert both["homogeneous"] == pytest.approx(both["softer"], rel=1e-3)


def test_splits_and_intervals():
    data = load("cupro-su1098")
    found = splits(data.experiments)
    assert [len(train) for _, train, _ in found] == [2, 2, 3, 3]
    fabric = template_fabric(data, get_law("st-venant-kirchhoff"))
    rows = by_interval(predict_all(fabric, data.experiments))
    assert sum(r["n_readings"] for r in rows) == sum(len(e) for e in data.experiments)
    assert fabric.bending.warp == pytest.approx(10.02e-6) and math.isclose(fabric.thickness, 0.1046e-3)


def test_dataset_without_thickness_needs_a_fabric():
    from dataclasses import replace

    bare = replace(load("cupro-su1098"), thickness=None)
    with pytest.raises(InputError, match="--fabric"):
        template_fabric(bare, get_law("neo-hookean"))
    whole = template_fabric(load("cupro-su1098"), get_law("neo-hookean"))
    assert template_fabric(bare, get_law("neo-hookean"), whole) is whole
    derived = template_fabric(replace(load("cupro-su1098"), bending={}), get_law("neo-hookean"))
    assert "not measured" in derived.sources["bending"]
