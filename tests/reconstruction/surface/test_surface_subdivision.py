"""Loop's rules, conforming adaptive meshes, curvature."""

import numpy as np
import pytest
from surface_shapes import ball, bowl, edge_counts, euler

from mfar_fem.errors import ParameterError, SurfaceError
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.curvature import mean_curvature
from reconstruction.surface.loop_rules import interpolating_controls, limit_matrix, loop_step
from reconstruction.surface.study_curvature import jittered_tube
from reconstruction.surface.subdivision import adaptive_loop, too_coarse, uniform_loop
from reconstruction.surface.triangles import TriangleMesh


@pytest.mark.parametrize("mesh", [ball(), bowl()], ids=["closed", "open"])
def test_a_step_is_that_of_libigl(mesh):
    igl = pytest.importorskip("igl")
    from scipy.spatial import cKDTree

    theirs, faces = igl.loop(mesh.vertices, mesh.faces, 1)
    matrix, children, _ = loop_step(mesh.faces, len(mesh.vertices))
    ours = matrix @ mesh.vertices
    assert len(ours) == len(theirs) and len(children) == len(faces)
    valence = np.bincount(mesh.edges.ravel(), minlength=len(mesh.vertices))
    rim = np.isin(np.arange(len(valence)), mesh.boundary_vertices)
    # libigl has Warren's weights, Loop's are the same at six neighbours
    same = np.r_[rim | (valence == 6), np.ones(len(mesh.edges), bool)]
    assert same.sum() > 0.9 * len(ours)
    assert cKDTree(theirs).query(ours[same])[0].max() < 1e-12
    assert np.asarray(matrix.sum(axis=1)).ravel() == pytest.approx(1)


@pytest.mark.parametrize("mesh", [ball(1), bowl()], ids=["closed", "open"])
def test_the_limit_is_where_many_steps_lead(mesh):
    count, faces, x = len(mesh.vertices), mesh.faces, mesh.vertices
    limit = limit_matrix(faces, count) @ x
    for _ in range(4):
        matrix, faces, _ = loop_step(faces, len(x))
        x = matrix @ x
    error = np.linalg.norm(x[:count] - limit, axis=1).max()
    matrix, faces, _ = loop_step(faces, len(x))
    x = matrix @ x
    assert np.linalg.norm(x[:count] - limit, axis=1).max() < 0.5 * error < 0.01
    controls = interpolating_controls(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(limit_matrix(mesh.faces, count) @ controls, mesh.vertices, atol=1e-12)


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_any_marks_make_a_conforming_mesh(levels, seed):
    rng = np.random.default_rng(seed)
    mesh = bowl()
    made = adaptive_loop(mesh, lambda m: rng.random(len(m.faces)) < 0.06, levels)
    assert (edge_counts(made.mesh) <= 2).all() and euler(made.mesh) == 1
    loops = boundary_loops(made.mesh.faces)
    assert len(loops) == 1
    np.testing.assert_allclose(made.mesh.vertices[: len(mesh.vertices)], mesh.vertices, atol=1e-12)
    assert (np.einsum("ij,ij->i", made.mesh.area_vectors, made.mesh.vertices[made.mesh.faces].mean(axis=1)) > 0).all()
    assert made.mesh.areas.sum() == pytest.approx(uniform_loop(mesh, 2).areas.sum(), rel=0.02)
    if levels > 1:
        edges = {}
        for f, level in zip(made.mesh.faces, made.levels, strict=True):
            for k in range(3):
                edges.setdefault(tuple(sorted((f[k], f[(k + 1) % 3]))), []).append(level)
        assert max(abs(v[0] - v[-1]) for v in edges.values()) <= 1


def test_an_adaptive_mesh_is_part_of_the_uniform_one():
    mesh = bowl()
    made = adaptive_loop(mesh, lambda m: m.vertices[m.faces][:, :, 0].mean(axis=1) > 0.5, 2)
    whole = adaptive_loop(mesh, lambda m: np.ones(len(m.faces), bool), 2).mesh
    from scipy.spatial import cKDTree

    assert cKDTree(whole.vertices).query(made.mesh.vertices)[0].max() < 1e-12
    assert len(whole.faces) == 16 * len(mesh.faces) > len(made.mesh.faces) > len(mesh.faces)
    assert not adaptive_loop(mesh, lambda m: np.zeros(len(m.faces), bool), 2).green.any()


def test_interpolation_keeps_the_size_and_the_plain_rule_shrinks():
    mesh = ball(2)
    kept, shrunk = uniform_loop(mesh), uniform_loop(mesh, interpolate=False)
    assert np.abs(np.linalg.norm(kept.vertices, axis=1) - 1).max() < 3e-3
    assert np.linalg.norm(shrunk.vertices, axis=1).max() < 0.99


def test_creases_and_corners_stay():
    cube = TriangleMesh(
        np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], float),
        [
            [0, 1, 3],
            [0, 3, 2],
            [4, 6, 7],
            [4, 7, 5],
            [0, 4, 5],
            [0, 5, 1],
            [2, 3, 7],
            [2, 7, 6],
            [0, 2, 6],
            [0, 6, 4],
            [1, 5, 7],
            [1, 7, 3],
        ],
    )
    edges = cube.edges[np.linalg.norm(cube.vertices[cube.edges[:, 0]] - cube.vertices[cube.edges[:, 1]], axis=1) < 1.1]
    made = uniform_loop(cube, 2, creases=edges)
    on_face = np.isclose(made.vertices, 0, atol=1e-12) | np.isclose(made.vertices, 1, atol=1e-12)
    assert len(edges) == 12 and on_face.any(axis=1).all() and made.areas.sum() == pytest.approx(6)
    assert uniform_loop(cube, 2, interpolate=False).areas.sum() < 4
    with pytest.raises(SurfaceError, match="no edge"):
        uniform_loop(cube, 1, creases=[[0, 7]])


def test_errors():
    mesh = ball(1)
    with pytest.raises(ParameterError, match="levels"):
        adaptive_loop(mesh, levels=9)
    with pytest.raises(ParameterError, match="triangles"):
        adaptive_loop(ball(6), levels=5)
    with pytest.raises(SurfaceError, match="more than two"):
        adaptive_loop(TriangleMesh(np.vstack([mesh.vertices, [[2, 2, 2]]]), np.vstack([mesh.faces, [[*mesh.faces[0, :2], 42]]])))


def test_curvature_of_a_sphere_converges_at_second_order():
    rms = []
    for level in (2, 3, 4):
        value = mean_curvature(TriangleMesh(2.0 * ball(level).vertices, ball(level).faces))
        rms.append(np.sqrt(((2 * value - 1) ** 2).mean()))
    assert rms[-1] < 1e-3 or rms[0] / rms[1] > 3 < rms[1] / rms[2]
    inside = TriangleMesh(ball(2).vertices, ball(2).faces[:, ::-1])
    assert mean_curvature(inside).max() < -0.9


def test_quadric_is_off_at_its_default_radius_and_better_at_two():
    pytest.importorskip("igl")
    mesh = ball(3)
    default, chosen = (np.abs(mean_curvature(mesh, "quadric", r) - 1).max() for r in (5, 2))
    assert default > 0.10 and chosen < 0.03
    with pytest.raises(ParameterError):
        mean_curvature(mesh, "umbrella")


def test_curvature_of_an_open_tube_includes_its_rim():
    tube = jittered_tube(1.0, 3.0, 48, np.random.default_rng(0))
    assert np.sqrt(((mean_curvature(tube, smoothing=1) - 0.5) ** 2).mean()) < 0.03
    assert np.abs(mean_curvature(tube)[tube.boundary_vertices] - 0.5).max() < 0.2


def test_the_rule_follows_size_and_shape():
    """h |H| has no unit: a larger sphere with the same triangles gives the same answer; twice as many triangles halve it."""
    for size in (0.1, 10.0):
        assert too_coarse(TriangleMesh(size * ball(2).vertices, ball(2).faces), angle=0.25).all()
        assert not too_coarse(TriangleMesh(size * ball(3).vertices, ball(3).faces), angle=0.25).any()
    assert too_coarse(ball(2), kappa=0.9).all() and not too_coarse(ball(2), kappa=1.1).any()
    long = ball(3).vertices * [1, 1, 2]
    marked = too_coarse(TriangleMesh(long, ball(3).faces), angle=0.25)
    tip = np.abs(long[ball(3).faces][:, :, 2].mean(axis=1)) > 1.8
    assert marked[tip].mean() > 0.8 and marked[~tip].mean() < 0.5
