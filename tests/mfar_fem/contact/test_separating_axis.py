"""Separating axes against exact integer intersection, distances of another library, brute force and the bodies themselves."""

import exact_triangles as exact
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mfar_fem.contact import separating_axis_kernels as kernels
from mfar_fem.contact.body import Cylinder, Disc, Plane, Sphere
from mfar_fem.contact.primitive_meshes import square
from mfar_fem.contact.separating_axis import candidate_pairs, penetration, resolve, triangles_overlap
from mfar_fem.errors import InputError

PAIRS = 100_000
seeds = st.integers(0, 2**32 - 1)


def moved(A, axis, step):
    return A + step[:, None, None] * axis[:, None, :]


def test_oracle_on_pairs_known_by_eye():
    t = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
    known = [([[1, 1, -1], [1, 1, 1], [9, 9, 9]], True),    # pierces the face
             ([[3, 3, -1], [3, 3, 1], [9, 9, 9]], False),   # passes beside it
             ([[1, 1, 0], [2, 1, 0], [1, 2, 0]], True),     # inside, coplanar
             ([[4, 0, 0], [5, 0, 0], [5, 1, 3]], True),     # shares a corner
             ([[2, 2, 0], [3, 3, 0], [3, 2, 5]], True),     # corner on an edge
             ([[3, 2, 0], [4, 4, 0], [2, 3, 0]], False),    # coplanar beside it
             ([[1, 1, 1], [2, 1, 1], [1, 2, 1]], False),    # parallel
             ([[1, 1, 0]] * 3, True), ([[3, 3, 0]] * 3, False),
             ([[-1, 2, 0], [5, 2, 0], [5, 2, 0]], True), ([[-1, 5, 0], [5, 5, 0], [0, 5, 0]], False)]
    A, B = np.array([t] * len(known)), np.array([k[0] for k in known])
    assert exact.triangles_meet(A, B).tolist() == [k[1] for k in known]
    assert exact.triangles_meet(B, A).tolist() == [k[1] for k in known]


def test_overlap_agrees_with_exact_intersection_on_100_000_pairs():
    rng, wrong, total = np.random.default_rng(17), {}, 0
    for kind in exact.KINDS:
        A, B = exact.random_pairs(kind, PAIRS // len(exact.KINDS), rng)
        meet = exact.triangles_meet(A, B)
        assert 0 < meet.sum() and (meet.sum() < len(meet) or kind in ("shared vertex", "shared edge"))
        depth, axis = penetration(A, B)
        wrong[kind] = int((triangles_overlap(A, B) != meet).sum() + ((depth >= 0.0) != meet).sum())
        assert np.all(np.isfinite(depth)) and np.allclose(np.linalg.norm(axis, axis=1), 1.0, rtol=1e-14)
        total += len(A)
    assert total == PAIRS and not any(wrong.values()), wrong


def test_in_plane_axes_are_needed_and_eleven_do_not_do():
    A, B = exact.random_pairs("coplanar tilted", 500, np.random.default_rng(3))
    meet = exact.triangles_meet(A, B)
    a, b, edges, axes = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, 3)), np.empty((kernels.SIDES, 3))
    eleven = []
    for s, t in zip(A.astype(float), B.astype(float), strict=True):
        kernels.shift(s, t, a, b)
        kernels.side_axes(a, b, edges, axes)
        eleven.append(all(min(kernels.ways(axis, a, b)) >= 0.0 for axis in axes[2:13]))
    assert np.all(np.array(eleven) | ~meet) and np.sum(np.array(eleven) & ~meet) > 50


@given(seeds, st.floats(1e-6, 1e3))
@settings(max_examples=20, deadline=None)
def test_least_translation_parts_and_nothing_shorter_does(seed, scale):
    rng = np.random.default_rng(seed)
    A, B = scale * rng.normal(size=(2, 300, 3, 3))
    depth, axis = penetration(A, B)
    deep = depth > 0.0
    A, B, depth, axis = A[deep], B[deep], depth[deep], axis[deep]
    assert len(A) > 10
    assert np.all(np.abs(penetration(moved(A, axis, depth), B)[0]) < 1e-12 * scale)
    assert not np.any(triangles_overlap(moved(A, axis, depth + 1e-9 * scale), B))
    for _ in range(20):
        any_way = rng.normal(size=axis.shape)
        any_way /= np.linalg.norm(any_way, axis=1, keepdims=True)
        assert np.all(triangles_overlap(moved(A, any_way, (1.0 - 1e-9) * depth), B))


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_overlap_is_symmetric_and_blind_to_order_of_corners_and_rigid_motion(seed):
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(2, 200, 3, 3))
    depth, axis = penetration(A, B)
    back, away = penetration(B[:, [1, 2, 0]], A[:, [2, 1, 0]])
    assert np.allclose(depth, back, atol=1e-14) and np.allclose(axis, -away, atol=1e-7)
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    assert np.allclose(penetration(A @ Q.T + 5.0, B @ Q.T + 5.0)[0], depth, atol=1e-13)


def test_distance_of_separate_triangles_agrees_with_ipctk():
    ipctk = pytest.importorskip("ipctk")
    rng = np.random.default_rng(4)
    A, B = rng.normal(size=(2, 1500, 3, 3))
    B += 2.0 * rng.normal(size=(1500, 1, 3))
    A[::5] = A[::5, :1] + rng.normal(size=(300, 3, 1)) * rng.normal(size=(300, 1, 3))  # segments
    apart = np.flatnonzero(~triangles_overlap(A, B))
    depth = penetration(A, B)[0]
    for i in apart[:800]:
        a, b = A[i], B[i]
        gaps = [ipctk.edge_edge_distance(a[j], a[j - 1], b[k], b[k - 1]) for j in range(3) for k in range(3)]
        gaps += [ipctk.point_triangle_distance(b[k], *a) for k in range(3) if i % 5]
        gaps += [ipctk.point_triangle_distance(a[k], *b) for k in range(3)]
        assert -depth[i] == pytest.approx(np.sqrt(min(gaps)), rel=1e-7, abs=1e-9)
    near = triangles_overlap(A[apart], B[apart], thickness=0.3)
    assert np.array_equal(near, depth[apart] >= -0.3) and 0 < near.sum() < len(near)


def test_degenerate_floats_give_finite_answers():
    rng = np.random.default_rng(5)
    A, B = rng.normal(size=(2, 400, 3, 3))
    A[:, 2] = A[:, 0] + rng.random((400, 1)) * (A[:, 1] - A[:, 0])  # collinear up to rounding
    B[:200] = B[:200, :1]
    depth, axis = penetration(A, B)
    assert np.all(np.isfinite(depth)) and np.allclose(np.linalg.norm(axis, axis=1), 1.0)
    same = penetration(np.ones((1, 3, 3)), np.ones((1, 3, 3)))
    assert same[0] == 0.0 and np.linalg.norm(same[1]) == 1.0


@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_broad_phase_finds_what_brute_force_finds(margin):
    rng = np.random.default_rng(6)
    x, T = rng.normal(size=(300, 3)) * 0.2, rng.integers(0, 300, (400, 3))
    x[:12] *= 8.0  # a few large triangles among small ones
    y, S = square(1.0, 0.1)
    for other in ((None, None), (y, S)):
        b, U = (x, T) if other[0] is None else other
        near = np.all((x[T].min(1)[:, None] <= b[U].max(1) + margin) & (b[U].min(1) <= x[T].max(1)[:, None] + margin), axis=2)
        if other[0] is None:
            near &= ~(T[:, None, :, None] == T[None, :, None, :]).any(axis=(2, 3)) & np.triu(np.ones_like(near), 1)
        expected = np.argwhere(near)
        assert len(expected) > 100
        assert np.array_equal(candidate_pairs(x, T, *other, margin=margin), expected)


def sheet(height: float, cells: int = 24, extent: float = 0.3):
    x, T = square(extent, extent / cells)
    return x + np.array([0.0, 0.0, height]), T


BODIES = {
    "ball": (Sphere((0, 0, 0), 0.1), 0.06),
    "ball, half": (Sphere((0, 0, 0), 0.1), 0.0),
    "lying cylinder": (Cylinder((0, 0, 0), (1, 0, 0), 0.05, 0.2), 0.043),
    "standing cylinder": (Cylinder((0, 0, 0), (0, 0, 1), 0.05, 0.2), 0.09),
    "disc, along its rings": (Disc((0, 0, 0), (0, 0, 1), 0.09, 0.002), 0.0005),
    "plane": (Plane(extent=0.5), -0.002),
}


@pytest.mark.parametrize("thickness", [0.0, 5e-4])
@pytest.mark.parametrize("case", BODIES)
def test_correction_leaves_no_penetration(case, thickness):
    body, height = BODIES[case]
    x, T = sheet(height)
    x[:, 2] += 5e-3 * np.sin(40.0 * x[:, 0]) * (case == "plane")
    V, F = body.mesh()
    start = candidate_pairs(x, T, V, F)
    assert triangles_overlap(x[T[start[:, 0]]], V[F[start[:, 1]]]).any()
    y, report = resolve(x, T, np.ones(len(x)), V, F, tolerance=1e-6, max_iterations=60, thickness=thickness)
    assert report.stop == "clear" and report.penetration == 0.0 and report.penetrating == 0 and 0 < report.iterations <= 60
    pairs = candidate_pairs(y, T, V, F, margin=2e-3)
    depth, _ = penetration(y[T[pairs[:, 0]]], V[F[pairs[:, 1]]])
    assert np.max(depth) <= 1e-6 - thickness
    within = np.concatenate([V[F].mean(axis=1), 0.5 * (V[F] + np.roll(V[F], 1, axis=1)).reshape(-1, 3)])
    sagitta = -body.signed_distance(within)[0].min()
    assert body.signed_distance(y)[0].min() >= thickness - sagitta - 2e-6
    assert np.array_equal(resolve(y, T, np.ones(len(x)), V, F, 1e-6, thickness=thickness)[0], y)


def test_correction_of_a_flat_dip_is_the_dip_and_leaves_the_rest_alone():
    x, T = sheet(0.01)
    dip = np.abs(x[:, :2]).max(axis=1) < 0.02
    x[dip, 2] = -0.003
    y, report = resolve(x, T, np.ones(len(x)), *Plane(extent=1.0).mesh(), tolerance=1e-9)
    assert report.stop == "clear"
    assert np.array_equal(y[~dip], x[~dip]) and np.allclose(y[dip], x[dip] * [1, 1, 0], atol=1e-9)


def test_held_vertices_stay_and_masses_do_not_matter_against_a_fixed_body():
    x, T = sheet(-0.004)
    x[:, 2] += 0.006 * np.sin(40.0 * x[:, 0])
    held = (x[:, 2] >= 0.0) & (x[:, 0] < -0.1)
    weights = np.where(held, 0.0, np.random.default_rng(7).uniform(0.1, 10.0, len(x)))
    y, report = resolve(x, T, weights, *Plane(extent=1.0).mesh(), tolerance=1e-9)
    assert report.stop == "clear" and held.sum() > 10 and np.array_equal(y[held], x[held]) and y[:, 2].min() > -1e-9
    assert np.array_equal(y, resolve(x, T, (weights > 0.0).astype(float), *Plane(extent=1.0).mesh(), tolerance=1e-9)[0])


def test_faces_without_area_push_too():
    x, T = sheet(-0.002, 6)
    x[:, 2] += 5e-3 * np.sin(40.0 * x[:, 0])
    needle = np.array([[0.0, 0.0, -0.05], [0.0, 0.0, 0.05], [0.0, 0.0, 0.0]])
    y, report = resolve(x + np.array([0.011, 0.007, 0.0]), T, np.ones(len(x)), needle, [[0, 1, 2]], tolerance=1e-6)
    assert report.stop == "clear" and report.iterations > 0
    assert penetration(y[T], np.tile(needle, (len(T), 1, 1)))[0].max() <= 1e-6


def test_stops_that_are_not_clear_say_so():
    x, T = sheet(0.05)
    ball = Sphere((0, 0, 0), 0.1)
    y, report = resolve(x, T, np.zeros(len(x)), *ball.mesh(), tolerance=1e-6, max_iterations=5)
    assert report.stop == "iteration limit" and report.iterations == 5 and report.penetration > 1e-3 and report.penetrating > 10
    assert np.array_equal(x, y)
    x, T = sheet(0.0, 3, 0.02)
    assert resolve(x, T, np.ones(len(x)), *ball.mesh(), tolerance=1e-6)[1].stop == "enclosed"
    assert resolve(x + 1.0, T, np.ones(len(x)), *ball.mesh(), tolerance=1e-6)[1].stop == "clear"


def test_wrong_input_is_named():
    t = np.zeros((2, 3, 3))
    with pytest.raises(InputError, match=r"\(n, 3, 3\)"):
        triangles_overlap(t, t[:1])
    with pytest.raises(InputError, match="1 pairs have corners that are not finite, the first is pair 1"):
        penetration(t, np.where(np.arange(2)[:, None, None] == 1, np.nan, t))
    with pytest.raises(InputError, match="thickness"):
        triangles_overlap(t, t, thickness=-1.0)
    x, T = sheet(0.0, 2)
    with pytest.raises(InputError, match="margin"):
        candidate_pairs(x, T, margin=-1.0)
    with pytest.raises(InputError, match="not finite"):
        candidate_pairs(x * np.nan, T)
    with pytest.raises(InputError, match="tolerance"):
        resolve(x, T, np.ones(len(x)), x, T, tolerance=0.0)
    with pytest.raises(InputError, match="the body needs triangles"):
        resolve(x, T, np.ones(len(x)), x, T[:0], tolerance=1e-6)
    with pytest.raises(InputError, match="inverse masses"):
        resolve(x, T, -np.ones(len(x)), x, T, tolerance=1e-6)
