"""The commands: one JSON object, files where they are said to be, errors that name the option."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from mfar_fem.errors import DataFileError, InputError, UnknownNameError
from reconstruction import cli_style
from reconstruction.style.scenes import draw_scene, view

image_module = pytest.importorskip("PIL.Image")


def invoke(function, *arguments):
    app = typer.Typer()
    app.command()(function)
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder, scene = tmp_path_factory.mktemp("pictures"), draw_scene(np.random.default_rng(3))
    for kind in ("mural", "textile"):
        image_module.fromarray(view(scene, kind, np.random.default_rng(0), 96)).save(folder / f"{kind}.png")
    return folder


def test_style_moves_colours_and_keeps_structure(pictures, tmp_path):
    out = tmp_path / "made.png"
    result = invoke(cli_style.style, pictures / "textile.png", "--like", pictures / "mural.png", "-o", out, "--json")
    payload = json.loads(result.stdout)
    assert payload["colour_after"] < 0.7 * payload["colour_before"] and payload["gradient_correlation"] > 0.8
    assert image_module.open(out).size == (96, 96)
    shown = invoke(cli_style.style, pictures / "textile.png", "--like", pictures / "mural.png", "-o", out, "-m", "reinhard")
    assert "colour distance" in shown.stdout


def test_style_refuses_by_name(pictures, tmp_path):
    both = (pictures / "textile.png", "--like", pictures / "mural.png")
    with pytest.raises(UnknownNameError, match="reinhard"):
        invoke(cli_style.style, *both, "-m", "rheinhard", "-o", tmp_path / "a.png")
    with pytest.raises(InputError, match="--out"):
        invoke(cli_style.style, *both, "-o", tmp_path / "a.jpg")
    with pytest.raises(DataFileError, match=r"none\.png"):
        invoke(cli_style.style, pictures / "none.png", "--like", pictures / "mural.png", "-o", tmp_path / "a.png")


def test_training_and_using_a_network(pictures, tmp_path):
    torch = pytest.importorskip("torch")
    from reconstruction.style.small_features import SmallNetwork, save_small_features

    torch.manual_seed(0)
    save_small_features(SmallNetwork(), tmp_path / "features.pt")
    (tmp_path / "list.csv").write_text("".join(
        ["path,kind,subject\n"] + [f"{pictures / kind}.png,{kind},1\n" for kind in ("mural", "textile")]))
    with pytest.raises(DataFileError, match=r"mural\.png.*patches need 128"):
        invoke(cli_style.train_style, "--data", tmp_path / "list.csv", "-o", tmp_path / "run",
               "--features", f"small={tmp_path / 'features.pt'}")
    arguments = ["-o", tmp_path / "run", "--features", f"small={tmp_path / 'features.pt'}", "--scenes", 2, "--batch", 1, "--json"]
    report = json.loads(invoke(cli_style.train_style, "--steps", 1, *arguments).stdout)
    assert report["steps"] == 1 and report["parameters"] < 1_250_000
    result = invoke(cli_style.style, pictures / "textile.png", "-l", pictures / "mural.png", "-m", "network",
                    "--weights", report["weights"], "-o", tmp_path / "made.png", "--json")
    assert json.loads(result.stdout)["ssim"] > 0.3


def test_study_writes_numbers_and_pictures(tmp_path):
    pytest.importorskip("torch")
    pytest.importorskip("cv2")
    small = ("--scenes", 2, "--size", 64, "--no-train")
    result = invoke(cli_style.study_style, *small, "--weights", "shipped", "-o", tmp_path, "--json")
    payload = json.loads(result.stdout)
    assert payload == json.loads((tmp_path / "study.json").read_text())
    assert payload["pairs"] == 12 and (tmp_path / "study.png").is_file()
    table = payload["table"]
    assert {"none", "reinhard", "monge-kantorovich", "sliced", "histogram", "untrained network", "shipped",
            "oracle kind"} == set(table)
    assert table["sliced"]["colour"]["value"] < table["reinhard"]["colour"]["value"] < table["none"]["colour"]["value"]
    assert len(payload["verdict"]) == 6
    with pytest.raises(InputError, match="NAME=FILE"):
        invoke(cli_style.study_style, "--no-train", "--weights", "file.pt", "-o", tmp_path)
