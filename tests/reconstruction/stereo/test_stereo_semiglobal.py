"""Semi-global smoothing against a search through all paths, and what must not change it."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.stereo.semiglobal import DIRECTIONS, smooth

SMALL, LARGE = 0.15, 0.4


def everywhere(cost):
    return np.ones(cost.shape[:2], dtype=bool)


def jump(a, b):
    return 0.0 if a == b else SMALL if abs(a - b) == 1 else LARGE


def through(costs):
    """Cheapest of all sequences of hypotheses over a row (w, n) that has each hypothesis at each pixel (w, n), by trying all."""
    w, n = costs.shape
    best = np.full((w, n), np.inf)
    for path in itertools.product(range(n), repeat=w):
        price = sum(costs[x, k] for x, k in enumerate(path)) + sum(jump(a, b) for a, b in itertools.pairwise(path))
        for x, k in enumerate(path):
            best[x, k] = min(best[x, k], price)
    return best


@pytest.mark.parametrize("seed", range(4))
def test_one_row_finds_the_cheapest_path_of_all(seed):
    """Both horizontal directions together, less the pixel's cost that both count, are the cheapest whole path through a hypothesis;
    the other six directions begin anew at every pixel of a row."""
    cost = np.random.default_rng(seed).random((1, 5, 4))
    row = len(DIRECTIONS) * smooth(cost, SMALL, LARGE, everywhere(cost))[0].astype(float) - 7 * cost[0]
    exact = through(cost[0])
    level = lambda a: a - a.min(axis=1, keepdims=True)  # noqa: E731 - paths are known up to a constant of each pixel
    np.testing.assert_allclose(level(row), level(exact), atol=1e-5)
    np.testing.assert_array_equal(row.argmin(axis=1), exact.argmin(axis=1))


def test_a_column_is_smoothed_as_a_row_is():
    cost = np.random.default_rng(5).random((1, 6, 4))
    np.testing.assert_allclose(
        smooth(cost.transpose(1, 0, 2), SMALL, LARGE, everywhere(cost).T)[:, 0],
        smooth(cost, SMALL, LARGE, everywhere(cost))[0],
        atol=1e-6,
    )


@given(st.integers(0, 10**6))
def test_turning_and_mirroring_picture_and_hypotheses(seed):
    rng = np.random.default_rng(seed)
    cost, mask = rng.random((4, 5, 3)), rng.random((4, 5)) > 0.3
    whole = smooth(cost, SMALL, LARGE, mask)
    for turn in (lambda a: a[::-1], lambda a: a[:, ::-1], lambda a: np.swapaxes(a, 0, 1)):
        np.testing.assert_allclose(smooth(turn(cost), SMALL, LARGE, turn(mask)), turn(whole), atol=1e-5)
    np.testing.assert_allclose(smooth(cost[..., ::-1], SMALL, LARGE, mask), whole[..., ::-1], atol=1e-5)


@given(st.integers(0, 10**6), st.floats(0.1, 10))
def test_the_unit_of_cost_does_not_matter(seed, unit):
    cost = np.random.default_rng(seed).random((3, 4, 3))
    np.testing.assert_allclose(
        smooth(unit * cost, unit * SMALL, unit * LARGE, everywhere(cost)),
        unit * smooth(cost, SMALL, LARGE, everywhere(cost)),
        rtol=1e-4,
    )


def test_a_constant_of_a_pixel_is_added_and_no_more():
    rng = np.random.default_rng(1)
    cost, constant = rng.random((4, 5, 3)), rng.random((4, 5, 1))
    np.testing.assert_allclose(
        smooth(cost + constant, SMALL, LARGE, everywhere(cost)), smooth(cost, SMALL, LARGE, everywhere(cost)) + constant, atol=1e-5
    )


def test_without_penalties_nothing_changes():
    cost = np.random.default_rng(2).random((4, 5, 3))
    np.testing.assert_allclose(smooth(cost, 0.0, 0.0, everywhere(cost)), cost, atol=1e-6)


def test_what_is_outside_the_mask_has_no_say():
    rng = np.random.default_rng(3)
    cost, mask = rng.random((5, 6, 3)), np.ones((5, 6), dtype=bool)
    mask[:, 3] = False
    other = cost.copy()
    other[:, 3:] = rng.random((5, 3, 3))
    np.testing.assert_array_equal(smooth(cost, SMALL, LARGE, mask)[:, :3], smooth(other, SMALL, LARGE, mask)[:, :3])
    np.testing.assert_array_equal(smooth(cost, SMALL, LARGE, mask)[:, 3], 0.0)


def test_an_outlier_is_outvoted_and_an_edge_kept():
    cost = np.ones((9, 12, 8))
    cost[:, :6, 1], cost[:, 6:, 6] = 0.0, 0.0
    cost[4, 3], cost[4, 3, 5] = 0.3, 0.0
    best = smooth(cost, SMALL, LARGE, everywhere(cost)).argmin(axis=2)
    np.testing.assert_array_equal(best[:, :6], 1)
    np.testing.assert_array_equal(best[:, 6:], 6)
