"""Values at the degrees of freedom that the rows of a matrix reach: a rank's own and those it sees of others.

A vertex that one rank owns may have a cell of another rank that touches none of the first rank's facets. The matrix's
rows reach into that cell, the ghosts of a finite-element space do not; the matrix's own numbering of columns does.
A rank's cells reach fewer than there are ghosts, and only those are sent.
"""

from typing import Any, NamedTuple

import numpy as np
from dolfinx import common
from mpi4py import MPI
from numpy.typing import DTypeLike, NDArray

TAG = 15  # of its messages
Indices = NDArray[np.integer]


class Partner(NamedTuple):
    """What another rank is sent of this one's rows, and what it sends back, by number."""

    rank: int
    sent: Indices
    received: Indices


class Halo:
    """Room for values of several components, with the exchange between ranks; on one rank there is none.

    Parameters
    ----------
    numbering
        Of the degrees of freedom, the owned ones first, then the others.
    components
        m.
    real
        What they are.
    reached
        Those that are needed, by number, in any order and as often as one likes; all, if not given.

    Attributes
    ----------
    owned, size
        Rows that this rank owns, and all rows.
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
        """Return the values of all, shape (size, m), for those owned, (owned, m); collective.

        The array is reused by the next call, or is the one given.
        """
        if self._alone:
            return np.ascontiguousarray(owned)
        self._rows[: self.owned] = owned
        for place, values in self._exchange(self._rows, self._to_fetch):
            self._rows[place] = values
        return self._rows

    def collect(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return the sums over ranks at those owned, shape (owned, m), of parts at all, (size, m); collective.

        They are found where the parts stand.
        """
        if self._alone:
            return rows
        for place, values in self._exchange(rows, self._to_collect):
            rows[place] += values
        return rows[: self.owned]

    def _exchange(self, rows: NDArray[Any], partners: list[Partner]) -> list[tuple[Indices, NDArray[Any]]]:
        """Return where what comes from each partner belongs, and what it is; collective."""
        sent = [rows[one.sent] for one in partners]
        come = [np.empty((one.received.size, *rows.shape[1:]), dtype=rows.dtype) for one in partners]
        waited = [self._comm.Irecv(values, one.rank, TAG) for one, values in zip(partners, come, strict=True)]
        waited += [self._comm.Isend(values, one.rank, TAG) for one, values in zip(partners, sent, strict=True)]
        MPI.Request.Waitall(waited)
        return [(one.received, values) for one, values in zip(partners, come, strict=True)]


def _partners(numbering: common.IndexMap, reached: Indices) -> list[Partner]:
    """Return the ranks with which degrees of freedom are shared, in their order; collective."""
    ghosts = np.unique(reached[reached >= numbering.size_local]) - numbering.size_local
    owners, first = numbering.owners[ghosts], numbering.local_range[0]
    of_ranks = [ghosts[owners == rank] for rank in range(numbering.comm.size)]
    requested = numbering.comm.alltoall([numbering.ghosts[of_rank] for of_rank in of_ranks])
    pairs = enumerate(zip(requested, of_ranks, strict=True))
    all_of_them = [Partner(rank, sent - first, own + numbering.size_local) for rank, (sent, own) in pairs]
    return [one for one in all_of_them if one.sent.size + one.received.size]
