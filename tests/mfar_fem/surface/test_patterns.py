"""Patterns: areas, orientation, sides, closure, curved midpoints."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.errors import InputError
from mfar_fem.surface import patterns
from mfar_fem.surface.grid import PATTERNS, signed_areas, triangulate


def vector_areas(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    return 0.5 * np.cross(b - a, c - a)


def edges_of(mesh):
    edges = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    return np.unique(edges, axis=0)


def euler(mesh):
    return len(mesh.vertices) - len(edges_of(mesh)) + len(mesh.triangles)


@settings(deadline=None, max_examples=60)
@given(
    nx=st.integers(1, 7),
    ny=st.integers(1, 7),
    pattern=st.sampled_from(PATTERNS),
    jitter=st.sampled_from([None, 0.1, 0.4]),
    seed=st.integers(0, 50),
)
def test_every_pattern_fills_the_rectangle_once(nx, ny, pattern, jitter, seed):
    points, triangles = triangulate(nx, ny, pattern, jitter, seed)
    areas = signed_areas(points, triangles)
    assert areas.min() > 0
    assert areas.sum() == pytest.approx(nx * ny, rel=1e-12)
    assert np.array_equal(np.unique(triangles), np.arange(len(points)))
    mesh = patterns.strip(0.3, 0.05, nx, ny, pattern, jitter, seed)
    assert euler(mesh) == 1
    named = np.unique(np.concatenate(list(mesh.boundary.values())))
    assert np.array_equal(named, np.unique(mesh.boundary_edges()))


def test_strip_sides_are_exact_and_ordered():
    mesh = patterns.strip(0.3, 0.05, 6, 3, "union", jitter=0.4, seed=3)
    x, y, z = mesh.vertices.T
    assert np.all(x[mesh.boundary["left"]] == 0) and np.all(x[mesh.boundary["right"]] == 0.3)
    assert np.all(y[mesh.boundary["bottom"]] == 0) and np.all(y[mesh.boundary["top"]] == 0.05)
    assert np.all(z == 0)
    for name, along in (("left", y), ("right", y), ("bottom", x), ("top", x)):
        assert np.all(np.diff(along[mesh.boundary[name]]) > 0)
    assert mesh.vertices.dtype == np.float64 and mesh.triangles.dtype == np.int64
    straight = patterns.strip(0.3, 0.05, 6, 3, "union")
    assert np.abs(mesh.vertices - straight.vertices).max() > 0.1 * 0.05 / 3


def test_counts():
    assert len(patterns.strip(1, 1, 4, 3, "criss").triangles) == 48
    assert len(patterns.strip(1, 1, 4, 3, "right").triangles) == 24
    assert len(patterns.disc(1, 5).triangles) == 6 * 25
    mesh = patterns.rectangle(4, 2, (0, 4), (0, np.sqrt(3)), pattern="equilateral")
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    sides = np.linalg.norm([b - a, c - b, a - c], axis=2)
    assert (np.ptp(sides, axis=0) < 1e-12).sum() == 14  # all but the four half triangles at the two ends


@pytest.mark.parametrize("pattern", PATTERNS)
def test_annulus_closed_and_slit(pattern):
    closed = patterns.annulus(0.09, 0.15, 4, 36, pattern=pattern)
    slit = patterns.annulus(0.09, 0.15, 4, 36, slit=True, pattern=pattern)
    assert euler(closed) == 0 and euler(slit) == 1
    assert set(closed.boundary) == {"inner", "outer"}
    exact = np.pi * (0.15**2 - 0.09**2)
    for mesh in (closed, slit):
        areas = vector_areas(mesh)
        assert areas[:, 2].min() > 0
        assert areas[:, 2].sum() == pytest.approx(exact, rel=0.02)
        assert np.allclose(np.hypot(*mesh.vertices[mesh.boundary["inner"], :2].T), 0.09, rtol=1e-14)
        middle = mesh.midpoints(mesh.boundary_edges())
        radius = np.hypot(middle[:, 0], middle[:, 1])
        on_rim = np.isclose(radius, 0.09, rtol=1e-12) | np.isclose(radius, 0.15, rtol=1e-12)
        assert on_rim.sum() == len(on_rim) - (0 if mesh is closed else 8)
        ends = mesh.vertices[mesh.boundary_edges()]
        assert np.linalg.norm(middle - ends.mean(axis=1), axis=1).max() < 0.01  # no midpoint across the seam
    faces = [slit.vertices[slit.boundary[name]] for name in ("slit0", "slit1")]
    assert np.allclose(*faces, atol=1e-16) and not np.intersect1d(slit.boundary["slit0"], slit.boundary["slit1"]).size


def test_sector():
    mesh = patterns.annulus(1, 2, 3, 8, angle=np.pi / 2)
    assert set(mesh.boundary) == {"inner", "outer", "slit0", "slit1"}
    assert np.allclose(mesh.vertices[mesh.boundary["slit1"], 0], 0)


def test_disc_rim_and_midpoints():
    mesh = patterns.disc(0.15, 6)
    assert euler(mesh) == 1
    areas = vector_areas(mesh)
    assert areas[:, 2].min() > 0
    assert np.allclose(np.linalg.norm(mesh.vertices[mesh.boundary["outer"]], axis=1), 0.15, rtol=1e-14)
    assert np.array_equal(np.unique(mesh.boundary_edges()), np.sort(mesh.boundary["outer"]))
    edges = edges_of(mesh)
    middle = mesh.midpoints(edges)
    rim = np.isclose(np.linalg.norm(middle, axis=1), 0.15, rtol=1e-12)
    assert rim.sum() == 36
    assert np.allclose(middle[~rim], mesh.vertices[edges[~rim]].mean(axis=1))


@pytest.mark.parametrize("closed", [False, True])
def test_cylinder_and_sphere_point_outwards(closed):
    turn = 2 * np.pi if closed else 1.2
    tube = patterns.cylinder(0.3, 0.5, (0.0, turn), 24, 4, closed=closed)
    zone = patterns.sphere(10.0, (0.0, turn), (0.0, np.radians(72)), 24, 8, closed=closed)
    assert euler(tube) == euler(zone) == (0 if closed else 1)
    centre = tube.vertices[tube.triangles].mean(axis=1) * [1, 0, 1]
    assert np.all((vector_areas(tube) * centre).sum(axis=1) > 0)
    assert np.all((vector_areas(zone) * zone.vertices[zone.triangles].mean(axis=1)).sum(axis=1) > 0)
    middle = zone.midpoints(edges_of(zone))
    assert np.allclose(np.linalg.norm(middle, axis=1), 10.0, rtol=1e-14)
    middle = tube.midpoints(edges_of(tube))
    assert np.allclose(np.hypot(middle[:, 0], middle[:, 2]), 0.3, rtol=1e-14)
    assert ("left" in tube.boundary) is not closed


@pytest.mark.parametrize(
    "build",
    [
        lambda: patterns.strip(-1, 1, 2, 2),
        lambda: patterns.strip(1, 0, 2, 2),
        lambda: patterns.strip(1, 1, 0, 2),
        lambda: patterns.strip(1, 1, 2.5, 2),
        lambda: patterns.strip(1, 1, 2, 2, "hexagon"),
        lambda: patterns.strip(1, 1, 2, 2, jitter=0.6),
        lambda: patterns.annulus(2, 1, 3, 3),
        lambda: patterns.annulus(1, 2, 3, 12, angle=7.0),
        lambda: patterns.annulus(1, 2, 3, 2),
        lambda: patterns.disc(1, 0),
        lambda: patterns.cylinder(1, 1, (0, 1), 8, 2, closed=True),
        lambda: patterns.sphere(1, (0, 1), (0, np.pi / 2), 8, 2),
        lambda: patterns.rectangle(4, 4, close="w"),
    ],
)
def test_bad_input(build):
    with pytest.raises(InputError):
        build()


def test_graded_annulus_widens_outward():
    ring = patterns.annulus(0.09, 0.15, 6, 24, grading=8.0)
    r = np.unique(np.round(np.hypot(*ring.vertices[:, :2].T), 12))
    widths = np.diff(r)
    assert r[[0, -1]] == pytest.approx([0.09, 0.15]) and np.allclose(widths[1:] / widths[:-1], 8.0 ** (1 / 6))
    s = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(patterns.ungraded(patterns.graded(s, 8.0), 8.0), s, atol=1e-14)
