"""MPI, or one rank if mpi4py is not installed, and errors that all ranks raise together."""

import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from types import SimpleNamespace
from typing import TYPE_CHECKING, TypeVar

from wavetank.base.errors import WavetankError

T = TypeVar("T")


class OneRank:
    """The communicator of one process, with the methods that commands without a solver use."""

    rank, size = 0, 1

    def Dup(self) -> "OneRank":
        """Return the communicator itself."""
        return self

    def Ibarrier(self) -> SimpleNamespace:
        """Return a request that is complete."""
        return SimpleNamespace(Test=lambda: True)

    def bcast(self, value: T) -> T:
        """Return the value."""
        return value


if TYPE_CHECKING:
    from mpi4py import MPI as MPI
else:
    try:
        from mpi4py import MPI
    except ModuleNotFoundError:
        MPI = SimpleNamespace(COMM_WORLD=OneRank(), Comm=OneRank)

SPIN = 0.002  # time for which a rank polls the others without a pause [s]
PAUSE = 0.001  # time between later polls [s]; MPI's wait would occupy a processor


def raise_on_all_ranks(comm: MPI.Comm, evaluate: Callable[[], T]) -> T:
    """Return the result of ``evaluate`` on this rank; raise the first ``WavetankError`` on all ranks; collective."""
    if comm.size == 1:
        return evaluate()
    result: list[T] = []
    failure: WavetankError | None = None
    try:
        result.append(evaluate())
    except WavetankError as error:
        failure = error
    all_ranks_arrive(comm)
    for first in comm.allgather(failure):
        if first is not None:
            raise first
    return result[0]


def on_first(comm: MPI.Comm, action: Callable[[], T]) -> T | None:
    """Return the result of ``action`` on the first rank, None on the others; raise its error on all; collective."""
    return raise_on_all_ranks(comm, lambda: action() if comm.rank == 0 else None)


def from_first(comm: MPI.Comm, action: Callable[[], T]) -> T:
    """Return the result of ``action`` on the first rank on all ranks; raise its error on all; collective."""
    if comm.size == 1:
        return action()  # the same object, with its caches
    result: T = comm.bcast(on_first(comm, action))
    return result


def all_ranks_arrive(comm: MPI.Comm, timeout: float = inf) -> bool:
    """Return True when all ranks have called this, or False after the timeout [s]; collective."""
    barrier, start = comm.Ibarrier(), time.monotonic()
    while not barrier.Test():
        waited = time.monotonic() - start
        if waited > timeout:
            return False
        if waited > SPIN:
            time.sleep(PAUSE)
    return True


@contextmanager
def abort_unless_all_fail(comm: MPI.Comm, timeout: float) -> Iterator[None]:
    """Abort all ranks if the block fails on some and the others do not arrive within the timeout [s]."""
    try:
        yield
    except (Exception, SystemExit) as error:
        if not all_ranks_arrive(comm, timeout):
            traceback.print_exception(error)
            comm.Abort(1)
        raise
