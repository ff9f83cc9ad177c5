"""Wave gauges: the elevation at fixed places of the laboratory."""

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError, OutsideError, RunError
from wavetank.fem.line_points import points_in
from wavetank.simulation.contract import Moments, ObservedWaves, Patient
from wavetank.simulation.passing import Called, Passing
from wavetank.simulation.record import Record
from wavetank.simulation.schedule import Schedule
from wavetank.tank.surface_points import SurfacePoints


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
    foreseen
        Whether it is known before that no paddle passes any; else moments are worked off at once while one is near.
    """

    def __init__(
        self,
        waves: ObservedWaves,
        places: Vector,
        *,
        record: Record,
        schedule: Schedule,
        called: Called | None = None,
        foreseen: bool = False,
    ):
        places = np.asarray(places, dtype=np.float64)
        self._waves, self._record, self.schedule = waves, record, schedule
        self._elevation, self.sees = waves.plane.function("elevation"), waves
        wall = waves.wall
        self._points = points_in(waves.plane, waves.plane.chart.place(wall.to_reference(places)))  # far ones stay there
        reached = wall.reaches(places)
        self._near = np.flatnonzero(reached)
        self._beside = SurfacePoints(waves.plane, wall, places[reached])
        called = called or Called.unnamed(wall, "gauge", places)
        names = [called.places[n] for n in self._near]
        self._passing = Passing(wall, places[reached], called._replace(places=names))
        self.foreseen = foreseen or not self._near.size

    @property
    def hurries(self) -> bool:
        """See ``Patient``: so that nothing is recorded after a paddle has passed."""
        return not self.foreseen and self._passing.near(self._waves.wall.stood)

    def work_off(self, moments: Moments) -> None:
        """Append a row for each moment; raises ``PaddleError`` if a paddle has passed a gauge; collective."""
        rows = self._rows(moments)
        elevations = self._points.of_all(rows)
        try:
            if self._near.size:
                elevations[:, self._near] = self._over_the_near(moments, rows)
        except RunError:
            for row in range(len(moments)) if len(moments) > 1 else ():  # up to the one where that is
                self.work_off(moments.some([row]))
            raise
        self._record.extend(np.column_stack([moments.times, elevations]))

    def _over_the_near(self, moments: Moments, rows: Vector) -> Vector:
        """Return the elevation over gauges within the paddles' reach, shape (K, N); raises as ``work_off``."""
        stand = moments.stands(self._waves, self._beside.places)
        try:
            return self._beside.each(rows, stand)
        except OutsideError as error:
            row, place = divmod(error.index, len(self._beside.places))
            raise self._passing.error(float(moments.times[row]), place, stand[:, row]) from None
        except ConvergenceError as error:
            raise ConvergenceError(f"t = {moments.times[0]:.6g} s: {error}", t=float(moments.times[0])) from None

    def _rows(self, moments: Moments) -> Vector:
        """Return the elevations at all degrees of freedom, those of other ranks among them, (K, rows); collective."""
        surfaces = moments.elevations(self._waves)
        if self._waves.plane.comm.size == 1:
            return surfaces
        rows = list[Vector]()
        for eta in surfaces:
            self._elevation.set(eta)
            rows.append(self._elevation.rows[:, 0].copy())
        return np.array(rows)
