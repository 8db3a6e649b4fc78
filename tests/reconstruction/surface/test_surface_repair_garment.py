"""A garment's mesh damaged in every way at once, mended by the command."""

import json

import numpy as np
import pytest
import typer
from shape_scene import scene
from typer.testing import CliRunner

from mfar_fem.surface.mesh import Surface
from reconstruction.cli_surface import repair
from reconstruction.surface.connectivity import loop_lengths
from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.triangles import TriangleMesh

pytest.importorskip("embreex")
pytest.importorskip("igl")

APP = typer.Typer()
APP.command()(repair)


def damaged(mesh):
    """Two holes, turned triangles, torn corners, a triangle without area, a vertex of the front pulled through the back."""
    rng = np.random.default_rng(1)
    x, faces = mesh.vertices.copy(), mesh.faces.copy()
    centre = x[faces].mean(axis=1)
    inner = np.flatnonzero(~np.isin(faces, mesh.boundary_vertices).any(axis=1))
    front = np.flatnonzero((np.abs(x[:, 0]) < 0.05) & (np.abs(x[:, 2] + 0.35) < 0.05) & (x[:, 1] < 0))
    x[front[0], 1] = x[:, 1].max() + 0.03
    turned = rng.choice(inner, 25, replace=False)
    faces[turned] = faces[turned][:, ::-1]
    torn = rng.choice(inner, 20, replace=False)
    x = np.vstack([x, x[faces[torn, 0]]])
    faces[torn, 0] = len(x) - 20 + np.arange(20)
    flat = faces[inner[0]]
    faces = np.vstack([faces, [flat[0], flat[1], flat[1]], faces[inner[5]]])
    gone = [inner[np.argmin(np.linalg.norm(centre[inner] - at, axis=1))] for at in ([0.1, 0.2, -0.3], [-0.1, 0.2, -0.45])]
    return TriangleMesh(x, np.delete(faces, gone, axis=0))


def test_a_damaged_garment_is_mended_and_every_step_listed(tmp_path):
    mesh = scene()[0]
    source, target = tmp_path / "torn.ply", tmp_path / "mended.ply"
    damaged(mesh).write(source)
    done = CliRunner().invoke(APP, [str(source), str(target), "--openings", "4", "--json"])
    assert done.exit_code == 0, done.output
    payload = json.loads(done.stdout)
    listed = " | ".join(a["what"] for a in payload["actions"])
    for word in ("joined", "fewer than three", "more than once", "turned to agree", "pass through", "closed"):
        assert word in listed
    mended = TriangleMesh.read(target)
    assert len(self_intersections(mended)) == 0
    assert sorted(loop_lengths(mended)) == pytest.approx(sorted(loop_lengths(mesh)), rel=1e-6)  # hem, collar and cuffs as they were
    assert mended.areas.sum() == pytest.approx(mesh.areas.sum(), rel=0.02)
    warp = np.tile([0.0, 0.0, 1.0], (len(mended.faces), 1))
    Surface(mended.vertices, mended.faces, 1, warp)  # the shell takes it
    again = CliRunner().invoke(APP, [str(target), str(tmp_path / "again.ply")])
    assert "nothing had to be done" in again.stdout


def test_what_cannot_be_mended_is_named(tmp_path):
    from mfar_fem.errors import MfarError

    mesh = scene()[0]
    source = tmp_path / "garment.ply"
    mesh.write(source)
    failed = CliRunner().invoke(APP, [str(source), str(tmp_path / "out.ply"), "--openings", "9"])
    assert isinstance(failed.exception, MfarError) and "4 boundary loops where 9 openings" in str(failed.exception)
    assert not (tmp_path / "out.ply").exists()
