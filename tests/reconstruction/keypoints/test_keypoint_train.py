"""Training and prediction on stick figures: it learns, repeats, goes on where it was killed, calibrates, saves and loads."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("cv2")
pytest.importorskip("rdflib")

import stick_figures  # noqa: E402

from mfar_fem.errors import DataFileError, InputError, ParameterError  # noqa: E402
from reconstruction.keypoints import baselines, predict  # noqa: E402
from reconstruction.keypoints.crops import Augmentation, read_image  # noqa: E402
from reconstruction.keypoints.evaluate import WITHIN, errors, summary  # noqa: E402
from reconstruction.keypoints.heatmaps import encode, to_map  # noqa: E402
from reconstruction.keypoints.hrnet import Architecture, build  # noqa: E402
from reconstruction.keypoints.predict import Calibration, Detector, outcomes  # noqa: E402
from reconstruction.keypoints.report import finish  # noqa: E402
from reconstruction.keypoints.train import BEST, CHECKPOINT, Trainer, TrainSettings, train  # noqa: E402
from reconstruction.landmarks import MIRROR  # noqa: E402

TINY = Architecture(6, (1, 1, 1), 1, 12, 1)
QUICK = TrainSettings(arch=TINY, epochs=2, batch_size=4, learning_rate=2e-3, milestones=(1,), threads=1)


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    folder = tmp_path_factory.mktemp("few")
    return stick_figures.make(folder, 8), stick_figures.make(folder, 4, split="validation")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """A network trained on 48 figures until it beats the mean pose, with its test figures."""
    folder = tmp_path_factory.mktemp("trained")
    parts = {"train": 48, "validation": 16, "test": 16}
    training, validation, test = (stick_figures.make(folder, n, split=name, absent=0.3) for name, n in parts.items())
    settings = replace(QUICK, epochs=7, milestones=(5,), learning_rate=6e-3, augmentation=Augmentation(5.0), arm="none",
                       precision="bfloat16")
    result = train(training, validation, folder / "run", settings)
    return folder, training, validation, test, result


def columns(result, *names):
    return [[row[n] for n in names] for row in result.history]


def test_a_killed_run_goes_on_as_if_nothing_had_happened(few, tmp_path):
    whole = train(*few, tmp_path / "whole", QUICK)
    train(*few, tmp_path / "broken", replace(QUICK, epochs=1))
    assert (tmp_path / "broken" / CHECKPOINT).exists()
    resumed = train(*few, tmp_path / "broken", QUICK, resume=True)
    names = ("epoch", "rate", "loss", "mse", "knowledge", "validation_mse", "validation_rmse_px")
    assert columns(whole, *names) == columns(resumed, *names)  # bitwise
    for a, b in zip(whole.model.state_dict().values(), resumed.model.state_dict().values(), strict=True):
        assert torch.equal(a, b)
    assert [row["rate"] for row in whole.history] == pytest.approx([2e-3, 2e-4])
    again = train(*few, tmp_path / "broken", QUICK, resume=True)
    assert columns(again, "loss") == columns(whole, "loss")
    with pytest.raises(DataFileError, match=r"run with learning_rate = 0\.002, not 0\.1"):
        train(*few, tmp_path / "broken", replace(QUICK, learning_rate=0.1), resume=True)


def test_arms_differ_and_share_their_first_weights(few):
    trainers = {arm: Trainer(replace(QUICK, arm=arm)) for arm in ("graph", "none", "literal", "shuffled", "graph-pixels")}
    first = [t.model.conv1.weight for t in trainers.values()]
    assert all(torch.equal(first[0], w) for w in first)
    from reconstruction.keypoints.data import Dataset

    batch = Dataset(few[0]).batch(range(4))
    terms = {arm: t.forward(batch)[1].item() for arm, t in trainers.items()}
    assert terms["none"] == 0 and terms["graph"] > 0
    assert len({terms[arm] for arm in ("none", "graph", "shuffled")}) == 3
    # points that are not found are told nothing: an untrained network hears next to nothing unless the gate is opened
    loud = Trainer(replace(QUICK, gate=False)).forward(batch)[1].item()
    assert terms["graph"] < 0.1 * loud


def test_masks_of_the_points_reach_the_loss(few):
    from reconstruction.keypoints.data import Dataset

    batch = Dataset(few[0]).batch(range(4))
    assert not batch.visible.all()
    losses = {w: Trainer(replace(QUICK, arm="none", hidden_weight=w)).forward(batch)[0].item() for w in (0.0, 1.0)}
    assert losses[0.0] != losses[1.0]
    present = batch.present.copy()
    present[:, 4] = False
    hidden = replace(batch, present=present, visible=batch.visible & present)
    weights = {w: Trainer(replace(QUICK, arm="none", absent_weight=w)) for w in (0.0, 1.0)}
    gradients = {}
    for w, trainer in weights.items():
        trainer.forward(hidden)[0].backward()
        gradients[w] = trainer.model.head[3].weight.grad[4].abs().max().item()
    assert gradients[0.0] == 0 and gradients[1.0] > 0


def test_early_stop_time_limit_and_wrong_input(few, tmp_path):
    stopped = train(*few, tmp_path / "a", replace(QUICK, epochs=9, learning_rate=1e-12, patience=1))
    assert len(stopped.history) < 9 and "no better validation" in stopped.reason
    short = train(*few, tmp_path / "b", replace(QUICK, max_seconds=1e-3))
    assert len(short.history) == 1 and "time is up" in short.reason
    calls = []
    train(*few, tmp_path / "c", replace(QUICK, epochs=1), progress=lambda n, description: calls.append(description))
    assert calls == ["epoch 1 of 1"] * 2
    for name in ("log.csv", "curves.png", BEST, CHECKPOINT):
        assert (tmp_path / "c" / name).stat().st_size > 50
    with pytest.raises(ParameterError, match="both training and validation"):
        train(few[0], few[0][:1], tmp_path / "d", QUICK)
    with pytest.raises(ParameterError, match="at least 2 and 1"):
        train(few[0], [], tmp_path / "d", QUICK)
    for bad in ({"arm": "none at all"}, {"precision": "float8"}, {"epochs": 0}, {"batch_size": 1}, {"frame": "mine"}):
        with pytest.raises(ParameterError):
            replace(QUICK, **bad)
    assert TrainSettings.from_dict(QUICK.to_dict()) == QUICK


def test_it_learns(trained):
    folder, training, _, test, result = trained
    p = Detector.load(folder / "run" / BEST).predict_samples(test)
    network = summary([errors(p.points, test, p.scale)], replicates=0)["rmse_input_px"]
    mean = summary([errors(baselines.mean_pose(training, test), test)], replicates=0)["rmse_input_px"]
    assert network < 0.6 * mean, (network, mean)
    assert result.history[-1]["loss"] < 0.5 * result.history[0]["loss"]


def test_the_report_calibrates_and_draws(trained):
    folder, _, validation, test, _ = trained
    scores = finish(folder / "run", validation, test, replicates=20)
    assert scores["calibration_error"] < 0.15
    assert scores["present_accuracy"] >= scores["present_chance"]
    for name in ("detector.pt", "scores.json", "reliability.png", "predictions.png", "heatmaps.png"):
        assert (folder / "run" / name).stat().st_size > 100
    detector = Detector.load(folder / "run" / "detector.pt")
    p = detector.predict_samples(test)
    assert p.within == WITHIN
    score, near, present = outcomes(test, p, WITHIN)
    assert ((0 < p.confidence) & (p.confidence < 1)).all()
    assert abs(p.confidence[present].mean() - near[present].mean()) < 0.15
    assert score.shape == near.shape == (16, 12)
    # a point whose confidence is that of a Gaussian: the standard deviation says so
    sigma = p.deviations() * p.scale[:, None]
    assert 1 - np.exp(-0.5 * (WITHIN / sigma) ** 2) == pytest.approx(p.confidence, rel=1e-6)


class Painter(torch.nn.Module):
    """In place of a network: heat maps of known points, moved as the crop says."""

    def __init__(self, points):
        super().__init__()
        self.arch, self.points = TINY, points

    def forward(self, images):
        return torch.from_numpy(np.stack([encode(to_map(p)) for p in self.points[: len(images)]]))


def test_points_come_back_in_image_pixels_with_any_box():
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (300 + 50 * i, 400, 3)).astype(np.uint8) for i in range(3)]
    inside = rng.uniform([10, 10], [180, 245], (3, 12, 2))
    detector = Detector(Painter(inside), 3.0)
    boxes = [None, (50.0, 20.0, 200.0, 320.0), (-30.0, 0.0, 500.0, 300.0)]
    p = detector.predict(images, boxes, keep_heatmaps=True)
    for i in range(3):
        back = p.points[i] @ p.matrices[i][:, :2].T + p.matrices[i][:, 2]
        assert back == pytest.approx(inside[i], abs=0.05)
    assert p.within is None and p.confidence.max() <= 1
    tops = p.alternatives(1)
    assert len(tops["left_wrist"]) == 1
    assert (tops["left_wrist"][0].x, tops["left_wrist"][0].y) == pytest.approx(p.points[1][4], abs=0.2)
    with pytest.raises(ParameterError, match="boxes for"):
        detector.predict(images, boxes[:2])
    with pytest.raises(ParameterError, match="keep_heatmaps"):
        detector.predict(images[:1]).alternatives(0)
    assert len(detector.predict([])) == 0


def test_batches_do_not_matter_and_flipping_is_symmetric(trained):
    folder, _, _, test, _ = trained
    detector = Detector.load(folder / "run" / BEST)
    images = [read_image(s.image_path) for s in test[:5]]
    a, b = detector.predict(images, batch_size=2), detector.predict(images, batch_size=5)
    assert a.points == pytest.approx(b.points, abs=1e-3)
    detector.flip = True
    here, mirrored = detector.predict(images), detector.predict([np.ascontiguousarray(i[:, ::-1]) for i in images])
    turned = mirrored.points[:, list(MIRROR)]
    turned[..., 0] = images[0].shape[1] - 1 - turned[..., 0]
    assert turned == pytest.approx(here.points, abs=0.15)  # bilinear weights are multiples of 1/32 in opencv


def test_saving_in_16_bits_changes_little_and_wrong_files_are_named(trained, tmp_path):
    folder, _, _, test, result = trained
    exact = Detector(result.model, 3.0).predict_samples(test)
    stored = Detector.load(folder / "run" / BEST).predict_samples(test)
    assert np.quantile(np.abs(exact.points - stored.points), 0.98) < 0.3
    calibration = Detector(result.model, 3.0).calibrate(test)
    assert Calibration.from_dict(asdict(calibration)) == calibration
    kept = Detector(result.model, 3.0, 0.1, calibration, True, {"a": "b"})
    kept.save(tmp_path / "x.pt")
    back = Detector.load(tmp_path / "x.pt")
    assert (back.calibration, back.margin, back.flip, back.notes) == (calibration, 0.1, True, {"a": "b"})
    with pytest.raises(DataFileError, match="no such file"):
        Detector.load(tmp_path / "no.pt")
    torch.save({"a": 1}, tmp_path / "other.pt")
    with pytest.raises(DataFileError, match="is no detector"):
        Detector.load(tmp_path / "other.pt")
    with pytest.raises(ParameterError, match="17 heat maps"):
        Detector(build(replace(TINY, joints=17)), 3.0)


def test_without_shipped_weights_the_way_out_is_said(monkeypatch, tmp_path):
    monkeypatch.setattr(predict, "SHIPPED_FILE", tmp_path / "none.pt")
    with pytest.raises(InputError, match="mfar train keypoints"):
        Detector.load()
