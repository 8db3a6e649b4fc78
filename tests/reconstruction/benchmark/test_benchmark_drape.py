"""The drape: small problems with known answers, then every type."""

import numpy as np
import pytest

from mfar_fem.errors import NotConvergedError
from reconstruction.benchmark.body import draw_body, field
from reconstruction.benchmark.body_field import Field
from reconstruction.benchmark.cutting import KINDS
from reconstruction.benchmark.drape import _flat_distance, drape, penetration
from reconstruction.benchmark.drape_kernels import advance, separate
from reconstruction.benchmark.identity import crossing_edges
from reconstruction.benchmark.wearing import put_on

NOBODY = np.array([[50.0, 0, 0, 50, 0, 1, 0.01, 0.01]])
NO_BELT = np.zeros(0, dtype=np.int64)


def run(x, free, links, lengths, capsules=NOBODY, steps=2000, gravity=5.0):
    v = np.zeros_like(x)
    compliance = np.full(len(links), 1e-8)
    links, lengths = np.asarray(links), np.asarray(lengths)
    body = (capsules, 0.004, np.zeros((1, 1, 1)), np.zeros(4))
    advance(x, v, free, steps, 1 / 800, gravity, 4.0, links, lengths, compliance, *body, 0.007, 0.3, NO_BELT, 0.1)
    return v


def test_a_chain_hangs_straight_down_from_its_held_end():
    n = 20
    x = np.stack([0.02 * np.arange(n), np.zeros(n), np.full(n, 1.0)], axis=1)
    free = np.ones(n)
    free[0] = 0.0
    links = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1)
    run(x, free, links, np.full(n - 1, 0.02), steps=6000)
    assert x[0] == pytest.approx([0, 0, 1.0])
    assert x[-1] == pytest.approx([0, 0, 1.0 - 0.02 * (n - 1)], abs=0.01)


def test_free_fall_follows_gravity_and_the_floor_stops_it():
    x = np.array([[0.0, 0.0, 1.0], [0.02, 0.0, 1.0]])
    links, lengths = np.array([[0, 1]]), np.array([0.02])
    run(x, np.ones(2), links, lengths, steps=160)
    t = 0.2
    with_drag = 1.0 - 5.0 / 4 * (t - (1 - np.exp(-4 * t)) / 4)  # dv/dt = g - 4 v
    assert x[:, 2] == pytest.approx(with_drag, abs=2e-3)
    run(x, np.ones(2), links, lengths, steps=4000)
    assert x[:, 2].min() >= 0.002 - 1e-12


def test_a_point_rests_on_a_ball_at_the_margin():
    ball = np.array([[0, 0, 0.5, 0, 0, 0.5001, 0.1, 0.1]])
    x = np.array([[0.0, 0.0, 0.7], [1e-3, 0.0, 0.7]])
    run(x, np.ones(2), np.array([[0, 1]]), np.array([1e-3]), ball, steps=1200)
    assert Field(ball, 0.004)(x) == pytest.approx(0.007, abs=1e-3)


def test_separation_finds_the_pairs_of_a_brute_force_search():
    rng = np.random.default_rng(0)
    x = rng.random((400, 3)) * 0.2
    start = x * 10  # far apart at first: every near pair must be pushed
    near = lambda y: (np.linalg.norm(y[:, None] - y[None], axis=2)[np.triu_indices(len(y), 1)] < 0.0132).sum()  # noqa: E731
    before, moved = near(x), x.copy()
    separate(moved, np.zeros_like(x), np.ones(len(x)), start, 0.0132)
    touched = np.any(moved != x, axis=1)
    d = np.linalg.norm(x[:, None] - x[None], axis=2) + np.eye(len(x))
    assert before > 50
    assert touched[(d < 0.0132).any(axis=1)].all()
    for _ in range(60):
        separate(moved, np.zeros_like(x), np.ones(len(x)), start, 0.0132)
    assert near(moved * (1 + 1e-3)) < 0.02 * before
    same = x.copy()
    separate(same, np.zeros_like(x), np.ones(len(x)), x, 0.0132)  # as near as at the start: nothing to do
    assert np.array_equal(same, x)


def test_flat_distance_of_two_equilateral_triangles():
    assert _flat_distance(1.0, 1.0, 1.0, 1.0, 1.0) == pytest.approx(np.sqrt(3))


@pytest.mark.parametrize("kind", KINDS)
def test_every_type_hangs_unstretched_outside_the_body(kind, model_of):
    made = model_of(kind)
    assert np.isfinite(made.draped.vertices).all()
    assert made.draped.mean_stretch < 0.03
    assert made.draped.max_penetration <= 0.002
    assert penetration(made.mesh, made.draped.vertices, field(made.spec)) == made.draped.max_penetration
    assert crossing_edges(made.mesh, made.draped.vertices) < 0.02
    warp = made.mesh.warp(made.draped.vertices)
    assert np.linalg.norm(warp, axis=1) == pytest.approx(1.0)


def test_the_same_seed_drapes_to_the_same_bytes_and_another_does_not(model_of):
    made = model_of("half-sleeve")
    again = [drape(made.mesh, put_on(made.mesh, made.cut, made.spec), made.spec, seed).vertices for seed in (101, 102)]
    assert again[0].tobytes() == made.draped.vertices.tobytes()
    assert not np.array_equal(again[0], again[1])


def test_a_drape_that_fails_says_so(model_of):
    made = model_of("flying-ribbon")
    worn = put_on(made.mesh, made.cut, made.spec)
    broken = type(worn)(worn.start * 4.0, worn.held, lambda blend: 4.0 * worn.start[worn.held])
    with pytest.raises(NotConvergedError, match="stretch"):
        drape(made.mesh, broken, made.spec)


def test_a_belt_draws_the_waist_in(model_of):
    made = model_of("round-collar-robe")
    tied = put_on(made.mesh, made.cut, made.spec, belt=True).belt
    assert len(tied) > 20
    shape = field(made.spec)
    loose = drape(made.mesh, put_on(made.mesh, made.cut, made.spec), made.spec, 5).vertices
    belted = drape(made.mesh, put_on(made.mesh, made.cut, made.spec, belt=True), made.spec, 5).vertices
    assert shape(belted[tied]).mean() < 0.035 < shape(loose[tied]).mean()


def test_bodies_for_hats_are_dressed_with_hanging_arms():
    assert draw_body(1, "veil-hat").start != draw_body(1).start
    assert not draw_body(1, "veil-hat").topknot


def test_crossing_edges_are_found(model_of):
    made = model_of("half-sleeve")
    assert crossing_edges(made.mesh, _folded_through(made)) > 0.02


def _folded_through(made):
    """The garment with its front pushed through its back."""
    x = made.draped.vertices.copy()
    front = x[:, 1] < 0
    x[front, 1] *= -1.5
    return x
