"""Vectors: numpy arrays of the values that this rank owns, and reductions over ranks."""

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # commands without a solver do not import MPI
    from mpi4py import MPI

Vector = NDArray[np.float64]

Summand = TypeVar("Summand", float, Vector)


def read_only(values: Vector) -> Vector:
    """Return a read-only view of values."""
    view = values.view()
    view.flags.writeable = False
    return view


def summed(comm: "MPI.Comm", part: Summand) -> Summand:
    """Return the sum over all ranks of a number or an array; collective."""
    if comm.size == 1:
        return part
    from mpi4py import MPI

    total = np.array(part, dtype=np.float64)
    comm.Allreduce(MPI.IN_PLACE, total)
    return float(total) if isinstance(part, float) else total


def largest(comm: "MPI.Comm", part: Summand) -> Summand:
    """Return the maximum over all ranks of a number, or of each element of an array; collective."""
    if comm.size == 1:
        return part
    from mpi4py import MPI

    total = np.array(part, dtype=np.float64)
    comm.Allreduce(MPI.IN_PLACE, total, op=MPI.MAX)
    return float(total) if isinstance(part, float) else total
