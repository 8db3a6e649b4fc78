"""Compiled search for :mod:`mfar_fem.assembly.pattern`."""

from __future__ import annotations

from numba import njit

jit = njit(cache=True, error_model="numpy")


@jit
def locate(dofs, indptr, indices, out):
    """Write to ``out`` (ne, nd²) where the entries of each element matrix are stored; ``dofs`` (ne, nd), ``indices`` sorted."""
    ne, nd = dofs.shape
    for e in range(ne):
        for i in range(nd):
            first, last = indptr[dofs[e, i]], indptr[dofs[e, i] + 1]
            for j in range(nd):
                column = dofs[e, j]
                low, high = first, last
                while low < high:
                    middle = (low + high) // 2
                    if indices[middle] < column:
                        low = middle + 1
                    else:
                        high = middle
                out[e, i * nd + j] = low
