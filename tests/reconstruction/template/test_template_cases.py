"""Templates against the patterns that were sewn."""

import numpy as np
import pytest
from PIL import Image

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.measure.silhouette import contour, read_mask
from reconstruction.template.case_study import compare, roughened, summary


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    pytest.importorskip("embreex")
    from reconstruction.benchmark.case import make_case

    folder = tmp_path_factory.mktemp("case") / "robe"
    make_case(folder, "half-sleeve", 3, size=0.045)
    return folder


def test_a_textile_with_its_scale_gives_the_pattern_back(case):
    rows = compare(case, case / "truth" / "keypoints.json", "half-sleeve")
    textile = {r["dimension"]: r for r in rows if r["sources"] == "textile" and r["points"] == "true"}
    assert set(textile) == {"length", "cross_sleeve_width", "body_width", "armhole_depth", "cuff_width", "hem_width", "neck_width"}
    assert max(abs(r["error"]) for r in textile.values()) < 0.03 and not any(r["assumed"] for r in textile.values())
    voted = [r for r in rows if r["sources"] == "all" and r["points"] == "true" and r["dimension"] == "cross_sleeve_width"]
    errors = {r["vote"]: abs(r["error"]) for r in voted}
    assert errors["precision"] < 0.01 < errors["paper"]  # the fixed weights let bent arms in


def test_what_could_not_be_made_is_counted_not_dropped():
    row = {"garment": "flying-ribbon", "points": "true", "sources": "figures", "vote": "paper",
           "dimension": "length", "true_m": 2.0}
    rows = [row | {"error": 0.02, "found_m": 2.04, "assumed": False}, row | {"error": None, "found_m": None, "assumed": None}]
    (found,) = summary(rows)
    assert (found["cases"], found["without"], found["within_3_percent"]) == (2, 1, 1)
    assert found["median_error"] == pytest.approx(0.02)


def test_a_rough_outline_is_as_rough_as_it_says(tmp_path):
    disc = np.hypot(*np.mgrid[-200:200, -200:200]) < 150
    Image.fromarray(disc.astype(np.uint8) * 255).save(tmp_path / "m.png")
    marks = {"marks": np.array([[10.0, 10.0], [310.0, 10.0]]), "length": 0.3}
    image = ImageKeypoints.of(tmp_path / "i.png", "textile", np.full((12, 2), np.nan), mask=tmp_path / "m.png", scale=marks)
    rough = roughened([image] * 20, tmp_path / "rough", sigma=2.0)
    off = np.concatenate([np.linalg.norm(contour(read_mask(r.mask)) - 200, axis=1) - 150 for r in rough])
    print("outline", off.std(), off.mean())
    assert off.std() == pytest.approx(2.0, rel=0.1) and abs(off.mean()) < 0.5
    moved = np.array([r.scale["marks"] - marks["marks"] for r in rough])
    assert moved.std() == pytest.approx(1.0, rel=0.25) and rough[0].scale["length"] == 0.3
    assert image.mask == tmp_path / "m.png"


def test_with_detected_points_and_rough_outlines_large_lengths_stay(case, tmp_path):
    pytest.importorskip("torch")
    from reconstruction.keypoints.locate import FILE, locate

    locate([case], tmp_path, garment="half-sleeve")
    rows = compare(case, tmp_path / FILE, "half-sleeve", tmp_path / "rough")
    rows = [r for r in rows if r["sources"] == "all" and r["vote"] == "precision"]
    errors = {(r["points"], r["dimension"]): abs(r["error"]) for r in rows}
    dimensions = {d for _, d in errors}
    assert max(errors["detected", d] for d in dimensions) < 0.03
    assert max(errors["detected, rough masks", d] for d in ("length", "cross_sleeve_width", "body_width", "hem_width")) < 0.03
