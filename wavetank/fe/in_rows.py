"""Fields of many times in rows, compiled: numpy goes through all of them once to put them in order, and once more."""

from functools import cache

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fe.kernels import Kernel, source

DECLARATIONS = """
void in_rows(long times, long n, const double *t, const double *x, const int *order, const double *first,
             const double *second, double *rows);
"""


def in_rows(t: Vector, x: Vector, fields: tuple[Vector, Vector], order: NDArray[np.int32]) -> Vector:
    """Return rows (K, 1 + 3 N): times, shape (K,), places, (N,), and two fields (K, N) in an order, (N,)."""
    rows, at = np.empty((len(t), 1 + 3 * len(x))), _kernel().pointer
    times, places, *each = (np.ascontiguousarray(one, dtype=np.float64) for one in (t, x, *fields))
    _kernel().call.in_rows(len(t), len(x), at(times), at(places), at(order), *map(at, each), at(rows))
    return rows


@cache
def _kernel() -> Kernel:
    """Return what is compiled, the same for all rows."""
    code = source("in_rows.c")
    return Kernel("in_rows", DECLARATIONS, key=code, source=lambda: code, comm=MPI.COMM_SELF)
