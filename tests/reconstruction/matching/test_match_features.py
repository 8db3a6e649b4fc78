"""SIFT points: octaves, RootSIFT, the same list twice, and pictures without any."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from reconstruction.matching.features import detect, root, sift, signed_octave
from reconstruction.matching.settings import MatchSettings


@pytest.fixture(scope="module")
def grey():
    """Texture at all scales."""
    rng = np.random.default_rng(0)
    noise = sum(gaussian_filter(rng.standard_normal((300, 400)), s) * s for s in (1, 3, 8, 20))
    return np.clip(128 + 60 * noise / noise.std(), 0, 255).astype(np.uint8)


def test_octave_is_the_signed_low_byte():
    assert [signed_octave(v) for v in (0, 1, 255, 255 + (3 << 8), 2 + (1 << 8) + (9 << 16))] == [0, 1, -1, -1, 2]


def test_octaves_are_counted_from_the_doubled_picture(grey):
    import cv2

    keypoints = cv2.SIFT_create(contrastThreshold=0.03, edgeThreshold=10, enable_precise_upscale=True).detect(grey, None)
    octaves = np.array([signed_octave(k.octave) for k in keypoints])
    assert octaves.min() == -1 and octaves.max() >= 3
    for count in (1, 4):
        assert len(sift(grey, MatchSettings(octaves=count))) == (octaves < count - 1).sum()


def test_descriptors_have_128_numbers_and_root_sift_is_on_the_unit_sphere(grey):
    plain, rooted = sift(grey, MatchSettings()), sift(grey, MatchSettings(root_sift=True))
    assert plain.descriptors.shape == (len(plain), 128) and plain.descriptors.dtype == np.float32
    assert np.allclose(np.linalg.norm(rooted.descriptors, axis=1), 1, atol=1e-5)
    assert np.allclose(rooted.descriptors, root(plain.descriptors))


def test_points_keep_their_place_when_the_picture_is_shifted_and_turned(grey):
    found = sift(grey, MatchSettings(most_features=200)).points
    turned = sift(np.rot90(grey), MatchSettings(most_features=200)).points
    back = np.column_stack([399 - turned[:, 1], turned[:, 0]])  # rot90 turns counter-clockwise: (x, y) came to (y, w - 1 - x)
    distance = np.linalg.norm(found[:, None] - back[None], axis=2).min(axis=1)
    assert np.median(distance) < 0.05  # no bias of a quarter pixel, which the default upscaling has


def test_the_same_list_twice_strongest_first_and_capped(grey):
    first, again = sift(grey, MatchSettings()), sift(grey, MatchSettings())
    assert np.array_equal(first.points, again.points) and np.array_equal(first.descriptors, again.descriptors)
    capped = sift(grey, MatchSettings(most_features=50))
    assert np.array_equal(capped.points, first.points[:50])


def test_a_picture_without_features_gives_an_empty_list():
    assert len(detect(np.full((64, 64), 120, np.uint8), MatchSettings())) == 0
