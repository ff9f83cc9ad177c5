"""Probes: velocity, acceleration and pressure at fixed points of the laboratory, where there is water."""

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector, summed
from wavetank.errors import InputError, RunError
from wavetank.fe.patch import Cells, patch
from wavetank.fe.points import Points
from wavetank.observers.contract import Moment
from wavetank.observers.record import Record
from wavetank.observers.schedule import EverySteps, Schedule
from wavetank.stateful import Held, Stateful
from wavetank.water.kinematics import Kinematics
from wavetank.water.rates import MovingWater

RINGS = 2  # of cells around a probe's: accelerations are gradients of what means of gradients make
AT = 1e-9  # of the water column: so near to bed or surface is in the water


class Probes:
    """What the water does at points: see ``records.probe_table`` for the columns; empty where there is none.

    Parameters
    ----------
    points
        (x, y, z) [m], shape (N, 3); z from still water.
    density
        Of the water [kg/m³].
    record
        Where rows go.
    """

    def __init__(self, water: MovingWater, points: Vector, *, density: float, record: Record, schedule: Schedule):
        self._water, self._record, self._density, self.schedule = water, record, density, schedule
        self._places, self._z = np.array(points[:, :2]), np.array(points[:, 2])
        self._points = Points(water.plane, self._coordinates())
        self._cells = self._points.cells
        self._kinematics = Kinematics(water, self._patch())
        self._depth = water.plane.function("depth")
        self._axes = [0, 1, 2] if water.plane.mesh.topology.dim == 2 else [0, 2]

    def _coordinates(self) -> Vector:
        """Return where the probes are in the mesh, shape (N, 3)."""
        return self._water.plane.chart.place(self._water.wall.to_reference(self._places, self._z))

    def _patch(self) -> Cells:
        return patch(self._water.plane, self._cells, rings=RINGS)

    def observe(self, moment: Moment) -> None:
        """Append one row; raises ``RunError`` if the paddle has passed a probe; collective."""
        self._water.find_rates(moment.q, moment.p, moment.t)
        try:
            self._points.move(self._coordinates())
        except InputError as error:
            raise RunError(f"t = {moment.t:.6g} s: the paddle has reached a probe: {error}") from None
        self._stay_in_cells()
        rows = ([None] * len(found) if is_dry else found for found, is_dry in zip(*self._found(), strict=True))
        self._record.append([moment.t, *(value for row in rows for value in row)])

    def _stay_in_cells(self) -> None:
        moved = float(not np.array_equal(self._points.cells, self._cells))
        if summed(self._water.plane.comm, moved):
            self._cells = self._points.cells
            self._kinematics.be_in(self._patch())

    def _found(self) -> tuple[Vector, NDArray[np.bool_]]:
        """Return velocity, accelerations and pressure of each probe, shape (N, columns), and where it is dry, (N,).

        Collective.
        """
        water, layers = self._water, self._kinematics.layers()
        self._depth.set(np.zeros(water.plane.owned) + water.bed.still)
        zeta = (self._z + self._points.evaluate(self._depth)) / self._points.evaluate(water.h)
        weights = self._kinematics.weights(zeta)

        def at(values: Vector) -> Vector:
            """Return values at the points of values at the levels, shape (levels, rows, ...); collective."""
            return np.asarray(np.einsum("nl,nl...->n...", weights, self._points.of(np.moveaxis(values, 0, 1))))

        velocity, rate = at(layers.velocity), at(layers.rate)
        pressure = -self._density * (rate + water.head(velocity) + water.gravity * self._z)
        vectors = [velocity, *map(at, self._kinematics.accelerations())]
        found = np.column_stack([*(vector[:, self._axes] for vector in vectors), pressure])
        return found, (zeta < -AT) | (zeta > 1 + AT)


class WaterKept:
    """Remembers the water that others look into, so that a run that goes on looks into the same."""

    def __init__(self, water: Stateful):
        self.schedule, self._water = EverySteps(), water

    def observe(self, moment: Moment) -> None:
        """Do nothing."""

    def held(self) -> Held:
        """Return what the water holds."""
        return self._water.held()

    def take(self, held: Held) -> None:
        """Let it take that back; collective."""
        self._water.take(held)
