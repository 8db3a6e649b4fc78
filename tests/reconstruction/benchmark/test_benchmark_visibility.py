"""Ray casting and visibility against brute force."""

import numpy as np
import pytest

from reconstruction.benchmark import keypoints
from reconstruction.benchmark.body_field import Field, surface
from reconstruction.benchmark.camera import oblique, perspective
from reconstruction.benchmark.cutting import KINDS
from reconstruction.benchmark.mural import draw_camera
from reconstruction.landmarks import INDEX, LANDMARKS, PAIRS

PRESENT = {
    "round-collar-robe": set(LANDMARKS),
    "half-sleeve": set(LANDMARKS),
    "flying-ribbon": {n for n in LANDMARKS if not n.endswith("waist")},
    "veil-hat": {n for n in LANDMARKS if n.split("_")[1] in ("shoulder", "neckline", "ankle")},
}


def brute_first(vertices, faces, origin, direction):
    """Nearest triangle and distance by testing every one (Cramer's rule on a + v e1 + w e2 = o + t d)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    system = np.stack([np.broadcast_to(-direction, a.shape), b - a, c - a], axis=2)
    det = np.linalg.det(system)
    ok = np.abs(det) > 1e-14
    solution = np.full((len(faces), 3), np.nan)
    solution[ok] = np.linalg.solve(system[ok], (origin - a)[ok][..., None])[..., 0]
    t, v, w = solution.T
    with np.errstate(invalid="ignore"):
        hit = (t > 1e-9) & (v >= -1e-9) & (w >= -1e-9) & (v + w <= 1 + 1e-9)
    if not hit.any():
        return -1, np.inf
    best = np.flatnonzero(hit)[np.argmin(t[hit])]
    return int(best), float(t[best])


def test_depth_of_a_ball_is_analytic():
    pytest.importorskip("embreex")
    from reconstruction.benchmark.raycast import Caster

    vertices, faces = surface(Field(np.array([[0, 0, 1.0, 0, 0, 1.000001, 0.4, 0.4]]), 0.004), 0.02)
    camera = perspective(vertices, 0.0, 0.0, 3.0, 60, 60)
    hits = Caster(vertices, faces).image(camera)
    origins, directions = camera.rays()
    to_centre = np.array([0, 0, 1.0]) - origins
    along = np.einsum("ij,ij->i", to_centre, directions)
    off = np.linalg.norm(to_centre, axis=1) ** 2 - along**2
    inner = off < 0.37**2
    t = along[inner] - np.sqrt(0.16 - off[inner])
    wanted = (origins[inner] + t[:, None] * directions[inner]) @ camera.depth_row[:3] + camera.depth_row[3]
    assert hits.depth.reshape(-1)[inner] == pytest.approx(wanted, abs=1e-3)
    assert hits.weights.sum(axis=2)[hits.face >= 0] == pytest.approx(1.0, abs=1e-5)
    assert (hits.face.reshape(-1)[off > 0.41**2] == -1).all()


def test_first_hits_are_those_of_brute_force(model_of):
    scene = model_of("half-sleeve").worn
    camera = draw_camera(scene.vertices, 5, 40, 52)
    hits = scene.caster.image(camera)
    origins, directions = camera.rays()
    rng = np.random.default_rng(2)
    for i in rng.integers(0, len(origins), 60):
        face, t = brute_first(scene.vertices, scene.faces, origins[i], directions[i])
        got = hits.depth.reshape(-1)[i]
        assert (face < 0) == np.isnan(got)
        if face >= 0:
            point = origins[i] + t * directions[i]
            assert got == pytest.approx(point @ camera.depth_row[:3] + camera.depth_row[3], abs=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_visibility_is_that_of_brute_force(kind, model_of):
    made = model_of(kind)
    scene, points = made.worn, keypoints.place(made.mesh, made.draped.vertices)
    for camera in (perspective(scene.vertices, 15.0, 5.0, 4.0, 384, 512), perspective(scene.vertices, 180.0, 5.0, 4.0, 384, 512),
                   oblique(scene.vertices, -30.0, 0.0, 384, 512, (0.2, 0.1))):
        seen = keypoints.visible(points, camera, scene.caster)
        for i, point in enumerate(points):
            if np.isnan(point).any():
                assert not seen[i]
                continue
            back = camera.towards(point[None])[0]
            hit = brute_first(scene.vertices, scene.faces, point + keypoints.TOLERANCE * back, back)[0]
            assert seen[i] == (hit < 0), LANDMARKS[i]


@pytest.mark.parametrize("kind", KINDS)
def test_which_points_a_type_has(kind, model_of):
    made = model_of(kind)
    there = keypoints.present(made.mesh)
    assert {n for n, ok in zip(LANDMARKS, there, strict=True) if ok} == PRESENT[kind]
    assert np.array_equal(np.isfinite(keypoints.place(made.mesh, made.draped.vertices)).all(axis=1), there)
    points = keypoints.place(made.mesh, made.draped.vertices)
    for left, right in PAIRS:
        if there[left]:
            assert points[left, 0] > points[right, 0]


def test_flat_points_measure_the_cut(model_of):
    made = model_of("round-collar-robe")
    points = keypoints.place(made.flat.mesh, made.flat.cloth)
    at = lambda name: points[INDEX[name], :2]  # noqa: E731
    assert np.linalg.norm(at("left_wrist") - at("right_wrist")) == pytest.approx(made.cut["cross_sleeve"], rel=1e-6)
    assert at("left_ankle") - at("right_ankle") == pytest.approx([made.cut["hem_width"], 0], abs=1e-9)
    assert at("left_neckline")[0] == pytest.approx(made.cut["collar_radius"], abs=1e-3)
    assert at("left_elbow") == pytest.approx((at("left_shoulder") + at("left_wrist")) / 2, abs=1e-9)


def test_a_point_outside_the_picture_or_behind_the_body_is_not_seen(model_of):
    made = model_of("half-sleeve")
    points = keypoints.place(made.mesh, made.draped.vertices)
    close = perspective(made.worn.vertices[made.worn.vertices[:, 2] > 1.5], 0.0, 0.0, 4.0, 64, 64)
    seen = keypoints.visible(points, close, made.worn.caster)
    assert not seen[INDEX["left_ankle"]]
    centre = np.full((12, 3), np.nan)
    centre[0] = made.worn.body_vertices.mean(axis=0)
    assert not keypoints.visible(centre, perspective(made.worn.vertices, 0.0, 0.0, 4.0, 64, 64), made.worn.caster)[0]
