"""Values by the places of degrees of freedom: gathered from the ranks there are, found again on any others."""

from collections.abc import Sequence

import numpy as np
import scipy
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError
from wavetank.fem.plane import Plane

SAME = 1e-6  # of a cell: so near are the places of one degree of freedom on different ranks


def gathered(plane: Plane, arrays: Sequence[Vector]) -> tuple[list[Vector], Vector]:
    """Return arrays of shape (..., owned) with the values of all ranks, and their coordinates in the mesh, (N, 3) [m].

    On the first rank; collective. Raises ``TypeError``, on all ranks, for an array of another shape.
    """
    shaped = all(values.ndim and values.shape[-1] == plane.owned for values in arrays)
    if not plane.comm.allreduce(shaped, op=MPI.LAND):
        raise TypeError("an array is held whose last axis does not run over the degrees of freedom")
    parts = [plane.comm.gather(values) for values in (*arrays, plane.coordinates().T)]
    *on_first, places = (np.concatenate(part, axis=-1) if part else np.zeros((3, 0)) for part in parts)
    return on_first, np.ascontiguousarray(places.T)


def at_dofs(plane: Plane, arrays: Sequence[Vector], places: Vector) -> list[Vector]:
    """Return what arrays of the first rank, of shape (..., N), have at this rank's degrees of freedom; collective.

    Raises ``InputError`` where those are in other places, (N, 3) [m].
    """
    comm = plane.comm
    places, count = comm.bcast((places, len(arrays)))
    rows = _rows(plane, places)
    if rows is None:
        raise InputError(f"{plane.size} degrees of freedom: must be those of the checkpoint, {len(places)}, in place.")
    return [np.ascontiguousarray(comm.bcast(arrays[n] if comm.rank == 0 else None)[..., rows]) for n in range(count)]


def has_places(plane: Plane, places: Vector) -> bool:
    """Return whether the degrees of freedom are in those places of the first rank, (N, 3) [m]; collective."""
    return _rows(plane, plane.comm.bcast(places)) is not None


def _rows(plane: Plane, places: Vector) -> NDArray[np.intp] | None:
    """Return which of the places this rank's degrees of freedom are in; None where some are in others; collective."""
    distances, rows = scipy.spatial.cKDTree(places).query(plane.coordinates())
    farthest = plane.comm.allreduce(float(np.max(distances, initial=0.0)), op=MPI.MAX)
    return rows if len(places) == plane.size and farthest <= SAME * plane.cell_size else None
