"""The sparsity pattern of the tangent, computed once for a mesh; matrices are filled by index and never rebuilt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_matrix


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
        keys = [np.arange(n, dtype=np.int64) * (n + 1)]
        for dofs in element_dofs:
            dofs = np.asarray(dofs, dtype=np.int64)
            keys.append((dofs[:, :, None] * n + dofs[:, None, :]).reshape(-1))
        sizes = [len(k) for k in keys]
        unique, inverse = np.unique(np.concatenate(keys), return_inverse=True)
        self._keys = unique
        inverse = inverse.reshape(-1).astype(np.int32)
        self.n, self.nnz = n, len(unique)
        self.indices = (unique % n).astype(np.int32)
        self.indptr = np.searchsorted(unique, np.arange(n + 1, dtype=np.int64) * n).astype(np.int32)
        parts = np.split(inverse, np.cumsum(sizes)[:-1])
        self.diagonal = parts[0]
        self.positions = [np.ascontiguousarray(p.reshape(len(d), -1))
                          for p, d in zip(parts[1:], element_dofs, strict=True)]

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
