"""Wave gauges: the elevation at fixed places of the laboratory."""

import numpy as np

from wavetank.errors import RunError
from wavetank.fe.points import Points
from wavetank.hamiltonian.contract import Vector
from wavetank.observers.contract import Moment, ObservedWaves
from wavetank.observers.record import Record
from wavetank.observers.schedule import Schedule


class Gauges:
    """Elevation [m] at distances x [m] along the tank, from the paddle's rest position or from anywhere in a ring.

    Parameters
    ----------
    x
        Positions, shape (N,).
    record
        Where rows (t, eta_1, ..., eta_N) go.
    """

    def __init__(self, waves: ObservedWaves, x: Vector, *, record: Record, schedule: Schedule):
        self._waves, self._x, self._record, self.schedule = waves, np.asarray(x, dtype=float), record, schedule
        self._points = Points(waves.plane, waves.plane.chart.place(self._reference()))

    def _reference(self) -> Vector:
        return self._waves.wall.to_reference(self._x)

    def observe(self, moment: Moment) -> None:
        """Append one row; raises ``RunError`` if the paddle has passed a gauge; collective."""
        self._waves.evaluate(moment.q, moment.p, moment.t)
        reference = self._reference()
        if np.any(reference < 0.0):
            raise RunError(f"t = {moment.t:.6g} s: the paddle has reached the gauge at x = {self._x.min():g} m")
        self._points.move(self._waves.plane.chart.place(reference))
        eta = self._points.evaluate(self._waves.h) - self._waves.depth
        self._record.append([moment.t, *eta])
