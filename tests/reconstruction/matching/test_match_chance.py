"""The a-contrario test: random matches are called random, right ones are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from match_scenes import SIZE, cameras, project, world

from reconstruction.matching.chance import log10_nfa, of_model
from reconstruction.matching.robust import fundamental_matrix
from reconstruction.matching.settings import MatchSettings

SIZES = (SIZE, SIZE)


def test_by_hand_for_eight_of_ten():
    distance = np.array([1.0] * 8 + [50.0] * 2)
    alpha = 2 * 800 / (640 * 480)
    expected = math.log10(3 * 3 * math.comb(10, 8) * math.comb(8, 7) * alpha)
    assert log10_nfa(distance, SIZES, 3.5) == pytest.approx(expected)


def test_seven_inliers_say_nothing():
    assert log10_nfa(np.array([0.0] * 7 + [90.0] * 40), SIZES, 3.5) == math.inf


@pytest.mark.parametrize("estimator", ["ransac", "magsac"])
@pytest.mark.parametrize("count", [20, 40, 150])
def test_random_matches_are_not_taken_for_a_model(count, estimator):
    settings = MatchSettings(iterations=1000, estimator=estimator)
    for seed in range(12):
        points = np.random.default_rng(seed).uniform(0, 1, (count, 4)) * [*SIZE, *SIZE]
        model = fundamental_matrix(points[:, :2], points[:, 2:], settings)
        if model is not None:
            assert model.inliers.sum() >= 7 or estimator == "magsac"  # there always are some
            assert of_model(model.matrix, points[:, :2], points[:, 2:], SIZES, 3.5) > settings.log10_nfa


def test_right_matches_among_as_many_wrong_ones_are_far_from_chance():
    first, second = cameras()
    points = world(40)
    rng = np.random.default_rng(0)
    wrong = rng.uniform(0, 1, (40, 4)) * [*SIZE, *SIZE]
    a = np.vstack([project(first, points), wrong[:, :2]]) + 0.3 * rng.standard_normal((80, 2))
    b = np.vstack([project(second, points), wrong[:, 2:]]) + 0.3 * rng.standard_normal((80, 2))
    model = fundamental_matrix(a, b, MatchSettings())
    assert model is not None and model.inliers[:40].sum() >= 38
    assert of_model(model.matrix, a, b, SIZES, 3.5) < -20


def test_nearer_inliers_are_stronger_evidence():
    near, far = (log10_nfa(np.r_[np.full(20, d), np.full(20, 90.0)], SIZES, 3.5) for d in (0.5, 3.0))
    assert near < far - 5
