"""What the water does at points of the laboratory: velocity, acceleration and pressure."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector, summed
from wavetank.fem.patch import Cells, patch
from wavetank.fem.points import Points
from wavetank.tank.kinematics import Kinematics
from wavetank.tank.rates import MovingWater

RINGS = 2  # of cells around a point's: accelerations are gradients of what means of gradients make
AT = 1e-9  # of the water column: so near to bed or surface is in the water


class Sounded(NamedTuple):
    """What was found at N points; nothing of sense where they are dry.

    Attributes
    ----------
    velocity, local, acceleration
        Of the water, along x, y and z [m/s, m/s²], shape (N, 3): its velocity, its rate at the point, and that of the
        water that passes.
    pressure
        Above that of the air [Pa], shape (N,).
    dry
        Where there is no water, shape (N,).
    """

    velocity: Vector
    local: Vector
    acceleration: Vector
    pressure: Vector
    dry: NDArray[np.bool_]


class Sounding:
    """Points in the water.

    Parameters
    ----------
    points
        (x, y, z) [m], shape (N, 3); z from still water.
    density
        Of the water [kg/m³].

    Raises ``InputError`` for a point outside the mesh; collective throughout.
    """

    def __init__(self, water: MovingWater, points: Vector, *, density: float):
        self._water, self._density, self._at = water, density, points
        self._points = Points(water.plane, self._coordinates())
        self._cells = self._points.cells
        self._kinematics = Kinematics(water, self._patch())
        self._depth = water.plane.function("depth")

    @property
    def points(self) -> Vector:
        """The points (x, y, z) [m], shape (N, 3)."""
        return self._at

    @property
    def places(self) -> Vector:
        """Where the points are, seen from above: (x, y) [m], shape (N, 2)."""
        return self._at[:, :2]

    def _coordinates(self) -> Vector:
        """Return where the points are in the mesh, shape (N, 3)."""
        return self._water.plane.chart.place(self._water.wall.to_reference(self._at[:, :2], self._at[:, 2]))

    def _patch(self) -> Cells:
        return patch(self._water.plane, self._cells, rings=RINGS)

    def take(self, points: Vector | None = None) -> Sounded:
        """Return what the water does there, its rates having been found; other points may be given, as many.

        Raises ``InputError`` for one that is outside the mesh, as behind a paddle.
        """
        self._at = self._at if points is None else points
        self._points.move(self._coordinates())
        self._stay_in_cells()
        water, layers, z = self._water, self._kinematics.layers(), self._at[:, 2]
        self._depth.set(np.zeros(water.plane.owned) + water.bed.still)
        zeta = (z + self._points.evaluate(self._depth)) / self._points.evaluate(water.h)
        weights = self._kinematics.weights(zeta)

        def at(values: Vector) -> Vector:
            """Return values at the points of values at the levels, shape (levels, rows, ...); collective."""
            return np.asarray(np.einsum("nl,nl...->n...", weights, self._points.of(np.moveaxis(values, 0, 1))))

        velocity, rate = at(layers.velocity), at(layers.rate)
        local, total = map(at, self._kinematics.accelerations())
        pressure = -self._density * (rate + water.head(velocity) + water.gravity * z)
        return Sounded(velocity, local, total, pressure, (zeta < -AT) | (zeta > 1 + AT))

    def _stay_in_cells(self) -> None:
        moved = float(not np.array_equal(self._points.cells, self._cells))
        if summed(self._water.plane.comm, moved):
            self._cells = self._points.cells
            self._kinematics.be_in(self._patch())
