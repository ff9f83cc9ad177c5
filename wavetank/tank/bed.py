"""The bed: the still-water depth d at the degrees of freedom, and its rate of change beside a moving wall.

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

Depth = Callable[[Vector, Vector], Vector]  # d [m] at positions x, y [m], all of shape (N,)
MARGIN, SAMPLES = 0.1, 2001  # margin relative to the displaced length; number of points of equal depth on a flat bed
INSTANT = 1e-4  # step of the central differences of the depth [s]; error 1e-8 for walls at metres per second


class FlatBed:
    """A bed of uniform depth: a constant, whose gradient vanishes before compilation.

    Parameters
    ----------
    depth
        Depth [m].

    Attributes
    ----------
    description
        Description of the bed in the energy.
    d
        Still-water depth [m], in UFL.
    rate
        Its rate of change at a fixed point of the reference tank [m/s], in UFL.
    depth
        Mean depth [m].
    still
        d at the owned degrees of freedom [m], shape (owned,).
    varies
        Whether d depends on the position.
    sinking
        Rate of change of ``still`` [m/s], shape (owned,) or a number. Like ``still``, a new object after a change.
    """

    description = "∇d = 0: the bed is flat"
    varies = False

    def __init__(self, depth: float, *, plane: Plane):
        self.d, self.rate = fem.Constant(plane.mesh, float(depth)), ufl.as_ufl(0)
        self.depth, self.still = float(depth), np.zeros(plane.owned) + float(depth)
        self.sinking = 0.0

    def at(self, places: Vector) -> Vector:
        """Return the depth at physical positions (x, y) [m], shape (N,)."""
        return np.full(len(places), self.depth)

    def follow(self, wall: Any) -> None:
        """Update the depth for the displacements of a ``Wall``; collective."""

    def follow_on(self, wall: Any) -> None:
        """Update the rate of the depth for the mesh velocities of a ``Wall``; collective."""

    def levelled(self) -> AbstractContextManager[None]:
        """Have the mean depth everywhere within a context; collective."""
        return nullcontext()


class VaryingBed:
    """A bed of depth d(x, y), interpolated at the degrees of freedom; its slope is that of the interpolation.

    Parameters
    ----------
    depth
        d(x, y).

    Raises ``InputError`` if the depth is not positive.
    """

    description = "d = d(x, y) at the physical positions: the bed varies"
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
        self._flat: float | None = None  # flat distance beside the displaced points [m]; < 0: the depth varies

    def _is_flat(self, wall: Any) -> bool:
        """Return whether the bed is flat wherever a wall has displaced points."""
        if self._flat is None:
            self._flat = self._flat_margin(self._plane.places[wall.displaced_dofs])
        if wall.displaced > self._flat:
            self._flat = -1.0
        return self._flat >= 0.0

    def _flat_margin(self, places: Vector) -> float:
        """Return the distance [m] beside positions on a slice, all on this rank, over which the bed is flat, or -1."""
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
        """Return the depth at physical positions (x, y) [m], shape (N,); collective."""
        depth = raise_on_all_ranks(self._plane.comm, lambda: self._depth(places[:, 0], places[:, 1]))
        return np.asarray(depth, dtype=np.float64)

    def follow(self, wall: Any) -> None:
        """Update the depth for the displacements of a ``Wall``; collective."""
        if not self._is_flat(wall):
            self._set(wall.to_physical(self._plane.places[wall.displaced_dofs]), wall.displaced_dofs)

    def _set(self, places: Vector, which: NDArray[np.intp]) -> None:
        """Set the depth at the positions of some degrees of freedom; collective."""
        result = self.at(places)
        if not largest(self._plane.comm, -float(result.min(initial=np.inf))) < 0.0:
            self._raise_dry(result, places)
        still = self.still.copy()
        still[which] = result
        self.still = still
        self._field.set(still)

    @contextmanager
    def levelled(self) -> Iterator[None]:
        """Have the mean depth everywhere within a context; collective."""
        self._field.set(np.full_like(self.still, self.depth))
        yield
        self._field.set(self.still)

    def _raise_dry(self, depths: Vector, places: Vector) -> None:
        """Raise the error for a bed above still water, with the position of its highest point; collective."""
        shallow = int(np.argmin(depths)) if len(places) else 0
        mine = (
            (float(depths[shallow]), *map(float, np.round(places[shallow], 6))) if len(places) else (np.inf, 0.0, 0.0)
        )
        least, x, y = self._plane.comm.allreduce(mine, op=MPI.MIN)
        where = f"x = {x:.4g} m, y = {y:.4g} m"
        allowed = "must be positive, which tank.bed.minimum_depth ensures"
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
    """Return the bed of a uniform depth, or of a function of (x, y)."""
    if callable(depth):
        return VaryingBed(depth, plane=plane)
    return FlatBed(depth, plane=plane)
