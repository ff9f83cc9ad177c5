"""What the paddle does: position, velocity and acceleration, when the gauges are read."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wavetank.arrays import Vector
from wavetank.observers.contract import Moment
from wavetank.observers.record import Record
from wavetank.observers.schedule import Schedule

RATES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}  # a motion's methods, with their units


def columns(places: Vector | None) -> list[str]:
    """Return the table's columns, of a paddle in segments for each place y along it [m]."""
    at = [""] if places is None else [f"@y={y:.6g}" for y in places]
    return ["t [s]", *(f"{name}{place} [{unit}]" for name, unit in RATES.items() for place in at)]


class PaddleMotion:
    """Position [m], velocity [m/s] and acceleration [m/s²] of a paddle.

    Parameters
    ----------
    rates
        These three, by name: functions of t [s] that return a number, or one for each place along the paddle.
    record
        Where rows go, in the order of ``columns``.
    """

    def __init__(self, rates: Mapping[str, Callable[[Any], Any]], *, record: Record, schedule: Schedule):
        self._rates, self._record, self.schedule = rates, record, schedule

    def observe(self, moment: Moment) -> None:
        """Append one row."""
        self._record.append([moment.t, *np.hstack([self._rates[name](moment.t) for name in RATES])])
