"""Putative matches: the dynamic threshold, FLANN beside an exact search, and the same answer twice."""

from __future__ import annotations

import numpy as np
import pytest
from match_scenes import cameras, features, project, world

from mfar_fem.errors import ParameterError
from reconstruction.matching import nearest
from reconstruction.matching.features import Features
from reconstruction.matching.settings import MatchSettings


@pytest.fixture(scope="module")
def pair():
    first, second = cameras()
    points = world(200)
    return features(project(first, points), project(second, points), wrong=20)


def test_tau_lets_through_as_many_wrong_neighbours_as_a_poisson_process_says():
    rng = np.random.default_rng(0)
    a, b = (
        Features(rng.uniform(0, 500, (1500, 2)), rng.uniform(0, 100, (1500, 16)).astype(np.float32), (500, 500)) for _ in range(2)
    )
    for quantile, expected in ((0.05, 0.299), (0.25, 0.617)):
        found = nearest.putative(a, b, MatchSettings(quantile=quantile, ratio=1.0, mutual=False))
        assert len(found) / 1500 == pytest.approx(expected, rel=0.15)  # all of them are wrong
        assert (found.distance < found.tau).all()


def test_tau_follows_the_descriptors(pair):
    a, b = pair
    tau = nearest.putative(a, b, MatchSettings()).tau
    doubled = nearest.putative(*(Features(f.points, 2 * f.descriptors, f.size) for f in pair), MatchSettings()).tau
    assert doubled == pytest.approx(2 * tau, rel=1e-3)
    assert nearest.putative(a, b, MatchSettings(quantile=1.0)).tau == float("inf")


def test_right_pairs_are_found(pair):
    a, b = pair
    found = nearest.putative(a, b, MatchSettings())
    assert len(found) >= 215
    near = np.linalg.norm(a.descriptors[found.index[:, 0]] - b.descriptors[found.index[:, 1]], axis=1)
    assert near.max() < 60 and np.allclose(near, found.distance, rtol=1e-4)


def test_mutual_and_ratio_only_take_away(pair):
    loose = nearest.putative(*pair, MatchSettings(ratio=1.0, mutual=False, quantile=1.0))
    strict = nearest.putative(*pair, MatchSettings(ratio=0.6))
    assert {tuple(row) for row in strict.index} <= {tuple(row) for row in loose.index}
    assert len(set(strict.index[:, 1])) == len(strict)


def test_twins_at_one_place_count_once():
    rng = np.random.default_rng(0)
    points = rng.uniform(0, 500, (30, 2))
    descriptors = rng.uniform(0, 100, (60, 32)).astype(np.float32)
    twice = Features(np.vstack([points, points]), descriptors, (500, 500))
    assert len(nearest.putative(twice, twice, MatchSettings())) == 30


def test_flann_finds_nearly_all_nearest_neighbours_and_more_with_more_checks():
    rng = np.random.default_rng(0)
    descriptors = rng.gamma(0.5, 20, (3000, 128)).astype(np.float32)
    queries = (descriptors[:600] + rng.normal(0, 12, (600, 128))).astype(np.float32)
    few, many = (nearest.flann_precision(queries, descriptors, MatchSettings(checks=c)) for c in (8, 200))
    assert few < many and many > 0.9  # the paper's target precision, at its 200 checks
    assert nearest.flann_precision(queries, descriptors, MatchSettings(checks=3000)) > 0.999


def test_the_same_twice_and_another_seed_may_differ():
    rng = np.random.default_rng(0)
    a, b = rng.uniform(0, 1, (2, 2000, 128)).astype(np.float32)
    first, again, other = (nearest.two_nearest(a, b, MatchSettings(checks=20, seed=seed))[0] for seed in (0, 0, 5))
    assert np.array_equal(first, again) and not np.array_equal(first, other)


@pytest.mark.parametrize("count", [0, 1])
def test_without_a_second_neighbour_there_is_no_match(pair, count):
    few = Features(pair[0].points[:count], pair[0].descriptors[:count], pair[0].size)
    for one, two in ((few, pair[1]), (pair[1], few)):
        found = nearest.putative(one, two, MatchSettings())
        assert len(found) == 0 and np.isnan(found.tau)


@pytest.mark.parametrize("wrong", [{"detector": "surf"}, {"estimator": "lmeds"}, {"detector": "aliked"}, {"ratio": 1.5},
                                   {"checks": 0}, {"threshold": float("nan")}, {"trees": 17}, {"fewest": 7}])  # fmt: skip
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(ParameterError):
        MatchSettings(**wrong)
