"""The figure: field, surface, proportions."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reconstruction.benchmark.body import draw_body, field, joints
from reconstruction.benchmark.body_field import Field, surface
from reconstruction.landmarks import STATURE


def test_distance_to_one_capsule_is_exact():
    capsule = Field(np.array([[0, 0, 0, 0, 0, 1.0, 0.1, 0.1]]), 0.004)
    assert capsule([[0.3, 0, 0.5], [0, 0, 1.5], [0, 0.05, 0.2]]) == pytest.approx([0.2, 0.4, -0.05])


def test_gradient_is_that_of_the_distance():
    shape = field(draw_body(3))
    rng = np.random.default_rng(1)
    points = rng.uniform([-0.5, -0.3, 0.1], [0.5, 0.3, 1.6], (200, 3))
    d, g = shape.with_gradient(points)
    h = 1e-6
    numeric = np.stack([(shape(points + h * e) - shape(points - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    numeric /= np.linalg.norm(numeric, axis=1, keepdims=True)
    agreement = np.einsum("ij,ij->i", numeric, g)[np.abs(d) < 0.3]
    assert np.quantile(agreement, 0.02) > 0.99  # the taper tilts the true gradient a little


def test_surface_of_a_sphere():
    ball = Field(np.array([[0, 0, 0, 0, 0, 1e-6, 0.1, 0.1]]), 0.004)
    vertices, faces = surface(ball, 0.01)
    assert np.linalg.norm(vertices, axis=1) == pytest.approx(0.1, abs=1e-5)
    p = vertices[faces]
    volume = np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6  # positive: outward
    assert volume == pytest.approx(4 / 3 * np.pi * 1e-3, rel=0.01)
    sides = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    assert {tuple(e) for e in sides.tolist()} == {tuple(e[::-1]) for e in sides.tolist()}  # closed


@given(st.integers(0, 10**6), st.floats(0, 1))
@settings(max_examples=30)
def test_limbs_keep_their_length_while_moving(seed, blend):
    spec = draw_body(seed)
    at, start = joints(spec, blend), joints(spec, 0.0)
    for a, b in (("shoulder", "elbow"), ("elbow", "wrist")):
        for side in ("left", "right"):
            length = [np.linalg.norm(j[f"{side}_{a}"] - j[f"{side}_{b}"]) for j in (at, start)]
            assert length[0] == pytest.approx(length[1])
    assert start["left_hand"][0] > 0 > start["right_hand"][0]  # the wearer's left is at +x


@pytest.mark.parametrize("seed", range(4))
def test_stature_and_volume_are_human(seed):
    spec = dataclasses.replace(draw_body(seed), topknot=False, skirt=False)
    vertices, faces = surface(field(spec), 0.02, 0.0)
    assert np.ptp(vertices[:, 2]) == pytest.approx(spec.stature, rel=0.02)
    assert abs(spec.stature - STATURE[spec.sex]) <= 0.1001
    p = vertices[faces]
    litres = 1000 * np.einsum("ij,ij->i", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() / 6
    assert 38 < litres < 95
