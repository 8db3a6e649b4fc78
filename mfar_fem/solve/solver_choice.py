"""What the linear solvers need to know of a problem, and the rule behind ``linear_solver="auto"``."""

from __future__ import annotations

import numpy as np

from mfar_fem.solve.inertia import Inertia
from mfar_fem.solve.linear import Layout, _pardiso

FEWEST = {("superlu", 1): 30_000, ("superlu", 2): 100_000, ("pardiso", 1): 100_000, ("pardiso", 2): 300_000}
"""Unknowns from which AMG is faster, by direct solver and order, as measured in steps of up to :data:`LONGEST` edges."""
LONGEST = 150.0
RULE = (f"'auto' takes AMG in steps in which a membrane wave passes at most {LONGEST:g} nodes, from "
        + ", ".join(f"{n} unknowns at order {order} ({direct})" for (direct, order), n in FEWEST.items()) + "; else 'direct'")


def choose(unknowns: int, travel: float, order: int, direct: str | None = None) -> str:
    """Linear solver, ``amg`` or ``direct``, by the crossover that :mod:`mfar_fem.benchmarks.linear_solvers` measures.

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
    return "amg" if unknowns >= FEWEST[direct, order] and travel <= LONGEST else "direct"


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
