"""Fields at some times in rows, compiled: numpy copies them to choose them, to put them in order, and once more."""

from functools import cache

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.kernels import Kernel, source

Indices = NDArray[np.integer]
DECLARATIONS = """
void in_rows(long times, long n, const double *t, const double *x, const int *which, const int *order,
             const double *fields, const double *others, double *rows);
"""


def in_rows(t: Vector, x: Vector, fields: tuple[Vector, Vector], which: Indices, order: Indices) -> Vector:
    """Return rows (K, 1 + 3 N): times, (K,), places, (N,), and which rows, (K,), of two fields in an order, (N,)."""
    rows, at = np.empty((len(t), 1 + 3 * len(x))), _kernel().pointer
    numbers = [np.ascontiguousarray(one, dtype=np.float64) for one in (t, x, *fields)]
    indices = [np.ascontiguousarray(one, dtype=np.int32) for one in (which, order)]
    times, places, *each = map(at, numbers)
    _kernel().call.in_rows(len(t), len(x), times, places, *map(at, indices), *each, at(rows))
    return rows


@cache
def _kernel() -> Kernel:
    """Return what is compiled, the same for all rows."""
    code = source("in_rows.c")
    return Kernel("in_rows", DECLARATIONS, key=code, source=lambda: code, comm=MPI.COMM_SELF)
