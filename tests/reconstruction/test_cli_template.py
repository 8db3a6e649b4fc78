"""``mfar template`` from file to folder."""

import json
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from reconstruction.cli_template import template
from reconstruction.keypoints_file import KeypointsFile, write_keypoints
from reconstruction.template.garmentcode import read_garmentcode

sys.path.insert(0, str(Path(__file__).parent / "template"))
from pattern_pictures import Flat, draw

app = typer.Typer()
app.command()(template)
WRITTEN = {"template.svg", "template.dxf", "template.json", "measurements.csv", "votes.csv", "conflicts.csv", "boundaries.csv",
           "poses.json", "overview.png"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fusion")
    images = (draw(folder, "robe", "textile", Flat(), 200, noise=0.5), draw(folder, "mural", "mural", Flat(), 200, figure="male"))
    write_keypoints(folder / "keypoints.json", KeypointsFile(images, "round-collar-robe"))
    return folder


@pytest.mark.parametrize("given", ["", "keypoints.json"])
def test_folder_or_file_makes_all_files(folder, given, tmp_path):
    pytest.importorskip("ezdxf")
    result = CliRunner().invoke(app, [str(folder / given), "--out", str(tmp_path / "out"), "--json"])
    assert result.exit_code == 0, result.output
    payload = json.loads(result.stdout)
    assert {Path(p).name for p in payload["files"].values()} == WRITTEN == {p.name for p in (tmp_path / "out").iterdir()}
    assert payload["garment"] == "round-collar-robe"
    length = next(v for v in payload["votes"] if v["name"] == "garment_length")
    assert length["value_m"] == pytest.approx(1.38, rel=0.02) and length["weights"].keys() == {"textile", "mural"}
    assert read_garmentcode(tmp_path / "out" / "template.json").panels.keys() == set(payload["panels"])
    assert (tmp_path / "out" / "overview.png").stat().st_size > 20_000


def test_text_output_names_assumptions_and_another_type(folder, tmp_path):
    result = CliRunner().invoke(app, [str(folder), "--out", str(tmp_path), "--type", "half-sleeve", "--loom", "30 cm"])
    assert result.exit_code == 0, result.output
    assert "half-sleeve" in result.stdout and "assumed: slit" in result.stdout and "30.0 cm needs a seam" in result.stdout


def test_a_type_that_does_not_fit_the_lengths_is_doubted(folder, tmp_path):
    right = CliRunner().invoke(app, [str(folder), "--out", str(tmp_path / "a")])
    wrong = CliRunner().invoke(app, [str(folder), "--out", str(tmp_path / "b"), "--type", "half-sleeve"])
    assert "are type and scale right?" not in right.stdout
    assert "garment_length is 138 cm, of a half-sleeve usually about 60 cm" in wrong.stdout.replace("\n", " ")


def test_wrong_type_and_missing_file_are_errors(folder, tmp_path):
    result = CliRunner().invoke(app, [str(folder), "--out", str(tmp_path), "--type", "toga"])
    assert "unknown type of garment 'toga'" in str(result.exception)
    result = CliRunner().invoke(app, [str(tmp_path / "none.json"), "--out", str(tmp_path)])
    assert "no such file" in str(result.exception)
