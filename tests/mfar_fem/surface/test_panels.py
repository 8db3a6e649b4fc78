"""Panels by gmsh: area, sides, size field, repeatability, and errors that need no gmsh."""

import sys

import numpy as np
import pytest

from mfar_fem.errors import MissingDependencyError, SurfaceError
from mfar_fem.surface import panels, quality

turn = np.linspace(0, np.pi / 2, 9)
QUARTER = {
    "hem": [(0, 0), (0.3, 0)],
    "arm": 0.3 * np.column_stack([np.cos(turn), np.sin(turn)]),
    "centre": [(0, 0.3), (0, 0)],
}


@pytest.fixture
def gmsh_works():
    try:
        import gmsh  # noqa: F401
    except (ImportError, OSError) as error:
        pytest.skip(f"gmsh cannot be loaded here: {error}")


def area(mesh):
    a, b, c = (mesh.vertices[mesh.triangles[:, i]] for i in range(3))
    return 0.5 * np.cross(b - a, c - a)[:, 2]


def test_quarter_disc_with_a_hole(gmsh_works):
    hole = panels.polygon([(0.1, 0.1), (0.15, 0.1), (0.12, 0.15)])
    mesh = panels.panel(QUARTER, 0.02, [hole])
    quality.check_surface(mesh.vertices, mesh.triangles)
    assert area(mesh).min() > 0
    assert area(mesh).sum() == pytest.approx(np.pi * 0.3**2 / 4 - 0.5 * 0.05**2, rel=2e-3)
    arm = mesh.vertices[mesh.boundary["arm"]]
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 0.3, rtol=1e-3)
    assert np.all(np.diff(np.arctan2(arm[:, 1], arm[:, 0])) > 0)
    named = np.unique(np.concatenate(list(mesh.boundary.values())))
    assert np.array_equal(named, np.unique(mesh.boundary_edges()))
    again = panels.panel(QUARTER, 0.02, [hole])
    assert np.array_equal(again.vertices, mesh.vertices) and np.array_equal(again.triangles, mesh.triangles)


def test_clockwise_outline_and_size_field(gmsh_works):
    mesh = panels.panel(panels.polygon([(0, 0), (0, 1), (1, 1), (1, 0)]), lambda x, y: 0.04 + 0.2 * x)
    assert area(mesh).min() > 0 and area(mesh).sum() == pytest.approx(1.0)
    left, right = (len(mesh.boundary[name]) for name in ("side0", "side2"))
    assert left > 20 and right < 8


@pytest.mark.parametrize(
    ("outline", "size", "says"),
    [
        ({"a": [(0, 0), (1, 0)], "b": [(1, 0.1), (0, 0)]}, 0.1, "starts 0.1 m away"),
        ({"a": [(0, 0), (1, 0)], "b": [(1, 0), (0, 0)]}, 0.1, "no area"),
        (panels.polygon([(0, 0), (1, 1), (1, 0), (0, 1.5)]), 0.1, "crosses itself"),
        (panels.polygon([(0, 0), (1, 0), (1, 1)]), -1.0, "must be positive"),
        ({"a": [(0, 0)]}, 0.1, "two or more"),
        ({}, 0.1, "no sides"),
    ],
)
def test_bad_outlines(outline, size, says):
    with pytest.raises(SurfaceError, match=says):
        panels.panel(outline, size)


def test_missing_gmsh_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(MissingDependencyError, match="libglu1-mesa"):
        panels.panel(QUARTER, 0.1)
