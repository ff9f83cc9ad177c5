"""The sponge: where the surface potential is damped, and how strongly.

    d psi/dt = -H_h - gamma psi     ([G16] (38)-(45) with gamma = gamma(x, y); the factor itself: integrators/)

gamma grows from nothing, gamma = gamma_0 (distance / width)², with the distance from the sponge's inner edge: a kink or
step would reflect. On linear waves of uniform gamma the amplitude falls at the rate gamma / 2, whatever the depth; a
wave that crosses the sponge and comes back keeps e^(-gamma_0 width / (3 c_g)) of it, c_g the group velocity. Which
gamma_0 serves which wave was measured: docs/absorption.md.
"""

import numpy as np
import scipy
from dolfinx import la
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.errors import InputError
from wavetank.fem.plane import Plane

POWER = 2


def profile(distance: Vector, *, width: float, strength: float) -> Vector:
    """Return gamma [1/s] at distances into the sponge [m], shape (N,): 0 before it, ``strength`` from its width on."""
    return np.asarray(strength * np.clip(distance / width, 0.0, 1.0) ** POWER)


def distance_from_edge(plane: Plane, cells: NDArray[np.int32]) -> Vector:
    """Return how far the owned degrees of freedom are inside a group of cells [m], shape (owned,); collective.

    It is the distance from the group's inner edge, where its cells meet others: 0 outside.

    Parameters
    ----------
    plane
        The horizontal space.
    cells
        This rank's cells of the group, with or without ghosts.

    Raises ``InputError`` for a group without cells, and for one that is the whole mesh.
    """
    owned = plane.mesh.topology.index_map(plane.mesh.topology.dim).size_local
    is_inside = np.isin(np.arange(owned), cells)
    inside, outside = (_touched(plane, np.flatnonzero(chosen)) for chosen in (is_inside, ~is_inside))
    edge = np.concatenate(plane.comm.allgather(plane.places[inside & outside]))
    if not len(edge):
        raise InputError("the sponge: its group of cells is empty, or the whole mesh; it must be a part of the mesh.")
    distance = np.zeros(plane.owned)
    distance[inside] = scipy.spatial.cKDTree(edge).query(plane.places[inside])[0]
    return distance


def _touched(plane: Plane, cells: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which owned degrees of freedom belong to some of the cells, on whatever rank those are; collective."""
    mark = plane.function("mark")
    mark.rows[plane.V.dofmap.list[cells].ravel()] = 1.0
    mark.function.x.scatter_reverse(la.InsertMode.add)
    return np.asarray(mark.owned > 0.0)


def width_of(plane: Plane, distance: Vector) -> float:
    """Return the largest distance [m] over all ranks; collective."""
    return float(plane.comm.allreduce(float(np.max(distance, initial=0.0)), op=MPI.MAX))


def checked(plane: Plane, gamma: Vector) -> Vector:
    """Return gamma [1/s], shape (owned,); raises ``InputError`` where it is negative or not finite; collective."""
    bad = np.flatnonzero(~(np.isfinite(gamma) & (gamma >= 0.0)))
    first = (*map(float, plane.places[bad[0]]), float(gamma[bad[0]])) if bad.size else None
    for x, y, received in filter(None, plane.comm.allgather(first)):
        raise InputError(
            f"the sponge: gamma = {received:.4g} 1/s at x = {x:.4g} m, y = {y:.4g} m; it must be 0 or more."
        )
    return gamma
