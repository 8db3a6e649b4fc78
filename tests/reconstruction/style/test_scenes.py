"""Drawn scenes: deterministic, registered between kinds, and exact under a homography."""

import numpy as np
import pytest

from reconstruction.landmarks import KINDS
from reconstruction.style import scenes
from reconstruction.style.match_rate import transform
from reconstruction.style.scenes import GARMENTS, PARTS, areas, draw_scene, random_homography, view


def test_same_seed_same_picture():
    one, two = (view(draw_scene(np.random.default_rng(5)), "mural", np.random.default_rng(1), 64) for _ in range(2))
    assert np.array_equal(one, two) and one.shape == (64, 64, 3) and one.dtype == np.uint8


def test_all_garments_and_parts_occur():
    grid = np.meshgrid(np.linspace(0, 1, 96), np.linspace(0, 1, 96))
    scenes = [draw_scene(np.random.default_rng(k)) for k in range(30)]
    assert {s.garment for s in scenes} == set(GARMENTS)
    labels = {int(v) for s in scenes for v in np.unique(areas(s, *grid).label)}
    assert labels == set(range(len(PARTS)))


def test_a_view_shows_at_the_mapped_place_what_the_front_shows(monkeypatch):
    """The label seen at H p is that of the scene at p, for points inside areas (deeper than the rounding of a pixel)."""
    monkeypatch.setattr(scenes, "render", lambda found, kind, rng, x, y: found.label)
    scene = draw_scene(np.random.default_rng(3))
    homography = random_homography(np.random.default_rng(2), 200)
    seen = view(scene, "mural", np.random.default_rng(0), 200, homography)
    points = np.random.default_rng(1).uniform(20, 180, (3000, 2))
    found = areas(scene, points[:, 0] / 199, points[:, 1] / 199)
    moved = np.rint(transform(homography, points)).astype(int)
    kept = (found.outline > 0.012) & ((moved >= 0) & (moved < 200)).all(1)
    assert kept.sum() > 1500 and len(set(found.label[kept])) > 3
    assert np.array_equal(seen[moved[kept, 1], moved[kept, 0]], found.label[kept])


def test_kinds_are_known():
    with pytest.raises(ValueError, match="mural"):
        view(draw_scene(np.random.default_rng(0)), "fresco", np.random.default_rng(0))
    assert len(KINDS) == 3
