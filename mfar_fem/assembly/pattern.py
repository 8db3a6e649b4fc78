"""The sparsity pattern of the tangent, computed once for a mesh; matrices are filled by index and never rebuilt."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_matrix, identity, vstack


class Pattern:
    """Symmetric CSR pattern of the union of element blocks.

    Parameters
    ----------
    n : int
        Number of unknowns.
    element_dofs : sequence of (ne_k, nd_k) int arrays
        Unknowns of the elements, one array a kind of energy; duplicates within a row are allowed.

    Attributes
    ----------
    positions : list of (ne_k, nd_k²) int32 arrays
        Where entry ``(i, j)`` of an element matrix (row-major) goes in ``data``.
    diagonal : (n,) int array
        Where the diagonal entries are.
    """

    def __init__(self, n: int, element_dofs: Sequence[np.ndarray]):
        from mfar_fem.assembly.pattern_kernels import locate

        blocks = [np.ascontiguousarray(dofs, dtype=np.int32) for dofs in element_dofs]
        incidence = vstack([identity(n, dtype=bool, format="csr"), *(_incidence(dofs, n) for dofs in blocks)], format="csr")
        union = incidence.T.tocsr() @ incidence
        union.sort_indices()
        self.n, self.nnz = n, union.nnz
        self.indices, self.indptr = union.indices.astype(np.int32, copy=False), union.indptr.astype(np.int32, copy=False)
        everyone = np.arange(n, dtype=np.int32)[:, None]
        self.diagonal, *self.positions = (np.empty((len(dofs), dofs.shape[1] ** 2), dtype=np.int32) for dofs in [everyone, *blocks])
        for dofs, out in zip([everyone, *blocks], [self.diagonal, *self.positions], strict=True):
            locate(dofs, self.indptr, self.indices, out)
        self.diagonal = self.diagonal[:, 0]

    @cached_property
    def _keys(self) -> np.ndarray:
        """``row · n + column`` of every entry, ascending."""
        rows = np.repeat(np.arange(self.n, dtype=np.int64), np.diff(self.indptr))
        return rows * self.n + self.indices

    def matrix(self, data: np.ndarray) -> csr_matrix:
        """CSR matrix (n, n) that shares the pattern's index arrays."""
        return csr_matrix((data, self.indices, self.indptr), shape=(self.n, self.n), copy=False)

    def scatter(self, rows: np.ndarray, columns: np.ndarray, values: np.ndarray, data: np.ndarray) -> list[tuple]:
        """Add matrix entries to ``data`` where the pattern has them; the others come back as ``[(rows, columns, values)]``."""
        if len(values) == 0:
            return []
        keys = np.asarray(rows, dtype=np.int64) * self.n + columns
        at = np.minimum(np.searchsorted(self._keys, keys), self.nnz - 1)
        inside = self._keys[at] == keys
        np.add.at(data, at[inside], values[inside])
        outside = ~inside
        return [(rows[outside], columns[outside], values[outside])] if outside.any() else []

    def sub(self, rows: np.ndarray, columns: np.ndarray) -> SubPattern:
        """Pattern of the block ``rows × columns`` (arrays of unknowns)."""
        return SubPattern(self, rows, columns)


class SubPattern:
    """A block of a :class:`Pattern`, extracted by one gather."""

    def __init__(self, pattern: Pattern, rows: np.ndarray, columns: np.ndarray):
        numbered = pattern.matrix(np.arange(1, pattern.nnz + 1, dtype=np.int64))
        block = numbered[rows][:, columns].tocsr()
        block.sort_indices()
        self.gather = block.data - 1
        self.indices, self.indptr, self.shape = block.indices, block.indptr, block.shape

    def matrix(self, data: np.ndarray) -> csr_matrix:
        """The block (CSR) of the matrix with the whole pattern's ``data``."""
        return csr_matrix((data[self.gather], self.indices, self.indptr), shape=self.shape, copy=False)


def _incidence(dofs: np.ndarray, n: int) -> csr_matrix:
    """Boolean matrix (ne, n): which unknowns an element has."""
    ends = np.arange(0, dofs.size + 1, dofs.shape[1], dtype=np.int32)
    return csr_matrix((np.ones(dofs.size, dtype=bool), dofs.ravel(), ends), shape=(len(dofs), n))
