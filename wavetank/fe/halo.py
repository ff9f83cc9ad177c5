"""Values at the degrees of freedom that the rows of a matrix reach: a rank's own and those it sees of others.

A vertex that one rank owns may have a cell of another rank that touches none of the first rank's facets. The matrix's
rows reach into that cell, the ghosts of a finite-element space do not; the matrix's own numbering of columns does.
"""

import numpy as np
from dolfinx import common, la

from wavetank.arrays import Vector


class Halo:
    """Room for values of several components, with the exchange between ranks.

    Parameters
    ----------
    numbering
        Of the degrees of freedom, the owned ones first, then the others.
    components
        m.
    """

    def __init__(self, numbering: common.IndexMap, components: int):
        self._vector = la.vector(numbering, components)
        self._rows: Vector = self._vector.array.reshape(-1, components)
        self._owned = numbering.size_local

    @property
    def size(self) -> int:
        """The number of degrees of freedom, owned and others."""
        return len(self._rows)

    def fetch(self, owned: Vector) -> Vector:
        """Return the values of all, shape (size, m), for those owned, (owned, m); collective.

        The array is reused by the next call.
        """
        self._rows[: self._owned] = owned
        self._vector.scatter_forward()
        return self._rows

    def collect(self, rows: Vector) -> Vector:
        """Return the sums over ranks at those owned, shape (owned, m), of parts at all, (size, m); collective."""
        self._rows[:] = rows
        self._vector.scatter_reverse(la.InsertMode.add)
        return np.array(self._rows[: self._owned])
