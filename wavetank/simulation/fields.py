"""Fields for pictures and films: the surface, and the water's velocity below it, each rank its own part of the tank."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.lattice import Lattice
from wavetank.fem.plane import Field
from wavetank.output.directory import REST_POSITION
from wavetank.output.fields import VtkCells
from wavetank.simulation.contract import Moment, ObservedWaves
from wavetank.simulation.record import FieldRecord
from wavetank.simulation.schedule import Schedule
from wavetank.tank.bed import Bed
from wavetank.tank.velocity import Velocity
from wavetank.tank.waves import NonlinearWaves


class WavesOverABed(ObservedWaves, Protocol):
    """What fields are drawn of."""

    @property
    def bed(self) -> Bed:
        """The bed."""


class LatticePlaces:
    """Where the points of a lattice are in the laboratory, for the state that the waves evaluated last.

    Attributes
    ----------
    lattice
        This rank's part of the footprint.
    """

    def __init__(self, waves: WavesOverABed):
        self._waves, self.lattice = waves, Lattice(waves.plane)
        self._depth = waves.plane.function("depth")

    def at(self, field: Field) -> Vector:
        """Return the values of a scalar field, shape (N,)."""
        values: Vector = field.rows[self.lattice.dofs, 0]
        return values

    def depths(self) -> Vector:
        """Return the still-water depth d [m], shape (N,); collective."""
        self._depth.set(self._waves.bed.still)
        return self.at(self._depth)

    def points(self, z: Vector) -> Vector:
        """Return (x, y, z) [m] for heights above still water, shape (N, 3)."""
        return np.column_stack([self._waves.wall.to_physical(self.lattice.places, z), z])


class SurfaceFields:
    """The surface (x, y, eta): ``elevation`` [m], ``surface potential`` [m²/s] and still-water ``depth`` [m].

    In double precision: where there are no other records of the surface, it is measured by these. ``rest position``
    [m], (x, y) in the reference tank in single precision, identifies points in snapshots of other numbers of ranks.

    Parameters
    ----------
    damping
        Rate of the sponge at this rank's degrees of freedom [1/s], shape (owned,), written as ``damping rate``; None:
        there is no sponge.
    """

    def __init__(self, waves: WavesOverABed, series: FieldRecord, *, schedule: Schedule, damping: Vector | None = None):
        self._waves, self._series, self.schedule = waves, series, schedule
        self._places = LatticePlaces(waves)
        self._cells = VtkCells.flat(self._places.lattice.pieces)
        self._eta, self._psi = waves.plane.function("elevation"), waves.plane.function("surface potential")
        self._damping, self._rate = damping, waves.plane.function("damping rate")

    def observe(self, moment: Moment) -> None:
        """Write a snapshot; raises ``RunError``, on all ranks, if it cannot be written; collective."""
        self._eta.set(self._waves.elevation(moment.q, moment.p, moment.t))
        self._psi.set(moment.p)
        eta, psi = self._places.at(self._eta), self._places.at(self._psi)
        arrays: dict[str, NDArray[Any]] = {
            "elevation": eta,
            "surface potential": psi,
            "depth": self._places.depths(),
            REST_POSITION: self._places.lattice.places.astype(np.float32),
        }
        if self._damping is not None:
            self._rate.set(self._damping)  # a run that goes on may have taken another
            arrays["damping rate"] = self._places.at(self._rate)
        self._series.append(moment.t, self._places.points(eta), cells=self._cells, arrays=arrays)


class VelocityFields:
    """The water below the surface: ``velocity`` (along x, y and z) [m/s] and ``potential`` [m²/s].

    In single precision: they are n+1 times as large as the surface, and looked at.

    Parameters
    ----------
    levels
        Heights zeta, ascending in [0, 1] from the bed to the surface; the n+1 Gauss-Lobatto nodes, if not given.
    """

    def __init__(self, waves: NonlinearWaves, series: FieldRecord, *, schedule: Schedule, levels: Vector | None = None):
        self._waves, self._series, self.schedule = waves, series, schedule
        self._levels = waves.vertical.nodes if levels is None else levels
        self._places, self._velocity = LatticePlaces(waves), Velocity(waves)
        lattice = self._places.lattice
        self._cells = VtkCells.layered(lattice.pieces, points=len(lattice.dofs), levels=len(self._levels))

    def observe(self, moment: Moment) -> None:
        """Write a snapshot; raises ``RunError``, on all ranks, if it cannot be written; collective."""
        self._waves.evaluate(moment.q, moment.p, moment.t)
        h, d, dofs = self._places.at(self._waves.h), self._places.depths(), self._places.lattice.dofs
        points = [self._places.points(zeta * h - d) for zeta in self._levels]
        velocity = [self._velocity.at(zeta)[dofs] for zeta in self._levels]
        potential = [self._velocity.potential(zeta)[dofs] for zeta in self._levels]
        arrays = {"velocity": _single(velocity), "potential": _single(potential)}
        self._series.append(moment.t, _single(points), cells=self._cells, arrays=arrays)


def _single(layers: list[Vector]) -> Vector:
    """Return the layers one after another, in single precision."""
    return np.concatenate([layer.astype(np.float32) for layer in layers])
