"""Values of degrees of freedom by their coordinates: gathered from all ranks, distributed to any number of ranks."""

from collections.abc import Sequence

import numpy as np
import scipy
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError
from wavetank.fem.plane import Plane

SAME = 1e-6  # largest distance of equal coordinates over the cell size


def gathered(plane: Plane, arrays: Sequence[Vector]) -> tuple[list[Vector], Vector]:
    """Return, on the first rank, the values of all ranks and the coordinates in the mesh, shape (N, 3) [m]; collective.

    The arrays have shape (..., owned), the result (..., N). Raises ``TypeError`` on all ranks for another shape.
    """
    shaped = all(values.ndim and values.shape[-1] == plane.owned for values in arrays)
    if not plane.comm.allreduce(shaped, op=MPI.LAND):
        raise TypeError("an array is held whose last axis does not run over the degrees of freedom")
    parts = [plane.comm.gather(values) for values in (*arrays, plane.coordinates().T)]
    *on_first, places = (np.concatenate(part, axis=-1) if part else np.zeros((3, 0)) for part in parts)
    return on_first, np.ascontiguousarray(places.T)


def at_dofs(plane: Plane, arrays: Sequence[Vector], places: Vector) -> list[Vector]:
    """Return the values at this rank's degrees of freedom of arrays on the first rank, of shape (..., N); collective.

    ``places`` are the coordinates of the N values, shape (N, 3) [m]. Raises ``InputError`` if they are not those of the
    degrees of freedom.
    """
    comm = plane.comm
    places, count = comm.bcast((places, len(arrays)))
    rows = _rows(plane, places)
    if rows is None:
        raise InputError(f"{plane.size} degrees of freedom: must be those of the checkpoint, {len(places)}, in place.")
    return [np.ascontiguousarray(comm.bcast(arrays[n] if comm.rank == 0 else None)[..., rows]) for n in range(count)]


def has_places(plane: Plane, places: Vector) -> bool:
    """Return whether the degrees of freedom have the coordinates of the first rank, shape (N, 3) [m]; collective."""
    return _rows(plane, plane.comm.bcast(places)) is not None


def _rows(plane: Plane, places: Vector) -> NDArray[np.intp] | None:
    """Return the index of the place of each degree of freedom; None if the places differ; collective."""
    distances, rows = scipy.spatial.cKDTree(places).query(plane.coordinates())
    farthest = plane.comm.allreduce(float(np.max(distances, initial=0.0)), op=MPI.MAX)
    return rows if len(places) == plane.size and farthest <= SAME * plane.cell_size else None
