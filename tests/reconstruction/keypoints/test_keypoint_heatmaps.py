"""Heat maps: formula (5), decoding without bias, several peaks, borders."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError, UnknownNameError
from reconstruction.keypoints.heatmaps import METHODS, decode, encode, peaks, to_input, to_map


def positions(n, seed=0, margin=0.0):
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(margin, 47 - margin, n), rng.uniform(margin, 63 - margin, n)], axis=1)


def rmse_input(heatmaps, truth, method, sigma):
    return 4.0 * np.sqrt(np.mean(np.sum((decode(heatmaps, method, sigma)[0] - truth) ** 2, axis=1)))


@given(st.floats(-5, 52), st.floats(-5, 68), st.floats(0.5, 5))
def test_formula_5(x, y, sigma):
    made = encode([x, y], sigma=sigma)
    v, u = np.mgrid[:64, :48]
    assert made == pytest.approx(np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * sigma**2)), abs=1e-6)


def test_absent_points_have_empty_maps_and_sigma_is_positive():
    made = encode([[10, 10], [20, 20]], present=[True, False])
    assert made[0].max() == 1.0 and not made[1].any()
    with pytest.raises(ParameterError, match="positive"):
        encode([1, 1], sigma=0)


@given(st.floats(0, 191), st.floats(0, 255))
def test_mirroring_the_image_mirrors_the_map(x, y):
    there = to_map([x, y])
    assert to_input(there) == pytest.approx([x, y])
    assert to_map([191 - x, y]) == pytest.approx([47 - there[0], there[1]])


@pytest.mark.parametrize("sigma", [1.5, 2.0, 3.0])
def test_decoding_without_noise_is_exact_also_at_the_border(sigma):
    truth = positions(400)
    assert rmse_input(encode(truth, sigma=sigma), truth, "matched", sigma) < 0.02
    inside = positions(400, margin=3 * sigma)
    for method in ("matched", "log_fit", "dark"):
        assert rmse_input(encode(inside, sigma=sigma), inside, method, sigma) < 0.01
    # what rounds or averages does not reach it
    assert rmse_input(encode(inside, sigma=sigma), inside, "argmax", sigma) == pytest.approx(4 / np.sqrt(6), rel=0.1)
    assert rmse_input(encode(inside, sigma=sigma), inside, "quarter", sigma) > 0.5


@pytest.mark.parametrize("noise", [0.02, 0.1])
def test_with_noise_the_matched_filter_is_the_best_of_all(noise):
    truth = positions(400, margin=8)
    maps = encode(truth) + np.random.default_rng(1).normal(0, noise, (400, 64, 48))
    error = {method: rmse_input(maps, truth, method, 3.0) for method in METHODS}
    assert error["matched"] < 1.03 * min(error.values())  # DARK is as good here
    assert error["matched"] < 0.6 * error["log_fit"] < 0.6 * error["quarter"] < 0.6 * error["argmax"]
    # a Gaussian of unit height with white noise: Cramér and Rao give noise / sqrt(pi / 2) heat-map pixels along each axis
    everywhere = positions(400)
    maps = encode(everywhere) + np.random.default_rng(1).normal(0, noise, (400, 64, 48))
    assert rmse_input(maps, everywhere, "matched", 3.0) < 0.5 * rmse_input(maps, everywhere, "dark", 3.0)
    bound = 4 * noise / np.sqrt(np.pi / 2) * np.sqrt(2)
    assert bound * 0.85 < error["matched"] < 1.6 * bound


def test_peaks_are_apart_sorted_and_refined():
    heatmap = np.maximum(encode([10.3, 12.6], sigma=2.0), 0.6 * encode([30.7, 40.2], sigma=2.0))
    found = peaks(heatmap)
    assert [(p.x, p.y) for p in found] == [pytest.approx((10.3, 12.6), abs=0.02), pytest.approx((30.7, 40.2), abs=0.02)]
    assert found[0].score > found[1].score
    assert len(peaks(heatmap, limit=1)) == 1
    assert peaks(np.zeros((64, 48))) == []
    assert len(peaks(np.full((9, 9), 0.5))) == 1  # a plateau is one peak


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.sampled_from(sorted(METHODS)))
def test_any_map_gives_a_finite_point_near_it(seed, method):
    rng = np.random.default_rng(seed)
    maps = rng.choice([rng.normal(size=(3, 64, 48)), np.zeros((3, 64, 48)), np.full((3, 64, 48), -1.0)])
    points, score = decode(maps, method)
    assert np.isfinite(points).all() and np.isfinite(score).all()
    assert (points >= -4).all() and (points <= [51, 67]).all()


def test_an_unknown_method_is_named():
    with pytest.raises(UnknownNameError, match="did you mean 'matched'"):
        decode(np.zeros((64, 48)), "match")
