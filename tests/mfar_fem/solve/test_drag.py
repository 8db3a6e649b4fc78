"""Drag of the air: forces by hand, derivatives by differences, closed forms of fall, coast and wind, and the mesh."""

from __future__ import annotations

import numpy as np
import pytest

from mfar_fem.benchmarks.drag_study import GAMMA, coast, fall, free_sheet, hiding_step, mean_velocity, meshes, swatch, wind
from mfar_fem.benchmarks.free_vibration import DENSITY, SIZE, G, sheet
from mfar_fem.drag import AirDrag, VertexDrag
from mfar_fem.errors import InputError
from mfar_fem.shell import Shell
from mfar_fem.solve import Problem
from mfar_fem.solve.integrators import StepRule
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip


def moving(drag, order, v, turn=None, t=0.0):
    """Force (nn, 3) on a flat sheet 0.3 x 0.2, turned, whose nodes have the velocity ``v(x)``."""
    surface = Surface.from_pattern(strip(0.3, 0.2, 3, 2, pattern="jitter", jitter=0.2), order)
    shell = Shell(surface, sheet(1e3, 1e-5))
    x = surface.nodes if turn is None else surface.nodes @ turn.T
    drag.bind(shell)
    drag.begin_step(shell, StepRule(1.0, 1.0, (x - v(x)).ravel(), 1.0, x.ravel()), x, t)
    return -drag.force(shell, x).reshape(-1, 3), x


@pytest.mark.parametrize("order", [1, 2])
def test_force_on_a_turned_plate_by_hand(order):
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    n, v, wind_ = turn[:, 2], np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.1, -1.0])
    force, _ = moving(AirDrag(0.7, 0.2, wind_), order, lambda x: np.broadcast_to(v, x.shape), turn)
    w = v - wind_
    wn, wt = w @ n, w - (w @ n) * n
    expected = -0.06 * (0.7 * abs(wn) * wn * n + 0.2 * np.linalg.norm(wt) * wt)
    assert force.sum(axis=0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("order", [1, 2])
def test_field_of_the_air_is_taken_at_the_place_and_the_time(order):
    """Wind across that grows along the sheet and with the time: ∫ γ (x t)² dA."""
    drag = AirDrag(0.5, air=lambda x, t: np.outer(x[:, 0] * t, [0.0, 0.0, 1.0]))
    force, x = moving(drag, order, np.zeros_like, t=3.0)
    assert force.sum(axis=0) == pytest.approx([0, 0, 0.5 * 9.0 * 0.2 * 0.3**3 / 3], rel=1e-10, abs=1e-15)
    if order == 2:  # the moment about the y axis too: ∫ γ (x t)² x dA
        assert np.sum(force[:, 2] * x[:, 0]) == pytest.approx(0.5 * 9.0 * 0.2 * 0.3**4 / 4, rel=1e-10)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("drag", [AirDrag(0.7, 0.3, (0.2, 0.5, -1.0)), VertexDrag(2e-3, (0.2, 0.5, -1.0))])
def test_energy_gradient_and_hessian_agree(order, drag):
    problem = Problem(Surface.from_pattern(strip(0.1, 0.1, 2, 1), order), sheet(1e3, 1e-5), loads=[drag])
    shell, rng, state = problem.shell, np.random.default_rng(0), problem.start()
    x = shell.positions(state)
    bare = problem.tangent(state, 1.0, True)
    drag.begin_step(shell, StepRule(0.01, 100.0, (x + 0.01 * rng.standard_normal(x.shape)).ravel(), 1e4, x.ravel()), x, 0.0)
    g, data = np.zeros(problem.n), problem.tangent(state, 1.0, True)[1] - bare[1]
    drag.gradient(shell, state, 1.0, g)
    H, d, eps = problem.pattern.matrix(data), rng.standard_normal(problem.n), 1e-6
    ahead, back = state.with_u(state.u + eps * d), state.with_u(state.u - eps * d)
    slope = (drag.energy(shell, ahead, 1.0) - drag.energy(shell, back, 1.0)) / (2 * eps)
    assert slope == pytest.approx(g @ d, rel=1e-7)
    change = np.zeros((2, problem.n))
    for row, near in zip(change, (ahead, back), strict=True):
        drag.gradient(shell, near, 1.0, row)
    assert H @ d == pytest.approx((change[0] - change[1]) / (2 * eps), rel=1e-5, abs=1e-6 * np.abs(H @ d).max())
    assert np.linalg.eigvalsh(H.toarray()).min() > -1e-12 * np.abs(data).max()


@pytest.mark.parametrize(("method", "rho", "rate"), [("implicit-euler", 1.0, 1), ("bdf2", 1.0, 2), ("generalized-alpha", 1.0, 2),
                                                     ("generalized-alpha", 0.8, 2)])
def test_fall_from_rest_at_the_order_of_the_method(method, rho, rate):
    found = fall(method, rho, (15, 30), order=1 if rate == 1 else 2)
    assert found["rates"][0] == pytest.approx(rate, abs=0.1)
    assert found["errors"][1] < (1e-2 if rate == 1 else 5e-4)


def test_coast_and_wind():
    assert (row := coast(steps=100))["ratio"] == pytest.approx(row["exact"], rel=1e-3)
    assert (row := wind(steps=60))["share"] == pytest.approx(row["exact"], rel=1e-3)


def test_rotating_air_makes_the_sheet_turn():
    spin = 5.0

    def air(x, t):
        return spin * np.column_stack([-(x[:, 1] - SIZE / 2), x[:, 0] - SIZE / 2, 0 * x[:, 0]])

    dynamics = free_sheet(AirDrag(0.0, 5.0, air), "bdf2", 0.02, falls=False)
    assert dynamics.run(1.5).converged
    x, v = (a.reshape(-1, 3) for a in (dynamics.motion.kinematics.x, dynamics.motion.kinematics.v))
    r = x - x.mean(axis=0)
    found = np.cross(r, v)[:, 2].sum() / np.sum(r**2)
    assert 0.6 * spin < found < spin
    assert np.linalg.norm(mean_velocity(dynamics)) < 1e-3 * spin * SIZE


@pytest.mark.parametrize("order", [1, 2])
def test_the_mesh_changes_the_drag_per_vertex_and_not_that_per_area(order):
    rows = meshes((1, 2), order)
    for row in rows:
        assert row["terminal_speed_per_area"] == pytest.approx(np.sqrt(DENSITY * G / GAMMA), rel=1e-6)
        assert row["terminal_speed_per_vertex"] == pytest.approx(row["exact_per_vertex"], rel=1e-6)
    assert rows[0]["terminal_speed_per_vertex"] > 1.5 * rows[1]["terminal_speed_per_vertex"]


def test_implicit_euler_hides_the_air_and_bdf2_does_not():
    found = hiding_step(10.0, (8e-3, 16e-3, 32e-3), cells=(2, 3))
    share = [row["share"] for row in found["rows"]]
    assert np.all(np.diff(share) > 0)
    assert found["hides_at"] == pytest.approx(found["stiff_plate"], rel=0.6)
    assert abs(swatch(8e-3, 10.0, "bdf2", cells=(2, 3))["share"]) < 0.2 * share[0]


def test_wrong_drag_is_named():
    with pytest.raises(InputError, match="normal drag coefficient"):
        AirDrag(-1.0)
    with pytest.raises(InputError, match="tangential drag coefficient"):
        AirDrag(1.0, np.nan)
    with pytest.raises(InputError, match="per vertex"):
        VertexDrag(-1.0)
    with pytest.raises(InputError, match="three finite numbers"):
        AirDrag(1.0, air=(0.0, 1.0))
