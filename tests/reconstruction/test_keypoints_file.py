"""The keypoints file: what is written is read again; what is wrong is named."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mfar_fem.errors import DataFileError
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, read_keypoints, write_keypoints
from reconstruction.landmarks import KINDS, LANDMARKS

number = st.floats(-1e4, 1e4)
scales = st.one_of(
    st.none(),
    st.fixed_dictionaries({"dpi": st.floats(1, 5000)}),
    st.fixed_dictionaries({"metres_per_pixel": st.floats(1e-6, 1)}, optional={"relative_sigma": st.floats(0, 1)}),
    st.builds(lambda a, b, c, d, length: {"marks": np.array([(a, b), (c, d)]), "length": length}, number, number, number, number,
              st.floats(1e-3, 10)),
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    points=st.lists(st.one_of(st.none(), st.tuples(number, number)), min_size=12, max_size=12),
    sigma=st.lists(st.floats(0.01, 50), min_size=12, max_size=12),
    kind=st.sampled_from(KINDS), figure=st.sampled_from([None, "male", "female"]), scale=scales,
    confidence=st.lists(st.floats(0, 1), min_size=12, max_size=12),
)
def test_written_files_are_read_again(tmp_path, points, sigma, kind, figure, scale, confidence):
    array = np.array([(np.nan, np.nan) if p is None else p for p in points], dtype=float)
    image = ImageKeypoints.of(tmp_path / "a.png", kind, array, confidence=confidence, sigma=sigma, figure=figure, scale=scale,
                              mask=tmp_path / "m.png", curves={"lapel": np.array([(0.0, 1.0), (2.0, 3.5)])}, size=(10, 20))
    write_keypoints(tmp_path / "k.json", KeypointsFile((image,), "half-sleeve"))
    back = read_keypoints(tmp_path / "k.json")
    assert back.garment == "half-sleeve"
    (other,) = back.images
    assert (other.path, other.mask, other.kind, other.figure, other.size) == (image.path, image.mask, kind, figure, (10, 20))
    for name in ("points", "confidence", "present", "sigma"):
        np.testing.assert_array_equal(getattr(other, name), getattr(image, name))
    np.testing.assert_array_equal(other.curves["lapel"], image.curves["lapel"])
    assert (scale is None) == (other.scale is None)
    for key in scale or {}:
        np.testing.assert_array_equal(other.scale[key], scale[key])


def good():
    return {"format": "mfar keypoints", "version": 1, "images": [{"path": "a.png", "kind": "mural", "keypoints": [[1, 2]] * 12}]}


def test_defaults(tmp_path):
    data = good()
    data["images"][0]["keypoints"][3] = None
    (tmp_path / "k.json").write_text(json.dumps(data))
    (image,) = read_keypoints(tmp_path / "k.json").images
    assert image.present.sum() == 11 and not image.present[3] and np.isnan(image.points[3]).all()
    assert image.confidence.tolist() == image.present.astype(float).tolist()
    assert (image.sigma == 1).all() and image.mask is None and image.path == tmp_path / "a.png"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.update(format="other"), "'format' must be"),
        (lambda d: d.update(version=2), "version 2"),
        (lambda d: d.update(images=[]), "at least one image"),
        (lambda d: d.update(landmarks=list(LANDMARKS)[::-1]), "left_shoulder, right_shoulder"),
        (lambda d: d["images"][0].update(kind="fresco"), r"images\[0\].kind.*mural"),
        (lambda d: d["images"][0].update(figure="man"), "male, female"),
        (lambda d: d["images"][0].update(keypoints=[[1, 2]] * 11), "12 points"),
        (lambda d: d["images"][0]["keypoints"].__setitem__(4, [1, "x"]), "left_wrist"),
        (lambda d: d["images"][0].update(present=[True] * 12, keypoints=[[1, 2]] * 11 + [None]), "'right_ankle' is present but"),
        (lambda d: d["images"][0].update(confidence=[2.0] * 12), r"\[0, 1\]"),
        (lambda d: d["images"][0].update(sigma=0), "positive"),
        (lambda d: d["images"][0].update(sigma=[1, 2]), "12 numbers"),
        (lambda d: d["images"][0].update(scale={"marks": [[0, 0], [1, 1]]}), "keys of one of"),
        (lambda d: d["images"][0].update(scale={"dpi": -3}), "positive number"),
        (lambda d: d["images"][0].update(scale={"marks": [[0, 0]], "length": 1}), "at least two points"),
        (lambda d: d["images"][0].update(keypints=[]), "did you mean 'keypoints'"),
        (lambda d: d["images"][0].update(curves={"lapel": [[1, 2]]}), "curves.lapel"),
        (lambda d: d["images"][0].update(size=[0, 4]), "width, height"),
        (lambda d: d["images"][0].pop("path"), "path of the image"),
    ],
)
def test_wrong_files_are_refused_with_file_and_key(tmp_path, change, words):
    data = good()
    change(data)
    (tmp_path / "k.json").write_text(json.dumps(data))
    with pytest.raises(DataFileError, match=words) as caught:
        read_keypoints(tmp_path / "k.json")
    assert "k.json" in str(caught.value)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(max_size=60))
def test_any_other_text_is_refused_not_a_crash(tmp_path, text):
    (tmp_path / "k.json").write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(DataFileError):
        read_keypoints(tmp_path / "k.json")


json_values = st.recursive(st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=5),
                           lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
                           max_leaves=5)
KEYS = ("path", "kind", "figure", "keypoints", "confidence", "present", "sigma", "mask", "scale", "curves", "size")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(st.sampled_from(KEYS), json_values)
def test_a_key_of_any_value_is_read_or_refused(tmp_path, key, value):
    data = good()
    data["images"][0][key] = value
    (tmp_path / "k.json").write_text(json.dumps(data))
    try:
        read_keypoints(tmp_path / "k.json")
    except DataFileError as error:
        assert "images[0]" in str(error)


def test_a_file_written_with_relative_paths_is_read_from_anywhere(tmp_path, monkeypatch):
    """Pictures outside the file's folder: what is relative to the working directory would be looked for beside the file."""
    (tmp_path / "case").mkdir()
    (tmp_path / "found").mkdir()
    monkeypatch.chdir(tmp_path)
    image = ImageKeypoints.of("case/robe.png", "mural", np.full((12, 2), 5.0), mask=Path("case/mask.png"))
    write_keypoints(Path("found/keypoints.json"), KeypointsFile((image,)))
    monkeypatch.chdir(tmp_path / "found")
    (again,) = read_keypoints("keypoints.json").images
    assert again.path.resolve() == tmp_path / "case" / "robe.png" and again.mask.resolve() == tmp_path / "case" / "mask.png"
