"""Load levels by descent of the energy alone, for paths that snap: no branch is followed, each level rolls to a minimum.

The descent is stopped every few iterations to move the directors along (``accept``): parts that fall over would otherwise turn too
far from the directors their rotations are measured from.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from mfar_fem.result import LoadStep, StaticResult
from mfar_fem.solve import NewtonOptions, Problem
from mfar_fem.solve.newton import newton


def solve_downhill(problem: Problem, levels: Sequence[float], leg: int = 20, legs: int = 30, progress=None) -> StaticResult:
    """Minimise the potential at one load level after the other.

    Parameters
    ----------
    problem : Problem
        Conservative.
    levels : sequence of float
    leg : int
        Iterations between two renewals of the directors.
    legs : int
        At most, at one level.
    progress : callable, optional

    Returns
    -------
    StaticResult
        The steps are equilibria; those that were not reached are absent and the status is ``Diverged``.
    """
    clock, state = time.perf_counter(), problem.start()
    totals: dict[str, Any] = {"iterations": 0, "assemblies": 0, "assembly": 0.0, "solve": 0.0}
    steps, notes, wasted, result = [], [], 0, None
    for level in levels:
        used = 0
        for k in range(legs):
            result = newton(problem, state, level, NewtonOptions(plain_iterations=8 if k == 0 else 0, max_iterations=leg))
            state = problem.shell.accept(result.state)
            used += result.iterations
            totals["assemblies"] += result.assemblies
            totals["assembly"] += result.assembly_s
            totals["solve"] += result.solve_s
            notes += result.notes
            if result.converged:
                break
        assert result is not None
        if not result.converged:
            wasted += used
            break
        totals["iterations"] += used
        g = problem.gradient(state, level)
        reaction = np.zeros_like(g)
        reaction[problem.fixed] = g[problem.fixed]
        steps.append(LoadStep(float(level), state, used, result.residual, result.residual_relative,
                              *problem.shell.energies(state), reaction))
        if progress is not None:
            progress(level)
    converged = len(steps) == len(levels)
    if not steps:  # nothing reached: the start is all there is
        start = problem.start()
        steps = [LoadStep(0.0, start, 0, 0.0, 0.0, *problem.shell.energies(start), np.zeros(problem.n))]
    message = "equilibrium reached at every level" if converged else f"Diverged after load factor {steps[-1].lam:.6g}"
    timings = {"assembly": totals["assembly"], "solve": totals["solve"], "total": time.perf_counter() - clock}
    return StaticResult(converged, "converged" if converged else "Diverged", message, tuple(steps), totals["iterations"], wasted,
                        totals["assemblies"], timings, tuple(dict.fromkeys(notes)))
