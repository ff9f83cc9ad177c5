"""What each rank does by itself, or the first one alone, but all must succeed in."""

import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from typing import TypeVar

from wavetank.errors import WavetankError
from wavetank.mpi import MPI

T = TypeVar("T")

SOON = 0.002  # s that a rank looks for the others without a pause
PAUSE = 0.001  # s between its looks from then on: MPI's own wait would take a processor as long as it lasts


def agreed(comm: MPI.Comm, evaluate: Callable[[], T]) -> T:
    """Return what ``evaluate`` gives on this rank; raise the first ``WavetankError`` on all of them; collective."""
    if comm.size == 1:
        return evaluate()
    result: list[T] = []
    failure: WavetankError | None = None
    try:
        result.append(evaluate())
    except WavetankError as error:
        failure = error
    all_here(comm)
    for met in comm.allgather(failure):
        if met is not None:
            raise met
    return result[0]


def on_first(comm: MPI.Comm, action: Callable[[], T]) -> T | None:
    """Return what ``action`` gives on the first rank, None on the others; raise its error on all; collective."""
    return agreed(comm, lambda: action() if comm.rank == 0 else None)


def from_first(comm: MPI.Comm, action: Callable[[], T]) -> T:
    """Return on all ranks what ``action`` gives on the first one; raise its error on all; collective."""
    if comm.size == 1:
        return action()  # the very same, with all that it has found of itself
    result: T = comm.bcast(on_first(comm, action))
    return result


def all_here(comm: MPI.Comm, within: float = inf) -> bool:
    """Return, once all ranks are here, that they are; or, after some seconds, that they are not; collective."""
    here, start_time = comm.Ibarrier(), time.monotonic()
    while not here.Test():
        waited = time.monotonic() - start_time
        if waited > within:
            return False
        if waited > SOON:
            time.sleep(PAUSE)
    return True


@contextmanager
def ending_together(comm: MPI.Comm, within: float) -> Iterator[None]:
    """End all ranks where the block fails on some, and the others have not come after some seconds."""
    try:
        yield
    except (Exception, SystemExit) as error:
        if not all_here(comm, within):
            traceback.print_exception(error)
            comm.Abort(1)
        raise
