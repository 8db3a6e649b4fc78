"""Distances to an epipolar geometry and its estimation from points."""

from __future__ import annotations

import numpy as np
import pytest
from match_scenes import cameras, project, world

from reconstruction.matching import epipolar
from reconstruction.matching.cameras import fundamental


@pytest.fixture(scope="module")
def scene():
    first, second = cameras()
    points = world(60)
    return fundamental(first, second), project(first, points), project(second, points)


def test_sampson_is_the_distance_to_the_constraint_to_first_order(scene):
    matrix, a, b = scene
    rng = np.random.default_rng(0)
    small = 1e-3 * rng.standard_normal((2, len(a), 2))
    distance = epipolar.sampson_distance(matrix, a + small[0], b + small[1])
    # the exact distance: the shift along the normal of the constraint in the space of (x1, y1, x2, y2)
    lines2, lines1 = epipolar.homogeneous(a) @ matrix.T, epipolar.homogeneous(b) @ matrix
    normal = np.hstack([lines1[:, :2], lines2[:, :2]])
    exact = np.abs((normal * np.hstack(small)).sum(axis=1)) / np.linalg.norm(normal, axis=1)
    assert np.allclose(distance, exact, rtol=1e-3, atol=1e-7)


def test_epipolar_distance_is_that_of_point_and_line(scene):
    matrix, a, b = scene
    lines = epipolar.homogeneous(a) @ matrix.T
    normal = lines[:, :2] / np.linalg.norm(lines[:, :2], axis=1, keepdims=True)
    assert (epipolar.epipolar_distance(matrix, a, b + 2.5 * normal) >= 2.5 - 1e-9).all()
    assert (epipolar.sampson_distance(matrix, a, b + 2.5 * normal) <= 2.5).all()


def test_a_matrix_of_zeros_is_infinitely_far(scene):
    _, a, b = scene
    assert np.isinf(epipolar.sampson_distance(np.zeros((3, 3)), a, b)).all()
    assert np.isinf(epipolar.epipolar_distance(np.zeros((3, 3)), a, b)).all()


@pytest.mark.parametrize("count", [8, 60])
def test_eight_points_give_the_matrix_back(scene, count):
    matrix, a, b = scene
    found = epipolar.eight_point(a[:count], b[:count])
    assert min(np.abs(found - matrix).max(), np.abs(found + matrix).max()) < 1e-6


def test_refinement_comes_nearer_to_the_truth_than_eight_points_and_bears_outliers(scene):
    _, a, b = scene
    rng = np.random.default_rng(3)
    errors = []
    for _ in range(10):
        x, y = a + 0.5 * rng.standard_normal(a.shape), b + 0.5 * rng.standard_normal(b.shape)
        y[:3] += rng.uniform(2, 3, (3, 2))  # inliers by the threshold that are wrong
        rough, algebraic = epipolar.eight_point(x[:9], y[:9]), epipolar.eight_point(x, y)
        fine = epipolar.refined(rough, x, y)
        assert abs(np.linalg.det(fine)) < 1e-12
        errors.append([np.median(epipolar.sampson_distance(m, a, b)) for m in (rough, algebraic, fine)])
    rough, algebraic, fine = np.median(errors, axis=0)
    assert fine < 0.3 * rough and fine < 0.9 * algebraic


def test_refinement_does_not_depend_on_how_the_pictures_are_turned(scene):
    _, a, b = scene
    rng = np.random.default_rng(4)
    x, y = a + 0.5 * rng.standard_normal(a.shape), b + 0.5 * rng.standard_normal(b.shape)
    turned = [np.column_stack([p[:, 1], 640 - p[:, 0]]) for p in (x, y)]
    upright = epipolar.sampson_distance(epipolar.refined(epipolar.eight_point(x, y), x, y), x, y)
    rotated = epipolar.sampson_distance(epipolar.refined(epipolar.eight_point(*turned), *turned), *turned)
    assert np.allclose(upright, rotated, atol=1e-3)


def test_homography_transfer(scene):
    _, a, _ = scene
    h = np.array([[1.1, 0.1, 5], [-0.1, 0.9, 3], [1e-4, 2e-4, 1]])
    assert epipolar.transfer_distance(h, a, epipolar.apply(h, a)).max() < 1e-9
    assert (epipolar.transfer_distance(h, a, np.add(epipolar.apply(h, a), [3, 4])) >= 5 - 1e-9).all()
