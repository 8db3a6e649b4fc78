"""From the fitted shape to the mesh of the solver."""

import numpy as np
import pytest
from shape_scene import scene

from mfar_fem.errors import SurfaceError
from mfar_fem.surface.mesh import Surface
from reconstruction.shape.simulation_mesh import simulation_mesh
from reconstruction.shape.untangle import untangle
from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.triangles import TriangleMesh

pytest.importorskip("embreex")


def stored():
    mesh, sewn, *_ = scene()
    return {"vertices": mesh.vertices, "faces": mesh.faces, "warp": sewn.warp_in_space(mesh.vertices),
            "noise": np.full(len(mesh.vertices), 0.01)} | {f"opening_{k}": v for k, v in sewn.openings.items()}  # fmt: skip


def test_the_shell_takes_it_with_warp_and_edges():
    made = simulation_mesh(stored())
    surface = Surface(made.mesh.vertices, made.mesh.faces, 1, made.warp.directions, boundary=made.openings)
    assert set(surface.boundary) == {"neck", "hem", "left_cuff", "right_cuff"}
    down = made.warp.directions[:, 2]
    centre = made.mesh.vertices[made.mesh.faces].mean(axis=1)
    trunk = (np.abs(centre[:, 0]) < 0.15) & (centre[:, 2] < -0.12)
    assert (np.abs(down[trunk]) > 0.7).mean() > 0.95  # the grain of the body runs up and down
    assert made.warp.prior.mean() == 0.0


@pytest.mark.slow
def test_the_poisson_surface_keeps_openings_and_warp():
    pytest.importorskip("gpytoolbox")
    known = stored()
    made = simulation_mesh(known, "poisson", 0.03)
    assert len(made.mesh.faces) != len(known["faces"])
    assert len(self_intersections(made.mesh)) == 0
    assert {name for name, ids in made.openings.items() if len(ids) > 3} == {"neck", "hem", "left_cuff", "right_cuff"}


def test_crossing_sheets_are_drawn_apart_and_only_there():
    mesh = scene()[0]
    assert len(self_intersections(mesh)) == 0
    x = mesh.vertices.copy()
    front = np.flatnonzero((np.abs(x[:, 0]) < 0.05) & (np.abs(x[:, 2] + 0.35) < 0.05) & (x[:, 1] < 0))
    x[front[0], 1] = x[:, 1].max() + 0.03  # one vertex pulled through the back
    spoilt = TriangleMesh(x, mesh.faces)
    assert len(self_intersections(spoilt)) > 0
    loose = untangle(spoilt)
    assert loose.before == len(self_intersections(spoilt)) and loose.after == 0
    moved = np.linalg.norm(loose.vertices - x, axis=1) > 0
    assert moved[front[0]] and moved.mean() < 0.2


def test_what_cannot_be_untangled_is_named(monkeypatch):
    known = stored()
    flat = known["vertices"].copy()
    flat[:, 1] *= 1e-4  # both layers in one plane, crumpled into each other
    flat[:, 1] += 1e-3 * np.random.default_rng(0).normal(size=len(flat))
    with pytest.raises(SurfaceError, match="still pass through each other"):
        simulation_mesh(known | {"vertices": flat})
