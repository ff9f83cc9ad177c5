"""What the paddle does: position, velocity and acceleration, when the gauges are read."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wavetank.observers.contract import Moment
from wavetank.observers.record import Record
from wavetank.observers.schedule import Schedule
from wavetank.records.paddle_table import RATES as RATES


class PaddleMotion:
    """Position [m], velocity [m/s] and acceleration [m/s²] of a paddle.

    Parameters
    ----------
    rates
        These three, by name: functions of t [s] that return a number, or one for each place along the paddle.
    record
        Where rows go, in the order of ``records.paddle_table.columns``.
    """

    def __init__(self, rates: Mapping[str, Callable[[Any], Any]], *, record: Record, schedule: Schedule):
        self._rates, self._record, self.schedule = rates, record, schedule

    def observe(self, moment: Moment) -> None:
        """Append one row."""
        self._record.append([moment.t, *np.hstack([self._rates[name](moment.t) for name in RATES])])
