"""Templates against the patterns that were sewn."""

import pytest

from reconstruction.template.case_study import compare, summary


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
