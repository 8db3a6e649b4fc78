"""Poisson surfaces and their openings on spheres and cylinders."""

import numpy as np
import pytest

from mfar_fem.errors import ParameterError, SurfaceError
from reconstruction.surface.analytic import Frustum, Sphere, Torus, curve_distances, sample_mesh
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.denoise import denoised, point_spacing
from reconstruction.surface.openings import plane_curve, trim_by_curves
from reconstruction.surface.poisson import CoplanarPointsError, NormalsError, TooFewPointsError, poisson_surface
from reconstruction.surface.trimming import OpeningsError, trim_by_distance

pytest.importorskip("gpytoolbox")
pytest.importorskip("igl")
TUBE = Frustum(0.2, 0.2, 0.8)


@pytest.fixture(scope="module")
def tube():
    points, normals = TUBE.sample(5000, np.random.default_rng(0))
    return poisson_surface(points, normals)


@pytest.mark.parametrize(("shape", "euler"), [(Sphere(), 2), (Torus(), 0)])
def test_closed_surfaces(shape, euler):
    rng = np.random.default_rng(1)
    points, normals = shape.sample(4000, rng)
    made = poisson_surface(points, 3 * normals)
    mesh = made.mesh
    assert not len(mesh.boundary_edges) and len(mesh.vertices) - len(mesh.edges) + len(mesh.faces) == euler
    distance = shape.distance(sample_mesh(mesh, 5000, rng)[0])
    assert distance.mean() < 3e-4 and distance.max() < 4e-3
    volume = np.einsum("ij,ij->", mesh.area_vectors, mesh.vertices[mesh.faces].mean(axis=1)) / 3
    assert volume > 0  # outward
    again = poisson_surface(points, -normals)
    assert np.einsum("ij,ij->", again.mesh.area_vectors, again.mesh.vertices[again.mesh.faces].mean(axis=1)) < 0


def test_spacing_of_a_grid_and_of_random_points():
    rng = np.random.default_rng(0)
    points = np.c_[rng.random((20000, 2)), np.zeros(20000)]
    assert point_spacing(points) == pytest.approx(20000**-0.5, rel=0.06)


def test_known_deviations_are_smoothed_and_bad_points_count_less():
    rng = np.random.default_rng(0)
    points, normals = Sphere(1.0).sample(6000, rng)
    sigma = np.where(rng.random(6000) < 0.3, 0.05, 0.005)
    noisy = points + (sigma * rng.normal(size=6000))[:, None] * normals
    spacing = point_spacing(noisy)
    before = np.sqrt((Sphere(1.0).distance(noisy) ** 2).mean())
    weighted = np.sqrt((Sphere(1.0).distance(denoised(noisy, normals, sigma, spacing)) ** 2).mean())
    even = np.sqrt((Sphere(1.0).distance(denoised(noisy, normals, np.full(6000, sigma.mean()), spacing)) ** 2).mean())
    assert weighted < 0.25 * even < 0.5 * before
    np.testing.assert_array_equal(denoised(points, normals, np.zeros(6000), spacing), points)


def test_degenerate_points_are_named():
    rng = np.random.default_rng(0)
    points, normals = Sphere().sample(500, rng)
    with pytest.raises(TooFewPointsError, match="30 usable"):
        poisson_surface(points[:30], normals[:30])
    with pytest.raises(TooFewPointsError, match="1 usable"):
        poisson_surface(np.repeat(points[:1], 400, axis=0), normals[:400])
    with pytest.raises(NormalsError):
        poisson_surface(points, 0 * normals)
    flat = points * [1, 1, 0] + 0.5
    with pytest.raises(CoplanarPointsError, match="one plane"):
        poisson_surface(flat, normals)
    with pytest.raises(CoplanarPointsError, match="one line"):
        poisson_surface(points * [1, 0, 0], normals)
    with pytest.raises(SurfaceError, match="not finite"):
        poisson_surface(np.where(np.arange(500)[:, None] == 7, np.nan, points), normals)
    with pytest.raises(SurfaceError, match=r"\(n, 3\)"):
        poisson_surface(points, normals[:-1])
    with pytest.raises(ParameterError):
        poisson_surface(points, normals, depth=40)


def test_a_stray_blob_is_dropped_and_two_bodies_are_kept():
    rng = np.random.default_rng(0)
    points, normals = Sphere().sample(4000, rng)
    small, inward = Sphere(0.02).sample(60, rng)
    made = poisson_surface(np.vstack([points, small + np.array([0.6, 0, 0])]), np.vstack([normals, inward]))
    assert len(made.dropped) == 1 and any("dropped" in a for a in made.actions)
    assert abs(made.dropped[0].vertices[:, 0].mean() - 0.6) < 0.02
    two = poisson_surface(np.vstack([points, points + np.array([0.6, 0, 0])]), np.vstack([normals, normals]))
    assert not two.dropped and any("2 separate pieces kept" in a for a in two.actions)


def test_distance_opens_a_tube_where_its_points_end(tube):
    cut = trim_by_distance(tube.mesh, tube.points, tube.spacing, expected=2)
    rim = curve_distances([cut.mesh.vertices[c] for c in cut.loops], TUBE.openings)
    assert rim.mean() < 0.3 * tube.spacing and rim.max() < tube.spacing
    assert cut.removed_area > 0 and cut.lengths[0] == pytest.approx(2 * np.pi * 0.2, rel=0.02)
    with pytest.raises(OpeningsError, match="2 openings, expected 3") as caught:
        trim_by_distance(tube.mesh, tube.points, tube.spacing, expected=3)
    assert len(caught.value.ids) == 2
    with pytest.raises(ParameterError):
        trim_by_distance(tube.mesh, tube.points, factor=0.5)
    with pytest.raises(OpeningsError, match="farther"):
        trim_by_distance(tube.mesh, tube.points + 5)


def test_curves_cut_a_smooth_rim(tube):
    cut = trim_by_curves(tube.mesh, TUBE.openings, tube.points, expected=2)
    rim = curve_distances([cut.mesh.vertices[c] for c in cut.loops], TUBE.openings)
    assert rim.max() < 2e-3  # chords of the rim against the circle
    for loop in cut.loops:
        assert np.ptp(cut.mesh.vertices[loop, 2]) < 1e-12
    slanted = plane_curve((0, 0, 0.4), (0.5, 0, 1), 0.2)
    slanted[:, :2] *= 0.2 / np.linalg.norm(slanted[:, :2], axis=1)[:, None]
    slanted[:, 2] = 0.4 - 0.5 * slanted[:, 0]
    half = trim_by_curves(tube.mesh, [slanted, TUBE.openings[1][::-1]], expected=2)  # what lies to the left stays
    z = half.mesh.vertices[:, 2] + 0.5 * half.mesh.vertices[:, 0]
    assert 0.4 - 5e-3 < z.min() < 0.4 + 1e-9


def test_curves_that_do_not_fit_are_named(tube):
    with pytest.raises(OpeningsError, match="mm from the surface"):
        trim_by_curves(tube.mesh, [plane_curve((0, 0, 0.3), (0, 0, 1), 0.4)])
    with pytest.raises(ParameterError):
        trim_by_curves(tube.mesh, [np.zeros((2, 3))])
    opened = trim_by_curves(tube.mesh, TUBE.openings, tube.points).mesh
    patch = plane_curve((0.2, 0, 0.4), (1, 0, 0), 0.05)
    patch[:, 0] = np.sqrt(0.04 - patch[:, 1] ** 2)
    kept = trim_by_curves(opened, [patch], tube.points)
    assert len(kept.loops) in (1, 3)  # with points on both sides either may stay, but cleanly
    assert len(boundary_loops(kept.mesh.faces)) == len(kept.loops)
