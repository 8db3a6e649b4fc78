r"""Exact sensitivities of an equilibrium with respect to material parameters.

At equilibrium the residual vanishes on the free unknowns, :math:`R_f(u(θ), θ) = 0`, so that :math:`K_{ff}\,du_f/dθ = -∂R_f/∂θ` with
the converged exact tangent, factorised once for all parameters, and the reactions change by
:math:`dR_c/dθ = ∂R_c/∂θ + K_{cf}\,du_f/dθ`. The result does not depend on the load steps that led to the state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError
from mfar_fem.shell import State
from mfar_fem.shell import kernels as shell_kernels
from mfar_fem.shell.geometry import bending_factors
from mfar_fem.solve.linear import LinearSolver
from mfar_fem.solve.problem import Problem

BENDING = {
    "warp": (((1.0, 0.0, 0.0), 1.0),),
    "weft": (((0.0, 1.0, 0.0), 1.0),),
    "twist": (((0.0, 0.0, 1.0), 1.0),),
    "coupling": (((1.0, 1.0, 0.0), 0.5), ((1.0, -1.0, 0.0), -0.5)),
}
"""dD/dθ of the bending parameters as a sum of ``weight · v vᵀ``."""


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives at an equilibrium; ``p`` parameters.

    Attributes
    ----------
    names : tuple of str
        ``law.<name>`` or ``bending.<name>``.
    state : (n, p) array
        du/dθ, zero on held unknowns (unit of u per unit of the parameter).
    reaction : (n, p) array
        Derivative of the reactions, zero on free unknowns.
    """

    names: tuple[str, ...]
    state: np.ndarray
    reaction: np.ndarray


def residual_sensitivity(problem: Problem, state: State, names: Sequence[str]) -> np.ndarray:
    """Partial derivative of the gradient (n, p) with respect to parameters ``law.<name>`` or ``bending.<name>``."""
    shell = problem.shell
    out = np.zeros((problem.n, len(names)))
    law = [n for n in names if n.startswith("law.")]
    if law and shell.with_membrane:
        C = shell.right_cauchy_green(state)
        dS = shell.fabric.law.stress_sensitivity(C.reshape(-1, 3), [n.removeprefix("law.") for n in law])
        dS = shell.fabric.membrane_scale * dS.reshape(*C.shape, len(law))
    for column, name in enumerate(names):
        kind, _, parameter = name.partition(".")
        g = np.zeros(problem.n)
        if kind == "law":
            if shell.with_membrane:
                _gradient(shell, state, g, S=dS[..., law.index(name)])
        elif kind == "bending" and parameter in BENDING:
            if shell.with_bending:
                for vector, weight in BENDING[parameter]:
                    part = np.zeros(problem.n)
                    R = bending_factors(shell.surface, shell.fabric.bending.matrix, np.asarray(vector))
                    _gradient(shell, state, part, R=R)
                    g += weight * part
        else:
            raise ParameterError(f"unknown parameter '{name}'; write law.<name> or bending.{'|'.join(BENDING)}")
        out[:, column] = g
    return out


def _gradient(shell, state: State, out: np.ndarray, S=None, R=None) -> None:
    """Membrane gradient with the stress ``S``, or bending gradient with the factors ``R``."""
    g, t = shell.geometry, shell.geometry.tables
    membrane = S is not None
    S = np.ascontiguousarray(S) if membrane else np.zeros((*g.area_weights.shape, 3))
    R_interior, R_edge = (g.R_interior, g.R_edge) if R is None else R
    alpha = shell.alpha(state) if shell.with_bending else np.zeros(1)
    directors = state.directors if shell.with_bending else np.zeros((1, 3))
    shell_kernels.assemble(shell_kernels.SHAPES[t.order], shell.positions(state), alpha, directors, shell.surface.elements,
                           g.edge_director, g.edge_sign, t.dN, t.second, t.edge_dN, t.edge_ds, t.mean, t.interpolation, g.push,
                           g.area_weights, S, S, np.zeros((1, 1, 3, 3)), membrane, not membrane, R_interior, R_edge,
                           g.c0_interior, g.c0_edge, True, False, shell.alpha_offset, np.zeros((1, 1), dtype=np.int32), out,
                           np.zeros(0))


def sensitivity(problem: Problem, state: State, lam: float, names: Sequence[str], linear_solver: str = "direct") -> Sensitivity:
    """Sensitivities of the equilibrium ``state`` at load factor ``lam``.

    Parameters
    ----------
    problem : Problem
    state : State
        Converged; the sensitivities are as exact as it is.
    names : sequence of str
        ``law.<parameter>`` or ``bending.warp|weft|twist|coupling``; derivatives per SI unit of the parameter.

    Raises
    ------
    ParameterError
        For an unknown parameter.
    SingularMatrixError
        At a limit or bifurcation point.
    """
    names = tuple(names)
    partial = residual_sensitivity(problem, state, names)
    _, data = problem.tangent(state, lam, True)
    solve = LinearSolver(linear_solver).factor(problem.free_block.matrix(data))
    du = np.zeros_like(partial)
    if len(problem.free):
        du[problem.free] = np.column_stack([solve(np.ascontiguousarray(-c)) for c in partial[problem.free].T]) \
            if names else np.zeros((len(problem.free), 0))
    reaction = np.zeros_like(partial)
    K = problem.coupling_block.matrix(data)
    reaction[problem.fixed] = partial[problem.fixed] + K.T @ du[problem.free]
    return Sensitivity(names, du, reaction)
