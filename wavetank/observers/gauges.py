"""Wave gauges: the elevation at fixed places of the laboratory."""

from typing import NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError, OutsideError
from wavetank.fe.points import Points
from wavetank.observers.contract import Moment, ObservedWaves, Patient
from wavetank.observers.passing import Called, Passing
from wavetank.observers.record import Record
from wavetank.observers.schedule import Schedule
from wavetank.water.surface_points import SurfacePoints


class _Kept(NamedTuple):
    """The time [s], the elevation [m] at this rank's degrees of freedom, and how the wall stood beside the gauges."""

    t: float
    eta: Vector
    stand: Vector


class Gauges(Patient):
    """Elevation [m] at places of the tank.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2); x from the paddle's rest position in a slice, from anywhere in a ring.
    record
        Where rows (t, eta_1, ..., eta_N) go.
    called
        What they and the paddles are called in a case.
    """

    def __init__(
        self, waves: ObservedWaves, places: Vector, *, record: Record, schedule: Schedule, called: Called | None = None
    ):
        places = np.asarray(places, dtype=np.float64)
        self._waves, self._record, self.schedule = waves, record, schedule
        self._elevation, self._kept = waves.plane.function("elevation"), list[_Kept]()
        place, wall = waves.plane.chart.place, waves.wall
        Points(waves.plane, place(wall.to_reference(places)))  # refuses what is outside
        reached = wall.reaches(places)
        self._near, self._far = np.flatnonzero(reached), np.flatnonzero(~reached)
        self._beside = SurfacePoints(waves.plane, wall, places[reached])
        self._points = Points(waves.plane, place(places[~reached]))
        called = called or Called.unnamed(wall, "gauge", places)
        names = [called.places[n] for n in self._near]
        self._passing = Passing(wall, places[reached], called._replace(places=names))
        self._stand = self._beside.stand()

    def keep(self, moment: Moment) -> None:
        """Keep the elevation, but work it off where a paddle is near; raises as ``work_off``; collective."""
        if self._near.size:
            self._stand = self._beside.stand()
        self._kept.append(_Kept(moment.t, moment.elevation(self._waves), self._stand))
        if self._near.size and self._passing.near(self._stand):
            self.work_off()

    def work_off(self) -> None:
        """Append a row for each moment; raises ``PaddleError`` if a paddle has passed a gauge; collective."""
        kept, self._kept = self._kept, []
        if kept:
            self._append(kept)

    def _append(self, kept: list[_Kept]) -> None:
        rows = self._rows(kept)
        elevations = np.empty((len(kept), self._near.size + self._far.size))
        elevations[:, self._far] = self._points.of_all(rows)
        try:
            if self._near.size:
                elevations[:, self._near] = self._beside.each(rows, [one.stand for one in kept])
        except (OutsideError, ConvergenceError) as error:
            for one in kept if len(kept) > 1 else ():  # up to the one where that is
                self._append([one])
            if isinstance(error, OutsideError):
                raise self._passing.error(kept[0].t, error.index, kept[0].stand) from None
            raise ConvergenceError(f"t = {kept[0].t:.6g} s: {error}") from None
        self._record.extend(np.column_stack([[one.t for one in kept], elevations]))

    def _rows(self, kept: list[_Kept]) -> Vector:
        """Return the elevations at all degrees of freedom, those of other ranks among them, (K, rows); collective."""
        if self._waves.plane.comm.size == 1:
            return np.array([one.eta for one in kept])
        rows = list[Vector]()
        for one in kept:
            self._elevation.set(one.eta)
            rows.append(self._elevation.rows[:, 0].copy())
        return np.array(rows)
