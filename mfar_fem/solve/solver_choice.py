"""What the linear solvers need to know of a problem, and the rule behind ``linear_solver="auto"``."""

from __future__ import annotations

import numpy as np

from mfar_fem.solve.inertia import Inertia
from mfar_fem.solve.linear import Layout, _pardiso

FEWEST, LONGEST = 50_000, 60.0
"""Free unknowns from which, and nodes a step up to which, AMG is faster than SuperLU at order 1.

Measured on one core in whole time steps of hanging silk charmeuse, CPU seconds a step, AMG : SuperLU : PARDISO. Order 1:
30k unknowns, 0.5 ms 0.4 : 0.4 : -, 2 ms 1.0 : 0.8 : -; 100k, 0.5 ms 1.2 : 1.7 : 0.8, 2 ms 2.7 : 2.3 : 1.0;
300k, 0.5 ms 4.2 : 9.1 : 4.1, 2 ms 8.7 : - : 6.0. Order 2: 100k, 0.5 ms 3.1 : 2.5 : 1.2. Long steps start where the tangent is
indefinite, and AMG falls back.
"""
RULE = (f"'auto' takes AMG at order 1 without PARDISO from {FEWEST} unknowns in steps in which a membrane wave passes at most "
        f"{LONGEST:g} nodes; else 'direct'")


def choose(unknowns: int, travel: float, order: int, direct: str | None = None) -> str:
    """Linear solver, ``amg`` or ``direct``, by the measured crossover (:data:`FEWEST`).

    Parameters
    ----------
    unknowns : int
    travel : float
        Edges that a membrane wave passes in a time step (:func:`wave_travel`): the square is the stiffness over the inertia.
    order : int
    direct : {'superlu', 'pardiso'}, optional
        The direct solver at hand; default: what is installed.
    """
    direct = direct or ("pardiso" if _pardiso() is not None else "superlu")
    pays = direct == "superlu" and order == 1 and unknowns >= FEWEST and travel <= LONGEST
    return "amg" if pays else "direct"


def wave_travel(problem) -> float:
    """Distance between nodes that a membrane wave passes in the present time step, as a number of them; infinite in statics."""
    for load in problem.loads:
        if isinstance(load, Inertia) and load.factor > 0 and problem.shell.with_membrane:
            fabric = problem.shell.fabric
            stiffness = fabric.membrane_scale * float(np.abs(np.diag(np.atleast_2d(fabric.law.tangent_at_rest()))).max())
            spacing = problem.rotation_length / problem.surface.order
            return float(np.sqrt(stiffness / (load.areal_density * load.factor)) / spacing)
    return np.inf


def layout(problem) -> Layout:
    """Layout of the free unknowns of a problem, computed once."""
    if "layout" not in problem.linear_cache:
        surface, free, k = problem.surface, problem.free, problem.shell.alpha_offset
        places = [np.repeat(surface.nodes, 3, axis=0)]
        if problem.shell.with_bending:
            places.append(np.repeat(surface.vertices[surface.edges].mean(axis=1), surface.order, axis=0))
        problem.linear_cache["layout"] = Layout(free[free < k], np.concatenate(places)[free])
    return problem.linear_cache["layout"]
