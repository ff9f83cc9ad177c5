"""Banded matrices along a slice or ring, for compiled kernels (``matrices.c``)."""

import numpy as np
from numpy.typing import NDArray

from wavetank.fem.codegen import Instance
from wavetank.fem.plane import Plane

Indices = NDArray[np.intp]


def order_along(plane: Plane) -> Indices:
    """Return the degrees of freedom of one rank in the order of x; a ring is cut at a vertex, which is last."""
    return np.roll(np.argsort(plane.x, kind="stable"), -1 if plane.mesh.geometry.dim == 2 else 0)


class Chain:
    """Symmetric banded matrices with the same sparsity; for a ring the last row is a border.

    Parameters
    ----------
    systems
        Number of matrices.
    band
        Largest distance of coupled rows.
    backwards
        Whether the rows of a slice end at x = 0.

    Attributes
    ----------
    row
        Row of each degree of freedom, shape (dofs,).
    entries
        Lower halves, then factors, shape (entries, systems): row by row, by the distance from the diagonal; then
        the border and the corner.
    struct
        The matrices in C.
    """

    def __init__(self, instance: Instance, plane: Plane, *, systems: int, band: int, backwards: bool = False):
        cut = int(plane.mesh.geometry.dim == 2)
        self.row = np.argsort(order_along(plane)[:: -1 if backwards and not cut else 1])
        self._band, self._rows = band, plane.size - cut
        self._banded, border = (self._rows + band) * (band + 1), cut * self._rows
        self.entries = np.zeros((self._banded + border + 1, systems), dtype=instance.dtype)
        self.struct = instance.struct(
            "Chain",
            dofs=plane.size,
            cut=cut,
            row=self.row,
            L=self.entries[: self._banded],
            column=self.entries[self._banded : -1],
            reduced=np.zeros((border, systems)),
            corner=self.entries[-1],
        )

    def places(self, row: Indices, other: Indices) -> Indices:
        """Return the index in ``entries`` for pairs of rows; the number of entries for pairs above the diagonal."""
        border = np.where(other < self._rows, self._banded + other, len(self.entries) - 1)
        result = np.where(row < self._rows, row * (self._band + 1) + row - other, border)
        return np.where(other <= row, result, len(self.entries))
