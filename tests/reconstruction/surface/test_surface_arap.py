"""ARAP to handles, and triangles made better on the surface."""

import numpy as np
import pytest
from surface_shapes import ball, noisy_grid

from mfar_fem.errors import NotConvergedError, ParameterError, SurfaceError
from reconstruction.surface.analytic import Sphere
from reconstruction.surface.arap import arap, edge_weights
from reconstruction.surface.collapse import collapse_short_edges
from reconstruction.surface.connectivity import loop_lengths
from reconstruction.surface.improve import ideal_corners, improve, target_areas
from reconstruction.surface.quality import quality, quality_picture, quality_table, smallest_angles
from reconstruction.surface.remesh import remesh
from reconstruction.surface.triangles import TriangleMesh

TURN = np.array([[np.cos(0.7), -np.sin(0.7), 0], [np.sin(0.7), np.cos(0.7), 0], [0, 0, 1.0]])


def bend(mesh, move=(0.3, 0.0, 0.2)):
    """Poles of a sphere held, the upper one turned and moved."""
    v = mesh.vertices
    return {int(i): v[i] for i in np.flatnonzero(v[:, 2] < -0.8)} | {
        int(i): TURN @ v[i] + move for i in np.flatnonzero(v[:, 2] > 0.8)
    }


def test_rigid_handles_move_the_mesh_rigidly():
    mesh = ball(2)
    handles = {i: TURN @ mesh.vertices[i] + [1, 2, 3] for i in (0, 5, 11, 40)}
    made = arap(mesh, handles, tolerance=1e-14, iterations=500, start=mesh.vertices @ TURN.T + [1, 2, 3.0])
    np.testing.assert_allclose(made.mesh.vertices, mesh.vertices @ TURN.T + [1, 2, 3], atol=1e-9)
    assert made.energies[-1] < 1e-20 and made.converged
    far = arap(mesh, handles, tolerance=1e-7, iterations=1000)
    assert far.energies[-1] < 1e-2 * far.energies[0]


@pytest.mark.parametrize("weight", [None, 5.0])
def test_the_energy_never_rises_and_faces_stay(weight):
    mesh = TriangleMesh(ball(3).vertices * [1, 1, 2], ball(3).faces)  # stretched: obtuse triangles, negative cotangent weights
    v = mesh.vertices
    handles = {int(i): v[i] for i in np.flatnonzero(v[:, 2] < -1.7)} | {int(i): TURN @ v[i] for i in np.flatnonzero(v[:, 2] > 1.7)}
    made = arap(mesh, handles, weight)
    energies = np.array(made.energies)
    assert made.raised > 0 and (edge_weights(mesh)[1] > 0).all()
    assert (np.diff(energies) <= 1e-12 * energies[0]).all() and energies[-1] < 0.2 * energies[0] and made.converged
    np.testing.assert_array_equal(made.mesh.faces, mesh.faces)
    off = np.array([np.linalg.norm(made.mesh.vertices[i] - p) for i, p in handles.items()])
    assert off.max() == 0 if weight is None else 0 < off.max() < 0.3


def test_libigl_finds_the_same_shape():
    igl = pytest.importorskip("igl")
    mesh = ball(3)
    handles = bend(mesh)
    ours = arap(mesh, handles, tolerance=1e-10, iterations=2000)
    data = igl.ARAPData()  # the spokes of (10), not libigl's spokes and rims
    data.energy, data.max_iter = igl.ARAP_ENERGY_TYPE_SPOKES, ours.iterations
    ids = np.array(sorted(handles), dtype=np.int32)
    igl.arap_precomputation(mesh.vertices, mesh.faces, 3, ids, data)
    start = mesh.vertices.copy()
    start[ids] = [handles[int(i)] for i in ids]
    theirs = igl.arap_solve(np.ascontiguousarray(start[ids]), data, start)
    assert ours.raised == 0
    assert np.abs(theirs - ours.mesh.vertices).max() < 1e-4


def test_arap_itself_betters_no_triangle():
    """The rest shape is its own minimum: what the paper attributes to (10) needs another rest shape."""
    mesh = noisy_grid(12, np.random.default_rng(0), 0.3)
    handles = {int(i): mesh.vertices[i] for i in mesh.boundary_vertices}
    np.testing.assert_allclose(arap(mesh, handles).mesh.vertices, mesh.vertices, atol=1e-9)
    assert improve(mesh).energies[-1] < 0.7 * improve(mesh).energies[0]


def test_arap_errors():
    mesh = ball(1)
    with pytest.raises(ParameterError, match="handles"):
        arap(mesh, {})
    with pytest.raises(ParameterError, match="no vertex"):
        arap(mesh, {99: np.zeros(3)})
    with pytest.raises(ParameterError, match="finite"):
        arap(mesh, {0: np.full(3, np.nan)})
    two = TriangleMesh(np.vstack([mesh.vertices, mesh.vertices + 5]), np.vstack([mesh.faces, mesh.faces + len(mesh.vertices)]))
    with pytest.raises(SurfaceError, match="no handle") as caught:
        arap(two, {0: mesh.vertices[0]})
    assert len(caught.value.ids) == len(mesh.vertices)
    with pytest.raises(NotConvergedError) as stopped:
        arap(ball(2), bend(ball(2)), iterations=1, tolerance=1e-12, strict=True)
    assert stopped.value.result.iterations == 1


def test_ideal_corners_fit_and_keep_an_equilateral_triangle():
    rng = np.random.default_rng(0)
    side = 0.7
    flat = side * np.array([(0, 0, 0), (1, 0, 0), (0.5, np.sqrt(3) / 2, 0)])
    x = flat @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T + 2
    target, energy = ideal_corners(x, np.array([[0, 1, 2]]), np.array([np.sqrt(3) / 4 * side**2]))
    np.testing.assert_allclose(target[0], x - x.mean(axis=0), atol=1e-12)
    assert energy == pytest.approx(0, abs=1e-24)
    y = rng.normal(size=(3, 3))
    target, energy = ideal_corners(y, np.array([[0, 1, 2]]), np.array([1.0]))
    local = y - y.mean(axis=0)
    normal = np.cross(y[1] - y[0], y[2] - y[0]) / np.linalg.norm(np.cross(y[1] - y[0], y[2] - y[0]))
    for angle in (-0.01, 0.01):  # no turn in the plane fits better
        k = np.cross(normal, target[0])
        turned = np.cos(angle) * target[0] + np.sin(angle) * k
        assert ((local - turned) ** 2).sum() > energy


@pytest.mark.parametrize("shape", ["flat", "ball"])
def test_improvement_is_monotone_on_the_surface_and_opens_angles(shape):
    rng = np.random.default_rng(3)
    if shape == "flat":
        mesh = noisy_grid(20, rng, 0.3)
    else:
        x = ball(3).vertices + 0.05 * rng.normal(size=ball(3).vertices.shape)
        mesh = TriangleMesh(x / np.linalg.norm(x, axis=1)[:, None], ball(3).faces)
    made = improve(mesh, iterations=40)
    assert (np.diff(made.energies) < 0).all() and len(made.energies) > 3
    before, after = smallest_angles(mesh.vertices, mesh.faces), smallest_angles(made.mesh.vertices, made.mesh.faces)
    assert np.percentile(after, 1) > 1.2 * np.percentile(before, 1) and after.min() >= min(before.min(), np.radians(20)) - 1e-6
    np.testing.assert_array_equal(made.mesh.faces, mesh.faces)
    if shape == "flat":
        assert np.abs(made.mesh.vertices[:, 2]).max() < 1e-12 and made.mesh.areas.sum() == pytest.approx(1)
        assert loop_lengths(made.mesh) == pytest.approx([4.0]) and made.off_max < 1e-9
    else:
        sagitta = Sphere(1.0).distance(mesh.vertices[mesh.faces].mean(axis=1)).max()
        assert Sphere(1.0).distance(made.mesh.vertices).max() < 1.05 * sagitta
    assert made.moved_max > made.moved_mean > 0


def test_target_areas_keep_the_area_and_the_grading():
    mesh = noisy_grid(10, np.random.default_rng(0))
    mesh = TriangleMesh(mesh.vertices**2, mesh.faces)
    areas = target_areas(mesh, 2)
    assert areas.sum() == pytest.approx(mesh.areas.sum())
    assert np.corrcoef(areas, mesh.areas)[0, 1] > 0.8


def test_slivers_collapse_and_the_rim_stays():
    pytest.importorskip("gpytoolbox")
    mesh = noisy_grid(16, np.random.default_rng(0))
    x = mesh.vertices.copy()
    pairs = [(40, 41), (100, 118), (200, 201), (3, 4)]  # vertices nearly on their neighbours, one on the rim
    for a, b in pairs:
        x[a] = x[b] + 0.02 * (x[a] - x[b])
    bad = TriangleMesh(x, mesh.faces)
    good, count = collapse_short_edges(bad, 0.01)
    assert count == 4 and quality(good).least_angle > 5 * quality(bad).least_angle
    assert good.areas.sum() == pytest.approx(1) and loop_lengths(good) == pytest.approx([4])
    assert len(good.vertices) - len(good.edges) + len(good.faces) == 1
    even, actions = remesh(bad, 0.08)
    assert quality(even).least_angle > 15 and "collapsed" in actions[0]
    with pytest.raises(ParameterError):
        remesh(bad, 1e-6)


def test_quality_of_known_triangles(tmp_path):
    right = TriangleMesh([(0, 0, 0), (3, 0, 0), (0, 4, 0)], [[0, 1, 2]])
    row = quality(right)
    assert row.least_angle == pytest.approx(np.degrees(np.arctan(0.75))) and row.largest_aspect == pytest.approx(
        5 / (2 * np.sqrt(3))
    )
    needle = TriangleMesh([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)], [[0, 1, 2], [0, 1, 3]])
    assert quality(needle).degenerate == 1 and quality(needle).largest_aspect is None and quality(needle).least_angle == 0
    rows = quality_table({"a": ball(1), "b": ball(2)})
    assert [r.stage for r in rows] == ["a", "b"] and sum(rows[1].histogram) == 320 and rows[0].loops == 0
    path = quality_picture(tmp_path / "picture.png", [("before", noisy_grid(6, np.random.default_rng(0))), ("after", ball(2))])
    import matplotlib.image

    assert matplotlib.image.imread(path)[..., :3].std() > 0.05
