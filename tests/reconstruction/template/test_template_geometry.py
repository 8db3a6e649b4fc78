"""Offsets and simplicity of polygons."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reconstruction.measure.silhouette import signed_area
from reconstruction.template.geometry import extent, is_simple, offset, self_crossings, without_loops


def sides(polygon):
    """Every side of a polygon as a piece of its own."""
    return list(np.stack([polygon, np.roll(polygon, -1, axis=0)], axis=1))


SQUARE = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)


@given(st.integers(3, 12), st.floats(0.01, 0.5))
def test_offset_of_a_regular_polygon(n, distance):
    """Area = A + P d + d² Σ tan(turn / 2) where mitres are not cut off."""
    angle = 2 * np.pi * np.arange(n) / n
    polygon = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    side = 2 * np.sin(np.pi / n)
    expected = signed_area(polygon) + n * side * distance + distance**2 * n * np.tan(np.pi / n)
    assert signed_area(offset(sides(polygon), np.full(n, distance))) == pytest.approx(expected, rel=1e-9)


def test_every_side_moves_by_its_own_distance():
    moved = offset(sides(SQUARE), [0.1, 0.2, 0.3, 0.0])
    np.testing.assert_allclose(moved, [(0, -0.1), (1.2, -0.1), (1.2, 1.3), (0, 1.3)], atol=1e-12)
    t = np.linspace(0, np.pi / 2, 30)  # a shallow hollow beside a fold (distance 0): the cut line stays below the fold
    curve = np.stack([0.9 - 0.4 * t, -0.12 * np.sin(t)], axis=1)
    end = curve[-1]
    pieces = [np.array([(end[0], -1), (1, -1)]), np.array([(1, -1), (1, 0)]), np.array([(1, 0), curve[0]]), curve,
              np.array([end, (end[0], -1)])]
    moved = offset(pieces, [0.01, 0.01, 0.0, 0.01, 0.01])
    assert moved[:, 1].max() < 1e-12 and is_simple(moved)
    np.testing.assert_allclose(offset(sides(SQUARE), np.zeros(4)), SQUARE)


def test_sharp_corner_is_cut_off_and_a_narrow_hollow_leaves_no_loop():
    needle = np.array([(0, 0), (1, 0.02), (0, 0.04)], float)
    moved = offset(sides(needle), [0.01] * 3)
    assert moved[:, 0].max() < 1.06 and is_simple(moved)
    t = np.linspace(np.pi, 0, 30)
    hollow = np.vstack([[(0, -1), (1, -1), (1, 0)], np.stack([0.5 - 0.05 * np.cos(t), -0.02 * np.sin(t)], axis=1), [(0, 0)]])
    assert is_simple(hollow) and signed_area(hollow) > 0
    moved = offset(sides(hollow), np.full(len(hollow), 0.08))
    assert is_simple(moved)
    assert signed_area(moved) > signed_area(hollow)


def test_crossings_are_found():
    bow = np.array([(0, 0), (1, 1), (1, 0), (0, 1)], float)
    assert self_crossings(bow) == [(0, 2)]
    assert not is_simple(bow) and is_simple(SQUARE)
    assert is_simple(without_loops(bow))
    assert not is_simple(np.array([(0, 0), (1, 0), (0.5, 0), (0.5, 1)], float))  # runs back along itself


@given(st.floats(0, 2 * np.pi))
def test_extent_of_the_unit_square(angle):
    direction = 3 * np.array([np.cos(angle), np.sin(angle)])
    assert extent(SQUARE, direction) == pytest.approx(abs(np.cos(angle)) + abs(np.sin(angle)))
