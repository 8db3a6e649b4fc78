"""Damaged meshes: mended with a list of what was done, or refused by name."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from surface_shapes import ball, euler

from mfar_fem.errors import ParameterError, SurfaceError
from mfar_fem.surface.quality import InvertedTriangleError, NonManifoldEdgeError, check_surface
from reconstruction.surface.connectivity import boundary_loops
from reconstruction.surface.intersections import self_intersections
from reconstruction.surface.repair import SelfIntersectionError, repair
from reconstruction.surface.study_curvature import jittered_tube
from reconstruction.surface.triangles import TriangleMesh

pytest.importorskip("igl")
BALL = ball(3)


def flip(v, f, rng):
    i = rng.choice(len(f), 20, replace=False)
    f[i] = f[i][:, ::-1]
    return v, f


def double(v, f, rng):
    i, c = rng.choice(len(f), 30, replace=False), rng.integers(0, 3, 30)
    v = np.vstack([v, v[f[i, c]]])
    f[i, c] = len(v) - 30 + np.arange(30)
    return v, f


def hole(v, f, rng):
    return v, np.delete(f, rng.choice(len(f), 5, replace=False), axis=0)


def repeat(v, f, rng):
    return v, np.vstack([f, f[rng.choice(len(f), 6, replace=False)]])


def collapse(v, f, rng):
    g = f[rng.choice(len(f), 4, replace=False)]
    return v, np.vstack([f, np.stack([g[:, 0], g[:, 1], g[:, 1]], axis=1)])


def cap(v, f, rng):
    """A vertex on an edge, and a triangle without area between it and the edge."""
    edges = np.sort(f[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    k = rng.integers(len(f))
    a, b = f[k, 0], f[k, 1]
    both = np.flatnonzero((edges == np.sort([a, b])).all(axis=1)) // 3
    if len(both) != 2:
        return v, f
    other = both[both != k][0]
    d = f[other].sum() - a - b
    m = len(v)
    v = np.vstack([v, 0.5 * (v[a] + v[b])])
    return v, np.vstack([np.delete(f, other, axis=0), [[a, m, b], [m, a, d], [b, m, d]]])


def fin(v, f, rng):
    k = rng.integers(len(f))
    v = np.vstack([v, 1.3 * v[f[k]].mean(axis=0)])
    return v, np.vstack([f, [[f[k, 0], f[k, 1], len(v) - 1]]])


def speck(v, f, rng):
    v = np.vstack([v, 3 + 0.01 * np.eye(3)])
    return v, np.vstack([f, [[len(v) - 3, len(v) - 2, len(v) - 1]]])


def spike(v, f, rng):
    """A vertex pulled through the far side."""
    k = f[rng.integers(len(f)), 0]
    v = v.copy()
    v[k] *= -1.2 / np.linalg.norm(v[k])
    return v, f


def stray(v, f, rng):
    return np.vstack([v, [[9.0, 9, 9]]]), f


WORDS = {
    flip: "turned to agree", double: "joined", hole: "closed", repeat: "more than once", collapse: "fewer than three",
    cap: "without area", fin: "hanging on", speck: "separate pieces", spike: "pass through", stray: "no triangle",
}  # fmt: skip


def damaged(kinds, seed):
    rng = np.random.default_rng(seed)
    v, f = BALL.vertices.copy(), BALL.faces.copy()
    for kind in kinds:
        v, f = kind(v, f, rng)
    return TriangleMesh(v, f)


@pytest.mark.parametrize("kind", WORDS, ids=lambda k: k.__name__)
def test_each_damage_is_mended_and_listed(kind):
    made = repair(damaged([kind], 1), openings=0)
    assert any(WORDS[kind] in a.what and a.count > 0 for a in made.actions)
    assert euler(made.mesh) == 2 and not len(made.mesh.boundary_edges) and not len(self_intersections(made.mesh))
    limit = 0.05 if kind is spike else 0.01  # a hole of two rings is closed flat
    assert np.abs(np.linalg.norm(made.mesh.vertices, axis=1) - 1).max() < limit
    if kind is flip:
        assert [a.count for a in made.actions] == [20]
    if kind is double:
        assert len(made.mesh.vertices) == len(BALL.vertices)
    assert made.to_dict()["actions"][0]["what"] == made.actions[0].what


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.lists(st.sampled_from(list(WORDS)), min_size=1, max_size=6, unique=True), st.integers(0, 10**6))
def test_any_damage_ends_in_a_sound_mesh_or_a_named_error(kinds, seed):
    try:
        made = repair(damaged(kinds, seed), openings=0)
    except SurfaceError as error:
        assert error.ids
        return
    check_surface(made.mesh.vertices, made.mesh.faces, made.coincident, size=None)
    assert not len(made.mesh.boundary_edges) and euler(made.mesh) == 2 and made.actions


def test_a_sound_mesh_stays_as_it_is():
    made = repair(BALL)
    assert not made.actions and not len(made.coincident)
    np.testing.assert_array_equal(made.mesh.vertices, BALL.vertices)
    np.testing.assert_array_equal(made.mesh.faces, BALL.faces)


def test_openings_stay_and_holes_go():
    tube = jittered_tube(0.2, 0.6, 24, np.random.default_rng(0))
    torn = tube.submesh(np.delete(np.arange(len(tube.faces)), [50, 120, 121]))
    made = repair(torn, openings=2)
    assert len(boundary_loops(made.mesh.faces)) == 2 and sum("closed" in a.what for a in made.actions) >= 2
    assert len(boundary_loops(repair(torn).mesh.faces)) > 2
    with pytest.raises(SurfaceError, match="2 boundary loops where 3"):
        repair(tube, openings=3)


def test_sheets_that_meet_in_an_edge_are_parted():
    v = np.array([(0, 0, 0), (1, 0, 0), (0.5, 1, 0), (0.5, -1, 0), (0.5, 0, 1), (0.5, 0, -1), (1.5, 1, 0), (1.5, 0, 1.2)], float)
    f = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5], [1, 6, 2], [1, 7, 4]]
    made = repair(TriangleMesh(v, f), specks=0.0)
    check_surface(made.mesh.vertices, made.mesh.faces, made.coincident, size=None)
    assert len(made.coincident) >= 4 or any("hanging" in a.what for a in made.actions)
    with pytest.raises(NonManifoldEdgeError) as caught:
        repair(_book(), specks=0.0, split=False)
    assert caught.value.ids == [(0, 1)]
    assert any("doubled" in a.what for a in repair(_book(), specks=0.0).actions)


def _book():
    """Four pages of two triangles at one spine."""
    v, f = [(0, 0, 0), (0, 0, 1)], []
    for angle in np.pi / 2 * np.arange(4):
        k = len(v)
        v += [(np.cos(angle), np.sin(angle), 0), (np.cos(angle), np.sin(angle), 1), (2 * np.cos(angle), 2 * np.sin(angle), 0.5)]
        f += [[0, k, 1], [1, k, k + 1], [k, k + 2, k + 1]]
    return TriangleMesh(np.array(v, float), f)


def test_one_sided_and_crossing_surfaces_are_refused():
    n = 12
    t = 2 * np.pi * np.arange(n) / n
    rim = [
        np.stack([(1 + s * np.cos(t / 2)) * np.cos(t), (1 + s * np.cos(t / 2)) * np.sin(t), s * np.sin(t / 2)], axis=1)
        for s in (-0.3, 0.3)
    ]
    f = []
    for i in range(n):
        a, b = i, n + i
        c, d = (i + 1, n + i + 1) if i < n - 1 else (n, 0)
        f += [[a, c, b], [b, c, d]]
    with pytest.raises(InvertedTriangleError, match="Möbius"):
        repair(TriangleMesh(np.vstack(rim), f))
    two = TriangleMesh(
        np.vstack([BALL.vertices, BALL.vertices + np.array([1, 0, 0.013])]),
        np.vstack([BALL.faces, BALL.faces + len(BALL.vertices)]),
    )
    assert len(self_intersections(two)) > 50
    with pytest.raises(SelfIntersectionError) as caught:
        repair(two, rounds=0)
    assert len(caught.value.ids) == len(self_intersections(two))


def test_intersections_of_known_triangles():
    v = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.2, 0.2, -1), (0.2, 0.2, 1), (3, 3, 0.1)], float)
    assert self_intersections(TriangleMesh(v, [[0, 1, 2], [3, 4, 5]])).tolist() == [[0, 1]]
    assert not len(self_intersections(TriangleMesh(v, [[0, 1, 2], [0, 1, 5]])))
    assert not len(self_intersections(BALL))
    folded = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0.3, 0.3, 0.5), (0.3, 0.3, -0.5)], float)
    assert self_intersections(TriangleMesh(folded, [[0, 1, 2], [0, 3, 4]])).tolist() == [[0, 1]]  # one shared vertex


def test_options_are_checked():
    with pytest.raises(ParameterError):
        repair(BALL, merge=0.5)
    with pytest.raises(SurfaceError, match="no triangles"):
        repair(TriangleMesh(BALL.vertices, np.zeros((0, 3), int)))
    with pytest.raises(SurfaceError, match="nothing is left"):
        repair(TriangleMesh(np.eye(3), [[0, 0, 1]]))
