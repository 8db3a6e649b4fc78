"""Scores of matching against a known homography: perfect, partly wrong and consistently wrong matches are told apart."""

import numpy as np
import pytest

from reconstruction.style.match_rate import score, sift_matches, transform
from reconstruction.style.scenes import draw_scene, random_homography, view

pytest.importorskip("cv2")
BLANK = np.zeros((200, 200, 3), dtype=np.uint8)
TRUTH = random_homography(np.random.default_rng(4), 200)
POINTS = np.random.default_rng(0).uniform(10, 190, (40, 2))


def test_true_points_score_full():
    result = score(BLANK, BLANK, TRUTH, lambda a, b: (POINTS, transform(TRUTH, POINTS)))
    assert (result.proposed, result.correct, result.inliers, result.correct_inliers) == (40, 40, 40, 40)
    assert result.precision == 1.0 and result.corner_error < 1e-2 and result.registered()


def test_self_consistent_is_not_correct():
    wrong = np.array([[0, -1, 199], [1, 0, 0], [0, 0, 1.0]])  # a turn by 90 degrees: every match agrees with every other
    result = score(BLANK, BLANK, TRUTH, lambda a, b: (POINTS, transform(wrong, POINTS)))
    assert result.inliers == 40 and result.correct == result.correct_inliers == 0 and not result.registered()


def test_outliers_are_counted_and_survived():
    moved = transform(TRUTH, POINTS)
    moved[::4] += np.random.default_rng(1).uniform(30, 60, (10, 2))
    result = score(BLANK, BLANK, TRUTH, lambda a, b: (POINTS, moved))
    assert (result.proposed, result.correct) == (40, 30) and result.precision == 0.75
    assert result.correct_inliers == 30 and result.inliers == 30 and result.corner_error < 0.1


@pytest.mark.parametrize("count", [0, 3])
def test_too_few_matches_register_nothing(count):
    result = score(BLANK, BLANK, TRUTH, lambda a, b: (POINTS[:count], transform(TRUTH, POINTS[:count])))
    assert result.correct == count and result.inliers == 0 and not result.registered() and np.isfinite(result.precision)


def test_sift_finds_a_picture_again_and_nothing_in_a_blank():
    scene = draw_scene(np.random.default_rng(3))
    a = view(scene, "mural", np.random.default_rng(0), 200)
    result = score(a, a, np.eye(3))
    assert result.correct == result.proposed > 20 and result.registered(1.0)
    assert sift_matches(a, BLANK)[0].shape == (0, 2)
