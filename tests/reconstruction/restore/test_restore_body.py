"""A figure gives way to the cloth: inside itself, closed, and as far away as asked."""

import numpy as np
import pytest

from mfar_fem.errors import SurfaceError
from reconstruction.restore.body import LEAST, crossings, fit_body
from reconstruction.surface.triangles import TriangleMesh

igl = pytest.importorskip("igl")
trimesh = pytest.importorskip("trimesh")


def sphere(radius, centre=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.icosphere(4, radius)
    return TriangleMesh(mesh.vertices + centre, mesh.faces)


def sheet(z, size=0.5, n=40):
    x = np.linspace(-size, size, n)
    v = np.array([(a, b, z) for a in x for b in x])
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return TriangleMesh(v, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]))


def volume(mesh):
    return float(np.einsum("fi,fi->", mesh.vertices[mesh.faces].mean(axis=1), mesh.area_vectors) / 3.0)


def test_far_from_the_cloth_nothing_changes():
    fitted = fit_body(sphere(0.2), sheet(0.4), 0.01)
    assert fitted.taken == 0.0 and not len(fitted.mesh.boundary_edges)
    assert volume(fitted.mesh) == pytest.approx(4 / 3 * np.pi * 0.2**3, rel=0.03)
    np.testing.assert_allclose(np.linalg.norm(fitted.mesh.vertices, axis=1), 0.2, atol=2e-3)


def test_what_is_near_the_cloth_is_taken_away():
    """A plane through a ball leaves two caps, each the clearance away from it."""
    clearance = 0.02
    fitted = fit_body(sphere(0.2), sheet(0.05), clearance)
    z = fitted.mesh.vertices[:, 2] - 0.05
    assert fitted.distance >= LEAST * clearance and np.abs(z).min() == pytest.approx(clearance + 0.002, abs=0.004)
    assert (z > 0).any() and (z < 0).any() and not len(fitted.mesh.boundary_edges)
    assert np.linalg.norm(fitted.mesh.vertices, axis=1).max() < 0.2 + 2e-3  # nothing outside the figure
    cut = sum(np.pi * (h**2 * (3 * 0.2 - h) / 3) for h in (0.2 - 0.072, 0.2 + 0.028))  # caps above 0.072 and below 0.028
    assert volume(fitted.mesh) == pytest.approx(cut, rel=0.04)


def test_what_cannot_be_fitted_is_an_error():
    open_ball = TriangleMesh(sphere(0.2).vertices, sphere(0.2).faces[:-10])
    with pytest.raises(SurfaceError, match="not closed"):
        fit_body(open_ball, sheet(0.4), 0.01)
    with pytest.raises(SurfaceError, match="nothing of the figure is left"):
        fit_body(sphere(0.02), sheet(0.0), 0.05)


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.6, np.pi / 4])
def test_no_triangle_of_the_figure_meets_the_cloth(angle):
    """A sheet that ends within the ball, at several angles to the grid."""
    flat = sheet(0.0, 0.3, 31)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    cloth = TriangleMesh((flat.vertices + np.array((0.3, 0.0, 0.013))) @ turn.T, flat.faces)
    ball = sphere(0.2)
    assert crossings(ball, cloth) > 10
    fitted = fit_body(ball, cloth, 0.003)
    assert crossings(fitted.mesh, cloth) == 0 and fitted.distance > LEAST * 0.003
