"""The pattern against scipy's assembly of triplets."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_matrix

from mfar_fem.assembly import Pattern


@given(st.integers(1, 30), st.lists(st.tuples(st.integers(0, 12), st.integers(1, 6)), max_size=3), st.integers(0, 2**32 - 1))
def test_entries_land_where_scipy_puts_them(n, shapes, seed):
    rng = np.random.default_rng(seed)
    kinds = [rng.integers(0, n, size=shape) for shape in shapes]  # duplicates within an element included
    pattern = Pattern(n, kinds)
    data, rows, columns, values = np.zeros(pattern.nnz), [np.arange(n)], [np.arange(n)], [np.ones(n)]
    data[pattern.diagonal] += 1.0
    for dofs, positions in zip(kinds, pattern.positions, strict=True):
        blocks = rng.normal(size=(len(dofs), dofs.shape[1] ** 2))
        np.add.at(data, positions, blocks)
        rows.append(np.repeat(dofs, dofs.shape[1], axis=1).ravel())
        columns.append(np.tile(dofs, (1, dofs.shape[1])).ravel())
        values.append(blocks.ravel())
    rows, columns, values = (np.concatenate(parts) for parts in (rows, columns, values))
    expected = coo_matrix((values, (rows, columns)), shape=(n, n)).tocsr()
    A = pattern.matrix(data)
    assert A.has_sorted_indices and np.array_equal(A.indptr, expected.indptr)  # explicit zeros apart, the same pattern
    assert abs(A - expected).max() < 1e-12
    scattered = np.zeros(pattern.nnz)
    assert pattern.scatter(rows, columns, values, scattered) == []
    assert np.abs(scattered - data).max() < 1e-12
