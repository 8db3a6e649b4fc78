"""Matching on the canonical body: neighbours within reach, and the study's account of them."""

import numpy as np
import pytest

from reconstruction.matching.canonical import matches
from reconstruction.matching.features import Features
from reconstruction.measure.canonical import PIXELS_PER_METRE


def features(points, descriptors):
    return Features(np.asarray(points, float), np.asarray(descriptors, np.float32), (400, 400))


def test_a_twin_beyond_reach_is_not_seen_and_no_rival():
    rng = np.random.default_rng(1)
    d = rng.normal(size=(4, 128))
    a = features([(100, 100), (200, 200), (300, 100)], d[:3])
    near, far = d[0] + 0.02 * rng.normal(size=(2, 128))
    twins = features([(102, 100), (202, 200), (390, 390), (105, 300)], [near, d[1], d[2], far])
    assert matches(a, twins).tolist() == [[1, 1], [2, 2]]  # the first has a rival as good, far away
    found = matches(a, twins, reach=10 / PIXELS_PER_METRE)
    assert found.tolist() == [[0, 0], [1, 1]]
    assert matches(a, features(np.zeros((0, 2)), np.zeros((0, 128)))).shape == (0, 2)


def test_study_counts_right_matches_beside_chance():
    pytest.importorskip("embreex")
    pytest.importorskip("cv2")
    from reconstruction.matching.canonical_study import VARIANTS, study

    found = study(("half-sleeve",), seeds=1, size=0.045)
    rows = {(r["kinds"], r["variant"]): r for r in found["rows"]}
    same = rows["figurine – figurine", VARIANTS[0]]
    assert same["right"] <= same["matches"] and same["precision"] > 5 * same["chance"] > 0
    gated = rows["figurine – mural", VARIANTS[2]]
    assert gated["chance"] > rows["figurine – mural", VARIANTS[1]]["chance"]
