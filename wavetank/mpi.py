"""MPI for commands that compute nothing: one rank if mpi4py is not installed."""

from types import SimpleNamespace
from typing import TYPE_CHECKING, TypeVar

T = TypeVar("T")


class OneRank:
    """The communicator of one process, as far as commands without a solver use it."""

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
