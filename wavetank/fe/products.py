"""Products of sparse matrices S_t of one sparsity with rows of m numbers, y_i = sum_k sum_t S_t[i, k] x_t[k]: one pass.

SciPy takes a matrix at a time and knows neither count when it is compiled; a kernel that knows both reads each entry
once and keeps y_i in registers (``make bench`` has the ratio). Kernels are compiled where they are first needed, as
forms are, and kept in the user's cache.
"""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fe.kernels import Kernel

DECLARATION = "void product(int, const int *, const int *, const double *, int, const double *, double *);"
KERNEL = """
void product(int rows, const int *restrict pointers, const int *restrict columns, const double *restrict entries,
             int stride, const double *restrict x, double *restrict y)
{
    for (int i = 0; i < rows; ++i) {
        double sum[NUMBERS] = {0.0};
        for (int k = pointers[i]; k < pointers[i + 1]; ++k) {
            const double *entry = entries + (long)k * stride;
            const double *row = x + (long)columns[k] * (TERMS * NUMBERS);
            for (int t = 0; t < TERMS; ++t)
                #pragma omp simd
                for (int j = 0; j < NUMBERS; ++j)
                    sum[j] += entry[t] * row[t * NUMBERS + j];
        }
        for (int j = 0; j < NUMBERS; ++j)
            y[(long)i * NUMBERS + j] = sum[j];
    }
}
"""


class Products:
    """The product for a sparsity, a number of matrices and of numbers in a row.

    Parameters
    ----------
    columns, row_pointers
        Of the rows.
    size
        Number of columns.
    terms
        How many matrices.
    numbers
        m.
    """

    def __init__(
        self,
        columns: NDArray[np.integer],
        row_pointers: NDArray[np.integer],
        *,
        size: int,
        terms: int,
        numbers: int,
        comm: MPI.Comm,
    ):
        source = f"#define TERMS {terms}\n#define NUMBERS {numbers}\n{KERNEL}"
        self._kernel = Kernel(f"product_{terms}_{numbers}", DECLARATION, key=source, source=lambda: source, comm=comm)
        self._columns, self._pointers = (
            np.ascontiguousarray(places, dtype=np.int32) for places in (columns, row_pointers)
        )
        self._shape, self._numbers = (size, terms * numbers), numbers

    def __call__(self, entries: Vector, x: Vector) -> Vector:
        """Return y, shape (rows, m), for entries of the S_t side by side and x_t side by side, (size, terms m).

        ``entries`` has a row for each place of the sparsity, which may be longer than there are matrices.
        """
        if x.shape != self._shape or len(entries) != self._columns.size:
            raise ValueError(f"{x.shape} numbers and {len(entries)} entries do not fit {self._shape}")
        y = np.empty((self._pointers.size - 1, self._numbers))
        at = self._kernel.pointer
        self._kernel.call.product(
            len(y),
            at(self._pointers),
            at(self._columns),
            at(entries),
            entries.shape[1],
            at(np.ascontiguousarray(x)),
            at(y),
        )
        return y
