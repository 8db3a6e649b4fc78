"""Linear solvers of the Newton steps: sparse direct (SuperLU, PARDISO) and conjugate gradients with algebraic multigrid.

``direct`` is the default: a shell tangent is badly conditioned (thin sheets) and often indefinite. ``amg`` pays on many unknowns
with a positive tangent (short time steps); where it fails it falls back to ``direct`` and leaves a note. ``auto`` chooses
between the two by :func:`choose`, whose bounds were measured (:mod:`mfar_fem.benchmarks.linear_solvers`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import splu

from mfar_fem.errors import InputError, MissingDependencyError
from mfar_fem.solve.krylov import conjugate_gradients
from mfar_fem.solve.pardiso import find_mkl

METHODS = ("direct", "superlu", "pardiso", "amg", "auto")
LOOSEST, TIGHTEST = 1e-2, 1e-8
"""Bounds of the relative residual of an iterative solution within Newton's method."""
DISSECTED = 10_000
"""Unknowns from which SuperLU's order comes from nested dissection rather than from minimum degree."""


class SingularMatrixError(ArithmeticError):
    """The matrix could not be factorised."""


@dataclass(frozen=True)
class Layout:
    """What the unknowns of a matrix are.

    Attributes
    ----------
    positions : (m,) int array
        ``3 · node + component`` of the first m unknowns; the others are edge rotations.
    places : (n, 3) array
        Where the unknowns are on the reference surface, m.
    """

    positions: np.ndarray
    places: np.ndarray


class LinearSolver:
    """Solver of symmetric systems; keeps notes of what it had to do.

    ``iterations`` counts those of all iterative solutions, ``memory`` is what the last factorisation or hierarchy takes, bytes.

    Parameters
    ----------
    method : {'direct', 'superlu', 'pardiso', 'amg', 'auto'}
        ``direct`` takes PARDISO where it is installed (extra ``fast``), else SuperLU; ``auto`` is ``direct`` here, because only
        Newton's method knows the time step.
    near_nullspace : (n, k) array, optional
        Rigid-body modes for AMG.
    rtol : float
        Relative residual of the iterative solver.
    max_iterations : int
        Of the iterative solver, before it falls back to the direct one.
    cache : dict, optional
        Kept by the caller between solves of matrices with one pattern: elimination orders, PARDISO's symbolic factorisation and
        the multigrid hierarchy live there. It may be cleared at any time: nothing is lost but time. Solutions depend on it
        within rounding (direct) or the tolerance (AMG); clear it at a checkpoint if a resumed run is to take the same steps.
    layout : Layout, optional
        Lets SuperLU dissect the sheet, and AMG eliminate the rotations.
    adaptive : bool
        Tolerances of the iterative solver after Eisenstat and Walker (SIAM J. Sci. Comput. 17 (1996) 16, doi 10.1137/0917003, their
        choice 2): the right-hand sides are the residuals of a Newton iteration. ``rtol`` does not count then.
    """

    def __init__(self, method: str = "direct", near_nullspace: np.ndarray | None = None, rtol: float = 1e-8,
                 max_iterations: int = 500, cache: dict | None = None, layout: Layout | None = None, adaptive: bool = False):
        if method not in METHODS:
            raise InputError(f"unknown linear solver '{method}'; choose one of {', '.join(METHODS)}")
        if method in ("direct", "auto"):
            method = "pardiso" if _pardiso() is not None else "superlu"
        elif method == "pardiso" and _pardiso() is None:
            raise MissingDependencyError("linear solver 'pardiso' needs pypardiso: pip install 'mfar-fem[fast]' (x86-64)")
        self.method, self.near_nullspace, self.rtol, self.max_iterations = method, near_nullspace, rtol, max_iterations
        self.cache = {} if cache is None else cache
        self.layout, self.adaptive = layout, adaptive
        self.notes: list[str] = []
        self.iterations, self.memory = 0, 0
        self._last: tuple[float, float] | None = None
        self._failed = False

    def factor(self, A: csr_matrix) -> Callable[[np.ndarray], np.ndarray]:
        """Factorise (or set up) symmetric ``A``; the result solves for a right-hand side (n,) or (n, k).

        Raises
        ------
        SingularMatrixError
            If no solver can deal with the matrix.
        """
        if A.shape[0] == 0:
            return lambda b: b.copy()
        if self.method == "amg" and not self._failed:
            return self._amg(A)
        if self.method == "pardiso" or (self.method == "amg" and _pardiso() is not None):
            return self._pardiso_factor(A)
        return self._superlu(A)

    # -- direct ------------------------------------------------------------------------------------------------------------
    def _superlu(self, A: csr_matrix):
        """The order of elimination is kept for matrices of one pattern: it costs up to as much as the factorisation.

        The first matrix is factorised again in that order, so that its solution rounds like those of later ones (resumed runs).
        """
        from mfar_fem.solve.ordering import Reordered, nested_dissection

        order = self.cache.get("superlu")
        if order is None and self.layout is not None and A.shape[0] >= DISSECTED:
            order = self.cache["superlu"] = Reordered(A, nested_dissection(A, self.layout.places))
        if order is None or not order.fits(A):
            lu = factorise(csc_matrix((A.data, A.indices, A.indptr), shape=A.shape), "MMD_AT_PLUS_A")  # symmetric: its transpose
            if order is not None:  # another pattern than the usual one: contact between parts of the sheet
                self.memory = 12 * lu.nnz
                return lu.solve
            order = self.cache["superlu"] = Reordered(A, np.argsort(lu.perm_c))
        lu = factorise(order.matrix(A), "NATURAL")
        self.memory = 12 * lu.nnz
        return order.solver(lu.solve)

    def _pardiso_factor(self, A: csr_matrix):
        from mfar_fem.solve.pardiso import SymmetricPardiso

        solver = self.cache.get("pardiso")
        if solver is None or not solver.fits(A):
            solver = self.cache["pardiso"] = SymmetricPardiso(A)
        try:
            solve = solver.factor(A)
            self.memory = solver.memory
            return solve
        except ArithmeticError as error:
            raise SingularMatrixError(str(error)) from error

    # -- iterative ---------------------------------------------------------------------------------------------------------
    def _amg(self, A: csr_matrix):
        """Conjugate gradients; the hierarchy of an earlier matrix serves until it takes twice the iterations or so."""
        fallback: dict = {}

        def one(b):
            if "solve" not in fallback:
                x, reason = self._iterate(A, b)
                if x is not None:
                    return x
                self.notes.append(f"AMG-CG {reason}; direct solver used instead")
                self._failed = self.adaptive  # for the rest of this Newton solve
                fallback["solve"] = self._pardiso_factor(A) if _pardiso() is not None else self._superlu(A)
            return fallback["solve"](b)

        return lambda b: one(b) if b.ndim == 1 else np.column_stack([one(column) for column in np.ascontiguousarray(b.T)])

    def _iterate(self, A: csr_matrix, b: np.ndarray) -> tuple[np.ndarray | None, str]:
        """Solution, or None and the reason why there is none."""
        rtol = self._tolerance(b)
        digits = -np.log10(rtol)
        kept = self.cache.get("amg")
        if kept is not None and kept[0] == A.shape:
            _, preconditioner, per_digit = kept
            x, iterations, status = conjugate_gradients(A, b, preconditioner, rtol, int(2 * per_digit * max(digits, 4.0)) + 3)
            self.iterations += iterations
            if status == "converged":
                return x, ""
        try:
            preconditioner = self._preconditioner(A)
        except (ValueError, ArithmeticError, RuntimeError, np.linalg.LinAlgError) as error:
            return None, f"set-up failed ({error})"
        x, iterations, status = conjugate_gradients(A, b, preconditioner, rtol, self.max_iterations)
        self.iterations += iterations
        if status != "converged":
            self.cache.pop("amg", None)
            return None, f"did not converge ({status} after {iterations} iterations)"
        self.cache["amg"] = (A.shape, preconditioner, iterations / digits)
        return x, ""

    def _preconditioner(self, A: csr_matrix):
        from mfar_fem.solve.amg import ShellMultigrid, multigrid

        if self.layout is None or self.near_nullspace is None:
            cycle, self.memory = multigrid(A, self.near_nullspace)
            return cycle
        preconditioner = ShellMultigrid(A, self.layout.positions, self.near_nullspace)
        self.memory = preconditioner.memory
        return preconditioner

    def _tolerance(self, b: np.ndarray) -> float:
        """Relative residual to reach for this right-hand side."""
        if not self.adaptive:
            return self.rtol
        size, eta = float(np.linalg.norm(b)), LOOSEST
        if self._last is not None and self._last[0] > 0:
            eta = float(np.clip(0.9 * (size / self._last[0]) ** 2, TIGHTEST, LOOSEST))
        self._last = (size, eta)
        return eta


def factorise(matrix: csc_matrix, ordering: str):
    """SuperLU's factorisation of a symmetric matrix with pivots on the diagonal.

    Raises
    ------
    SingularMatrixError
        If the matrix cannot be factorised.
    """
    try:
        return splu(matrix, permc_spec=ordering, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from error


@cache
def _pardiso():
    find_mkl()
    try:
        from pypardiso import PyPardisoSolver
    except (ImportError, OSError):
        return None
    return PyPardisoSolver


def rigid_body_modes(shell, state) -> np.ndarray:
    """Rigid-body modes (n, 6) at a state: translations and rotations about the centroid, edge rotations included."""
    x = shell.positions(state)
    B = np.zeros((shell.n, 6))
    r = x - x.mean(axis=0)
    k = shell.alpha_offset
    for axis in range(3):
        e = np.eye(3)[axis]
        B[axis:k:3, axis] = 1.0
        B[:k, 3 + axis] = np.cross(e, r).ravel()
        if shell.with_bending:
            B[k:, 3 + axis] = -shell.edge_tangents(state) @ e
    return B


def negative_eigenvalues(A: csr_matrix) -> int:
    """Number of negative eigenvalues of a symmetric matrix, from the signs of its pivots (Sylvester's law of inertia).

    Raises
    ------
    SingularMatrixError
        If the matrix cannot be factorised.
    """
    lu = factorise(csc_matrix((A.data, A.indices, A.indptr), shape=A.shape), "MMD_AT_PLUS_A")
    if np.array_equal(lu.perm_r, lu.perm_c):
        return int(np.sum(lu.U.diagonal() < 0))
    from scipy.sparse.linalg import eigsh  # a pivot off the diagonal: look at the eigenvalues next to zero instead

    values = eigsh(A, k=min(12, A.shape[0] - 2), sigma=0.0, which="LM", return_eigenvectors=False)
    return int(np.sum(values < 0))
