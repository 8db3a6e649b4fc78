"""The whole stage, and its study."""

import json

import numpy as np
import pytest
import typer
from surface_shapes import noisy_grid
from typer.testing import CliRunner

from mfar_fem.errors import ParameterError, SurfaceError, UnknownNameError
from mfar_fem.surface.quality import check_surface
from reconstruction.surface.analytic import SURFACES, Frustum, Torus, analytic, mesh_distance, sample_mesh
from reconstruction.surface.pipeline import SurfaceSettings, build_surface
from reconstruction.surface.study_curvature import calibration
from reconstruction.surface.study_refinement import at_count
from reconstruction.surface.subdivision import uniform_loop
from reconstruction.surface.triangles import TriangleMesh

pytest.importorskip("gpytoolbox")
pytest.importorskip("igl")


@pytest.mark.parametrize("noise", [0.0, 0.003])
def test_a_sleeve_comes_out_within_a_millimetre(noise):
    shape, rng = Frustum(), np.random.default_rng(0)
    points, normals = shape.sample(2000, rng)
    made = build_surface(points + noise * rng.normal(size=(2000, 1)) * normals, normals, noise or None, shape.openings)
    distance = shape.distance(sample_mesh(made.mesh, 5000, rng)[0])
    assert distance.mean() < (0.8e-3 if noise == 0 else 2e-3)
    check_surface(made.mesh.vertices, made.mesh.faces)
    assert made.loop_lengths == pytest.approx([0.4 * np.pi, 0.2 * np.pi], rel=0.01)
    rows = {q.stage: q for q in made.quality}
    assert rows["final"].least_angle > 15 > rows["trimmed"].least_angle and rows["final"].degenerate == 0
    assert (np.diff(made.energies) < 0).all() and set(made.timings) >= {"poisson", "arap"}
    json.dumps(made.to_dict())


def test_the_same_input_gives_the_same_mesh_and_switches_switch():
    points, normals = Frustum().sample(700, np.random.default_rng(0))
    first, second = (build_surface(points, normals, openings=2) for _ in range(2))
    np.testing.assert_array_equal(first.mesh.vertices, second.mesh.vertices)
    plain = build_surface(points, normals, openings=2, settings=SurfaceSettings(even=False, adaptive=False, arap=False))
    assert len(plain.mesh.faces) == len(plain.trimmed.faces) and not plain.energies
    with pytest.raises(SurfaceError, match="expected 4"):
        build_surface(points, normals, openings=4)
    with pytest.raises(ParameterError):
        build_surface(points, normals, openings=2, closed=True)


def test_a_closed_figure_stays_closed():
    points, normals = Torus().sample(1000, np.random.default_rng(0))
    made = build_surface(points, normals, closed=True)
    assert not made.loop_lengths and len(made.mesh.vertices) - len(made.mesh.edges) + len(made.mesh.faces) == 0


def test_exact_distances():
    rng = np.random.default_rng(0)
    for shape in SURFACES.values():
        points, normals = shape.sample(500, rng)
        assert shape.distance(points).max() < 1e-9
        np.testing.assert_allclose(shape.distance(points + 1e-3 * normals), 1e-3, rtol=0.05)
    assert Frustum(0.2, 0.2, 1.0).distance(np.array([[0.2, 0, 1.5]])) == pytest.approx(0.5)
    with pytest.raises(UnknownNameError, match="sphere"):
        analytic("teapot")


def test_adaptive_beats_uniform_where_curvature_is_local():
    """One bump on a flat sheet; on pleats, curved all over, it does not on average (``mfar study surface``)."""
    flat = noisy_grid(20, np.random.default_rng(0))
    x = flat.vertices.copy()
    x[:, 2] = 0.1 * np.exp(-((x[:, :2] - 0.5) ** 2).sum(axis=1) / (2 * 0.08**2))
    base = TriangleMesh(x, flat.faces)
    uniform = uniform_loop(base)
    adaptive, _ = at_count(base, len(uniform.faces))
    assert len(adaptive.mesh.faces) <= 1.02 * len(uniform.faces)
    limit, _ = sample_mesh(uniform_loop(base, 4), 20000, np.random.default_rng(0))
    ours, theirs = mesh_distance(limit, adaptive.mesh), mesh_distance(limit, uniform)
    assert ours.mean() < 0.8 * theirs.mean() and np.percentile(ours, 95) < 0.8 * np.percentile(theirs, 95)


def test_calibration_has_every_estimate_and_names_the_bad_one():
    rows = calibration()
    sphere = [r for r in rows if r["surface"] == "sphere" and r["noise"] == 0 and r["edge_over_radius"] < 0.2]
    worst = max(sphere, key=lambda r: r["largest"])
    assert "default" in worst["estimate"] and worst["largest"] > 0.1
    assert len({r["estimate"] for r in rows}) == 6


@pytest.mark.slow
def test_study_command(tmp_path, monkeypatch):
    from reconstruction.cli_surface import study_surface
    from reconstruction.surface import study, study_refinement

    monkeypatch.setattr(study, "refinement", lambda: study_refinement.refinement((0.05,), 500))  # coarse, for time

    app = typer.Typer()
    app.command()(study_surface)
    out = tmp_path / "study"
    done = CliRunner().invoke(app, ["--points", "700", "--noise", "2 mm", "--surfaces", "sphere", "--out", str(out), "--json"])
    assert done.exit_code == 0, done.output
    payload = json.loads(done.stdout)
    assert payload["rows"][1]["stage"] == "final" and payload["rows"][1]["off_mean"] < 3
    for name in ("before_after.png", "rows.csv", "calibration.csv", "refinement.csv", "arms.csv", "study.json"):
        assert (out / name).stat().st_size > 100
