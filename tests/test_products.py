"""Compiled products with many matrices and numbers at once, against SciPy."""

import numpy as np
import pytest
import scipy.sparse as sparse
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI

from wavetank.fe.products import Products


def made(*, terms, numbers, rows, size, seed):
    """Return products for a random sparsity with empty rows, and the entries and numbers to try them on."""
    random = np.random.default_rng(seed)
    pattern = sparse.random_array((rows, size), density=0.3, format="csr", rng=random)
    counts = {"terms": terms, "numbers": numbers}
    products = Products(pattern.indices, pattern.indptr, size=size, comm=MPI.COMM_SELF, **counts)
    return (
        products,
        pattern,
        random.standard_normal((pattern.nnz, terms)),
        random.standard_normal((size, terms, numbers)),
    )


@settings(max_examples=30)
@given(st.sampled_from([(1, 1), (2, 4), (7, 5)]), st.integers(1, 12), st.integers(1, 12), st.integers(0, 99))
def test_products_are_those_of_scipy(counts, rows, size, seed):
    terms, numbers = counts
    products, pattern, entries, x = made(terms=terms, numbers=numbers, rows=rows, size=size, seed=seed)
    expected = sum(
        sparse.csr_array((entries[:, t], pattern.indices, pattern.indptr), shape=(rows, size)) @ x[:, t]
        for t in range(terms)
    )
    wide = np.hstack([entries, np.full((len(entries), 2), np.nan)])  # what stands beside the entries is not read
    found = products(wide, x.reshape(size, -1))
    assert found == pytest.approx(expected, rel=1e-13, abs=1e-13)


def test_what_does_not_fit_is_refused():
    products, _, entries, x = made(terms=2, numbers=3, rows=4, size=5, seed=1)
    with pytest.raises(ValueError, match="do not fit"):
        products(entries, x.reshape(5, -1)[:4])
    with pytest.raises(ValueError, match="do not fit"):
        products(entries[1:], x.reshape(5, -1))
