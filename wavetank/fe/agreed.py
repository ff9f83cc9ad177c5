"""What each rank does by itself, or the first one alone, but all must succeed in."""

import time
from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

from wavetank.errors import WavetankError

T = TypeVar("T")

SOON = 0.002  # s that a rank looks for the others without a pause
PAUSE = 0.001  # s between its looks from then on: MPI's own wait would take a processor as long as it lasts


def agreed(comm: MPI.Comm, evaluate: Callable[[], T]) -> T:
    """Return what ``evaluate`` gives on this rank; raise the first ``WavetankError`` on all of them; collective."""
    if comm.size == 1:
        return evaluate()
    found: list[T] = []
    failure: WavetankError | None = None
    try:
        found.append(evaluate())
    except WavetankError as error:
        failure = error
    _wait_for_all(comm)
    for met in comm.allgather(failure):
        if met is not None:
            raise met
    return found[0]


def on_first(comm: MPI.Comm, action: Callable[[], T]) -> T | None:
    """Return what ``action`` gives on the first rank, None on the others; raise its error on all; collective."""
    return agreed(comm, lambda: action() if comm.rank == 0 else None)


def from_first(comm: MPI.Comm, action: Callable[[], T]) -> T:
    """Return on all ranks what ``action`` gives on the first one; raise its error on all; collective."""
    if comm.size == 1:
        return action()  # the very same, with all that it has found of itself
    found: T = comm.bcast(on_first(comm, action))
    return found


def _wait_for_all(comm: MPI.Comm) -> None:
    """Return when all ranks are here; collective."""
    all_here, late = comm.Ibarrier(), time.monotonic() + SOON
    while not all_here.Test():
        if time.monotonic() > late:
            time.sleep(PAUSE)
