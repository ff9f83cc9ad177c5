"""Exchange of values at the degrees of freedom that rows of a matrix reach: owned ones and those of other ranks.

A vertex owned by one rank can have a cell of another rank that has no facet in common with the first rank. Rows of the
matrix reach into this cell; the ghosts of the finite element space do not, but the column numbering of the matrix does.
The cells of a rank reach fewer degrees of freedom than this numbering has ghosts. Only these are exchanged.
"""

from typing import Any, NamedTuple

import numpy as np
from dolfinx import common
from mpi4py import MPI
from numpy.typing import DTypeLike, NDArray

TAG = 15  # tag of its messages
Indices = NDArray[np.integer]


class Partner(NamedTuple):
    """Indices of the values that are sent to another rank and received from it."""

    rank: int
    sent: Indices
    received: Indices


class Halo:
    """Storage for values of several components with the exchange between ranks; on one rank there is no exchange.

    Parameters
    ----------
    numbering
        Index map of the degrees of freedom, owned ones first.
    components
        m.
    real
        Type of the values.
    reached
        Indices of the degrees of freedom that are needed, in any order, repeated or not; default: all.

    Attributes
    ----------
    owned, size
        Number of rows that this rank owns, and of all rows.
    """

    def __init__(
        self,
        numbering: common.IndexMap,
        components: int,
        real: DTypeLike = np.float64,
        *,
        reached: Indices | None = None,
    ):
        self.owned, self.size = numbering.size_local, numbering.size_local + numbering.num_ghosts
        self._alone = numbering.comm.size == 1
        if not self._alone:
            self._comm: MPI.Comm = numbering.comm
            self._rows: NDArray[Any] = np.zeros((self.size, components), dtype=real)
            self._to_fetch = _partners(numbering, np.arange(self.size) if reached is None else reached)
            self._to_collect = [Partner(one.rank, one.received, one.sent) for one in self._to_fetch]

    def fetch(self, owned: NDArray[Any]) -> NDArray[Any]:
        """Return all values, shape (size, m), from the owned ones, shape (owned, m); collective.

        The array is reused by the next call, or is ``values`` on one rank.
        """
        if self._alone:
            return np.ascontiguousarray(owned)
        self._rows[: self.owned] = owned
        for place, values in self._exchange(self._rows, self._to_fetch):
            self._rows[place] = values
        return self._rows

    def collect(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return sums over ranks for owned rows, shape (owned, m), of contributions to all rows, (size, m); collective.

        The sums are stored in the first rows of the contributions.
        """
        if self._alone:
            return rows
        for place, values in self._exchange(rows, self._to_collect):
            rows[place] += values
        return rows[: self.owned]

    def _exchange(self, rows: NDArray[Any], partners: list[Partner]) -> list[tuple[Indices, NDArray[Any]]]:
        """Return, for each partner, the indices and the values received; collective."""
        sent = [rows[one.sent] for one in partners]
        come = [np.empty((one.received.size, *rows.shape[1:]), dtype=rows.dtype) for one in partners]
        waited = [self._comm.Irecv(values, one.rank, TAG) for one, values in zip(partners, come, strict=True)]
        waited += [self._comm.Isend(values, one.rank, TAG) for one, values in zip(partners, sent, strict=True)]
        MPI.Request.Waitall(waited)
        return [(one.received, values) for one, values in zip(partners, come, strict=True)]


def _partners(numbering: common.IndexMap, reached: Indices) -> list[Partner]:
    """Return the ranks that share degrees of freedom with this one, in their order; collective."""
    ghosts = np.unique(reached[reached >= numbering.size_local]) - numbering.size_local
    owners, first = numbering.owners[ghosts], numbering.local_range[0]
    of_ranks = [ghosts[owners == rank] for rank in range(numbering.comm.size)]
    requested = numbering.comm.alltoall([numbering.ghosts[of_rank] for of_rank in of_ranks])
    pairs = enumerate(zip(requested, of_ranks, strict=True))
    all_of_them = [Partner(rank, sent - first, own + numbering.size_local) for rank, (sent, own) in pairs]
    return [one for one in all_of_them if one.sent.size + one.received.size]
