"""A garment mesh settles on its figure through an ordinary scene file."""

import numpy as np
import pytest

from mfar_fem.errors import InputError
from mfar_fem.scene_file import load_scene
from mfar_fem.surface.mesh import Surface
from reconstruction.restore.drape import FIGURE, GARMENT, SCENE, effort, settle, write_scene
from reconstruction.surface.triangles import TriangleMesh

igl = pytest.importorskip("igl")
trimesh = pytest.importorskip("trimesh")


def poncho(n=14, size=0.16, z=0.058):
    """A square sheet above the ball, with its warp along y."""
    x = np.linspace(-size / 2, size / 2, n)
    vertices = np.array([(a, b, z) for a in x for b in x])
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    rim = np.flatnonzero(np.abs(vertices[:, :2]).max(axis=1) > size / 2 - 1e-9)
    return Surface(vertices, faces, 1, (0.0, 1.0, 0.0), boundary={"hem": rim})


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("drape")
    ball = trimesh.creation.icosphere(4, 0.05)
    return folder, write_scene(folder, poncho(), TriangleMesh(ball.vertices, ball.faces), "silk-charmeuse", "draft", "poncho")


def test_the_scene_file_is_one_that_anyone_can_run(written):
    folder, fitted = written
    assert {p.name for p in folder.iterdir()} >= {GARMENT, FIGURE, SCENE}
    scene = load_scene(folder / SCENE)
    surface = scene.surface(1)
    np.testing.assert_allclose(surface.warp, np.tile([0.0, 1.0, 0.0], (len(surface.triangles), 1)), atol=1e-12)
    assert len(surface.nodes_of("hem")) == 52 and scene.has_contact and scene.bodies[0].friction == 0.5
    assert fitted.distance >= 0.003  # further than contact begins


def test_it_falls_onto_the_figure_and_stays_outside(written):
    folder, _ = written
    result = settle(folder)
    assert result["status"] == "converged" and result["time_s"] == pytest.approx(0.6) and result["elements"] == 338
    assert result["kinetic_J"] < 0.01 * result["kinetic_most_J"]
    nodes = np.load(folder / "settled.npz")["nodes"]
    rim = nodes[np.abs(poncho().vertices[:, :2]).max(axis=1) > 0.0799]
    assert rim[:, 2].mean() < 0.02  # it hangs down around the ball
    assert np.linalg.norm(nodes, axis=1).min() > 0.045  # the fitted ball is smaller than the ball by the clearance and its grid
    assert 0.01 < result["sag_m"] < 0.1


def test_unknown_effort():
    with pytest.raises(InputError, match="draft, standard, reference"):
        effort("best")
