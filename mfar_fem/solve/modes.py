r"""Small vibrations: natural frequencies and modes of a sheet about an equilibrium, by the tangent and the mass.

Edge rotations have no mass: they follow the positions. The eigenvalue problem :math:`K\varphi = \omega^2 M\varphi` is therefore one
of the positions alone, with the condensed stiffness; its inverse is what a solve with the whole tangent gives on the positions, so
that nothing is condensed in fact (shift-invert Lanczos, ARPACK).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigsh

from mfar_fem.errors import InputError, NotConvergedError
from mfar_fem.shell import State
from mfar_fem.solve.linear import LinearSolver, SingularMatrixError
from mfar_fem.solve.mass import Mass
from mfar_fem.solve.problem import InadmissibleStateError, Problem

SHIFT = 1e-10
"""Shift in units of the largest ratio of stiffness to mass: the tangent of a sheet with free rigid motions is singular."""


def natural_frequencies(problem: Problem, state: State, mass: Mass, count: int = 6,
                        lam: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The ``count`` frequencies nearest to zero, and their modes.

    Parameters
    ----------
    problem : Problem
        Its supports hold the sheet, its loads act (dead ones by the stress they cause, others by their stiffness too). Inertia,
        drag, damping and contact of a :class:`mfar_fem.solve.dynamics.Dynamics` are left out.
    state : State
        An equilibrium (:func:`mfar_fem.solve.solve_static`), else the result means nothing.
    mass : Mass
    count : int
        Below the number of free position unknowns.
    lam : float
        Load factor of ``state``.

    Returns
    -------
    omega : (count,) array
        Angular frequencies, rad/s, ascending. Negative: an unstable mode that grows like ``exp(|omega| t)``. Free rigid motions
        come out as zero, that is as the root of rounding errors.
    modes : (n, count) array
        Columns: positions (of unit generalised mass ``φᵀ M φ = 1 kg``, that is dimensionless) and rotations; zero where held.

    Raises
    ------
    InputError
        ``count`` out of range, or an inadmissible state.
    NotConvergedError
        The tangent is singular beyond the shift, or the iteration did not converge.
    """
    quiet = _without_dynamics(problem)
    viscosity, quiet.shell.viscosity = quiet.shell.viscosity, None
    try:
        _, data = quiet.tangent(state, lam, True)
    except InadmissibleStateError as error:
        raise InputError(f"no vibration about an inadmissible state: {error}") from error
    finally:
        quiet.shell.viscosity = viscosity
    free, n_x = quiet.free, quiet.shell.alpha_offset
    K, M = quiet.free_block.matrix(data).tocsr(), _mass_matrix(quiet, mass)
    n = int(np.sum(free < n_x))  # positions come first
    if not 0 < count < n:
        raise InputError(f"the number of modes must lie between 1 and {n - 1} (free position unknowns less one), got {count}")
    shift = SHIFT * float((np.abs(K.diagonal()[:n]) / M.diagonal()[:n]).max())
    solve = _solver(K, M, shift)

    def respond(f):  # displacements and rotations under forces on the positions
        return solve(np.concatenate([f, np.zeros(len(free) - n)]))

    operator = LinearOperator((n, n), matvec=lambda f: respond(f)[:n], dtype=float)
    first = np.random.default_rng(0).standard_normal(n)
    try:
        values, vectors = eigsh(K[:n, :n], k=count, M=M[:n, :n], sigma=-shift, OPinv=operator, which="LM", v0=first)
    except ArpackNoConvergence as error:
        raise NotConvergedError(f"{len(error.eigenvalues)} of {count} modes converged") from error
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    modes = np.zeros((quiet.n, count))
    for column, value, vector in zip(modes.T, values, vectors.T, strict=True):
        column[free] = respond((value + shift) * (M[:n, :n] @ vector))
    return np.sign(values) * np.sqrt(np.abs(values)), modes


def _without_dynamics(problem: Problem) -> Problem:
    other = object.__new__(type(problem))
    other.__dict__.update(problem.__dict__)
    other.loads = tuple(load for load in problem.loads if not getattr(load, "internal", False))
    return other


def _solver(K: csr_matrix, M: csr_matrix, shift: float):
    try:
        return LinearSolver("superlu").factor((K + shift * M).tocsr())
    except SingularMatrixError as error:
        raise NotConvergedError(f"the tangent is singular beyond its rigid motions: {error}") from error


def _mass_matrix(problem: Problem, mass: Mass) -> csr_matrix:
    """Mass of the free unknowns, rotations (without any) included."""
    elements = problem.surface.elements
    size = elements.shape[1]
    rows, columns = np.repeat(elements, size, axis=1).ravel(), np.tile(elements, (1, size)).ravel()
    axes = np.arange(3)[:, None]
    entries = (np.tile(mass.blocks.ravel(), 3), ((3 * rows + axes).ravel(), (3 * columns + axes).ravel()))
    return coo_matrix(entries, shape=(problem.n, problem.n)).tocsr()[problem.free][:, problem.free]
