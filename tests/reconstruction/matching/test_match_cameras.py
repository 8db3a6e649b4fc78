"""Known cameras: files, and the fundamental matrix of two of them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from match_scenes import VISION, cameras, needs, project, rotation, world

from mfar_fem.errors import DataFileError, InputError
from reconstruction.matching import cameras as known
from reconstruction.matching.epipolar import algebraic_residual, sampson_distance


@given(st.floats(-0.5, 0.5), st.floats(0.05, 1.0), st.floats(-0.5, 0.5), st.integers(0, 99))
def test_points_seen_by_two_cameras_lie_on_their_epipolar_lines(turn, along, up, seed):
    first, second = cameras(turn, (along, up, 0.2))
    matrix = known.fundamental(first, second)
    points = world(30, seed=seed)
    a, b = project(first, points), project(second, points)
    assert sampson_distance(matrix, a, b).max() < 1e-6
    assert np.abs(np.linalg.det(matrix)) < 1e-12 and np.linalg.norm(matrix) == pytest.approx(1)
    assert sampson_distance(known.fundamental(second, first), b, a).max() < 1e-6  # the other way round it is the transpose


def test_a_picture_of_half_the_size_needs_the_scaled_camera():
    first, second = cameras()
    points = world(30)
    a, b = project(first, points) / 2, project(second, points) / 2
    halved = known.fundamental(known.scaled(first, 0.5), known.scaled(second, 0.5))
    assert sampson_distance(halved, a, b).max() < 1e-8
    assert np.median(sampson_distance(known.fundamental(first, second), a, b)) > 5


def test_cameras_at_one_place_have_no_fundamental_matrix():
    first, _ = cameras()
    with pytest.raises(InputError, match="same centre"):
        known.fundamental(first, np.diag([2.0, 2.0, 1.0]) @ first)


def test_angle_between_views():
    first, _ = cameras()
    turned = first @ np.block([[rotation([0, 1, 0], 0.4), np.zeros((3, 1))], [np.zeros(3), 1]])
    assert known.baseline_angle(first, turned) == pytest.approx(0.4)
    assert known.baseline_angle(first, -turned) == pytest.approx(0.4)  # the sign of a projection matrix is arbitrary


@pytest.mark.parametrize(
    ("text", "says"),
    [("1 2 3", "holds 3 numbers"), ("1 0 0 0 0 1 0 0 0 0 x 0", "'x' is not a number"), ("1 0 0 0 " * 3, "singular"), ("", "number"),
     ("nan 0 0 0 0 1 0 0 0 0 1 0", "finite")],
)  # fmt: skip
def test_what_is_no_camera_is_refused(tmp_path, text, says):
    (tmp_path / "P.txt").write_text(text)
    with pytest.raises(DataFileError, match=says):
        known.read_matrix(tmp_path / "P.txt")


@given(st.lists(st.text(max_size=12), max_size=30))
def test_any_text_is_a_camera_or_a_named_error(tmp_path_factory, words):
    path = tmp_path_factory.getbasetemp() / "any_P.txt"
    path.write_bytes(" ".join(words).encode("utf-8", "surrogatepass"))
    for read in (known.read_matrix, known.read_middlebury):
        try:
            read(path)
        except DataFileError as error:
            assert "any_P.txt" in str(error)


def test_middlebury_lines_are_checked(tmp_path):
    numbers = " ".join(map(str, [*np.eye(3).ravel(), *np.eye(3).ravel(), 1, 2, 3]))
    (tmp_path / "par.txt").write_text(f"1\na.png {numbers}\n")
    assert np.array_equal(known.read_middlebury(tmp_path / "par.txt")["a.png"], np.column_stack([np.eye(3), [1, 2, 3]]))
    (tmp_path / "par.txt").write_text(f"2\na.png {numbers}\n")
    with pytest.raises(DataFileError, match="first line"):
        known.read_middlebury(tmp_path / "par.txt")
    (tmp_path / "par.txt").write_text(f"1\na.png {numbers} 4\n")
    with pytest.raises(DataFileError, match="line 2"):
        known.read_middlebury(tmp_path / "par.txt")


@needs["middlebury_templeRing"]
def test_the_temple_ring_is_a_ring_of_47():
    found = known.read_middlebury(VISION / "middlebury_templeRing" / "templeR_par.txt")
    centres = np.array([known.centre(camera) for camera in found.values()])
    assert len(found) == 47 and np.ptp(np.linalg.norm(centres - centres.mean(axis=0), axis=1)) < 0.2


def test_the_algebraic_residual_of_formula_3_is_no_distance():
    first, second = cameras()
    matrix = known.fundamental(first, second)
    points = world(20)
    a, b = project(first, points), np.add(project(second, points), [0, 2.0])
    assert np.allclose(algebraic_residual(7 * matrix, a, b), 7 * algebraic_residual(matrix, a, b))
    assert np.allclose(sampson_distance(7 * matrix, a, b), sampson_distance(matrix, a, b))
