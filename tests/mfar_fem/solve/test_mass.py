"""Consistent and lumped mass: totals, inertia of a rigid plate, positivity; small vibrations about an equilibrium."""

from __future__ import annotations

import numpy as np
import pytest

from mfar_fem.benchmarks.free_vibration import SIZE, sheet
from mfar_fem.errors import InputError
from mfar_fem.loads import gravity
from mfar_fem.shell import Shell
from mfar_fem.solve import Problem, solve_static
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions
from mfar_fem.solve.mass import Mass
from mfar_fem.solve.modes import natural_frequencies
from mfar_fem.supports import Clamp, Hinge
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import cylinder, strip

RHO = 0.1


def shell_of(order, pattern=None):
    surface = Surface.from_pattern(pattern or strip(0.3, 0.2, 4, 3, pattern="jitter", jitter=0.2), order)
    return Shell(surface, sheet(1e3, 1e-5))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", ["consistent", "lumped"])
def test_total_and_rigid_motions(order, kind):
    shell = shell_of(order)
    mass, nodes = Mass(shell, RHO, kind), shell.surface.nodes
    assert mass.total == pytest.approx(RHO * 0.06, rel=1e-12)
    assert mass.diagonal.sum() == pytest.approx(mass.total, rel=1e-12) and np.all(mass.diagonal > 0)
    ones = np.ones_like(nodes)
    assert np.sum(ones * mass(ones)) == pytest.approx(3 * mass.total, rel=1e-12)
    spin = np.cross([0.0, 0.0, 1.0], nodes)
    inertia = RHO * 0.06 * (0.3**2 + 0.2**2) / 3  # about a corner
    assert np.sum(spin * mass(spin)) == pytest.approx(inertia, rel=1e-12 if kind == "consistent" else 0.06)


def test_curved_shell_weighs_its_true_area_at_order_2():
    area = 2 * np.pi * 0.1 * 0.3 / 4
    pattern = cylinder(0.1, 0.3, (0.0, np.pi / 2), 8, 4)
    assert Mass(shell_of(2, pattern), RHO).total == pytest.approx(RHO * area, rel=1e-5)
    assert Mass(shell_of(1, pattern), RHO).total == pytest.approx(RHO * area, rel=5e-3)


@pytest.mark.parametrize("kind", ["consistent", "lumped"])
def test_solve_inverts_the_mass_on_the_free_unknowns(kind):
    shell = shell_of(2)
    mass, rng = Mass(shell, RHO, kind), np.random.default_rng(3)
    free = np.flatnonzero(rng.random(shell.alpha_offset) < 0.7)
    a = np.zeros(shell.alpha_offset)
    a[free] = rng.standard_normal(len(free))
    assert mass.solve(mass(a.reshape(-1, 3)).ravel(), free) == pytest.approx(a, rel=1e-9, abs=1e-12)


def test_wrong_mass_is_named():
    with pytest.raises(InputError, match="consistent, lumped"):
        Mass(shell_of(1), RHO, "diagonal")
    with pytest.raises(InputError, match="positive and finite"):
        Mass(shell_of(1), 0.0)


@pytest.mark.parametrize("order", [1, 2])
def test_modes_solve_the_eigenvalue_problem_and_rotations_follow(order):
    surface = Surface.from_pattern(strip(SIZE, 0.3 * SIZE, 6, 2), order)
    problem = Problem(surface, sheet(1e3, 1e-5, 0.3, RHO), [Clamp("left")], [gravity(RHO)])
    state, mass = solve_static(problem).state, Mass(problem.shell, RHO)
    omega, modes = natural_frequencies(problem, state, mass, 4)
    n_x, free = problem.shell.alpha_offset, problem.free
    K = problem.free_block.matrix(problem.tangent(state, 1.0, True)[1])
    inertia = np.array([np.r_[mass(m[:n_x].reshape(-1, 3)).ravel(), np.zeros(problem.n - n_x)] for m in modes.T]).T
    residual = K @ modes[free] - (inertia * omega**2)[free]
    assert np.abs(residual).max() < 1e-7 * np.abs(inertia * omega**2).max()
    gram = modes.T @ inertia
    assert gram == pytest.approx(np.eye(4), abs=1e-9)
    assert np.all(modes[problem.fixed] == 0.0)


def test_free_sheet_has_six_rigid_modes_and_a_dynamics_problem_gives_the_same():
    surface = Surface.from_pattern(strip(SIZE, 0.3 * SIZE, 6, 2), 2)
    fabric = sheet(1e3, 1e-5, 0.3, RHO)
    problem = Problem(surface, fabric)
    mass = Mass(problem.shell, RHO)
    omega, _ = natural_frequencies(problem, problem.start(), mass, 8)
    assert np.abs(omega[:6]).max() < 1e-2 * omega[6]
    dynamics = Dynamics(surface, fabric, options=DynamicsOptions(stiffness_damping=1e-3), velocity=surface.nodes)
    dynamics.run(0.004)
    again, _ = natural_frequencies(dynamics.problem, problem.start(), mass, 8)
    assert again[6:] == pytest.approx(omega[6:], rel=1e-8)


def test_upside_down_strip_is_unstable():
    """A limp strip that stands on its hinge: the frequency is negative, as documented; hung it is stable."""
    surface = Surface.from_pattern(strip(SIZE, 0.2 * SIZE, 4, 1), 1)
    for sign in (1.0, -1.0):
        problem = Problem(surface, sheet(1e3, 1e-4, 0.0, RHO), [Hinge("left")], [gravity(RHO, (sign * 9.80665, 0.0, 0.0))])
        state = solve_static(problem).state
        omega, _ = natural_frequencies(problem, state, Mass(problem.shell, RHO), 2)
        assert np.sign(omega[0]) == sign
        assert abs(omega[0]) == pytest.approx(np.sqrt(1.5 * 9.80665 / SIZE), rel=5e-2)


def test_wrong_counts_are_named():
    problem = Problem(Surface.from_pattern(strip(1.0, 1.0, 1, 1), 1), sheet(1e3, 1e-5))
    with pytest.raises(InputError, match="between 1 and 11"):
        natural_frequencies(problem, problem.start(), Mass(problem.shell, RHO), 12)
