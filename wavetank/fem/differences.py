"""The largest differences of rows that follow each other, compiled: of many rows at once, each found by itself."""

from functools import cache
from math import comb

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fem.kernels import Kernel, source

DECLARATIONS = """
void largest_differences(long first, long others, long columns, int terms, const double *weights, const double *before,
                         const double *values, double *found);
"""


def largest_differences(before: Vector, values: Vector, order: int) -> Vector:
    """Return the largest magnitude of each difference of an order between rows, over 2^order, shape (K - order,).

    The K rows are some before, and values, of shape (..., columns) each, which are not copied; of no columns it is 0,
    of what is not a number nan.
    """
    before, values = np.ascontiguousarray(before), np.ascontiguousarray(values)
    result, kernel, weights = np.empty(max(0, len(before) + len(values) - order)), _kernel(), _weights(order)
    sizes, known, at = (len(before), *values.shape, order + 1), kernel.known(weights), kernel.pointer
    kernel.call.largest_differences(*sizes, known, at(before), at(values), at(result))
    return result


@cache
def _weights(order: int) -> Vector:
    return np.array([(-1) ** (order - i) * comb(order, i) / 2**order for i in range(order + 1)])


@cache
def _kernel() -> Kernel:
    """Return what is compiled, the same for all rows."""
    return Kernel("differences", DECLARATIONS, key=source("differences.c"), comm=MPI.COMM_SELF)
