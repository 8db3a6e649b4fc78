r"""Algebraic multigrid for shells: the edge rotations are eliminated, the positions get smoothed aggregation with rigid modes.

With positions x and rotations α the tangent is factorised by blocks,

.. math:: \begin{pmatrix} K_{xx} & K_{x\alpha} \\ K_{\alpha x} & K_{\alpha\alpha} \end{pmatrix}, \qquad
          S = K_{xx} - K_{x\alpha} K_{\alpha\alpha}^{-1} K_{\alpha x} .

:math:`K_{\alpha\alpha}` couples edges of one element only, so its factorisation is cheap and done exactly. The multigrid works on S
with :math:`K_{\alpha\alpha}` lumped to its absolute row sums: sparse, and never softer than S, hence positive where S is. The
aggregates consist of nodes (blocks of three), the smoother is block Gauss–Seidel, the interpolation minimises energy (Mandel,
Brezina, Vaněk, Computing 62 (1999) 205; Vaněk, Mandel, Brezina, Computing 56 (1996) 179). Multigrid by pyamg.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
from scipy.sparse import bsr_matrix, coo_matrix, csr_matrix, diags, identity
from scipy.sparse.linalg import splu

from mfar_fem.solve.linear import factorise

Operator = Callable[[np.ndarray], np.ndarray]


def multigrid(A, modes: np.ndarray | None) -> tuple[Operator, int]:
    """One V-cycle of smoothed aggregation as a preconditioner, and the bytes that its matrices take.

    ``A`` may be a block matrix; ``modes`` (n, k) is its near null space.

    Raises
    ------
    ValueError, ArithmeticError, numpy.linalg.LinAlgError
        If the hierarchy cannot be built.
    """
    import pyamg

    smoother = "block_gauss_seidel" if isinstance(A, bsr_matrix) else "gauss_seidel"
    before, after = (smoother, {"sweep": "forward"}), (smoother, {"sweep": "backward"})
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        ml = pyamg.smoothed_aggregation_solver(A, B=modes, strength=("symmetric", {"theta": 0.0}), max_coarse=300,
                                               smooth=("energy", {"krylov": "cg", "maxiter": 4}), presmoother=before,
                                               postsmoother=after)
    levels = ml.levels
    coarsest = levels[-1].A.tocsc()
    shift = 1e-12 * float(np.abs(coarsest.diagonal()).mean())  # aggregates of few nodes do not have all the modes
    coarsest = splu(coarsest + shift * identity(coarsest.shape[0], format="csc"))

    def cycle(b: np.ndarray, level: int) -> np.ndarray:
        if level == len(levels) - 1:
            return coarsest.solve(b)
        here, x = levels[level], np.zeros_like(b)
        here.presmoother(here.A, x, b)
        x += here.P @ cycle(here.R @ (b - here.A @ x), level + 1)
        here.postsmoother(here.A, x, b)
        return x

    stored = [levels[0].A] + [matrix for here in levels[:-1] for matrix in (here.P, here.R)] + [here.A for here in levels[1:]]
    return lambda b: cycle(b, 0), sum(matrix.data.nbytes + matrix.indices.nbytes for matrix in stored) + 12 * coarsest.nnz


class ShellMultigrid:
    """Preconditioner of a shell tangent.

    Parameters
    ----------
    A : (n, n) sparse matrix
        Symmetric; positions first, rotations after them.
    positions : (m,) int array
        Which component of which node each of the first unknowns is: ``3 · node + component`` (held ones are missing).
    modes : (n, k) array
        Rigid-body modes.

    Attributes
    ----------
    memory : int
        Bytes of the hierarchy and of the factorised rotations.
    """

    def __init__(self, A: csr_matrix, positions: np.ndarray, modes: np.ndarray):
        m = self.m = len(positions)
        self._coupling = A[:m, m:].tocsr()
        self._transposed = self._coupling.T.tocsr()
        S = A[:m, :m]
        if m < A.shape[0]:
            rotations = A[m:, m:].tocsr()
            self._rotations = factorise(rotations.tocsc(), "MMD_AT_PLUS_A")
            lumped = np.asarray(abs(rotations).sum(axis=1)).ravel()
            S = S - self._coupling @ diags(1.0 / lumped) @ self._transposed
        nodes, block = np.unique(positions // 3, return_inverse=True)
        self._places, self._size = 3 * block + positions % 3, 3 * len(nodes)
        padded_modes = np.zeros((self._size, modes.shape[1]))
        padded_modes[self._places] = modes[:m] / np.linalg.norm(modes[:m], axis=0)
        self._cycle, self.memory = multigrid(self._blocks(S), padded_modes)
        if m < A.shape[0]:
            self.memory += 12 * (self._rotations.nnz + 2 * self._coupling.nnz)

    def _blocks(self, S) -> bsr_matrix:
        """The matrix in 3 × 3 blocks; held components get a diagonal entry of their own."""
        S = coo_matrix(S)
        missing = np.setdiff1d(np.arange(self._size), self._places)
        scale = float(np.abs(S.diagonal()).mean())
        rows, columns = (np.concatenate([self._places[ids], missing]) for ids in (S.row, S.col))
        values = np.concatenate([S.data, np.full(len(missing), scale)])
        return coo_matrix((values, (rows, columns)), shape=(self._size, self._size)).tobsr((3, 3))

    def __call__(self, r: np.ndarray) -> np.ndarray:
        """Approximate solution (n,) for a right-hand side (n,)."""
        m, padded = self.m, np.zeros(self._size)
        if m == len(r):
            padded[self._places] = r
            return self._cycle(padded)[self._places]
        rotations = self._rotations.solve(r[m:])
        padded[self._places] = r[:m] - self._coupling @ rotations
        x = self._cycle(padded)[self._places]
        return np.concatenate([x, rotations - self._rotations.solve(self._transposed @ x)])
