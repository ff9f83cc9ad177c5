"""Wave gauges: the elevation at fixed places of the laboratory."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import InputError, RunError
from wavetank.observers.contract import Moment, ObservedWaves
from wavetank.observers.record import Record
from wavetank.observers.schedule import Schedule
from wavetank.water.surface_points import SurfacePoints


class Gauges:
    """Elevation [m] at places of the tank.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); x from the paddle's rest position in a slice, from anywhere in a ring.
    record
        Where rows (t, eta_1, ..., eta_N) go.
    """

    def __init__(self, waves: ObservedWaves, places: Vector, *, record: Record, schedule: Schedule):
        self._waves, self._record, self.schedule = waves, record, schedule
        self._elevation = waves.plane.function("elevation")
        self._points = SurfacePoints(waves.plane, waves.wall, np.asarray(places, dtype=np.float64))

    def observe(self, moment: Moment) -> None:
        """Append one row; raises ``RunError`` if the paddle has passed a gauge; collective."""
        self._elevation.set(self._waves.elevation(moment.q, moment.p, moment.t))
        try:
            elevations = self._points.elevations(self._elevation)
        except InputError as error:
            raise RunError(f"t = {moment.t:.6g} s: the paddle has reached a gauge: {error}") from None
        self._record.append([moment.t, *elevations])
