"""What the drapemeter reads, on shapes whose shadow is known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from material_tests.drape import measure, seeds
from material_tests.drape.geometry import DrapeTest
from material_tests.drape.targets import OUTLINES, measured_outlines
from mfar_fem.errors import DataFileError, InputError, UnknownNameError

DISC, RIM = 0.09, 0.15


def ring(r, n=360):
    """A flat ring from the disc to the outline r(theta), as triangles."""
    t = np.linspace(0.0, 2 * np.pi, n, endpoint=False)
    e = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    points = np.vstack([DISC * e, r(t)[:, None] * e])
    i, j = np.arange(n), (np.arange(n) + 1) % n
    return points, np.vstack([np.column_stack([i, i + n, j + n]), np.column_stack([i, j + n, j])])


def test_flat_ring_casts_all_its_shadow():
    reading = measure.read(*ring(lambda t: np.full_like(t, RIM)), DISC, RIM)
    assert reading.drape_coefficient == pytest.approx(100.0, abs=0.01)
    assert reading.nodes == 0 and reading.depth == 0.0
    assert reading.amplitudes[0] == pytest.approx(RIM, rel=1e-4)


@settings(max_examples=8, deadline=None)
@given(n=st.integers(2, 14), swing=st.floats(0.004, 0.02), mean=st.floats(0.115, 0.128))
def test_wavy_outline(n, swing, mean):
    reading = measure.read(*ring(lambda t: mean + swing * np.cos(n * t)), DISC, RIM)
    area = np.pi * (mean**2 + 0.5 * swing**2)  # exact
    exact = 100.0 * (area - np.pi * DISC**2) / (np.pi * (RIM**2 - DISC**2))
    assert reading.drape_coefficient == pytest.approx(exact, abs=0.05)
    assert reading.nodes == n  # the running mean takes 1.6 % off at n = 14 at most, prominence stays above 4 mm
    assert reading.amplitudes[n] == pytest.approx(swing, rel=2e-3)
    assert np.abs(np.delete(reading.amplitudes, [0, n])).max() < 1e-3 * swing


def test_shadow_counts_overlaps_once_and_ignores_the_order():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
    corners = square[[[0, 1, 2], [0, 2, 3]]]
    assert measure.shadow_area(corners) == pytest.approx(1.0, abs=1e-9)
    twice = np.concatenate([corners, corners[:, ::-1] + [0.5, 0.0]])
    assert measure.shadow_area(twice) == pytest.approx(1.5, abs=1e-9)
    assert measure.shadow_area(corners - 0.5, disc_radius=2.0) == pytest.approx(4 * np.pi, rel=1e-4)


def test_folded_under_cloth_is_not_counted_twice():
    points, triangles = ring(lambda t: 0.13 + 0.012 * np.cos(6 * t))
    under = points * [1.0, 1.0, 1.0] - [0.0, 0.0, 0.05]
    alone = measure.read(points, triangles, DISC, RIM)
    both = measure.read(np.vstack([points, under]), np.vstack([triangles, triangles + len(points)]), DISC, RIM)
    assert both.drape_coefficient == pytest.approx(alone.drape_coefficient, abs=1e-9)
    assert both.depth == pytest.approx(0.05)
    assert np.allclose(both.outline, alone.outline)


def test_outline_takes_the_farthest_of_several_crossings():
    near = np.array([[[0.01, -0.01], [0.02, -0.01], [0.015, 0.01]]])
    far = near + np.array([0.05, 0.0])
    r = measure.outline(np.concatenate([far, near]), np.radians([0.0, 90.0]))
    assert r == pytest.approx([0.0675, 0.0], abs=1e-12)


@pytest.mark.skipif(not OUTLINES.exists(), reason="the measured outlines are not here")
def test_nodes_are_counted_as_in_the_measured_outlines():
    agree = []
    for fabric in range(1, 26):
        outlines, nodes = measured_outlines(fabric)
        agree += [measure.count_nodes(r) == n for r, n in zip(outlines, nodes, strict=True)]
    assert len(agree) > 500 and np.mean(agree) > 0.97


def test_absent_outlines_are_named(tmp_path):
    with pytest.raises(DataFileError, match=r"absent\.csv"):
        measured_outlines(1, tmp_path / "absent.csv")


@pytest.mark.parametrize("n", [2, 5, 9])
def test_seed_with_folds_keeps_its_rim_and_has_its_nodes(n):
    test = DrapeTest(cells=(2, 60))
    surface = test.surface()
    x = seeds.folds(surface, DISC, RIM, n, slope=np.radians(60.0))
    reading = measure.read(*measure.flat_triangles(surface, x), DISC, RIM)
    assert reading.nodes == n
    if n == 2:
        return  # two folds cannot hold the length of the rim
    outer = surface.nodes_of("outer")
    outer = outer[np.argsort(np.arctan2(surface.nodes[outer, 1], surface.nodes[outer, 0]))]
    length = np.linalg.norm(np.roll(x[outer], -1, axis=0) - x[outer], axis=1).sum()
    assert length == pytest.approx(2 * np.pi * RIM, rel=0.02)
    inner = surface.nodes_of("inner")
    assert np.allclose(x[inner], surface.nodes[inner], atol=1e-15)


def test_random_seed_is_reproducible_and_as_large_as_it_says():
    surface = DrapeTest(cells=(2, 24)).surface()
    a, b, c = (seeds.nearly_flat(surface, DISC, RIM, seed, 2e-3) for seed in (5, 5, 6))
    assert np.array_equal(a, b) and not np.allclose(a, c)
    assert np.abs(a[:, 2]).max() == pytest.approx(2e-3)


def test_prolongation_reproduces_a_smooth_shape():
    coarse, fine = DrapeTest(cells=(5, 36)), DrapeTest(cells=(7, 60))

    def shape(surface):
        r, t = seeds.polar(surface)
        return np.column_stack([r * np.cos(t), r * np.sin(t), -(r - DISC) ** 2 * (4 + np.cos(5 * t))])

    x = seeds.prolong(coarse.surface(), shape(coarse.surface()), coarse.mesh, fine.surface())
    assert np.abs(x - shape(fine.surface())).max() < 1e-4  # of 18 mm, ten degrees a cell


def test_sizes_and_bad_input():
    assert DrapeTest("jis-254").specimen_radius == 0.127 and DrapeTest("jis-254").disc_radius == 0.0635
    with pytest.raises(UnknownNameError, match="iso-36"):
        DrapeTest("iso-31")
    with pytest.raises(UnknownNameError, match="draft"):
        DrapeTest(fidelity="best")
    with pytest.raises(InputError, match="disc"):
        measure.read(*ring(lambda t: np.full_like(t, RIM)), 0.2, RIM)
    points, triangles = ring(lambda t: np.full_like(t, RIM))
    points[3] = np.nan
    with pytest.raises(InputError, match="finite"):
        measure.read(points, triangles, DISC, RIM)
