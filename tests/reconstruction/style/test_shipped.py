"""The weights that come with the package, and the training they came from on a small scale."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from mfar_fem.errors import DataFileError, ParameterError  # noqa: E402
from reconstruction.style import align, small_features, train_features  # noqa: E402
from reconstruction.style.published import load_published  # noqa: E402
from reconstruction.style.scenes import draw_scene, view  # noqa: E402
from reconstruction.style.structure import gradient_correlation  # noqa: E402
from reconstruction.style.style_distance import colour_distance  # noqa: E402


def test_files_are_small():
    assert align.SHIPPED.stat().st_size < 5e6 and small_features.SHIPPED.stat().st_size < 5e6


def test_shipped_features_tell_unseen_scenes_apart():
    network = small_features.SmallNetwork()
    load_published(network, small_features.SHIPPED)
    found = train_features.accuracy(network, *train_features.examples(77_000, 60))
    assert found["kind"]["right"] > 0.95 and found["garment"]["right"] > 0.75 > 2 * found["garment"]["chance"]
    assert found["medallions"]["right"] > found["medallions"]["chance"] + 0.1


def test_shipped_aligner_brings_colours_nearer_and_keeps_contours():
    scene, aligner = draw_scene(np.random.default_rng([900_000, 0])), align.Aligner.load()
    before, after = [], []
    for k, (a, b) in enumerate([("mural", "textile"), ("figurine", "mural"), ("textile", "figurine")]):
        like, image = view(scene, a, np.random.default_rng(k), 128), view(scene, b, np.random.default_rng(k + 9), 128)
        made = aligner.align(image, like)
        before.append(colour_distance(like, image))
        after.append(colour_distance(like, made))
        assert gradient_correlation(image, made) > 0.6
        assert np.array_equal(made, aligner.align(image, like))
    assert np.mean(after) < 0.6 * np.mean(before)


def test_training_of_features_learns_and_repeats():
    pictures, answers = train_features.examples(0, 32, 32)
    losses: list[list[float]] = [[], []]
    for run, epochs in zip(losses, (6, 6), strict=True):
        train_features.train(pictures, answers, epochs, 16, rate=4e-3, progress=lambda step, loss, run=run: run.append(loss))
    assert losses[0] == losses[1] and len(losses[0]) == 12
    assert np.mean(losses[0][-3:]) < 0.75 * losses[0][0]


def test_layers_and_files_are_checked(tmp_path):
    assert list(small_features.SmallFeatures(layers=["block2"])(torch.rand(1, 3, 32, 32))) == ["block2"]
    with pytest.raises(ParameterError, match="block5"):
        small_features.SmallFeatures(layers=["block5"])
    with pytest.raises(DataFileError, match="--features-only"):
        small_features.SmallFeatures(tmp_path / "none.pt")
    with pytest.raises(ParameterError, match="at least 16 px"):
        align.Aligner.load().align(np.zeros((8, 40, 3), dtype=np.uint8), np.zeros((40, 40, 3), dtype=np.uint8))
