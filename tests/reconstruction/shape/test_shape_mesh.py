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


def sheet_with_a_loop():
    """A band along x whose middle turns once over through itself, of edges 20 mm; its profile (n, 2), vertices across."""
    turn = np.linspace(0, 2 * np.pi, 60)
    loop = np.stack([0.18 * np.sin(turn) + 0.02 * turn, 0.18 * (1 - np.cos(turn))], axis=1)
    ahead = 0.02 * np.arange(1, 60)
    line = np.concatenate([np.stack([-ahead[::-1], 0 * ahead], axis=1), loop, np.stack([loop[-1, 0] + ahead, 0 * ahead], axis=1)])
    n, m = len(line), 12
    x = np.stack([np.repeat(line[:, 0], m), np.tile(0.02 * np.arange(m), n), np.repeat(line[:, 1], m)], axis=1)
    a = (np.arange(n - 1)[:, None] * m + np.arange(m - 1)).ravel()
    return TriangleMesh(x, np.concatenate([np.stack([a, a + m, a + 1], 1), np.stack([a + 1, a + m, a + m + 1], 1)])), line, m


def test_a_fold_that_has_passed_through_itself_is_spanned_anew():
    mesh, line, m = sheet_with_a_loop()
    assert len(self_intersections(mesh)) > 0
    loose = untangle(mesh)
    assert loose.after == 0 and loose.spanned > 0
    after = TriangleMesh(loose.vertices, mesh.faces)
    assert len(self_intersections(after)) == 0
    assert after.areas.min() > 0.1 * mesh.areas.min()
    moved = np.linalg.norm(loose.vertices - mesh.vertices, axis=1)
    far = np.repeat(np.abs(line[:, 0] - 0.06) > 0.7, m)
    assert far.sum() > 100 and moved[far].max() == 0.0  # the ends stay
    assert moved.max() == loose.moved < 0.6  # and nothing leaves the place of the loop


def test_a_corner_of_one_triangle_keeps_its_area():
    """Smoothed along the rim alone it would come to lie on the edge across it."""
    mesh, line, m = sheet_with_a_loop()
    top = (len(line) // 2) * m  # on the rim, where the loop is
    a, b, apex = top, top + m, len(mesh.vertices)
    tip = 0.5 * (mesh.vertices[a] + mesh.vertices[b]) + (0.0, -0.02, 0.0)
    eared = TriangleMesh(np.vstack([mesh.vertices, tip]), np.vstack([mesh.faces, [a, apex, b]]))
    loose = untangle(eared)
    after = TriangleMesh(loose.vertices, eared.faces)
    assert loose.after == 0 and np.linalg.norm(loose.vertices[apex] - tip) > 0.01
    assert after.areas[-1] > 0.2 * eared.areas[-1]


def test_a_free_edge_within_a_tangled_region_stays_where_it_was():
    mesh, _, _ = sheet_with_a_loop()
    low = mesh.vertices[mesh.faces].mean(axis=1)
    hole = (np.hypot(low[:, 0] - 0.06, low[:, 2] - 0.36) < 0.035) & (np.abs(low[:, 1] - 0.11) < 0.05)  # at the top of the loop
    faces = mesh.faces[~hole]
    used = np.unique(faces)
    back = np.full(len(mesh.vertices), -1)
    back[used] = np.arange(len(used))
    cut = TriangleMesh(mesh.vertices[used], back[faces])
    assert 2 < hole.sum() < 60
    loose = untangle(cut)
    assert loose.spanned > 0 and np.isfinite(loose.vertices).all() and loose.moved < 0.6


def test_what_cannot_be_untangled_is_named(monkeypatch):
    known = stored()
    flat = known["vertices"].copy()
    flat[:, 1] *= 1e-4  # both layers in one plane, crumpled into each other
    flat[:, 1] += 1e-3 * np.random.default_rng(0).normal(size=len(flat))
    with pytest.raises(SurfaceError, match="still pass through each other"):
        simulation_mesh(known | {"vertices": flat})
