"""What each rank does by itself, but all must succeed in."""

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from wavetank.errors import InputError

T = TypeVar("T")


def agreed(comm: MPI.Comm, evaluate: Callable[[], T]) -> T:
    """Return what ``evaluate`` gives on this rank; raise the first rank's ``InputError`` on all of them; collective."""
    found: list[T] = []
    failure: InputError | None = None
    try:
        found.append(evaluate())
    except InputError as error:
        failure = error
    for met in comm.allgather(failure):
        if met is not None:
            raise met
    return found[0]
