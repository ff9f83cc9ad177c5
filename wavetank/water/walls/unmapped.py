"""The inverse of the mapping of a paddle (``wavetank.motions.mapping``), compiled: each place is found as if alone."""

from functools import cache
from importlib.resources import files

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fe.kernels import Kernel

DECLARATIONS = "void take_back(long count, const double *r, const double *moved, double *found);"
SOURCE = files(__package__).joinpath("unmapped.c").read_text(encoding="utf-8")


def unmapped(r: Vector, moved: Vector) -> Vector:
    """Return R with R + s(R) moved = r, lengths in reaches, r of shape (N,) and all else (..., N), for moved < 3/4."""
    kernel, found = _kernel(), np.empty_like(moved, order="C")
    each = [np.ascontiguousarray(one) for one in (np.broadcast_to(r, moved.shape), moved)]
    kernel.call.take_back(moved.size, *map(kernel.pointer, (*each, found)))
    return found


@cache
def _kernel() -> Kernel:
    """Return what is compiled, the same for all paddles."""
    return Kernel("unmapped", DECLARATIONS, key=SOURCE, source=lambda: SOURCE, comm=MPI.COMM_SELF)
