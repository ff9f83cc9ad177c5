"""A PETSc matrix filled from the CSR values of the rows this rank owns."""

import numpy as np
from dolfinx import common
from numpy.typing import NDArray
from petsc4py import PETSc

from wavetank.fe.plane import Plane
from wavetank.hamiltonian.contract import Vector


class SparseRows:
    """A square distributed matrix with the sparsity of a scalar form, m interlaced copies of it.

    Parameters
    ----------
    columns, row_pointers
        Of the owned rows, columns in local numbering with ghosts.
    numbering
        The index map of the columns; the space's own, if not given.
    copies
        m: each entry stands m times, coupling unknown j of one degree of freedom to unknown j of another.
    """

    def __init__(
        self,
        plane: Plane,
        columns: NDArray[np.int32],
        row_pointers: NDArray[np.int32],
        *,
        copies: int = 1,
        numbering: common.IndexMap | None = None,
    ):
        index_map = numbering or plane.V.dofmap.index_map
        entries = np.diff(row_pointers)
        # entry (row, k, copy) moves to row * m + copy, keeping k in order
        row = np.repeat(np.arange(plane.owned), entries)
        copy = np.broadcast_to(np.arange(copies), (columns.size, copies))
        self._order = np.argsort((row[:, None] * copies + copy).ravel(), kind="stable")
        global_columns = index_map.local_to_global(columns.astype(np.int32))
        self._columns = (global_columns[:, None] * copies + copy).ravel()[self._order].astype(PETSc.IntType)
        self._pointers = np.concatenate([[0], np.cumsum(np.repeat(entries, copies))]).astype(PETSc.IntType)
        size = (plane.owned * copies, plane.size * copies)
        self.matrix = PETSc.Mat().createAIJ((size, size), comm=plane.comm)
        self.matrix.setPreallocationCSR((self._pointers, self._columns, np.zeros(self._columns.size)))

    def set(self, values: Vector) -> None:
        """Set all entries, shape (entries, copies) or (entries,); collective."""
        self.matrix.setValuesCSR(self._pointers, self._columns, values.ravel()[self._order])
        self.matrix.assemble()
