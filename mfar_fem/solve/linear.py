"""Linear solvers of the Newton steps: sparse direct (SuperLU, PARDISO) and AMG-preconditioned conjugate gradients.

``direct`` is the default: a shell tangent is badly conditioned (thin sheets) and often indefinite. ``amg`` pays on many unknowns
with a positive tangent (tension, short time steps); where it fails it falls back to ``direct`` and leaves a note.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix
from scipy.sparse.linalg import cg, splu

from mfar_fem.errors import InputError, MissingDependencyError

METHODS = ("direct", "superlu", "pardiso", "amg")


class SingularMatrixError(ArithmeticError):
    """The matrix could not be factorised."""


class LinearSolver:
    """Solver of symmetric systems; keeps notes of what it had to do.

    Parameters
    ----------
    method : {'direct', 'superlu', 'pardiso', 'amg'}
        ``direct`` takes PARDISO where it is installed (extra ``fast``), else SuperLU.
    near_nullspace : (n, k) array, optional
        Rigid-body modes for AMG.
    rtol : float
        Relative residual of the iterative solver.
    max_iterations : int
        Of the iterative solver, before it falls back to the direct one.
    cache : dict, optional
        Kept by the caller between solves of matrices with one pattern: PARDISO's symbolic factorisation lives there.
    """

    def __init__(self, method: str = "direct", near_nullspace: np.ndarray | None = None, rtol: float = 1e-8,
                 max_iterations: int = 500, cache: dict | None = None):
        if method not in METHODS:
            raise InputError(f"unknown linear solver '{method}'; choose one of {', '.join(METHODS)}")
        if method == "direct":
            method = "pardiso" if _pardiso() is not None else "superlu"
        elif method == "pardiso" and _pardiso() is None:
            raise MissingDependencyError("linear solver 'pardiso' needs pypardiso: pip install 'mfar-fem[fast]' (x86-64)")
        self.method, self.near_nullspace, self.rtol, self.max_iterations = method, near_nullspace, rtol, max_iterations
        self.cache = {} if cache is None else cache
        self.notes: list[str] = []
        self.iterations = 0

    def factor(self, A: csr_matrix) -> Callable[[np.ndarray], np.ndarray]:
        """Factorise (or set up) symmetric ``A``; the result solves for a right-hand side (n,) or (n, k).

        Raises
        ------
        SingularMatrixError
            If no solver can deal with the matrix.
        """
        if A.shape[0] == 0:
            return lambda b: b.copy()
        if self.method == "amg":
            return self._amg(A)
        return self._pardiso_factor(A) if self.method == "pardiso" else self._superlu(A)

    def _superlu(self, A: csr_matrix):
        matrix = csc_matrix((A.data, A.indices, A.indptr), shape=A.shape)  # symmetric: the transpose is the matrix
        try:
            lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from error
        return lu.solve

    def _pardiso_factor(self, A: csr_matrix):
        from mfar_fem.solve.pardiso import SymmetricPardiso

        solver = self.cache.get("pardiso")
        if solver is None or not solver.fits(A):
            solver = self.cache["pardiso"] = SymmetricPardiso(A)
        try:
            return solver.factor(A)
        except ArithmeticError as error:
            raise SingularMatrixError(str(error)) from error

    def _amg(self, A: csr_matrix):
        import pyamg

        state: dict = {}

        def fallback(b, reason):
            if "direct" not in state:
                self.notes.append(f"AMG-CG {reason}; direct solver used instead")
                state["direct"] = self._superlu(A)
            return state["direct"](b)

        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                ml = pyamg.smoothed_aggregation_solver(A, B=self.near_nullspace, strength=("symmetric", {"theta": 0.0}),
                                                       smooth=("energy", {"krylov": "cg", "maxiter": 4}), max_coarse=300)
                preconditioner = ml.aspreconditioner(cycle="V")
        except (ValueError, ArithmeticError, np.linalg.LinAlgError) as error:
            reason = f"set-up failed ({error})"
            return lambda b: fallback(b, reason)

        def solve(b):
            if "direct" in state:
                return state["direct"](b)
            counter = [0]

            def count(_):
                counter[0] += 1

            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                x, info = cg(A, b, rtol=self.rtol, atol=0.0, maxiter=self.max_iterations, M=preconditioner, callback=count)
            self.iterations += counter[0]
            if info != 0 or not np.all(np.isfinite(x)) or b @ x < 0:
                return fallback(b, f"did not converge in {counter[0]} iterations")
            return x

        return solve


@cache
def _pardiso():
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
    matrix = csc_matrix((A.data, A.indices, A.indptr), shape=A.shape)
    try:
        lu = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from error
    if np.array_equal(lu.perm_r, lu.perm_c):
        return int(np.sum(lu.U.diagonal() < 0))
    from scipy.sparse.linalg import eigsh  # a pivot off the diagonal: look at the eigenvalues next to zero instead

    values = eigsh(A, k=min(12, A.shape[0] - 2), sigma=0.0, which="LM", return_eigenvectors=False)
    return int(np.sum(values < 0))
