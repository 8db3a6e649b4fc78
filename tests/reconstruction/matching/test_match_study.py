"""The study on a few real views: every variant judged blindly and by the cameras, and the turned control."""

from __future__ import annotations

import pytest
from match_scenes import VISION, needs

from mfar_fem.errors import InputError
from reconstruction.images import load
from reconstruction.matching import MatchSettings, detect
from reconstruction.matching.study import LIT, VARIANTS, pair_row, stored_upside_down, study, summary, temple


@needs["middlebury_templeRing"]
def test_two_views_of_the_temple():
    reports = []
    temple = ["middlebury_templeRing"]
    found = study(VISION, sets=temple, most_views=2, progress=lambda done, total, label: reports.append((done, total)))
    assert [row["variant"] for row in found["summary"]] == [*VARIANTS, LIT]
    assert all(row["accepted_blindly"] == 1 and row["accepted_but_wrong"] == 0 for row in found["summary"])
    assert all(row["median_sampson_cameras_px"] < 0.5 for row in found["summary"])
    plain, turned = found["control"]
    assert turned["turned"] and turned["inliers"] > 0.9 * plain["inliers"]
    assert turned["median_sampson_cameras_px"] > 10 * plain["median_sampson_cameras_px"]
    assert found["flann"][0]["precision"] > 0.9 and "ALIKED left out" in found["notes"][0]
    assert reports[-1] == (8, 8)


def test_wrong_sets_and_folders_are_named(tmp_path):
    with pytest.raises(InputError, match="known: alicevision_buddha"):
        study(tmp_path, sets=["dunhuang"])
    with pytest.raises(InputError, match="holds no folder 'sceaux_castle'"):
        study(tmp_path, sets=["sceaux_castle"])


def test_summary_counts_what_is_accepted_but_wrong():
    row = {"set": "s", "variant": "v", "status": "matched", "angle_deg": 10.0, "putative": 40, "inliers": 30, "rate": 0.75,
           "median_sampson_px": 0.2, "median_sampson_cameras_px": 0.3,
           "median_sampson_upside_down_px": 2.0, "blind": True, "right": True}  # fmt: skip
    wrong = row | {"status": "failed: against the cameras", "median_sampson_cameras_px": 9.0, "right": False}
    refused = row | {"status": "failed: chance", "blind": False, "right": False}
    (found,) = summary([row, wrong, refused])
    assert (found["pairs"], found["accepted_blindly"], found["accepted_but_wrong"], found["inliers"]) == (3, 2, 1, 60)
    assert found["worst_short_baseline_px"] == 9.0 and found["worst_either_way_up_px"] == 2.0


@needs["middlebury_templeRing"]
def test_a_picture_that_is_stored_upside_down_is_found_out():
    views = temple(VISION / "middlebury_templeRing")
    for i, expected in ((0, []), (34, ["middlebury_templeRing: 1 pairs"])):
        found = [detect(load(view.path).grey, MatchSettings()) for view in views[i : i + 2]]
        row = {"set": "middlebury_templeRing"} | pair_row(*views[i : i + 2], *found, MatchSettings())
        assert row["blind"] and min(row["median_sampson_cameras_px"], row["median_sampson_upside_down_px"]) < 0.15
        assert [text[: len("middlebury_templeRing: 1 pairs")] for text in stored_upside_down([row])] == expected
