"""Equilibrium at a prescribed volume: the pressure is the unknown, so that a pressure maximum is passed without trouble."""

from __future__ import annotations

import numpy as np

from mfar_fem.errors import NotConvergedError
from mfar_fem.loads import Pressure
from mfar_fem.shell import State
from mfar_fem.solve import Problem
from mfar_fem.solve.linear import LinearSolver, SingularMatrixError
from mfar_fem.solve.problem import InadmissibleStateError


def at_volume(problem: Problem, load: Pressure, volume: float, state: State, factor: float, rtol: float = 1e-9,
              max_iterations: int = 40) -> tuple[State, float, int]:
    """State and load factor at which the sheet encloses ``volume`` (m³), by Newton's method on both.

    Parameters
    ----------
    problem : Problem
        With ``load`` among its loads (``ramp=True``) and a boundary on which the volume is defined (held, or on planes through the
        origin).
    state, factor : State, float
        Start.

    Returns
    -------
    state, factor, iterations

    Raises
    ------
    NotConvergedError
    """
    solver, free = LinearSolver("direct", cache=problem.linear_cache), problem.free
    for iteration in range(max_iterations):
        slope = np.zeros(problem.n)
        load.gradient(problem.shell, state, 1.0, slope)
        slope /= -load.pressure  # gradient of the volume
        now = -load.energy(problem.shell, state, 1.0) / load.pressure
        try:
            g, data = problem.tangent(state, factor, True)
            factorised = solver.factor(problem.system(data))
        except (InadmissibleStateError, SingularMatrixError) as error:
            raise NotConvergedError(f"volume {volume:.6g} m³: {error}") from error
        residual = np.linalg.norm(g[free])
        if residual <= rtol * abs(factor * load.pressure) * np.linalg.norm(slope[free]) and abs(now - volume) <= rtol * volume:
            return state, factor, iteration
        by_residual, by_pressure = factorised(-g[free]), factorised(load.pressure * slope[free])
        change = (volume - now - slope[free] @ by_residual) / (slope[free] @ by_pressure)
        u = state.u.copy()
        u[free] += by_residual + change * by_pressure
        state, factor = state.with_u(u), factor + change
        if not np.all(np.isfinite(u)):
            break
    raise NotConvergedError(f"volume {volume:.6g} m³ was not reached in {max_iterations} iterations")
