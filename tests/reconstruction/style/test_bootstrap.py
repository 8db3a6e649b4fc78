"""Intervals over scenes."""

import numpy as np
import pytest

from reconstruction.style.bootstrap import mean_interval, ratio_interval


def test_means_and_ratios_are_exact():
    groups = np.repeat(np.arange(10), 3)
    values = np.arange(30.0)
    assert mean_interval(values, groups).value == pytest.approx(14.5)
    assert ratio_interval(values, values + 1, groups).value == pytest.approx(435 / 465)
    assert np.isnan(ratio_interval(values, 0 * values, groups).value)


def test_dependence_within_scenes_widens_the_interval():
    rng = np.random.default_rng(0)
    scene = np.repeat(rng.normal(size=20), 6)
    apart, together = mean_interval(scene, np.arange(120)), mean_interval(scene, np.repeat(np.arange(20), 6))
    assert together.high - together.low > 1.8 * (apart.high - apart.low)


def test_coverage_of_the_mean():
    rng = np.random.default_rng(1)
    hits = 0
    for k in range(200):
        interval = mean_interval(rng.normal(size=30), np.arange(30), rounds=400, seed=k)
        hits += interval.low <= 0 <= interval.high
    assert 0.88 <= hits / 200 <= 0.98
