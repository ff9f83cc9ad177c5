"""What states and derivatives are: numpy arrays of the values that this rank owns; and their sums over ranks."""

from typing import TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

Vector = NDArray[np.float64]

Summand = TypeVar("Summand", float, Vector)


def summed(comm: MPI.Comm, part: Summand) -> Summand:
    """Return the sum of all ranks' numbers or arrays; collective. One rank, whose sum it is, is not sent to itself."""
    return part if comm.size == 1 else comm.allreduce(part)
