"""Colour transfers: the statistics they promise, and the laws of optimal transport."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import ParameterError, UnknownNameError
from reconstruction.style import colour
from reconstruction.style.colour_transfer import (
    METHODS,
    gaussian_transport,
    histogram_matching,
    monge_kantorovich,
    quantile_map,
    reinhard,
    sliced_transport,
    transfer,
)
from reconstruction.style.style_distance import colour_distance


def picture(seed, centre, spread, size=48):
    """Smooth random colours well inside the gamut, so that nothing is clipped."""
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(3, 3)) / 2
    values = np.array(centre) + spread * rng.uniform(-1, 1, (size, size, 3)) @ mixing
    return np.rint(255 * np.clip(values, 0.05, 0.95)).astype(np.uint8)


A = picture(0, (0.6, 0.45, 0.35), 0.10)
B = picture(1, (0.4, 0.5, 0.55), 0.08)


def lab(image):
    return colour.lab_from_srgb(colour.to_float(image)).reshape(-1, 3)


def test_reinhard_gives_means_and_deviations():
    made = lab(reinhard(B, A))
    assert made.mean(0) == pytest.approx(lab(A).mean(0), abs=0.15)
    assert made.std(0) == pytest.approx(lab(A).std(0), rel=0.02)
    cone = reinhard(B, A, space="lalphabeta")
    wanted, got = (colour.lalphabeta_from_srgb(colour.to_float(x)).reshape(-1, 3) for x in (A, cone))
    assert got.mean(0) == pytest.approx(wanted.mean(0), abs=0.005) and got.std(0) == pytest.approx(wanted.std(0), rel=0.05)


def test_monge_kantorovich_gives_the_covariance_where_reinhard_does_not():
    wanted = np.cov(lab(A).T)
    off = lambda image: np.linalg.norm(np.cov(lab(image).T) - wanted) / np.linalg.norm(wanted)  # noqa: E731
    assert off(monge_kantorovich(B, A)) < 0.02 < 0.1 < off(reinhard(B, A))


def test_histogram_matching_gives_every_channel_its_quantiles():
    made = histogram_matching(B, A)
    at = np.linspace(0.05, 0.95, 19)
    for c in range(3):
        assert np.quantile(made[..., c], at) == pytest.approx(np.quantile(A[..., c], at), abs=2.5)


def test_sliced_transport_gives_the_whole_distribution():
    start = colour_distance(A, B)
    linear, sliced = colour_distance(A, monge_kantorovich(B, A)), colour_distance(A, sliced_transport(B, A))
    assert sliced < 0.6 < start / 10
    assert sliced < linear < start
    assert np.array_equal(sliced_transport(B, A, strength=0.0), B)


@given(st.integers(0, 10_000))
@settings(max_examples=40)
def test_gaussian_transport_is_the_optimal_map(seed):
    rng = np.random.default_rng(seed)
    a, b = (m @ m.T + 0.1 * np.eye(3) for m in rng.normal(size=(2, 3, 3)))
    t = gaussian_transport(a, b, ridge=0.0)
    assert t == pytest.approx(t.T, abs=1e-8) and np.linalg.eigvalsh(t).min() > 0  # gradient of a convex function (Brenier)
    assert t @ a @ t == pytest.approx(b, rel=1e-6, abs=1e-8)
    # its cost is the Bures distance, below that of any other linear map that does it, e.g. through Cholesky factors
    cost = lambda m: np.trace(a) + np.trace(b) - 2 * np.trace(m @ a)  # noqa: E731
    other = np.linalg.cholesky(b) @ np.linalg.inv(np.linalg.cholesky(a))
    assert other @ a @ other.T == pytest.approx(b, rel=1e-6, abs=1e-8)
    assert cost(t) <= cost(other) + 1e-9


@given(st.lists(st.floats(-100, 100, allow_subnormal=False), min_size=20, max_size=200),
       st.lists(st.floats(-100, 100, allow_subnormal=False), min_size=20, max_size=200))
def test_quantile_map_is_increasing_and_stays_in_range(own, wanted):
    own, wanted = np.array(own), np.array(wanted)
    moved = quantile_map(own, wanted)(np.sort(own))
    assert (np.diff(moved) >= -1e-9).all()
    assert moved.min() >= wanted.min() - 1e-9 and moved.max() <= wanted.max() + 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_a_picture_given_its_own_colours_stays(method):
    assert np.abs(transfer(method, B, B).astype(int) - B).max() <= 2


@pytest.mark.parametrize("method", METHODS)
def test_grey_and_constant_pictures_are_no_trouble(method):
    grey = np.repeat(np.arange(48, 208, 5, dtype=np.uint8)[:, None, None], 32, 1).repeat(3, 2)
    for image, like in ((grey, A), (A, grey), (np.full_like(A, 90), A)):
        assert transfer(method, image, like).shape == image.shape


def test_masks_decide_whose_colours_count():
    mixed, mask = A.copy(), np.ones(A.shape[:2], dtype=bool)
    mixed[:24], mask[:24] = (0, 255, 0), False
    assert np.array_equal(reinhard(B, mixed, like_mask=mask)[5, 5], reinhard(B, A[24:])[5, 5])
    with pytest.raises(ParameterError, match="at least 16"):
        reinhard(B, A, like_mask=np.zeros(A.shape[:2], dtype=bool))
    with pytest.raises(ParameterError, match=r"\(48, 48\)"):
        reinhard(B, A, mask=np.ones((3, 3), dtype=bool))


def test_names_and_shapes_are_checked():
    with pytest.raises(UnknownNameError, match="did you mean 'reinhard'"):
        transfer("reinhart", B, A)
    with pytest.raises(UnknownNameError, match="lalphabeta"):
        reinhard(B, A, space="luv")
    with pytest.raises(ParameterError, match="uint8"):
        reinhard(B / 255.0, A)
