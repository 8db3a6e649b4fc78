"""Points that agree with known postures: a lost one is found again, others stay where they are."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stick_figures import pose

from reconstruction.keypoints.crops import apply, crop_matrix
from reconstruction.keypoints.data import Sample
from reconstruction.keypoints.heatmaps import decode, encode, to_input, to_map
from reconstruction.keypoints.postures import FAR, FLOOR, Postures
from reconstruction.landmarks import INDEX, LANDMARKS, points_of

ALL = np.ones(12, dtype=bool)


@pytest.fixture(scope="module")
def known() -> Postures:
    rng = np.random.default_rng(0)
    return Postures(np.array([pose(rng, (256, 192)) for _ in range(400)]), np.ones((400, 12), dtype=bool))


def seen(points, height=1.0):
    """Points, heights and heat maps as a network that knows `points` gives them."""
    maps = encode(to_map(points)) * np.broadcast_to(height, 12)[:, None, None]
    found, score = decode(maps)
    return to_input(found), score, maps


def test_a_lost_point_is_found_again(known):
    truth = pose(np.random.default_rng(5), (256, 192))
    k = INDEX["left_ankle"]
    points, score, maps = seen(truth)
    maps[k] = 0.6 * encode(to_map(np.array([20.0, 30.0]))) + 0.4 * encode(to_map(truth[k]))  # a stain, and the ankle paler
    points[k], score[k] = (20.0, 30.0), 0.6
    after, height, moved = known.settle(points, score, maps, ALL)
    assert moved.tolist() == [i == k for i in range(12)]
    assert after[k] == pytest.approx(truth[k], abs=1.0) and height[k] == pytest.approx(0.4, abs=0.02)
    assert (after[~moved] == points[~moved]).all() and (height[~moved] == score[~moved]).all()


def test_with_no_other_peak_it_lies_where_such_figures_have_it(known):
    truth = pose(np.random.default_rng(6), (256, 192))
    k = INDEX["right_waist"]
    points, score, maps = seen(truth)
    maps[k] = 0.15 * encode(to_map(np.array([185.0, 10.0])))
    points[k], score[k] = (185.0, 10.0), 0.15
    after, height, moved = known.settle(points, score, maps, ALL)
    assert moved[k] and height[k] == FLOOR
    assert np.linalg.norm(after[k] - truth[k]) < 12


@given(st.integers(0, 10_000), st.floats(0.0, 8.0))
@settings(max_examples=40, deadline=None)
def test_points_that_are_right_are_not_touched(seed, noise):
    """Not even those of figures that no training picture has exactly: it chooses, it does not average."""
    rng = np.random.default_rng(seed)
    known = Postures(np.array([pose(rng, (256, 192)) for _ in range(300)]), np.ones((300, 12), dtype=bool))
    points, score, maps = seen(pose(rng, (256, 192)) + rng.normal(0, noise / 2, (12, 2)))
    after, height, moved = known.settle(points, score, maps, ALL)
    assert not moved.any() and (after == points).all() and (height == score).all()


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_whatever_the_maps_are_the_result_is_a_peak_or_a_mean(seed):
    rng = np.random.default_rng(seed)
    known = Postures(np.array([pose(rng, (256, 192)) for _ in range(50)]), np.ones((50, 12), dtype=bool))
    maps = rng.random((12, 64, 48)).astype(np.float32)
    found, score = decode(maps)
    points = to_input(found)
    after, height, moved = known.settle(points, score, maps, ALL)
    assert np.isfinite(after).all() and (height >= 0).all()
    assert (np.linalg.norm(after - points, axis=1)[moved] >= FAR).all()
    assert (after[~moved] == points[~moved]).all()


def test_a_kind_that_training_never_had_is_left_alone(known):
    points, score, maps = seen(pose(np.random.default_rng(7), (256, 192)))
    points[INDEX["left_ankle"]] = (5.0, 5.0)
    hat = np.array(points_of("veil-hat"))
    after, _, moved = known.settle(points, score, maps, hat)
    assert not moved.any() and (after == points).all()


def test_points_of_types():
    assert all(points_of("round-collar-robe")) and all(points_of("half-sleeve"))
    assert [n for n, there in zip(LANDMARKS, points_of("flying-ribbon"), strict=True) if not there] == ["left_waist", "right_waist"]
    assert sum(points_of("veil-hat")) == 6


def test_postures_are_those_of_the_crop_and_survive_a_file():
    points = pose(np.random.default_rng(1), (300, 200))
    there = np.array(points_of("flying-ribbon"))
    box = (10.0, 5.0, 180.0, 290.0)
    sample = Sample(Path("not-read.png"), np.where(there[:, None], points, np.nan), there, there, box=box)
    made = Postures.of([sample], 0.1)
    assert made.points[0][there] == pytest.approx(apply(crop_matrix(box, 0.1), points)[there], abs=1e-3)
    assert (made.points[0][~there] == 0).all()
    back = Postures.from_dict(made.to_dict())
    assert np.abs(back.points - made.points).max() <= 0.5 and (back.present == made.present).all()


def test_a_detector_keeps_them_and_uses_them_where_the_garment_is_known(tmp_path, known):
    torch = pytest.importorskip("torch")
    from dataclasses import replace

    from reconstruction.keypoints.hrnet import architecture, build
    from reconstruction.keypoints.predict import Detector

    truth = pose(np.random.default_rng(8), (256, 192))
    k = INDEX["left_wrist"]
    maps = seen(truth)[2]
    maps[k] = 0.5 * encode(to_map(np.array([180.0, 240.0]))) + 0.45 * encode(to_map(truth[k]))
    small = build(replace(architecture("tiny"), joints=12))
    Detector(small, 3.0, postures=known).save(tmp_path / "d.pt")
    detector = Detector.load(tmp_path / "d.pt")
    assert detector.postures is not None and np.abs(detector.postures.points - known.points).max() <= 0.5

    class Painter(torch.nn.Module):
        arch = small.arch

        def forward(self, images):
            return torch.from_numpy(np.repeat(maps[None], len(images), axis=0))

    detector = replace(detector, model=Painter())
    picture = np.zeros((256, 192, 3), np.uint8)
    alone = detector.predict([picture])
    assert not alone.moved.any() and alone.points[0, k] == pytest.approx([180, 240], abs=2)
    together = detector.predict([picture], present=[points_of("half-sleeve")])
    assert together.moved[0].nonzero()[0].tolist() == [k]
    assert together.points[0, k] == pytest.approx(truth[k], abs=2) and together.score[0, k] < alone.score[0, k]
    assert together.select([0]).moved.any()
    from mfar_fem.errors import ParameterError

    with pytest.raises(ParameterError, match="present has shape"):
        detector.predict([picture], present=[[True] * 6])
