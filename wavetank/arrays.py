"""What states and derivatives are: numpy arrays of the values that this rank owns; their sums, and combinations."""

from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:  # whoever only reads records has no ranks
    from mpi4py import MPI

Vector = NDArray[np.float64]

Summand = TypeVar("Summand", float, Vector)


def read_only(values: Vector) -> Vector:
    """Return a view of values through which nobody can write."""
    view = values.view()
    view.flags.writeable = False
    return view


def summed(comm: "MPI.Comm", part: Summand) -> Summand:
    """Return the sum of all ranks' numbers or arrays; collective. One rank, whose sum it is, is not sent to itself."""
    if comm.size == 1:
        return part
    from mpi4py import MPI

    whole = np.array(part, dtype=np.float64)
    comm.Allreduce(MPI.IN_PLACE, whole)
    return float(whole) if isinstance(part, float) else whole


def largest(comm: "MPI.Comm", part: Summand) -> Summand:
    """Return the largest of all ranks' numbers, or of arrays one by one; collective."""
    if comm.size == 1:
        return part
    from mpi4py import MPI

    whole = np.array(part, dtype=np.float64)
    comm.Allreduce(MPI.IN_PLACE, whole, op=MPI.MAX)
    return float(whole) if isinstance(part, float) else whole
