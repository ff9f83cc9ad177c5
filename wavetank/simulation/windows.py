"""Windows: what columns of water do, from the bed to the surface, for other programs."""

from typing import Protocol

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import InputError, PaddleError
from wavetank.simulation.contract import Moment, ObservedWaves
from wavetank.simulation.probes import axes_of
from wavetank.simulation.schedule import Schedule
from wavetank.tank.rates import MovingWater
from wavetank.tank.sounding import Sounding
from wavetank.tank.surface_points import SurfacePoints


class WindowRecord(Protocol):
    """Where a window's motion goes."""

    def append(self, t: float, z: Vector, eta: Vector, moved: Vector) -> None:
        """Append heights [m], shape (columns, levels), elevations [m], (columns,), and the quantities of each point.

        These are velocities, accelerations and pressure in the order of ``records.window``, shape (quantities, columns,
        levels).
        """


class WindowObserver:
    """The motion of columns of water.

    Parameters
    ----------
    places
        (x, y) of each column [m], shape (N, 2).
    levels
        Points in each.
    density
        Of the water [kg/m³].
    """

    def __init__(
        self,
        waves: ObservedWaves,
        water: MovingWater,
        places: Vector,
        *,
        levels: int,
        density: float,
        record: WindowRecord,
        schedule: Schedule,
    ):
        self._waves, self._water, self._record, self.schedule = waves, water, record, schedule
        self._places, self._zeta, self._axes = places, np.linspace(0.0, 1.0, levels, dtype=np.float64), axes_of(water)
        self._surface = SurfacePoints(water.plane, water.wall, places)
        self._elevation, self._depth = water.plane.function("elevation"), water.plane.function("depth")
        points = np.column_stack([places, np.zeros(len(places))])
        self._sounding = Sounding(water, np.repeat(points, levels, axis=0), density=density)

    def observe(self, moment: Moment) -> None:
        """Append what the columns do; raises ``PaddleError`` if the paddle has passed one; collective."""
        self._water.find_rates(moment.q, moment.p, moment.t)
        self._elevation.set(self._waves.elevation(moment.q, moment.p, moment.t))
        self._depth.set(np.zeros(self._water.plane.owned) + self._water.bed.still)
        try:
            eta = self._surface.elevations(self._elevation)
            d, h = (self._surface.points.evaluate(field) for field in (self._depth, self._water.h))
            z = np.outer(h, self._zeta) - d[:, None]
            points = np.column_stack([np.repeat(self._places, self._zeta.size, axis=0), z.ravel()])
            found = self._sounding.take(points)
        except InputError as error:
            raise PaddleError(f"t = {moment.t:.6g} s: the paddle has reached a column of a window: {error}") from None
        vectors = (vector[:, self._axes].T for vector in (found.velocity, found.local, found.acceleration))
        moved = np.vstack([*vectors, found.pressure]).reshape(-1, *z.shape)
        self._record.append(moment.t, z, eta, moved)
