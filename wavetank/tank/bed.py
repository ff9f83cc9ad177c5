"""The bed: the still-water depth d at the degrees of freedom, and its rate where a wall moves.

The bed is fixed in the laboratory. In the reference tank, which a moving wall stretches, the depth at a fixed point
changes with the velocity of the mapping, d_t = velocity . grad d.
"""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, largest
from wavetank.base.errors import InputError
from wavetank.base.mpi import raise_on_all_ranks
from wavetank.fem.forms import ScalarForm
from wavetank.fem.plane import Plane

Depth = Callable[[Vector, Vector], Vector]  # d [m] at places x, y [m], all of shape (N,)
MARGIN, SAMPLES = 0.1, 2001  # of the displaced length; points over both, at which a bed must be level to be flat there
INSTANT = 1e-4  # s; for the rate of the depth by central differences, exact to 1e-8 for walls of metres a second


class FlatBed:
    """The same depth everywhere: a constant, whose gradient vanishes before compilation.

    Parameters
    ----------
    depth
        [m].

    Attributes
    ----------
    description
        The bed's part in the energy, in words.
    d
        Still-water depth [m], in UFL.
    rate
        Its rate of change at a fixed point of the reference tank [m/s], in UFL.
    depth
        The mean depth [m].
    still
        d at the owned degrees of freedom [m], shape (owned,).
    varies
        Whether d depends on the place.
    sinking
        Its rate of change there [m/s], shape (owned,) or a number: like ``still`` another object after a change.
    """

    description = "∇d = 0: the bed is flat"
    varies = False

    def __init__(self, depth: float, *, plane: Plane):
        self.d, self.rate = fem.Constant(plane.mesh, float(depth)), ufl.as_ufl(0)
        self.depth, self.still = float(depth), np.zeros(plane.owned) + float(depth)
        self.sinking = 0.0

    def at(self, places: Vector) -> Vector:
        """Return the depth at physical places (x, y) [m], shape (N,)."""
        return np.full(len(places), self.depth)

    def follow(self, wall: Any) -> None:
        """Update the depth for the displacements of a ``Wall``; collective."""

    def follow_on(self, wall: Any) -> None:
        """Update the rate of the depth for the mesh velocities of a ``Wall``; collective."""

    def levelled(self) -> AbstractContextManager[None]:
        """Lie flat at the mean depth within a context; collective."""
        return nullcontext()


class VaryingBed:
    """A depth d(x, y), interpolated at the degrees of freedom; its slope is that of the interpolation.

    Parameters
    ----------
    depth
        d(x, y).

    Raises ``InputError`` where the depth is not positive.
    """

    description = "d = d(x, y), of the places where the water stands: the bed varies"
    varies = True

    def __init__(self, depth: Depth, *, plane: Plane):
        self._plane, self._depth = plane, depth
        self._field, self._rate = plane.function("still-water depth"), plane.function("rate of the depth")
        self.d, self.rate = self._field.function, self._rate.function
        self.still: Vector = np.empty(plane.owned)
        self.sinking: Vector = np.zeros(plane.owned)
        self._set(plane.places, np.arange(plane.owned))
        measure = {"quadrature_degree": plane.order}
        volume, area = (
            ScalarForm(part * ufl.dx(domain=plane.mesh, metadata=measure), plane.comm).assemble()
            for part in (self.d, fem.Constant(plane.mesh, 1.0))
        )
        self.depth = float(volume / area)
        self._flat: float | None = None  # how far beside the displaced places the depth is constant [m]; < 0: it varies

    def _is_flat(self, wall: Any) -> bool:
        """Return whether all that a wall has displaced so far is over a flat part of the bed."""
        if self._flat is None:
            self._flat = self._flat_margin(self._plane.places[wall.displaced_dofs])
        if wall.displaced > self._flat:
            self._flat = -1.0
        return self._flat >= 0.0

    def _flat_margin(self, places: Vector) -> float:
        """Return how far to either side of places on a slice, all on this rank, the depth is the same [m], else -1."""
        if self._plane.comm.size > 1 or self._plane.mesh.topology.dim > 1 or not len(places):
            return -1.0
        low, high = places.min(axis=0), places.max(axis=0)
        margin = MARGIN * float((high - low).max())
        try:
            result = self.at(np.linspace(low - margin, high + margin, SAMPLES))
        except InputError:
            return -1.0
        return margin if result.min() == result.max() else -1.0

    def at(self, places: Vector) -> Vector:
        """Return the depth at physical places (x, y) [m], shape (N,); collective."""
        depth = raise_on_all_ranks(self._plane.comm, lambda: self._depth(places[:, 0], places[:, 1]))
        return np.asarray(depth, dtype=np.float64)

    def follow(self, wall: Any) -> None:
        """Update the depth for the displacements of a ``Wall``; collective."""
        if not self._is_flat(wall):
            self._set(wall.to_physical(self._plane.places[wall.displaced_dofs]), wall.displaced_dofs)

    def _set(self, places: Vector, which: NDArray[np.intp]) -> None:
        """Find the depth at the places of some degrees of freedom; collective."""
        result = self.at(places)
        if not largest(self._plane.comm, -float(result.min(initial=np.inf))) < 0.0:
            self._refuse(result, places)
        still = self.still.copy()
        still[which] = result
        self.still = still
        self._field.set(still)

    @contextmanager
    def levelled(self) -> Iterator[None]:
        """Lie flat at the mean depth within a context; collective."""
        self._field.set(np.full_like(self.still, self.depth))
        yield
        self._field.set(self.still)

    def _refuse(self, depths: Vector, places: Vector) -> None:
        """Raise what says where the bed is highest; collective."""
        shallow = int(np.argmin(depths)) if len(places) else 0
        mine = (
            (float(depths[shallow]), *map(float, np.round(places[shallow], 6))) if len(places) else (np.inf, 0.0, 0.0)
        )
        least, x, y = self._plane.comm.allreduce(mine, op=MPI.MIN)
        where = f"x = {x:.4g} m, y = {y:.4g} m"
        allowed = "it must be positive, which tank.bed.minimum_depth sees to"
        raise InputError(f"the bed: the still-water depth is {least:.4g} m at {where}; {allowed}.")

    def follow_on(self, wall: Any) -> None:
        """Update the rate of the depth for the mesh velocities of a ``Wall``; collective."""
        if self._is_flat(wall):
            return
        there = self._plane.places[wall.displaced_dofs]
        places, step = wall.to_physical(there), INSTANT * wall.mesh_velocities(there)
        after, before = self.at(np.concatenate([places + step, places - step])).reshape(2, -1)
        rate = self.sinking.copy()
        rate[wall.displaced_dofs] = (after - before) / (2 * INSTANT)
        self.sinking = rate
        self._rate.set(rate)


Bed = FlatBed | VaryingBed


def bed_of(depth: float | Depth, plane: Plane) -> Bed:
    """Return the bed of a depth that is the same everywhere, or a function of (x, y)."""
    if callable(depth):
        return VaryingBed(depth, plane=plane)
    return FlatBed(depth, plane=plane)
