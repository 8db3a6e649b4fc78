"""The canonical frame: landmarks land on landmarks, a picture and its moved copy become the same, behind is told."""

import numpy as np
import pytest

from reconstruction.keypoints_file import ImageKeypoints
from reconstruction.measure.canonical import canonical_map
from reconstruction.measure.frame import TooFewPointsError
from reconstruction.measure.skeleton import Skeleton

pytest.importorskip("cv2")


def seen(scale=150.0, turn=0.0, at=(200.0, 20.0), mirror=1.0):
    """Frontal picture of the canonical skeleton."""
    plan = np.column_stack([mirror * Skeleton.canonical().points[:, 0], 1.75 - Skeleton.canonical().points[:, 2]])
    c, s = np.cos(turn), np.sin(turn)
    return scale * plan @ np.array([[c, s], [-s, c]]) + at


def test_landmarks_are_interpolated_and_a_similarity_is_exact_everywhere():
    way = canonical_map(ImageKeypoints.of("a.png", "mural", seen(turn=0.2), figure="male"))
    np.testing.assert_allclose(way.to_picture(way.landmarks), seen(turn=0.2), atol=1e-6)
    corners = np.array([(0, 0), (way.size[0] - 1, way.size[1] - 1)], float)
    size = np.linalg.norm(np.diff(way.to_picture(corners), axis=0)) / np.linalg.norm(np.diff(corners, axis=0))
    assert size == pytest.approx(150 / 220, rel=1e-6)


def test_a_picture_and_its_turned_copy_become_the_same():
    y, x = np.mgrid[:400, :400]

    def paint(points):  # a smooth pattern that moves with the figure
        inverse = np.linalg.lstsq(np.column_stack([points, np.ones(12)]), seen(), rcond=None)[0]
        u = np.stack([x, y, np.ones_like(x)], axis=-1) @ inverse
        return (127 + 60 * np.sin(u[..., 0] / 9) + 60 * np.cos(u[..., 1] / 11)).astype(np.uint8)

    pictures = []
    for points in (seen(), seen(scale=140, turn=0.15, at=(190, 40))):
        way = canonical_map(ImageKeypoints.of("a.png", "mural", points, figure="male"))
        pictures.append(way.unwarp(paint(points)).astype(float))
    middle = (slice(60, 330), slice(100, 300))
    assert np.abs(pictures[0][middle] - pictures[1][middle]).mean() < 2.0


def test_seen_from_behind_left_stays_left_of_the_picture():
    way = canonical_map(ImageKeypoints.of("a.png", "figurine", seen(mirror=-1.0), figure="male"))
    assert way.behind and way.landmarks[0, 0] < way.landmarks[1, 0]
    assert not canonical_map(ImageKeypoints.of("a.png", "figurine", seen(), figure="male")).behind


def test_too_few_landmarks_are_named():
    points = seen()
    points[3:] = np.nan
    with pytest.raises(TooFewPointsError, match="3 landmarks do not fix a map"):
        canonical_map(ImageKeypoints.of("a.png", "mural", points, figure="male"))
