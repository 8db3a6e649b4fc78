"""The README is the landing page: its Python runs, its fabric file loads, and the commands it names exist."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from mfar_fem.cli.main import SHORT_HELP

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_python_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scope = {}
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), scope)
    assert scope["pulled"].converged
    rmse = (scope["error"] ** 2).mean() ** 0.5
    assert rmse < 5.0  # preset fitted on the reference mesh, run on the standard one
    assert f"RMSE {rmse:.1f} % of the measured range of 100 N/m" in capsys.readouterr().out
    assert scope["pulled"].sensitivity[-1, 0] < 0  # a trellis that locks later carries less
    assert scope["shear"].min() < 5 < 40 < scope["shear"].max() < 90


def test_fabric_file_loads():
    from mfar_fem.materials import Fabric

    (block,) = blocks("toml")
    fabric = Fabric.from_dict(tomllib.loads(block))
    assert fabric.areal_density == pytest.approx(0.06944)
    assert fabric.law.G == pytest.approx(30 / 0.12e-3)


def test_commands_and_make_targets_named_exist():
    for command in re.findall(r"\bmfar (?!fem)([a-z]+(?:-[a-z]+)*)\b", README):
        assert command in SHORT_HELP, command
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    named = set(re.findall(r"`?make ([a-z]+)`?", "\n".join(blocks("sh")))) | set(re.findall(r"`make ([a-z]+)`", README))
    assert {"demo", "test", "validate", "bench"} <= named
    for target in named:
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_pictures_exist():
    for path in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", README):
        assert path.startswith("http") or (ROOT / path).exists(), path
