"""Bodies: distances against closed forms and brute force, properties of a distance, meshes, motion, errors."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mfar_fem.contact.body import Cylinder, Disc, MeshBody, Motion, Plane, Sphere
from mfar_fem.contact.mesh_distance import BodyMeshError, check_mesh
from mfar_fem.contact.position_correction import _winding
from mfar_fem.errors import InputError, ParameterError

SCAN = Path(__file__).parents[4] / "shared/data/vision/bodies/anny_female_rest.obj"
seeds = st.integers(0, 2**32 - 1)
property_test = settings(max_examples=15, deadline=None)


def box(size=(0.3, 0.2, 0.1), at=(0.0, 0.0, 0.0)):
    """Vertices and outward triangles of a box."""
    v = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float) - 0.5
    t = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
         [1, 5, 7], [1, 7, 3]]
    return v * size + at, np.array(t)


BODIES = {
    "plane": Plane((0.1, 0.0, 0.05), (1.0, 2.0, 3.0)),
    "sphere": Sphere((0.1, -0.1, 0.0), 0.2),
    "cylinder": Cylinder((0.0, 0.1, 0.0), (1.0, 0.5, -1.0), 0.15, 0.3),
    "disc": Disc((0.0, 0.0, 0.1), (0.2, 0.0, 1.0), 0.2, 0.04),
    "box": MeshBody(*box()),
    "mesh of a disc": MeshBody(*Disc((0.0, 0.0, 0.1), (0.2, 0.0, 1.0), 0.2, 0.04).mesh(0.05)),
}
each_body = pytest.mark.parametrize("body", BODIES.values(), ids=BODIES.keys())
MOTION = Motion([0.0, 0.5, 2.0], [[0, 0, 0], [0.1, 0, 0.2], [0, 0.3, 0]], [[0, 0, 0], [0, 0, 1.0], [0.5, 1.0, 0]],
                pivot=(0.1, 0.2, 0.0))


def points(seed: int, n: int = 200) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-0.5, 0.5, (n, 3))


@each_body
@given(seed=seeds)
@property_test
def test_distance_is_one(body, seed):
    """1-Lipschitz, unit normal, the foot of the perpendicular on the surface, and the normal is the gradient."""
    x = points(seed)
    d, n = body.signed_distance(x)
    assert np.allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-12)
    step = points(seed + 1) * np.random.default_rng(seed).choice([1e-3, 1.0])
    assert np.all(np.abs(body.signed_distance(x + step)[0] - d) <= np.linalg.norm(step, axis=1) * (1 + 1e-12) + 1e-15)
    outside = d > 0
    assert np.max(np.abs(body.signed_distance(x - d[:, None] * n)[0][outside]), initial=0.0) < 1e-14
    h = 1e-6
    ahead, behind = (np.stack([body.signed_distance(x + s * e)[0] for e in np.eye(3)], axis=1) for s in (h, -h))
    gradient = (ahead - behind) / (2 * h)
    smooth = outside & (d > 1e-3)
    assert np.max(np.abs(gradient - n)[smooth], initial=0.0) < 2e-2  # kinks of curvature at edges: h / distance
    assert np.quantile(np.abs(gradient - n).max(axis=1), 0.9) < 1e-7
    inside = body.signed_distance(x - d[:, None] * n)[0][~outside]
    assert np.quantile(np.abs(inside), 0.95) < 1e-14 if len(inside) else True


@each_body
@given(seed=seeds)
@property_test
def test_distance_moves_with_the_body(body, seed):
    t, x = np.random.default_rng(seed).uniform(-0.5, 2.5), points(seed)
    d, n = body.signed_distance(x)
    body.motion = MOTION
    try:
        placed = body.placed(x, t)
        moved, normal = body.signed_distance(placed, t)
    finally:
        body.motion = None
    assert np.allclose(moved, d, atol=1e-13) and np.allclose(normal, n @ MOTION.pose(t)[0].T, atol=1e-7)


@pytest.mark.parametrize("size", [None, 0.07, 0.02])
@pytest.mark.parametrize("name", ["sphere", "cylinder", "disc"])
def test_meshes_are_closed_outward_and_on_the_surface(name, size):
    body = BODIES[name]
    v, t = body.mesh(size)
    assert check_mesh(v, t).max() == 0  # closed, consistent, outward, one part: raises otherwise
    assert np.max(np.abs(body.signed_distance(v)[0])) < 1e-15
    edges = np.linalg.norm(v[t] - np.roll(v[t], 1, axis=1), axis=2)
    assert edges.max() <= 1.75 * (size or 0.1)
    within = np.random.default_rng(0).dirichlet([1, 1, 1], len(t))
    d = body.signed_distance(np.einsum("kv,kvc->kc", within, v[t]))[0]
    radius = {"sphere": 0.2, "cylinder": 0.15, "disc": 0.02}[name]
    assert d.max() < 1e-15 and -d.min() <= edges.max() ** 2 / (4 * radius)
    face = np.cross(v[t][:, 1] - v[t][:, 0], v[t][:, 2] - v[t][:, 0])
    assert np.all(np.einsum("kc,kc->k", face, body.signed_distance(v[t].mean(axis=1))[1]) > 0)
    volume = np.einsum("kc,kc->", v[t][:, 0], np.cross(v[t][:, 1], v[t][:, 2])) / 6
    r, a = 0.18, 0.02  # the disc is a flat disc of radius 0.18 thickened by 0.02: volume by Steiner's formula
    exact = {"sphere": 4 / 3 * np.pi * 0.2**3, "cylinder": np.pi * 0.15**2 * 0.3,
             "disc": 2 * np.pi * r**2 * a + np.pi**2 * r * a**2 + 4 / 3 * np.pi * a**3}[name]
    assert (0.99 if size == 0.02 else 0.9) * exact < volume < exact


def test_sheet_of_the_plane_faces_along_its_normal():
    body = BODIES["plane"]
    v, t = body.mesh(0.3)
    face = np.cross(v[t][:, 1] - v[t][:, 0], v[t][:, 2] - v[t][:, 0])
    assert np.max(np.abs(body.signed_distance(v)[0])) < 1e-15
    assert np.allclose(face / np.linalg.norm(face, axis=1, keepdims=True), body.normal)
    assert 0.5 * np.linalg.norm(face, axis=1).sum() == pytest.approx(1.0)


def test_known_distances():
    c = Cylinder(radius=0.1, length=0.4)
    d, n = c.signed_distance([[0.3, 0, 0], [0, 0, 0.5], [0.4, 0, 0.6], [0.09, 0, 0], [0, 0, -0.19], [0, 0, 0]])
    assert np.allclose(d, [0.2, 0.3, 0.5, -0.01, -0.01, -0.1])
    assert np.allclose(n[:5], [[1, 0, 0], [0, 0, 1], [0.6, 0, 0.8], [1, 0, 0], [0, 0, -1]])
    d, n = Disc(radius=0.1, thickness=0.02).signed_distance([[0, 0, 0.05], [0.05, 0, -0.03], [0.09 + 0.03, 0, 0.04], [0, 0.2, 0]])
    assert np.allclose(d, [0.04, 0.02, 0.04, 0.1]) and np.allclose(n[2], [0.6, 0, 0.8])
    assert np.allclose(Sphere(radius=0.1).signed_distance(np.zeros((1, 3)))[0], -0.1)


@given(seed=seeds)
@property_test
def test_mesh_distance_to_a_box_is_the_closed_form(seed):
    x, half = points(seed, 400), np.array([0.15, 0.1, 0.05])
    q = np.abs(x) - half
    exact = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    assert np.allclose(BODIES["box"].signed_distance(x)[0], exact, atol=1e-15)


def test_normals_on_the_surface_edges_and_corners_of_a_box():
    half = np.array([0.15, 0.1, 0.05])
    x = half * np.array([[1, 0.3, 0.2], [1, 1, 0.1], [1, 1, 1], [-1, 0.5, -1]])
    d, n = BODIES["box"].signed_distance(x)
    expected = np.array([[1, 0, 0], [1, 1, 0], [1, 1, 1], [-1, 0, -1]])
    assert np.allclose(d, 0) and np.allclose(n, expected / np.linalg.norm(expected, axis=1, keepdims=True))


def test_overlapping_parts_are_their_union():
    (v, t), (w, s) = box(), box(at=(0.2, 0.05, 0.0))
    both = MeshBody(np.vstack([v, w]), np.vstack([t, s + len(v)]))
    x = points(1, 1000)
    each = [MeshBody(v, t).signed_distance(x)[0], MeshBody(w, s).signed_distance(x)[0]]
    assert np.allclose(both.signed_distance(x)[0], np.minimum(*each), atol=1e-15)


@pytest.mark.skipif(not SCAN.exists(), reason="the shared body meshes are absent")
def test_scan_agrees_with_trimesh_and_the_winding_number():
    trimesh = pytest.importorskip("trimesh")
    body = MeshBody.load(SCAN)
    v, t = body.mesh()
    rng = np.random.default_rng(2)
    x = np.vstack([v[rng.integers(0, len(v), 150)] + 0.02 * rng.normal(size=(150, 3)), rng.uniform(v.min(0), v.max(0), (100, 3))])
    d, n = body.signed_distance(x)
    inside = np.array([_winding(p, v[t]) > 0.5 for p in x])
    assert np.array_equal(inside, d < 0) and 30 < inside.sum() < 220
    for p, distance in zip(x[~inside][:30], d[~inside], strict=False):
        foot = trimesh.triangles.closest_point(v[t], np.tile(p, (len(t), 1)))
        assert distance == pytest.approx(np.linalg.norm(foot - p, axis=1).min(), abs=1e-14)
    assert np.max(np.abs(body.signed_distance(x - d[:, None] * n)[0][~inside])) < 1e-14


FUNCTIONS = Motion.from_functions(lambda t: (0.1 * t**3, np.sin(t), 0), lambda t: (0.3 * t, t * t, 0.1), pivot=(0.1, 0, 0))


@pytest.mark.parametrize("motion", [MOTION, FUNCTIONS], ids=["keys", "functions"])
def test_velocity_is_the_derivative_of_the_placed_points(motion):
    body, X, h = Sphere(motion=motion), points(3, 20), 1e-5
    assert body.moving
    for t in (0.1, 0.3, 0.8, 1.7):
        difference = (body.placed(X, t + h) - body.placed(X, t - h)) / (2 * h)
        assert np.allclose(body.velocity(body.placed(X, t), t), difference, atol=1e-8)
        assert np.allclose(motion.reference(motion.position(X, t), t), X, atol=1e-14)


def test_keys_are_hit_held_and_turned_through_evenly():
    X = points(4, 10)
    for time, T, r in zip(MOTION.times, MOTION.translations, MOTION.rotations, strict=True):
        expected = Rotation.from_rotvec(r).apply(X - MOTION.pivot) + MOTION.pivot + T
        assert np.allclose(MOTION.position(X, time), expected, atol=1e-14)
    assert np.allclose(MOTION.position(X, -1.0), X) and np.allclose(MOTION.position(X, 9.0), MOTION.position(X, 2.0))
    assert not np.any(MOTION.velocity(X, -1.0)) and not np.any(MOTION.velocity(X, 2.0)) and np.any(MOTION.velocity(X, 0.0))
    turns = Motion([0.0, 1.0], rotations=[[0, 0, 0], [0, 0, 4 * np.pi]])  # two full turns, not none
    assert np.allclose(turns.position(np.array([[1.0, 0, 0]]), 0.125), [[0, 1, 0]])
    assert np.allclose(turns.rates(0.3)[0], [0, 0, 4 * np.pi])
    half = (Rotation.from_rotvec([0.5, 1.0, 0]) * Rotation.from_rotvec([0, 0, 1.0]).inv()).as_rotvec() / 2
    assert np.allclose(MOTION.pose(1.25)[0], (Rotation.from_rotvec(half) * Rotation.from_rotvec([0, 0, 1.0])).as_matrix())


def test_moving_says_whether_anything_moves():
    assert not Sphere().moving and not Sphere(motion=Motion([0.0, 1.0], [[1, 0, 0], [1, 0, 0]])).moving
    assert not Sphere(motion=Motion([0.0], [[1, 0, 0]])).moving and Sphere(motion=MOTION).moving
    assert np.allclose(Sphere(motion=Motion([0.0], [[1, 0, 0]])).placed(np.zeros((1, 3)), 0.0), [[1, 0, 0]])
    exact = Motion.from_functions(lambda t: (t, 0, 0), speed=lambda t: (1.0, 0, 0), spin=lambda t: (0, 0, 0))
    assert np.allclose(exact.velocity(np.zeros((1, 3)), 0.5), [[1, 0, 0]])


def _opened(v, t):
    return v, t[1:]


def _inverted(v, t):
    return v, t[:, ::-1]


def _one_flipped(v, t):
    return v, np.vstack([t[:1, ::-1], t[1:]])


def _not_finite(v, t):
    return np.where(np.arange(len(v))[:, None] == 3, np.nan, v), t


def _cavity(v, t):
    return np.vstack([v, 0.5 * v]), np.vstack([t, t[:, ::-1] + len(v)])


def _flat(v, t):
    return np.vstack([v, v[:2].mean(axis=0)]), np.vstack([t, [[0, 1, 8]]])


@pytest.mark.parametrize("spoil, message", [
    (_opened, "not closed: 3 of 18 edges belong to one triangle"), (_inverted, r"inverted: 1 of 1 parts \(12 of 12 triangles\)"),
    (_one_flipped, "inconsistent orientation: across 3 of 18 edges"), (_not_finite, "1 of 8 vertices are not finite, .* vertex 3"),
    (_cavity, "inverted: 1 of 2 parts"), (_flat, "1 triangles have no area, the first is 12"),
    (lambda v, t: (v[:7], t), "outside 0..6"), (lambda v, t: (v, t[:0]), "k > 0")])
def test_a_mesh_that_is_no_solid_is_named(spoil, message):
    with pytest.raises(BodyMeshError, match=message):
        MeshBody(*spoil(*box()))


@pytest.mark.parametrize("make", [
    lambda: Sphere(friction=-0.1), lambda: Sphere(friction=np.nan), lambda: Sphere(radius=0.0), lambda: Plane(normal=(0, 0, 0)),
    lambda: Plane(point=(0, 0)), lambda: Cylinder(length=-1.0), lambda: Cylinder(axis=(np.inf, 0, 0)), lambda: Disc(thickness=0.5),
    lambda: Sphere().mesh(0.0)])
def test_wrong_parameters_are_named(make):
    with pytest.raises(ParameterError):
        make()


@pytest.mark.parametrize("make", [
    lambda: Motion([]), lambda: Motion([0.0, 0.0]), lambda: Motion([0.0, 1.0], [[0, 0, 0]]),
    lambda: Motion([0.0], rotations=[[0, 0, np.nan]]), lambda: Motion([0.0], pivot=(0, 0)),
    lambda: Motion.from_functions(lambda t: (t, t)).pose(0.0), lambda: Motion.from_functions(step=0.0),
    lambda: Sphere().signed_distance(np.zeros(3))])
def test_wrong_motion_and_points_are_named(make):
    with pytest.raises(InputError):
        make()
