"""Every unusable mesh gets its own error, with the right ids."""

import numpy as np
import pytest

from mfar_fem.errors import SurfaceError
from mfar_fem.surface import patterns, quality


@pytest.fixture
def mesh():
    pattern = patterns.strip(0.3, 0.1, 6, 3, "union")
    return pattern.vertices.copy(), pattern.triangles.copy()


def test_good_meshes_pass(mesh):
    quality.check_surface(*mesh)
    for pattern in (
        patterns.annulus(0.1, 0.2, 3, 20, pattern="jitter"),
        patterns.disc(0.15, 4),
        patterns.sphere(0.5, (0, 2 * np.pi), (-1.2, 1.2), 30, 12, closed=True),
    ):
        quality.check_surface(pattern.vertices, pattern.triangles)


def test_degenerate(mesh):
    vertices, triangles = mesh
    triangles[4, 2] = triangles[4, 1]
    with pytest.raises(quality.DegenerateTriangleError, match="1 triangle \\(4\\)") as caught:
        quality.check_surface(vertices, triangles)
    assert caught.value.ids == [4]
    vertices, triangles = patterns.strip(1, 1, 1, 1).vertices.copy(), np.array([[0, 1, 3], [0, 3, 2]])
    vertices[2] = 0.5 * (vertices[0] + vertices[3])
    with pytest.raises(quality.DegenerateTriangleError) as caught:
        quality.check_surface(vertices, triangles)
    assert caught.value.ids == [1]


def test_turned_triangles(mesh):
    vertices, triangles = mesh
    triangles[[3, 17]] = triangles[[3, 17]][:, ::-1]
    with pytest.raises(quality.InvertedTriangleError) as caught:
        quality.check_surface(vertices, triangles)
    assert caught.value.ids == [3, 17]


def test_folded_over_plane(mesh):
    vertices, triangles = mesh
    inside = np.setdiff1d(np.arange(len(vertices)), patterns.strip(0.3, 0.1, 6, 3, "union").boundary_edges())[0]
    vertices[inside] += [0.07, 0.0, 0.0]
    with pytest.raises(quality.InvertedTriangleError, match="folded") as caught:
        quality.check_surface(vertices, triangles)
    assert caught.value.ids
    vertices[inside, 2] = 0.02  # lifted off the plane the same fold is a legitimate shape
    quality.check_surface(vertices, triangles)


def test_all_clockwise_is_consistent(mesh):
    quality.check_surface(mesh[0], mesh[1][:, ::-1])


def test_moebius_band():
    n = 12
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    ring = np.column_stack([np.cos(t), np.sin(t), 0 * t])
    across = 0.2 * np.column_stack([np.cos(t / 2) * np.cos(t), np.cos(t / 2) * np.sin(t), np.sin(t / 2)])
    vertices = np.vstack([ring - across, ring + across])
    low, high = np.arange(n), n + np.arange(n)
    low_next, high_next = np.r_[low[1:], high[0]], np.r_[high[1:], low[0]]
    triangles = np.vstack([np.column_stack([low, low_next, high_next]), np.column_stack([low, high_next, high])])
    with pytest.raises(quality.InvertedTriangleError, match="one side"):
        quality.check_surface(vertices, triangles)


def test_non_manifold_edge(mesh):
    vertices, triangles = mesh
    fin = np.vstack([vertices, [0.1, 0.05, 0.1]])
    a, b = triangles[10, :2]
    with pytest.raises(quality.NonManifoldEdgeError) as caught:
        quality.check_surface(fin, np.vstack([triangles, [a, b, len(vertices)], [b, a, len(vertices)]]))
    assert (min(a, b), max(a, b)) in caught.value.ids
    with pytest.raises(quality.NonManifoldEdgeError, match="more than once"):
        quality.check_surface(vertices, np.vstack([triangles, triangles[:1]]))


def test_duplicates_and_slit(mesh):
    pattern = patterns.annulus(0.1, 0.2, 3, 20, slit=True)
    with pytest.raises(quality.DuplicateVertexError) as caught:
        quality.check_surface(pattern.vertices, pattern.triangles)
    assert len(caught.value.ids) == 4
    quality.check_surface(pattern.vertices, pattern.triangles, coincident=pattern.boundary["slit0"])
    welded = quality.merge_duplicates(pattern.vertices, pattern.triangles)
    quality.check_surface(*welded)
    vertices, triangles = mesh
    soup = vertices[triangles].reshape(-1, 3)
    again = quality.merge_duplicates(soup, np.arange(len(soup)).reshape(-1, 3))
    assert len(again[0]) == len(vertices) and np.array_equal(again[0][again[1]], vertices[triangles])


def test_unreferenced(mesh):
    with pytest.raises(quality.UnreferencedVertexError) as caught:
        quality.check_surface(np.vstack([mesh[0], [0, 0, 1.0]]), mesh[1])
    assert caught.value.ids == [len(mesh[0])]


@pytest.mark.parametrize("scale", [1000.0, 1e-3])
def test_units(mesh, scale):
    with pytest.raises(quality.SuspectUnitsError):
        quality.check_surface(mesh[0] * scale, mesh[1])
    quality.check_surface(mesh[0] * scale, mesh[1], size=None)


@pytest.mark.parametrize("spoil", ["nan", "range", "shape", "none"])
def test_arrays(mesh, spoil):
    vertices, triangles = mesh
    if spoil == "nan":
        vertices[5, 1] = np.nan
    elif spoil == "range":
        triangles[2, 0] = 999
    elif spoil == "shape":
        vertices = vertices[:, :2]
    else:
        triangles = triangles[:0]
    with pytest.raises(SurfaceError):
        quality.check_surface(vertices, triangles)
