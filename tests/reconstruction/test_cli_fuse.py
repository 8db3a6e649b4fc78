"""The commands `fuse` and `study matching`, called as the command line calls them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import typer
from PIL import Image

from mfar_fem.errors import DataFileError, InputError
from reconstruction.cli_fuse import fuse, matching

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
    assert "2 groups that hang together" in shown and "figurine" in shown


def test_wrong_options_are_errors(folder, tmp_path):
    call("fuse", folder, "--template")
    wrong = {("--detector", "orb"): "sift, aliked", ("--cutoff", "0"): "cutoff", ("--detector", "aliked"): "weights"}
    for options, says in wrong.items():
        with pytest.raises(InputError, match=says):
            call("fuse", folder, "--out", tmp_path / "out", *options)
    with pytest.raises(InputError, match="holds no folder"):
        call("matching", "--data", tmp_path, "--out", tmp_path / "study")
