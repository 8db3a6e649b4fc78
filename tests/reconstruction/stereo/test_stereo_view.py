"""Calibrated pictures: cameras of any scale, pixels to rays and back, movement with depth."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from stereo_scene import SIZE, camera

from mfar_fem.errors import InputError
from reconstruction.stereo.view import View

BLANK = np.zeros((*SIZE, 3), dtype=np.float32)


def any_camera(seed, scale=1.0):
    """A camera with skew and unequal focal lengths, anywhere, turned anyhow; its centre."""
    rng = np.random.default_rng(seed)
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation = q * np.sign(np.linalg.det(q))
    k = np.array([[rng.uniform(100, 900), rng.uniform(-20, 20), rng.uniform(0, 112)], [0, rng.uniform(100, 900), 48], [0, 0, 1]])
    centre = rng.uniform(-5, 5, 3)
    return scale * k @ np.column_stack([rotation, -rotation @ centre]), centre


@given(st.integers(0, 10**6), st.floats(-1e6, 1e6))
def test_scale_and_sign_of_a_camera_do_not_matter(seed, scale):
    assume(abs(scale) > 1e-6)
    plain, centre = any_camera(seed)
    view = View.of("v", BLANK, scale * plain)
    np.testing.assert_allclose(view.camera, plain, rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(view.centre, centre, atol=1e-7)
    assert np.linalg.norm(view.axis) == pytest.approx(1.0)
    ahead = view.centre + 3.0 * view.axis
    assert view.project(ahead)[1] == pytest.approx(3.0)  # metres, and in front


@given(st.integers(0, 10**6), st.floats(-500, 500), st.floats(-500, 500), st.floats(0.01, 100))
def test_rays_lead_back_to_their_pixels(seed, x, y, depth):
    view = View.of("v", BLANK, any_camera(seed)[0])
    pixel, z = view.project(view.centre + depth * view.rays([x, y]))
    np.testing.assert_allclose(pixel, [x, y], atol=1e-5)
    assert z == pytest.approx(depth, rel=1e-6)


def test_a_depth_map_becomes_points_at_its_pixels():
    view = View.of("v", BLANK, any_camera(3)[0])
    depth = np.random.default_rng(0).uniform(1, 4, SIZE)
    pixels, z = view.project(view.points(depth))
    x, y = np.meshgrid(np.arange(SIZE[1]), np.arange(SIZE[0]))
    np.testing.assert_allclose(pixels, np.stack([x, y], axis=-1), atol=1e-6)
    np.testing.assert_allclose(z, depth, rtol=1e-9)


@given(st.integers(10, 80), st.floats(1.0, 4.0))
def test_parallax_is_the_derivative_of_the_other_pixel_by_depth(azimuth, depth):
    mask = np.zeros(SIZE, dtype=bool)
    mask[20:41, 60:81] = True
    view, other = View.of("a", BLANK, camera(0), mask), View.of("b", BLANK, camera(azimuth))
    ray, local = view.rays([70.0, 30.0]), other.camera[:, :3] @ view.rays([70.0, 30.0])
    place = other.camera[:, :3] @ (view.centre + depth * ray) + other.camera[:, 3]
    assume(place[2] > 0.5)
    exact = np.linalg.norm((local[:2] - place[:2] / place[2] * local[2]) / place[2])
    assert view.parallax(other, depth) == pytest.approx(exact, rel=2e-3, abs=1e-6)


def test_no_parallax_from_the_same_place():
    view = View.of("a", BLANK, camera(0))
    assert view.parallax(view, 2.0) == pytest.approx(0.0, abs=1e-9)


def test_pictures_of_bytes_and_greys():
    grey = np.full(SIZE, 51, dtype=np.uint8)
    view = View.of("v", grey, camera(0))
    assert view.image.shape == (*SIZE, 3) and view.image.dtype == np.float32
    np.testing.assert_allclose(view.image, 0.2, atol=1e-6)
    assert view.mask.all() and view.size == SIZE
    np.testing.assert_array_equal(View.of("v", grey, camera(0), (grey > 60) * 255).mask, False)


@pytest.mark.parametrize(
    "image, matrix, mask, message",
    [
        (np.zeros((5, 6, 4)), camera(0), None, r"'v': an image has shape .* not \(5, 6, 4\)"),
        (np.zeros((5, 6)), camera(0), np.ones((6, 5)), r"'v': the mask is \(5, 6\) pixels, the image \(6, 5\)"),
        (np.zeros((5, 6)), np.eye(4), None, r"'v': a camera is a 3x4 matrix, not \(4, 4\)"),
        (np.zeros((5, 6)), np.zeros((3, 4)), None, "'v'.*singular"),
        (np.zeros((5, 6)), np.ones((3, 4)), None, "'v'.*singular"),
        (np.zeros((5, 6)), np.full((3, 4), np.nan), None, "'v'.*finite"),
    ],
)
def test_what_is_no_view_is_refused_by_name(image, matrix, mask, message):
    with pytest.raises(InputError, match=message):
        View.of("v", image, matrix, mask)
