"""PARDISO for symmetric indefinite matrices of one pattern: the symbolic factorisation is made once and reused (extra ``fast``)."""

from __future__ import annotations

import os
import sys
import weakref
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix

SYMMETRIC_INDEFINITE = -2
ANALYSE, FACTORISE, SOLVE = 11, 22, 33


def find_mkl() -> None:
    """Tell pypardiso where the MKL is, if it lies where pip puts it: else it walks through the whole environment, for seconds."""
    if "PYPARDISO_MKL_RT" in os.environ:
        return
    for folder in (Path(sys.prefix) / "lib", Path(sys.prefix) / "Library" / "bin"):
        found = sorted(folder.glob("*mkl_rt*"), key=lambda path: len(path.name))
        if found:
            os.environ["PYPARDISO_MKL_RT"] = str(found[0])
            return


class SymmetricPardiso:
    """Factorisations of symmetric matrices that share the pattern of ``A``; only the upper triangle is used."""

    def __init__(self, A: csr_matrix):
        os.environ.setdefault("KMP_BLOCKTIME", "1")  # ms; MKL's idle threads would spin for 200 and hold up the element loops
        find_mkl()
        from pypardiso import PyPardisoSolver

        self._indices, self._indptr = A.indices, A.indptr
        rows = np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))
        self._upper = np.flatnonzero(A.indices >= rows)
        counts = np.bincount(rows[self._upper], minlength=A.shape[0])
        self._triangle = (A.indices[self._upper].astype(np.int32), np.concatenate([[0], np.cumsum(counts)]).astype(np.int32))
        self._solver = PyPardisoSolver(mtype=SYMMETRIC_INDEFINITE)
        os.environ.setdefault("PYPARDISO_MKL_RT", self._solver.libmkl._name)  # else every instance searches the disk for it
        for parameter, value in ((1, 1), (2, 2), (8, 0), (10, 13), (11, 1), (13, 1), (24, 0)):
            self._solver.set_iparm(parameter, value)
        self._analysed = False
        weakref.finalize(self, self._solver.free_memory, everything=True)

    def fits(self, A: csr_matrix) -> bool:
        """Whether ``A`` has the pattern that was analysed."""
        same = A.indices is self._indices and A.indptr is self._indptr
        return same or (np.array_equal(A.indptr, self._indptr) and np.array_equal(A.indices, self._indices))

    @property
    def memory(self) -> int:
        """Bytes that the analysis and the factors take."""
        return 1024 * (int(self._solver.get_iparm(16)) + int(self._solver.get_iparm(17)))

    def factor(self, A: csr_matrix) -> Callable[[np.ndarray], np.ndarray]:
        """Factorise; the result solves for (n,) or (n, k). It is valid until the next call.

        Raises
        ------
        ArithmeticError
            If PARDISO reports an error (zero pivot).
        """
        from pypardiso.pardiso_wrapper import PyPardisoError

        upper = csr_matrix((A.data[self._upper], *self._triangle), shape=A.shape, copy=False)
        zero = np.zeros(A.shape[0])
        try:
            if not self._analysed:
                self._call(ANALYSE, upper, zero)
                self._analysed = True
            self._call(FACTORISE, upper, zero)
        except PyPardisoError as error:
            raise ArithmeticError(f"PARDISO: {error}") from error
        return lambda b: self._call(SOLVE, upper, np.asfortranarray(b, dtype=float))

    def _call(self, phase: int, matrix: csr_matrix, b: np.ndarray) -> np.ndarray:
        self._solver.set_phase(phase)
        return self._solver._call_pardiso(matrix, b)
