"""Values at the degrees of freedom that the rows of a matrix reach: a rank's own and those it sees of others.

A vertex that one rank owns may have a cell of another rank that touches none of the first rank's facets. The matrix's
rows reach into that cell, the ghosts of a finite-element space do not; the matrix's own numbering of columns does.
"""

from typing import Any

import numpy as np
from dolfinx import common, la
from numpy.typing import DTypeLike, NDArray


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
    """

    def __init__(self, numbering: common.IndexMap, components: int, real: DTypeLike = np.float64):
        self._owned, self.size = numbering.size_local, numbering.size_local + numbering.num_ghosts
        self._alone = numbering.size_local == numbering.size_global
        if not self._alone:
            self._vector = la.vector(numbering, components, dtype=real)
            self._rows: NDArray[Any] = self._vector.array.reshape(-1, components)

    def fetch(self, owned: NDArray[Any]) -> NDArray[Any]:
        """Return the values of all, shape (size, m), for those owned, (owned, m); collective.

        The array is reused by the next call, or is the one given.
        """
        if self._alone:
            return np.ascontiguousarray(owned)
        self._rows[: self._owned] = owned
        self._vector.scatter_forward()
        return self._rows

    def collect(self, rows: NDArray[Any]) -> NDArray[Any]:
        """Return the sums over ranks at those owned, shape (owned, m), of parts at all, (size, m); collective."""
        if self._alone:
            return rows
        self._rows[:] = rows
        self._vector.scatter_reverse(la.InsertMode.add)
        return np.array(self._rows[: self._owned])
