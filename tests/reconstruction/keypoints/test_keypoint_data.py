"""Samples, crops and augmentation: points move with the pixels, left stays left, everything repeats."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

cv2 = pytest.importorskip("cv2")

import stick_figures  # noqa: E402

from mfar_fem.errors import DataFileError, InputError, ParameterError  # noqa: E402
from reconstruction.keypoints.crops import (  # noqa: E402
    NO_AUGMENTATION,
    Augmentation,
    apply,
    compose,
    crop_matrix,
    image_box,
    invert,
    normalise,
    warp,
)
from reconstruction.keypoints.data import Dataset, Sample  # noqa: E402
from reconstruction.keypoints.samples_file import further, garment_boxes, read_index, samples_of, write_index  # noqa: E402
from reconstruction.landmarks import INDEX  # noqa: E402


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(1, 900), st.floats(1, 900), st.floats(0, 0.5))
def test_crops_contain_the_box_centred_and_keep_the_aspect(x, y, w, h, margin):
    matrix = crop_matrix((x, y, x + w, y + h), margin)
    corners = apply(matrix, np.array([[x, y], [x + w, y + h]]))
    assert matrix[0, 0] == matrix[1, 1] and matrix[0, 1] == matrix[1, 0] == 0
    assert corners.mean(axis=0) == pytest.approx([95.5, 127.5])
    extent = np.ptp(corners, axis=0) * (1 + margin) / [192, 256]
    assert extent.max() == pytest.approx(1.0)
    assert apply(invert(matrix), apply(matrix, [[3.0, 4.0]])) == pytest.approx(np.array([[3.0, 4.0]]), abs=1e-6)
    assert compose(matrix, invert(matrix)) == pytest.approx(np.eye(3)[:2], abs=1e-6)


def test_a_whole_image_of_the_inputs_size_is_left_alone():
    image = np.random.default_rng(0).integers(0, 255, (256, 192, 3)).astype(np.uint8)
    matrix = crop_matrix(image_box(image.shape), 0.0)
    assert matrix == pytest.approx(np.eye(3)[:2])
    assert np.array_equal(warp(image, matrix), image)
    with pytest.raises(ParameterError, match="empty"):
        crop_matrix((5, 5, 5, 9))


def blobs(folder, n=4):
    """Pictures with one coloured spot a point: what is found in the crop must lie on the transformed point."""
    samples = []
    for i in range(n):
        rng = np.random.default_rng(i)
        points = np.stack([rng.permutation(12) * 22.0 + 30, rng.permutation(12) * 28.0 + 45], axis=1)
        v, u = np.mgrid[:400, :300]
        image = np.zeros((400, 300, 3))
        for k, (x, y) in enumerate(points):
            # left points are red and right ones green: the wearer's left sleeve stays the same cloth in a mirror
            image[..., k % 2] += 250 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * 4.0**2))
        path = folder / f"{i}.png"
        cv2.imwrite(str(path), np.clip(image, 0, 255).astype(np.uint8)[:, :, ::-1])
        samples.append(Sample(path, points, np.ones(12, bool), np.ones(12, bool), identity=str(i)))
    return samples


@pytest.mark.parametrize("epoch", [None, 0, 1, 2, 3])
def test_points_follow_the_pixels_through_crop_rotation_and_mirror(tmp_path, epoch):
    data = Dataset(blobs(tmp_path), Augmentation(brightness=0.0, scale=0.1, shift=0.05), seed=5)
    mirrored = 0
    for i in range(len(data)):
        crop, points, _, present, matrix = data.crop(i, epoch)
        flip = np.linalg.det(matrix[:, :2]) < 0
        mirrored += flip
        for k in np.flatnonzero(present):
            x, y = points[k]
            if not (8 < x < 183 and 8 < y < 247):
                continue
            # in a mirror the image of the wearer's left becomes that of a right: the name goes with the side, not with the cloth
            channel = (k % 2) ^ int(flip)
            window = crop[round(y) - 3 : round(y) + 4, round(x) - 3 : round(x) + 4, channel].astype(float)
            steps = np.arange(-3, 4)
            cx = round(x) + (window * steps).sum() / window.sum()
            cy = round(y) + (window * steps[:, None]).sum() / window.sum()
            assert (cx, cy) == pytest.approx((x, y), abs=0.6)
            assert window.max() > 150
    if epoch is None:
        assert mirrored == 0


def test_mirrored_samples_exchange_left_and_right(tmp_path):
    (sample,) = stick_figures.make(tmp_path, 1, seed=3)
    data = Dataset([sample], Augmentation(0.0, True, 0.0), seed=0)
    plain = data.crop(0)
    flipped = next(c for c in (data.crop(0, epoch) for epoch in range(20)) if np.linalg.det(c[4][:, :2]) < 0)
    for part in ("shoulder", "wrist", "waist"):
        left, right = INDEX[f"left_{part}"], INDEX[f"right_{part}"]
        assert flipped[1][left] == pytest.approx([191 - plain[1][right][0], plain[1][right][1]])
        assert flipped[1][left][0] > flipped[1][right][0]  # still a figure seen from the front
    assert plain[2].tolist().index(False) == INDEX["right_wrist"]
    assert flipped[2].tolist().index(False) == INDEX["left_wrist"]
    assert np.abs(flipped[0].astype(int) - plain[0][:, ::-1]).max() <= 2


def test_the_same_seed_and_epoch_repeat_and_others_differ(tmp_path):
    samples = stick_figures.make(tmp_path, 6)
    a, b = Dataset(samples, seed=1), Dataset(samples, seed=1, cache=False)
    for x, y in zip(a.epoch(2, 4), b.epoch(2, 4), strict=True):
        assert np.array_equal(x.images, y.images) and np.array_equal(x.points, y.points)
    first = next(iter(a.epoch(0, 4))).images
    assert not np.array_equal(first, next(iter(a.epoch(1, 4))).images)
    assert not np.array_equal(first, next(iter(Dataset(samples, seed=2).epoch(0, 4))).images)


def test_augmentation_keeps_its_limits(tmp_path):
    samples = stick_figures.make(tmp_path, 1)
    data = Dataset(samples, seed=0)
    angles, gains, flips = [], [], []
    grey = data.crop(0)[0].mean()
    for epoch in range(60):
        crop, *_, matrix = data.crop(0, epoch)
        flips.append(np.linalg.det(matrix[:, :2]) < 0)
        angles.append(np.rad2deg(np.arctan2(matrix[1, 0], matrix[1, 1])))
        gains.append(crop.mean() / grey)
    assert 12 < np.max(np.abs(angles)) <= 15
    assert 0.78 < np.min(gains) < 0.87 and 1.1 < np.max(gains) < 1.22
    assert 15 < sum(flips) < 45
    still = Dataset(samples, NO_AUGMENTATION).crop(0, 7)
    assert np.array_equal(still[0], data.crop(0)[0])


def test_points_outside_the_crop_count_as_absent(tmp_path):
    (sample,) = stick_figures.make(tmp_path, 1)
    tight = Sample(sample.image_path, sample.keypoints, sample.visible, sample.present, box=(0, 0, 144, 100))
    batch = Dataset([tight]).batch([0])
    assert not batch.present[0, INDEX["left_ankle"]] and batch.present[0, INDEX["left_neckline"]]
    assert not batch.targets()[0, INDEX["left_ankle"]].any()


def test_no_batch_has_a_single_image(tmp_path):
    data = Dataset(stick_figures.make(tmp_path, 9))
    assert [len(b.images) for b in data.epoch(0, 4)] == [4, 5]
    assert [len(b.images) for b in data.plain(4)] == [4, 4, 1]


def test_normalised_numbers():
    made = normalise(np.full((1, 2, 2, 3), 255, np.uint8))
    expected = (1 - np.array([0.485, 0.456, 0.406])) / [0.229, 0.224, 0.225]
    assert made.shape == (1, 3, 2, 2) and made[0, :, 0, 0] == pytest.approx(expected)


def test_index_round_trip(tmp_path):
    samples = stick_figures.make(tmp_path, 5, absent=0.5)
    write_index(samples, tmp_path / "samples.json")
    back = samples_of(tmp_path)
    for a, b in zip(samples, back, strict=True):
        assert a.image_path.samefile(b.image_path)
        assert (a.style, a.damage, a.split, a.identity) == (b.style, b.damage, b.split, b.identity)
        assert np.array_equal(a.present, b.present) and np.array_equal(a.visible, b.visible)
        assert np.array_equal(a.keypoints[a.present], b.keypoints[b.present])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda r: r.pop("keypoints"), "sample 2 has no 'keypoints'"),
        (lambda r: r.update(keypoints=[[1, 2]]), "sample 2 is wrong.*shape"),
        (lambda r: r.update(keypoints=[[1, 2]] * 11 + [None], present=[True] * 12), "sample 2 is wrong.*finite"),
        (lambda r: r.update(box=[1, 2]), "sample 2 is wrong"),
    ],
)
def test_faults_of_an_index_are_named(tmp_path, change, message):
    write_index(stick_figures.make(tmp_path, 3), tmp_path / "samples.json")
    data = json.loads((tmp_path / "samples.json").read_text())
    change(data["samples"][1])
    (tmp_path / "samples.json").write_text(json.dumps(data))
    with pytest.raises(DataFileError, match=message):
        read_index(tmp_path)
    (tmp_path / "samples.json").write_text("[]")
    with pytest.raises(DataFileError, match="list 'samples'"):
        read_index(tmp_path)
    with pytest.raises(DataFileError, match="neither"):
        samples_of(tmp_path / "nothing")


def test_samples_and_boxes_of_a_benchmark(tmp_path, monkeypatch):
    from types import SimpleNamespace

    import reconstruction.benchmark as benchmark

    (sample,) = stick_figures.make(tmp_path, 1)
    points, labels = sample.keypoints.copy(), np.zeros((192, 144), np.uint8)
    points[3] = np.nan
    labels[10:100, 20:50] = 2
    labels[0:5] = 1  # the figure outside the garment
    intact = np.ones(12, bool)
    intact[6] = False
    every = np.ones(12, bool)
    entry = SimpleNamespace(path=sample.image_path, keypoints=points, visible=every, present=every, intact=intact, style="mural",
                            damage=2, split="test-type", identity="H0000", truth=tmp_path, load_truth=lambda: {"labels": labels})
    (tmp_path / "benchmark.json").write_text("{}")
    monkeypatch.setattr(benchmark, "load_index", lambda folder: SimpleNamespace(samples=(entry,)))
    (made,) = samples_of(tmp_path)
    assert np.flatnonzero(~made.present).tolist() == [3] and np.flatnonzero(~made.visible).tolist() == [6]
    assert (made.style, made.damage, made.split, made.identity) == ("mural", 2, "test-type", "H0000")
    assert garment_boxes(tmp_path) == {sample.image_path: (19.5, 9.5, 49.5, 99.5)}
    entry.truth = None
    assert garment_boxes(tmp_path) == {}


def test_further_benchmarks_train_with_all_they_may_show(tmp_path, monkeypatch):
    from types import SimpleNamespace

    import reconstruction.benchmark as benchmark

    (sample,) = stick_figures.make(tmp_path, 1)
    every = np.ones(12, bool)

    def entry(split, identity, damage=0):
        return SimpleNamespace(path=sample.image_path, keypoints=sample.keypoints, visible=every, present=every, intact=every,
                               style="mural", damage=damage, split=split, identity=identity)

    entries = (entry("test", "I0001"), entry("test", "I0001", 3), entry("validation", "I0003"), entry("test-type", "H0000"))
    seeds = {"first": 0, "second": 1, "third": 0}
    for name in seeds:
        (tmp_path / name).mkdir()
        (tmp_path / name / "benchmark.json").write_text("{}")
    monkeypatch.setattr(benchmark, "load_index", lambda folder: SimpleNamespace(samples=entries, seed=seeds[folder.name]))
    found = further(tmp_path / "first", [tmp_path / "second"])
    assert [(s.split, s.identity) for s in found] == [("train", "1:I0001"), ("train", "1:I0003")]
    assert further(tmp_path / "first", []) == []
    with pytest.raises(InputError, match="the same garments"):
        further(tmp_path / "first", [tmp_path / "third"])
