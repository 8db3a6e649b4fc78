"""Cameras: projection, rays, depth."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mfar_fem.errors import InputError
from reconstruction.benchmark.camera import FAR, Camera, axes, oblique, perspective

BOX = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.2, 0.2) for z in (0.0, 1.7)])
ANGLE = st.floats(-180, 180)


def cameras(azimuth=20.0, elevation=8.0):
    return [perspective(BOX, azimuth, elevation, 4.0, 96, 128),
            oblique(BOX, azimuth, elevation, 96, 128, (0.2, -0.1), 0.9, 0.1, 3.0)]


@given(ANGLE, st.floats(-30, 30), st.integers(0, 2**31))
def test_unproject_inverts_project(azimuth, elevation, seed):
    points = np.random.default_rng(seed).uniform(-1, 1, (20, 3)) * [0.5, 0.2, 0.8] + [0, 0, 0.9]
    for camera in cameras(azimuth, elevation):
        pixels, depth = camera.project(points)
        assert camera.unproject(pixels, depth) == pytest.approx(points, abs=1e-9)


@pytest.mark.parametrize("camera", cameras(), ids=["perspective", "affine"])
@pytest.mark.parametrize("scale", [1, 2])
def test_points_along_a_ray_fall_on_its_pixel(camera, scale):
    origins, directions = camera.rays(scale)
    assert len(origins) == 96 * 128 * scale**2
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    x, y = np.meshgrid((np.arange(96 * scale) + 0.5) / scale - 0.5, (np.arange(128 * scale) + 0.5) / scale - 0.5)
    wanted = np.stack([x, y], axis=-1).reshape(-1, 2)
    for t in (1.0, 4.0):
        points = origins + t * directions
        np.testing.assert_allclose(camera.project(points)[0], wanted, atol=1e-8)
        np.testing.assert_allclose(camera.towards(points), -directions, atol=1e-12)


def test_perspective_matrix_is_made_of_its_parts():
    camera = cameras()[0]
    pose = np.column_stack([camera.rotation, camera.translation])
    assert camera.matrix == pytest.approx(camera.intrinsics @ pose)
    assert camera.rotation @ camera.rotation.T == pytest.approx(np.eye(3))
    assert np.linalg.det(camera.rotation) == pytest.approx(1.0)
    assert camera.centre == pytest.approx(-camera.rotation.T @ camera.translation)


def test_affine_depth_is_the_distance_along_the_ray():
    camera = cameras()[1]
    origins, directions = camera.rays()
    assert origins[:5] @ camera.depth_row[:3] + FAR == pytest.approx(0.0)
    assert (origins + 2.5 * directions)[:5] @ camera.depth_row[:3] + FAR == pytest.approx(2.5)


@pytest.mark.parametrize("make", [lambda a: perspective(BOX, a, 0.0, 4.0, 96, 128), lambda a: oblique(BOX, a, 0.0, 96, 128)])
def test_the_wearers_left_is_on_the_right_from_the_front_and_up_is_up(make):
    left, right, low, high = np.array([[0.3, 0, 1.0], [-0.3, 0, 1.0], [0, 0, 0.2], [0, 0, 1.6]])
    front, back = (make(a).project(np.stack([left, right, low, high]))[0] for a in (0.0, 180.0))
    assert front[0, 0] > front[1, 0] and back[0, 0] < back[1, 0]
    assert front[3, 1] < front[2, 1]
    assert axes(90.0, 0.0)[2] == pytest.approx([-1, 0, 0])  # from the wearer's left


def test_the_box_fills_the_picture_and_the_window_holds_it():
    for camera in cameras():
        pixels = camera.project(BOX)[0]
        used = np.ptp(pixels, axis=0) / [96, 128]
        assert used.max() == pytest.approx(0.93)
        rows, columns = camera.window(BOX)
        assert columns.start <= pixels[:, 0].min() and pixels[:, 0].max() <= columns.stop - 1
        assert rows.start <= pixels[:, 1].min() and pixels[:, 1].max() <= rows.stop - 1


def test_json_round_trip():
    for camera in cameras():
        again = Camera.from_dict(camera.to_dict())
        assert np.array_equal(again.matrix, camera.matrix) and again.affine == camera.affine


def test_a_camera_inside_the_figure_is_refused():
    with pytest.raises(InputError, match="larger distance"):
        perspective(BOX, 0.0, 0.0, 0.1, 96, 128)
