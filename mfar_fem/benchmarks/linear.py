"""One linear step from the reference state: what a small-displacement benchmark asks for, free of any load fraction."""

from __future__ import annotations

import time

import numpy as np

from mfar_fem.result import LoadStep, StaticResult
from mfar_fem.solve.linear import LinearSolver
from mfar_fem.solve.problem import Problem


def solve_linear(problem: Problem) -> StaticResult:
    """Displacements under the whole load by the tangent at rest; held unknowns stay where they are.

    Returns
    -------
    StaticResult
        Its one step has the linear displacements *added to the reference positions*; energies are those of the linear
        problem (``½ f·u`` in all, not split) and the residual is that of the linear system.
    """
    start = problem.start()
    clock = time.perf_counter()
    g, data = problem.tangent(start, 1.0, True)
    assembled = time.perf_counter()
    K, f = problem.free_block.matrix(data), -g[problem.free]
    du = LinearSolver().factor(K)(f)
    done = time.perf_counter()
    u = start.u.copy()
    u[problem.free] += du
    residual = float(np.linalg.norm(K @ du - f))
    reaction = np.zeros_like(u)
    reaction[problem.fixed] = problem.coupling_block.matrix(data).T @ du + g[problem.fixed]
    step = LoadStep(1.0, start.with_u(u), 1, residual, residual / float(np.linalg.norm(f)), 0.5 * float(f @ du), 0.0, reaction)
    timings = {"assembly": assembled - clock, "solve": done - assembled, "total": done - clock}
    return StaticResult(True, "converged", "linear system solved", (step,), 1, 0, 1, timings, ())
