"""What each rank does by itself, or the first one alone, but all must succeed in."""

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from wavetank.errors import WavetankError

T = TypeVar("T")


def agreed(comm: MPI.Comm, evaluate: Callable[[], T]) -> T:
    """Return what ``evaluate`` gives on this rank; raise the first ``WavetankError`` on all of them; collective."""
    found: list[T] = []
    failure: WavetankError | None = None
    try:
        found.append(evaluate())
    except WavetankError as error:
        failure = error
    for met in comm.allgather(failure):
        if met is not None:
            raise met
    return found[0]


def on_first(comm: MPI.Comm, action: Callable[[], T]) -> T | None:
    """Return what ``action`` gives on the first rank, None on the others; raise its error on all; collective."""
    return agreed(comm, lambda: action() if comm.rank == 0 else None)


def from_first(comm: MPI.Comm, action: Callable[[], T]) -> T:
    """Return on all ranks what ``action`` gives on the first one; raise its error on all; collective."""
    found: T = comm.bcast(on_first(comm, action))
    return found
