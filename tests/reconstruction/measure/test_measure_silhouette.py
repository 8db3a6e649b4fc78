"""Contours to a fraction of a pixel, chords, rectangles."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from mfar_fem.errors import DataFileError, InputError
from reconstruction.measure.accessories import smallest_rectangle
from reconstruction.measure.silhouette import between, chord, contour, crossings, read_mask, signed_area


def disc(radius, n=121, centre=(60.3, 59.6)):
    y, x = np.mgrid[:n, :n]
    return (x - centre[0]) ** 2 + (y - centre[1]) ** 2 <= radius**2


def test_contour_of_a_disc_is_sub_pixel():
    line = contour(disc(40.2))
    radius = np.hypot(*(line - (60.3, 59.6)).T)
    assert abs(radius.mean() - 40.2) < 0.05
    assert radius.std() < 0.25  # the staircase of a binary mask has 0.29
    assert signed_area(line) < 0  # anticlockwise to the eye
    assert abs(signed_area(line)) == pytest.approx(np.pi * 40.2**2, rel=0.003)


def test_the_largest_piece_is_taken_and_the_border_closes_it():
    mask = np.zeros((50, 60), bool)
    mask[:20, :30] = True
    mask[40:45, 50:55] = True
    line = contour(mask)
    np.testing.assert_allclose(line.min(axis=0), [-0.5, -0.5], atol=0.2)
    np.testing.assert_allclose(line.max(axis=0), [29.5, 19.5], atol=0.2)
    with pytest.raises(InputError, match="no piece"):
        contour(np.zeros((9, 9), bool))


@given(st.floats(0, np.pi), st.floats(-0.9, 0.9))
def test_chords_of_a_circle(angle, offset):
    t = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
    polygon = np.stack([np.cos(t), np.sin(t)], axis=1)
    direction = np.array([np.cos(angle), np.sin(angle)])
    point = offset * np.array([-direction[1], direction[0]])
    start, end = chord(polygon, point, direction)
    half = np.sqrt(1 - offset**2)
    assert start == pytest.approx(-half, abs=1e-4) and end == pytest.approx(half, abs=1e-4)


def test_a_line_beside_the_polygon_has_no_chord():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    assert chord(square, (5, 5), (1, 0)) is None
    assert len(crossings(square, (0.5, 0.5), (0, 1))) == 2


def test_both_ways_along_a_polygon():
    square = np.array([(x, 0) for x in range(10)] + [(10, y) for y in range(10)] + [(10 - x, 10) for x in range(10)]
                      + [(0, 10 - y) for y in range(10)], float)
    for through, size in (((10, 0), 21), ((0, 10), 21)):
        way = between(square, (0, 0), (10, 10), through)
        assert len(way) == size and tuple(way[0]) == (0, 0) and tuple(way[-1]) == (10, 10)
        assert (np.abs(way - through).sum(axis=1) == 0).any()


@given(st.floats(0, np.pi))
def test_smallest_rectangle_of_a_turned_one(angle):
    rectangle = np.array([(0, 0), (3, 0), (3, 1), (0, 1), (1.5, 0.5)]) @ np.array(
        [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    assert smallest_rectangle(rectangle) == pytest.approx((3, 1))


def test_masks_with_alpha_of_ones_and_broken_ones(tmp_path):
    mask = disc(20)
    Image.fromarray(np.dstack([np.zeros((*mask.shape, 3), np.uint8), mask.astype(np.uint8) * 255])).save(tmp_path / "alpha.png")
    Image.fromarray(mask.astype(np.uint8)).save(tmp_path / "ones.png")
    for name in ("alpha.png", "ones.png"):
        assert (read_mask(tmp_path / name) == mask).all()
    Image.new("L", (5, 5)).save(tmp_path / "empty.png")
    (tmp_path / "text.png").write_text("no image")
    for name, message in (("empty.png", "is empty"), ("text.png", "cannot be read"), ("none.png", "cannot be read")):
        with pytest.raises(DataFileError, match=message):
            read_mask(tmp_path / name)


def test_seen_from_behind_down_is_where_single_points_or_the_contour_lie():
    from reconstruction.landmarks import INDEX
    from reconstruction.measure.frame import garment_frame

    points = np.full((12, 2), np.nan)
    for name, at in {"left_neckline": (40, 20), "right_neckline": (60, 20), "left_shoulder": (30, 22), "right_shoulder": (70, 22),
                     "left_ankle": (35, 150)}.items():  # fmt: skip
        points[INDEX[name]] = at
    frame = garment_frame(points)
    np.testing.assert_allclose([frame.across, frame.down], [(-1, 0), (0, 1)], atol=1e-12)
    points[INDEX["left_ankle"]] = np.nan
    assert garment_frame(points).down[1] < 0  # nothing tells
    robe = np.array([(30, 20), (30, 150), (70, 150), (70, 20)], float)
    np.testing.assert_allclose(garment_frame(points, polygon=robe).down, (0, 1), atol=1e-12)


def test_a_mask_of_another_size_is_refused(tmp_path):
    path = tmp_path / "mask.png"
    Image.fromarray(np.full((30, 20), 255, dtype=np.uint8)).save(path)
    assert read_mask(path, (20, 30)).all()
    with pytest.raises(DataFileError, match=r"mask.png.*mask of 20 x 30 px; its picture has 40 x 60"):
        read_mask(path, (40, 60))
