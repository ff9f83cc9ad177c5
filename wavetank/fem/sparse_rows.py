"""A PETSc matrix that is filled from CSR values of owned rows."""

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from wavetank.base.arrays import Vector


class SparseRows:
    """A square distributed matrix: m interlaced copies of a scalar sparsity.

    Parameters
    ----------
    columns, row_pointers
        Sparsity of the owned rows of the scalar matrix, columns in global numbering.
    size
        Rows of the scalar matrix on all ranks.
    copies
        m; unknown j of a degree of freedom is coupled to unknown j of another.
    """

    def __init__(
        self,
        columns: NDArray[np.integer],
        row_pointers: NDArray[np.integer],
        *,
        size: int,
        comm: MPI.Comm,
        copies: int = 1,
    ):
        entries = np.diff(row_pointers)
        copy = np.arange(copies, dtype=PETSc.IntType)
        # entry k of row i, copy j, is entry k of row i * m + j
        first = np.arange(columns.size, dtype=PETSc.IntType) + np.repeat(row_pointers[:-1] * (copies - 1), entries)
        self._places = (first[:, None] + np.repeat(entries, entries)[:, None] * copy).astype(PETSc.IntType)
        self._pointers = np.concatenate([[0], np.cumsum(np.repeat(entries, copies))]).astype(PETSc.IntType)
        self._columns = self._interlaced((columns[:, None] * copies + copy).astype(PETSc.IntType))
        sizes = (entries.size * copies, size * copies)
        self._values, self._alone = np.zeros(self._columns.size), comm.size == 1
        csr = self._pointers, self._columns, self._values
        if self._alone:  # PETSc uses these arrays without a copy
            self.matrix = PETSc.Mat().createAIJWithArrays((sizes, sizes), csr, comm=comm)
        else:
            self.matrix = PETSc.Mat().createAIJ((sizes, sizes), comm=comm)
            self.matrix.setPreallocationCSR(csr)

    def _interlaced(self, values: NDArray[np.number]) -> NDArray[np.number]:
        if self._places.shape[1] == 1:
            return values.ravel()
        reordered = np.empty(values.size, dtype=values.dtype)
        reordered[self._places.ravel()] = values.ravel()
        return reordered

    def set(self, values: Vector) -> None:
        """Set all entries, shape (entries, copies) or (entries,); collective."""
        self._values[:] = self._interlaced(values)
        if not self._alone:
            self.matrix.setValuesCSR(self._pointers, self._columns, self._values)
        self.matrix.assemble()
