"""The detector that is shipped: on a garment it has never seen it finds what is in sight."""

import json

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("embreex")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    from reconstruction.benchmark.case import make_case

    folder = tmp_path_factory.mktemp("case") / "robe"
    make_case(folder, "round-collar-robe", 3, size=0.03)
    return folder


def test_points_in_sight_of_an_unseen_robe_are_found(case):
    from reconstruction.keypoints.predict import Detector
    from reconstruction.keypoints.weights_file import SHIPPED_FILE
    from reconstruction.keypoints_file import read_keypoints

    assert SHIPPED_FILE.stat().st_size < 20e6
    detector = Detector.load()
    assert "mfar benchmark-data" in detector.notes["data"]
    truth = read_keypoints(case / "truth" / "keypoints.json").images
    found = detector.predict([i.path for i in truth])
    apart = np.linalg.norm(found.points - [i.points for i in truth], axis=-1) * found.scale[:, None]
    apart = apart[np.isfinite(apart)]
    assert len(apart) > 60
    assert np.median(apart) < 3.0  # px of 256 x 192, hidden ones too; 2.1 here, 1.6 over the test pictures of the benchmark
    assert np.sqrt(np.mean(apart**2)) < 4.5 and (apart < 8.0).mean() > 0.95


def test_sources_to_keypoints_to_template(case, tmp_path):
    pytest.importorskip("ezdxf")
    import typer
    from typer.testing import CliRunner

    from reconstruction.cli_keypoints import keypoints
    from reconstruction.cli_template import template

    app = typer.Typer()
    app.command("keypoints")(keypoints)
    app.command("template")(template)
    first = CliRunner().invoke(app, ["keypoints", str(case), "--out", str(tmp_path), "--json"])
    assert first.exit_code == 0, first.output
    second = CliRunner().invoke(app, ["template", str(tmp_path), "--out", str(tmp_path / "t"), "--vote", "precision", "--json"])
    assert second.exit_code == 0, second.output
    cut = json.loads((case / "truth" / "truth.json").read_text())["cut"]
    votes = {v["name"]: v["value_m"] for v in json.loads(second.stdout)["votes"]}
    assert votes["garment_length"] == pytest.approx(cut["length"], rel=0.08)
    assert votes["cross_sleeve_width"] == pytest.approx(cut["cross_sleeve"], rel=0.08)


def test_a_type_that_it_never_saw_is_said(case, tmp_path):
    from reconstruction.keypoints.locate import locate

    picture = sorted((case / "pictures").glob("figurine*.jpg"))[:1]
    assert not any("never trained" in note for note in locate(picture, tmp_path / "robe", garment="round-collar-robe")["notes"])
    assert "never trained on a veil-hat" in locate(picture, tmp_path / "hat", garment="veil-hat")["notes"][0]
