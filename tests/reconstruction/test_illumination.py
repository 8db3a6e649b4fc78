"""Homomorphic filtering: a known uneven light on a known card, and the simpler rival beside it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from mfar_fem.errors import ParameterError
from reconstruction import illumination as il

HEIGHT, WIDTH = 180, 240
Y, X = np.mgrid[:HEIGHT, :WIDTH] / [[[HEIGHT]], [[WIDTH]]]
LIGHTS = {
    "from the left": 1 - 0.7 * X,
    "lamp": 0.25 + np.exp(-((X - 0.3) ** 2 + (Y - 0.4) ** 2) / 0.08),
    "shadow edge": np.where(X < 0.5, 1.0, 0.4),
    "even": np.ones_like(X),
}


def card(light, level=0.35):
    """A flat, evenly coloured, finely textured card under a light, 8-bit sRGB."""
    texture = gaussian_filter(np.random.default_rng(0).standard_normal((HEIGHT, WIDTH)), 1.5)
    reflectance = level * np.exp(0.15 * texture / texture.std())[..., None] * [1.0, 0.8, 0.6]
    return il.srgb_from_linear(reflectance * LIGHTS[light][..., None])


def removing(cutoff, **other):
    return il.HighEmphasis(gamma_low=0.0, gamma_high=1.0, cutoff=cutoff, **other)


@pytest.mark.parametrize("shape", ["gaussian", "butterworth"])
@pytest.mark.parametrize("light", ["from the left", "lamp", "shadow edge"])
def test_what_is_left_of_the_light_falls_with_the_cutoff(light, shape):
    picture = card(light)
    left = [il.correct(picture, removing(cutoff, shape=shape)).after for cutoff in (0.5, 1, 2, 4, 8)]
    assert all(np.diff(left) < 0)
    assert left[0] < il.nonuniformity(picture) and left[3] < 0.06 * il.nonuniformity(picture)


def test_gamma_low_is_the_share_of_the_light_that_stays():
    picture = card("from the left")
    before = il.nonuniformity(picture)
    for share in (0.3, 0.6):
        after = il.correct(picture, il.HighEmphasis(gamma_low=share, gamma_high=1.0, cutoff=4)).after
        assert after == pytest.approx(share * before, rel=0.1)


def test_background_division_is_as_good_for_smooth_light_and_worse_at_a_shadow_edge():
    left = {light: (il.correct(card(light), removing(2)).after, il.divide_background(card(light), 2).after) for light in LIGHTS}
    assert 0.8 < left["lamp"][1] / left["lamp"][0] < 1.0  # the simpler idea wins, by 10 %
    assert 0.8 < left["from the left"][1] / left["from the left"][0] < 1.0
    assert 1.05 < left["shadow edge"][1] / left["shadow edge"][0] < 1.3  # its halo is wider on the dark side


def test_no_gain_no_change_and_an_even_card_hardly_changes():
    picture = card("lamp")
    assert np.array_equal(il.correct(picture, il.HighEmphasis(gamma_low=1.0, gamma_high=1.0)).rgb, picture)
    even = card("even")
    assert np.abs(il.correct(even, removing(1)).rgb.astype(int) - even).max() <= 8


def test_the_mean_log_luminance_stays_and_the_texture_too():
    picture = card("from the left")
    log = [np.log(il.linear_from_srgb(p) @ il.LUMINANCE + il.EPSILON) for p in (picture, il.correct(picture, removing(2)).rgb)]
    assert log[1].mean() == pytest.approx(log[0].mean(), abs=0.01)
    fine = [values - gaussian_filter(values, 4) for values in log]
    assert np.corrcoef(fine[0].ravel(), fine[1].ravel())[0, 1] > 0.995


def test_chromaticity_stays_unless_a_channel_clips_and_clipping_is_counted():
    picture = card("lamp")
    result = il.correct(picture, il.HighEmphasis(gamma_high=1.0))
    assert result.clipped == 0.0
    before, after = (il.linear_from_srgb(p) for p in (picture, result.rgb))
    share = [values / values.sum(axis=2, keepdims=True) for values in (before, after)]
    assert np.abs(share[0] - share[1]).max() < 0.012  # 8-bit rounding
    spot = picture.copy()
    spot[5:15, -15:-5] = 255  # white in the dark corner
    bright = il.correct(spot, removing(1))
    assert bright.clipped == pytest.approx(100 / picture[..., 0].size, rel=0.3)


def test_the_cosine_transform_is_the_fourier_transform_of_the_mirrored_picture():
    values = np.random.default_rng(1).standard_normal((12, 20))
    mirrored = np.block([[values, values[:, ::-1]], [values[::-1], values[::-1, ::-1]]])
    settings = removing(1.5, shape="butterworth")
    v, u = np.fft.fftfreq(24) * 20, np.fft.fftfreq(40) * 20  # cycles per width
    h = 1 - 1 / (1 + (np.hypot(v[:, None], u[None]) / 1.5) ** 4)
    h[0, 0] = 1
    expected = np.fft.ifft2(np.fft.fft2(mirrored) * h).real[:12, :20]
    assert np.allclose(il.filtered(values, settings.transfer(values.shape)), expected, atol=1e-12)


def test_mirrored_borders_do_not_ring_as_joined_ones_do():
    ramp = np.broadcast_to(np.linspace(-1, 1, 128), (96, 128))
    ours = il.filtered(ramp, removing(2).transfer(ramp.shape))
    v, u = np.fft.fftfreq(96) * 128, np.fft.fftfreq(128) * 128
    joined = np.fft.ifft2(np.fft.fft2(ramp) * (1 - np.exp(-0.5 * np.hypot(v[:, None], u[None]) ** 2 / 4))).real
    assert np.abs(ours).max() < 0.25 * np.abs(joined).max()


def test_black_and_white_stay_finite():
    picture = np.zeros((40, 50, 3), np.uint8)
    picture[:, 25:] = 255
    for result in (il.correct(picture), il.divide_background(picture)):
        assert np.isfinite([result.before, result.after, result.clipped]).all()
        assert (result.rgb[:, :20] < 5).all()


@pytest.mark.parametrize("wrong", [{"shape": "ideal"}, {"gamma_low": 3.0}, {"gamma_low": -1.0}, {"cutoff": 0.0}, {"order": 0},
                                   {"epsilon": 0.0}, {"gamma_high": float("nan")}])  # fmt: skip
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(ParameterError):
        il.HighEmphasis(**wrong)


def test_srgb_round_trip():
    levels = np.arange(256, dtype=np.uint8)
    assert np.array_equal(il.srgb_from_linear(il.linear_from_srgb(levels)), levels)
