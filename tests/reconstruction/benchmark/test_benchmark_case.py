"""A case: a folder of sources that reads, and whose true points give back the cut."""

import json

import numpy as np
import pytest

from mfar_fem.errors import InputError


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    pytest.importorskip("embreex")
    pytest.importorskip("PIL")
    from reconstruction.benchmark.case import make_case

    folder = tmp_path_factory.mktemp("case") / "robe"
    seen = []
    made = make_case(folder, "round-collar-robe", 3, size=0.045, progress=lambda: seen.append(1))
    assert len(seen) == len(made["pictures"]) == 10
    return folder, made


def test_sources_read_with_masks_cameras_and_scale(case):
    from reconstruction.sources import read

    folder, made = case
    found = read(folder)
    found.load_each()
    assert [s.kind for s in found.sources] == ["figurine"] * 4 + ["mural"] * 3 + ["textile", "figurine", "mural"]
    assert all(s.mask is not None and s.mask.is_file() for s in found.sources)
    assert [s.camera is not None for s in found.sources] == [s.kind == "figurine" for s in found.sources]
    assert {s.figure for s in found.sources if s.kind != "textile"} == {made["sex"]}
    (textile,) = (s for s in found.sources if s.kind == "textile")
    assert textile.scale_entry()["length"] == pytest.approx(0.2)


def test_true_points_lie_in_the_pictures_and_the_textile_has_the_true_scale(case):
    from reconstruction.keypoints_file import read_keypoints
    from reconstruction.landmarks import INDEX
    from reconstruction.measure.scale import image_scale

    folder, _ = case
    contents = read_keypoints(folder / "truth" / "keypoints.json")
    for image in contents.images:
        inside = image.points[image.present]
        assert len(inside) and (inside >= 0).all() and (inside < np.array(image.size)).all()
    (textile,) = (i for i in contents.images if i.kind == "textile")
    with np.load(folder / "truth" / "geometry.npz") as arrays:
        flat = arrays["flat_keypoints"]
    a, b = INDEX["left_wrist"], INDEX["right_wrist"]
    span = np.linalg.norm(textile.points[a] - textile.points[b]) * image_scale(textile).metres_per_pixel
    assert span == pytest.approx(np.linalg.norm(flat[a] - flat[b]), rel=1e-3)


def test_template_from_the_true_points_has_the_length_of_the_cut(case, tmp_path):
    from reconstruction.keypoints_file import read_keypoints
    from reconstruction.template.pipeline import make_template

    folder, _ = case
    made = make_template(read_keypoints(folder / "truth" / "keypoints.json"), weighting="precision")
    cut = json.loads((folder / "truth" / "truth.json").read_text())["cut"]
    assert [f for f in made.findings if f.message.startswith("left out: no scale from proportions")]  # a side view
    assert made.votes["garment_length"].value == pytest.approx(cut["length"], rel=0.05)


def test_known_types_only_and_nothing_is_overwritten(case, tmp_path):
    from reconstruction.benchmark.case import make_case

    with pytest.raises(InputError, match="known: round-collar-robe"):
        make_case(tmp_path, "toga")
    with pytest.raises(InputError, match="exists already"):
        make_case(case[0], "round-collar-robe")


def test_figurines_from_all_round(tmp_path):
    from reconstruction.benchmark.case import make_case
    from reconstruction.sources import read

    pytest.importorskip("embreex")
    make_case(tmp_path / "robe", "half-sleeve", 3, size=0.045, around=6)
    cameras = [s.camera for s in read(tmp_path / "robe").sources if s.kind == "figurine"]
    ways = np.array([c[2, :2] for c in cameras])
    turn = np.unwrap(np.arctan2(ways[:, 0], ways[:, 1]))
    assert len(cameras) == 6 and np.abs(np.abs(np.diff(turn)) - np.pi / 3).max() < np.radians(13)
