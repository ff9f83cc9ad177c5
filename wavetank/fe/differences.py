"""The largest differences of rows that follow each other, compiled: of many rows at once, each found by itself."""

from functools import cache
from math import comb

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fe.kernels import Kernel, source

DECLARATIONS = """
void largest_differences(long rows, long columns, int terms, const double *weights, const double *given, double *found);
"""


def largest_differences_on(before: Vector, values: Vector, order: int) -> Vector:
    """Return the same of rows before, and values: those are not copied."""
    across = largest_differences(np.concatenate([before, values[:order]]), order)
    return np.concatenate([across, largest_differences(values, order)])


def largest_differences(values: Vector, order: int) -> Vector:
    """Return the largest magnitude of each difference of an order between rows, over 2^order, shape (K - order,).

    The values have the shape (K, columns); of no columns it is 0, of what is not a number nan.
    """
    values, found = np.ascontiguousarray(values), np.empty(max(0, len(values) - order))
    kernel, weights = _kernel(), _weights(order)
    at = kernel.pointer
    kernel.call.largest_differences(*values.shape, order + 1, kernel.known(weights), at(values), at(found))
    return found


@cache
def _weights(order: int) -> Vector:
    return np.array([(-1) ** (order - i) * comb(order, i) / 2**order for i in range(order + 1)])


@cache
def _kernel() -> Kernel:
    """Return what is compiled, the same for all rows."""
    return Kernel("differences", DECLARATIONS, key=source("differences.c"), comm=MPI.COMM_SELF)
