"""Failure is a named result with the last converged state; nothing that is not finite leaves the solver."""

import numpy as np
import pytest

from mfar_fem.benchmarks.case import sheet
from mfar_fem.errors import InputError
from mfar_fem.loads import edge_load
from mfar_fem.materials import Bending, EightChainSilk, Fabric, YarnNetwork
from mfar_fem.solve import NewtonOptions, Problem, solve_static
from mfar_fem.solve.newton import newton
from mfar_fem.supports import Clamp, Hinge, Support
from mfar_fem.surface import Surface
from mfar_fem.surface.patterns import strip

orders = pytest.mark.parametrize("order", [1, 2])


def fabric(law):
    return Fabric("strip", law, 1e-4, 0.06, Bending(1e-6, 1e-6, 1e-6))


def pulled(order, law, stretch):
    surface = Surface.from_pattern(strip(0.1, 0.05, 4, 2), order)
    flat = Support(np.arange(len(surface.nodes)), (2,), by_node=True)
    return Problem(surface, fabric(law), [Hinge("left"), Hinge("right", displacement=(0.1 * (stretch - 1), 0.0, 0.0)), flat],
                   bending=False)


def finite(result):
    return all(np.all(np.isfinite(step.state.u)) and np.all(np.isfinite(step.reaction)) for step in result.steps)


@orders
@pytest.mark.parametrize("law, stretch", [(EightChainSilk(nu=0.6), 3.0), (YarnNetwork(), 3.0)], ids=["eight-chain", "yarns"])
def test_pulling_beyond_locking_ends_with_a_named_failure(order, law, stretch):
    problem = pulled(order, law, stretch)
    result = solve_static(problem, [1.0], NewtonOptions(max_iterations=25), initial_step=0.1, min_step=1e-4)
    assert not result.converged
    assert result.status in {"LockingReached", "Diverged", "StepTooSmall"}
    assert 0.0 < result.lam < 1.0 and "last converged state" in result.message
    assert finite(result)
    assert np.isfinite(problem.energy(result.state, result.lam))
    reaction = result.steps[-1].reaction[: problem.shell.alpha_offset].reshape(-1, 3)
    pull = reaction[problem.surface.nodes_of("right"), 0].sum()
    earlier = result.steps[1].reaction[: problem.shell.alpha_offset].reshape(-1, 3)[problem.surface.nodes_of("right"), 0].sum()
    assert pull > earlier > 0


@orders
def test_line_search_refuses_infinite_energy(order):
    """A force whose first full step leaves the admissible stretches far behind is still carried, below locking."""
    law = EightChainSilk(nu=0.6)
    surface = Surface.from_pattern(strip(0.1, 0.05, 4, 2), order)
    flat = Support(np.arange(len(surface.nodes)), (2,), by_node=True)
    problem = Problem(surface, fabric(law), [Hinge("left"), flat], [edge_load("right", (400.0, 0.0, 0.0))], bending=False)
    start = problem.start()
    g, data = problem.tangent(start, 1.0, True)
    from mfar_fem.solve.linear import LinearSolver

    u = start.u.copy()
    u[problem.free] += LinearSolver("superlu").factor(problem.free_block.matrix(data))(-g[problem.free])
    assert problem.energy(start.with_u(u), 1.0) == np.inf
    result = newton(problem, start, 1.0, NewtonOptions(max_iterations=200))
    assert result.converged and np.isfinite(problem.energy(result.state, 1.0))


def test_inadmissible_start_is_named():
    problem = pulled(1, EightChainSilk(nu=0.6), 2.0)
    u = problem.start().u.copy()
    u[:] = 0.0
    result = newton(problem, problem.start().with_u(u), 0.0)
    assert result.status == "inadmissible start" and result.iterations == 0


def test_iteration_limit_is_named_and_keeps_the_last_state():
    surface = Surface.from_pattern(strip(0.1, 0.05, 4, 1), 2)
    problem = Problem(surface, sheet(1e6, 0.0, 1e-4), [Clamp("left")], [edge_load("right", (0.0, 0.0, 1e-3))])
    result = solve_static(problem, 1, NewtonOptions(max_iterations=1, plain_iterations=1), min_step=0.3)
    assert not result.converged and result.status in {"Diverged", "StepTooSmall"}
    assert result.lam < 1.0 and finite(result)


def test_unsupported_sheet_under_load_does_not_raise():
    surface = Surface.from_pattern(strip(0.1, 0.05, 2, 1), 1)
    problem = Problem(surface, sheet(1e6, 0.0, 1e-4), [], [edge_load("right", (0.0, 0.0, 1e-3))])
    result = solve_static(problem, 1, NewtonOptions(max_iterations=5), min_step=0.3)
    assert not result.converged and finite(result)


@pytest.mark.parametrize("levels", [0, [], [np.nan]])
def test_bad_levels(levels):
    with pytest.raises(InputError, match="levels"):
        solve_static(pulled(1, EightChainSilk(), 1.1), levels)


def test_every_level_is_hit_and_energy_split_adds_up():
    surface = Surface.from_pattern(strip(0.1, 0.02, 6, 1), 2)
    problem = Problem(surface, sheet(1e7, 0.0, 1e-3), [Clamp("left")], [edge_load("right", (0.0, 0.0, 0.5))])
    result = solve_static(problem, [0.25, 0.5, 1.0])
    assert [step.lam for step in result.at_levels()][-3:] == [0.25, 0.5, 1.0]
    last = result.steps[-1]
    assert last.membrane_energy + last.bending_energy == pytest.approx(problem.shell.energy(last.state))
    assert last.bending_energy > 100 * last.membrane_energy > 0


def test_load_steps_do_not_change_the_answer():
    surface = Surface.from_pattern(strip(0.1, 0.02, 6, 1), 2)
    problem = Problem(surface, sheet(1e7, 0.0, 1e-3), [Clamp("left")], [edge_load("right", (0.0, 0.0, 0.5))])
    x = [problem.shell.positions(solve_static(problem, n).state) for n in (2, 5)]
    assert x[0] == pytest.approx(x[1], abs=1e-9)
