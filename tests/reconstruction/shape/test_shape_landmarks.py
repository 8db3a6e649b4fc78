"""Landmarks in space and the wearer's axes."""

import numpy as np
import pytest

from mfar_fem.errors import InputError
from reconstruction.landmarks import INDEX, LANDMARKS
from reconstruction.shape.frame import body_frame
from reconstruction.shape.landmarks3d import SpacePoints, triangulate


def camera(azimuth, distance=5.0, focal=1000.0):
    """Looks at the origin from the front, turned about z."""
    a = np.radians(azimuth)
    forward = np.array([np.sin(a), np.cos(a), 0.0])
    right = np.array([np.cos(a), -np.sin(a), 0.0])
    r = np.stack([right, [0.0, 0.0, -1.0], forward])
    k = np.array([[focal, 0, 300], [0, focal, 400], [0, 0, 1.0]])
    return k @ np.column_stack([r, r @ (distance * forward)])


def figure():
    half = {"shoulder": (0.2, 1.4), "elbow": (0.45, 1.3), "wrist": (0.7, 1.2), "neckline": (0.07, 1.45), "waist": (0.2, 0.95),
            "ankle": (0.25, 0.1)}  # fmt: skip
    return np.array([(s * half[n.split("_")[1]][0], 0.02, half[n.split("_")[1]][1])
                     for n in LANDMARKS for s in [1 if n.startswith("left") else -1]])  # fmt: skip


def seen(cameras, points):
    p = np.stack([np.column_stack([points, np.ones(12)]) @ c.T for c in cameras])
    return p[..., :2] / p[..., 2:]


def test_exact_points_come_back_and_sigma_is_that_of_the_geometry():
    cameras = [camera(a) for a in (-30, 0, 30)]
    pixels = seen(cameras, figure())
    found = triangulate(cameras, pixels, np.full((3, 12), 2.0))
    np.testing.assert_allclose(found.points, figure(), atol=1e-9)
    rng = np.random.default_rng(0)
    noisy = [pixels + 2.0 * rng.normal(size=pixels.shape) for _ in range(60)]
    off = [triangulate(cameras, p, np.full((3, 12), 2.0)).points - figure() for p in noisy]
    largest = np.sqrt([np.linalg.eigvalsh(np.cov(np.array(off)[:, k].T))[-1] for k in range(12)])
    np.testing.assert_allclose(found.sigma, largest, rtol=0.35)
    assert (found.views == 3).all()


def test_a_point_taken_for_another_is_left_out():
    cameras = [camera(a) for a in (-30, 0, 30, 180)]
    pixels = seen(cameras, figure())
    left, right = INDEX["left_wrist"], INDEX["right_wrist"]
    pixels[3, [left, right]] = pixels[3, [right, left]]
    pixels[0, INDEX["left_elbow"]] = np.nan
    found = triangulate(cameras, pixels, np.full((4, 12), 2.0))
    np.testing.assert_allclose(found.points, figure(), atol=1e-9)
    assert found.views[left] == 3 and found.views[INDEX["left_elbow"]] == 3 and found.views[0] == 4


def test_too_little_is_named():
    with pytest.raises(InputError, match="there are 1"):
        triangulate([camera(0)], np.zeros((1, 12, 2)), np.ones((1, 12)))
    with pytest.raises(InputError, match="found alike in two"):
        triangulate([camera(0), camera(30)], np.full((2, 12, 2), np.nan), np.ones((2, 12)))
    points = np.full((12, 3), np.nan)
    points[INDEX["left_elbow"]] = 0.0
    with pytest.raises(InputError, match="found: no pair"):
        body_frame(SpacePoints(points, np.ones(12), np.ones(12, dtype=int)))


def test_the_axes_turn_with_the_figure():
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = figure() @ turn.T + (3.0, -1.0, 2.0)
    frame = body_frame(SpacePoints(moved, np.ones(12), np.ones(12, dtype=int)))
    local = frame.to_body(moved)
    np.testing.assert_allclose(local, figure() - (0.0, 0.02, 1.45), atol=1e-9)
    np.testing.assert_allclose(frame.to_world(local), moved, atol=1e-9)
    c = camera(20)
    np.testing.assert_allclose(seen([frame.camera(c)], local), seen([c], moved), atol=1e-6)
