"""Elimination order of a sheet's unknowns: nested dissection by their places (George, SIAM J. Numer. Anal. 10 (1973) 345)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_matrix, csr_matrix

LEAF = 30


def nested_dissection(A: csr_matrix, places: np.ndarray) -> np.ndarray:
    """Order (n,) in which to eliminate the unknowns of a symmetric matrix: halves first, then what separates them.

    Parameters
    ----------
    A : (n, n) sparse matrix
        Only its pattern counts.
    places : (n, d) array
        Where the unknowns are, m; neighbours in the matrix should be neighbours in space (use the reference surface).
    """
    side = np.zeros(len(places), dtype=np.int8)
    parts: list[np.ndarray] = []  # from the last to the first
    stack = [np.arange(len(places))]
    while stack:
        ids = stack.pop()
        along = places[ids][:, np.argmax(np.ptp(places[ids], axis=0))] if len(ids) > LEAF else np.zeros(0)
        low = along < np.median(along) if len(along) else np.zeros(0, dtype=bool)
        if not np.any(low):  # a leaf, or unknowns in one place
            parts.append(ids)
            continue
        left, right = ids[low], ids[~low]
        side[left], side[right] = 1, 2
        cut_left, cut_right = _touches(A, left, side, 2), _touches(A, right, side, 1)
        side[ids] = 0
        if cut_left.sum() <= cut_right.sum():
            parts.append(left[cut_left])
            left = left[~cut_left]
        else:
            parts.append(right[cut_right])
            right = right[~cut_right]
        stack += [part for part in (left, right) if len(part)]
    return np.concatenate(parts[::-1])


def _touches(A: csr_matrix, rows: np.ndarray, side: np.ndarray, other: int) -> np.ndarray:
    """Which of the ``rows`` have an entry in the ``other`` side."""
    block = A[rows]
    hit = np.concatenate([[0], np.cumsum(side[block.indices] == other)])
    return hit[block.indptr[1:]] > hit[block.indptr[:-1]]


class Reordered:
    """Matrices of one pattern, brought into an order by one gather."""

    def __init__(self, A: csr_matrix, order: np.ndarray):
        self.order, self._indices, self._indptr = order, A.indices, A.indptr
        numbered = csr_matrix((np.arange(A.nnz), A.indices, A.indptr), shape=A.shape)[order][:, order].tocsr()
        numbered.sort_indices()
        self._gather, self._pattern = numbered.data, (numbered.indices.astype(np.int32), numbered.indptr.astype(np.int32))

    def fits(self, A: csr_matrix) -> bool:
        """Whether ``A`` has the pattern of the matrix this was made for."""
        same = A.indices is self._indices and A.indptr is self._indptr
        return same or (np.array_equal(A.indptr, self._indptr) and np.array_equal(A.indices, self._indices))

    def matrix(self, A: csr_matrix) -> csc_matrix:
        """``A[order][:, order]`` of a symmetric matrix."""
        return csc_matrix((A.data[self._gather], *self._pattern), shape=A.shape)

    def solver(self, solve):
        """A solver of the reordered matrix as one of the matrix itself."""
        def unordered(b):
            x = np.empty_like(b, dtype=float)
            x[self.order] = solve(b[self.order])
            return x

        return unordered
