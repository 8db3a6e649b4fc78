"""The commands `fuse` and `study matching`, called as the command line calls them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from PIL import Image

from mfar_fem.errors import DataFileError, InputError
from reconstruction.cli_fuse import fuse, matching
from reconstruction.landmarks import LANDMARKS, PARTS

app = typer.Typer()
app.command("fuse")(fuse)
app.command("matching")(matching)


def call(*args):
    """Run a command; errors come through."""
    typer.main.get_command(app).main(args=[str(a) for a in args], standalone_mode=False)


@pytest.fixture
def folder(tmp_path):
    folder = tmp_path / "sources"
    folder.mkdir()
    rng = np.random.default_rng(0)
    for name in ("a.png", "b.png"):
        Image.fromarray(np.repeat(np.repeat(rng.integers(0, 255, (30, 40, 3), dtype=np.uint8), 4, 0), 4, 1)).save(folder / name)
    return folder


def test_template_then_errors_then_a_run(folder, tmp_path, capsys):
    with pytest.raises(DataFileError, match="--template"):
        call("fuse", folder, "--out", tmp_path / "out")
    call("fuse", folder, "--template", "--json")
    assert json.loads(capsys.readouterr().out)["template"].endswith("sources.toml")
    with pytest.raises(DataFileError, match=r"line 6.*'\?' is none of mural"):
        call("fuse", folder, "--out", tmp_path / "out")
    path = folder / "sources.toml"
    text = path.read_text(encoding="utf-8").replace('kind = "?"', 'kind = "figurine"').replace('licence = "?"', 'licence = "CC0"')
    path.write_text(text, encoding="utf-8")
    call("fuse", folder, "--out", tmp_path / "out", "--json", "--gamma-low", 0.5)
    payload = json.loads(capsys.readouterr().out)
    assert len(payload["pairs"]) == 1 and payload["pairs"][0]["status"].startswith("failed")
    assert (tmp_path / "out" / "fusion.json").is_file()
    call("fuse", folder, "--out", tmp_path / "out")
    shown = capsys.readouterr().out
    assert "no two pictures are joined by a matched pair" in shown and "figurine" in shown


def test_keypoints_in_the_output_become_measurements_votes_and_conflicts(folder, tmp_path, capsys):
    call("fuse", folder, "--template")
    path = folder / "sources.toml"
    text = path.read_text(encoding="utf-8").replace('licence = "?"', 'licence = "CC0"')
    path.write_text(text.replace('kind = "?"', 'kind = "textile"', 1).replace('kind = "?"', 'kind = "mural"'), encoding="utf-8")
    out = tmp_path / "out"
    call("fuse", folder, "--out", out)
    assert "mfar keypoints" in " ".join(capsys.readouterr().out.split())
    half = dict(zip(PARTS, (20, 40, 60, 8, 20, 24), strict=True))  # px from the middle: 40 px between the shoulders
    down = dict(zip(PARTS, (20, 30, 40, 15, 60, 100), strict=True))
    points = [[80 + side * half[part], down[part]] for part in PARTS for side in (1, -1)]
    images = [{"path": f"../sources/{name}", "kind": kind, "figure": None, "size": [160, 120], "keypoints": points, "sigma": 0.5,
               "scale": {"metres_per_pixel": width / 40, "relative_sigma": 0.01}}
              for name, kind, width in (("a.png", "textile", 0.5), ("b.png", "mural", 0.9))]  # fmt: skip
    contents = {"format": "mfar keypoints", "version": 1, "garment": "round-collar-robe", "landmarks": list(LANDMARKS),
                "images": images}  # fmt: skip
    (out / "keypoints.json").write_text(json.dumps(contents), encoding="utf-8")
    call("fuse", folder, "--out", out, "--vote", "paper", "--json")
    stage = json.loads(capsys.readouterr().out)["stages"]["measurements"]
    shoulders = next(v for v in stage["votes"] if v["name"] == "shoulder_width")
    assert shoulders["value_m"] == pytest.approx((0.5 * 0.5 + 0.2 * 0.9) / 0.7, rel=1e-6)  # the paper's weights
    assert any(c["name"] == "shoulder_width" and abs(c["z"]) > 2 for c in stage["conflicts"])
    call("fuse", folder, "--out", out)
    shown = " ".join(capsys.readouterr().out.split())
    assert "conflict: shoulder_width" in shown and "textile, mural" in shown


def test_wrong_options_are_errors(folder, tmp_path):
    call("fuse", folder, "--template")
    wrong = {("--detector", "orb"): "sift, aliked", ("--cutoff", "0"): "cutoff", ("--detector", "aliked"): "weights",
             ("--vote", "loud"): "precision"}  # fmt: skip
    for options, says in wrong.items():
        with pytest.raises(InputError, match=says):
            call("fuse", folder, "--out", tmp_path / "out", *options)
    with pytest.raises(InputError, match="holds no folder"):
        call("matching", "--data", tmp_path, "--out", tmp_path / "study")
