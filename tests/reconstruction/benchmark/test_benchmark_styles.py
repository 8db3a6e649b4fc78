"""The three styles: determinism, damage, what is drawn where."""

import dataclasses

import numpy as np
import pytest

from reconstruction.benchmark import figurine, mural, textile
from reconstruction.benchmark.camera import perspective
from reconstruction.benchmark.noise import cracks, value_noise
from reconstruction.benchmark.pattern import MOTIFS, colour, draw_pattern
from reconstruction.benchmark.scene import look, shrink

W, H = 96, 128


def draw(made, style, damage, seed=9):
    if style == "figurine":
        camera = perspective(made.worn.vertices, 10.0, 5.0, 4.0, W, H)
        return figurine.paint(made.worn, camera, made.pattern, 7, damage, seed)
    module, scene = (mural, made.worn) if style == "mural" else (textile, made.flat)
    return module.paint(scene, module.draw_camera(scene.vertices, seed, W, H), made.pattern, 7, damage, seed)[0]


@pytest.mark.parametrize("style", ["figurine", "mural", "textile"])
def test_pictures_repeat_and_decay(style, model_of):
    made = model_of("half-sleeve")
    new = draw(made, style, 0)
    assert new.shape == (H, W, 3) and new.dtype == np.uint8
    assert np.array_equal(new, draw(made, style, 0))
    assert not np.array_equal(new, draw(made, style, 0, seed=10))
    change = [np.abs(draw(made, style, d).astype(float) - new).mean() for d in (1, 2, 3)]
    assert 0 < change[0] < change[1] < change[2]


@pytest.mark.parametrize("damage", range(4))
def test_lost_area_is_as_documented(damage, model_of):
    made = model_of("half-sleeve")
    _, intact = mural.paint(made.worn, mural.draw_camera(made.worn.vertices, 3, W, H), made.pattern, 7, damage, 3, scale=1)
    assert 1 - intact.mean() == pytest.approx(mural.LOSS[damage], abs=0.002)
    camera = textile.draw_camera(made.flat.vertices, 3, W, H)
    _, intact = textile.paint(made.flat, camera, made.pattern, 7, damage, 3, scale=1)
    cloth = look(made.flat, camera).cloth
    assert 1 - intact[cloth].mean() == pytest.approx(textile.LOSS[damage], abs=0.005)
    assert intact[~cloth].all()


def test_the_warp_can_be_seen_in_a_plain_textile(model_of):
    made = model_of("half-sleeve")
    plain = dataclasses.replace(made.pattern, motif="plain", trim_width=0.0)
    camera = textile.draw_camera(made.flat.vertices, 3, 384, 512)
    image = textile.paint(made.flat, camera, plain, 7, 0, 3)[0].astype(float).mean(axis=2)
    cloth = look(made.flat, camera).cloth
    uv = look(made.flat, camera).uv
    inner = cloth & (np.abs(np.nan_to_num(uv[..., 0])) < 0.2) & (np.nan_to_num(uv[..., 1]) > 0.15)
    across, along = (np.abs(np.diff(image, axis=a))[inner[1:, 1:].nonzero()].mean() for a in (1, 0))
    assert across > 1.5 * along  # ribs run along v, which is down the page


def test_views_agree_with_themselves(model_of):
    made = model_of("round-collar-robe")
    camera = mural.draw_camera(made.worn.vertices, 4, W, H)
    view = look(made.worn, camera)
    assert np.array_equal(view.hit, np.isfinite(view.depth))
    rows, columns = np.nonzero(view.hit)
    pixels, depth = camera.project(view.position[view.hit])
    assert pixels == pytest.approx(np.stack([columns, rows], axis=1), abs=1e-3)
    assert depth == pytest.approx(view.depth[view.hit], abs=1e-5)
    assert np.linalg.norm(view.normal[view.hit], axis=1) == pytest.approx(1.0)
    assert (np.einsum("ij,ij->i", view.normal[view.hit], view.toward[view.hit]) > -0.3).mean() > 0.99
    assert np.isfinite(view.uv[view.cloth]).all() and np.isnan(view.uv[~view.cloth]).all()
    assert 0 <= view.sky.min() and view.sky.max() <= 1 + 1e-6
    assert (view.body & view.cloth).sum() == 0 and view.body.sum() > 50 and view.cloth.sum() > 500


def test_patterns_repeat_with_their_warp_repeat():
    rng = np.random.default_rng(0)
    uv, far = rng.uniform(-0.5, 0.5, (500, 2)), np.full(500, 9.0)
    seen = set()
    for seed in range(40):
        pattern = draw_pattern(seed)
        seen.add(pattern.motif)
        assert pattern.warp_repeat <= 0.55
        twice = uv + np.array([0.0, 2 * pattern.warp_repeat])  # rows of medallions are staggered: two of them make a period
        assert (np.abs(colour(pattern, uv, far) - colour(pattern, twice, far)).max(axis=1) < 1e-9).mean() > 0.99
    assert seen == set(MOTIFS)


def test_noise_repeats_is_continuous_and_fills_its_range():
    points = np.random.default_rng(1).uniform(-50, 50, (4000, 3))
    a = value_noise(points, 1.0, 5)
    assert np.array_equal(a, value_noise(points, 1.0, 5))
    assert np.abs(a - value_noise(points + 1e-6, 1.0, 5)).max() < 1e-4
    assert a.mean() == pytest.approx(0.5, abs=0.02) and 0.1 < a.std() < 0.4
    assert value_noise(points[:10, :2], 1.0, 5).shape == (10,)
    assert not np.array_equal(a, value_noise(points, 1.0, 6))


def test_cracks_and_shrink():
    rng = np.random.default_rng(0)
    none, many = cracks(80, 60, 0, rng), cracks(80, 60, 8, rng)
    assert none.shape == (60, 80) and none.max() == 0
    assert 0.01 < (many > 0).mean() < 0.5
    assert shrink(np.arange(16.0).reshape(4, 4), 2) == pytest.approx(np.array([[2.5, 4.5], [10.5, 12.5]]))
