"""What a mesh holds of a function of places."""

from collections.abc import Callable

import numpy as np
from dolfinx import fem

from wavetank.arrays import Vector
from wavetank.fem.plane import Plane
from wavetank.mpi import raise_on_all_ranks

FINER = 2  # orders above the space's: where the function is looked at


def misfit(plane: Plane, function: Callable[[Vector, Vector], Vector]) -> tuple[Vector, Vector]:
    """Return what the interpolation of a function misses, and the function, each of shape (N,); collective.

    At the nodes of a space of higher order that this rank owns; ``function`` takes x and y [m], shape (N,).
    """

    def at(places: Vector) -> Vector:
        return raise_on_all_ranks(plane.comm, lambda: np.asarray(function(*places.T), dtype=np.float64))

    held, space = plane.function("held"), fem.functionspace(plane.mesh, ("Lagrange", plane.order + FINER))
    held.set(at(plane.places))
    finer = fem.Function(space)
    finer.interpolate(held.function)
    owned = space.dofmap.index_map.size_local
    exact = at(plane.chart.places(space.tabulate_dof_coordinates()[:owned]))
    return np.asarray(finer.x.array[:owned] - exact), exact


def rms(plane: Plane, values: Vector) -> float:
    """Return the root mean square of values over all ranks; collective."""
    count = plane.comm.allreduce(values.size)
    return float(np.sqrt(plane.sum(values**2) / max(1, count)))
