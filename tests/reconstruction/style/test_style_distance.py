"""Distances in look: exact for shifts, blind to place, and ordered as the kinds are."""

import numpy as np
import pytest

from reconstruction.landmarks import KINDS
from reconstruction.style import colour
from reconstruction.style.scenes import draw_scene, view
from reconstruction.style.style_distance import colour_distance, filter_responses, texture_distance

SCENES = [draw_scene(np.random.default_rng(k)) for k in range(3)]


def test_a_shift_in_lab_measures_its_length():
    rng = np.random.default_rng(0)
    lab = np.array([55.0, 5.0, 5.0]) + rng.uniform(-8, 8, (64, 64, 3))
    shifted = lab + np.array([3.0, -4.0, 0.0])
    a, b = (colour.to_uint8(colour.srgb_from_lab(x)) for x in (lab, shifted))
    assert colour_distance(a, b, directions=400) == pytest.approx(5.0, rel=0.05)
    assert colour_distance(a, a) == 0.0


def test_colours_and_texture_do_not_mind_place():
    image = view(SCENES[0], "mural", np.random.default_rng(0), 128)
    turned = image[::-1, ::-1]
    assert colour_distance(image, turned) == pytest.approx(0.0, abs=1e-9)
    assert texture_distance(image, turned) == pytest.approx(0.0, abs=1e-6)


def test_filters_answer_to_their_direction_and_scale():
    stripes = np.rint(127 + 60 * np.sin(2 * np.pi * np.arange(96) / 8.8))[None, :, None].repeat(96, 0).repeat(3, 2).astype(np.uint8)
    strength = filter_responses(stripes)[:20].reshape(4, 5, -1).mean(-1)  # L*: scale by (four directions, Laplacian)
    assert (strength[:, 0] > 3 * strength[:, 2] + 1e-9).all()  # across the stripes, not along
    assert strength[:, 0].argmax() == 1  # s exp(-s²k²/2) is largest at s = 1/k = 1.4 px


def test_same_kind_is_nearer_in_texture_than_another():
    looks = {kind: [view(s, kind, np.random.default_rng(i), 128) for i, s in enumerate(SCENES)] for kind in KINDS}
    within = [texture_distance(v[0], v[1]) for v in looks.values()]
    across = [texture_distance(looks[a][0], looks[b][0]) for a in KINDS for b in KINDS if a < b]
    assert max(within) < min(across)
