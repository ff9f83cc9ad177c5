"""What the paddle does: position, velocity and acceleration, and on request force and power, with the gauges."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from wavetank.observers.contract import Moment
from wavetank.observers.loads import Pushing
from wavetank.observers.record import Record
from wavetank.observers.schedule import Schedule
from wavetank.records.paddle_table import RATES as RATES


class PaddleMotion:
    """Position [m], velocity [m/s] and acceleration [m/s²] of a paddle.

    Parameters
    ----------
    rates
        These three, by name: functions of t [s] that return a number, or one for each place along the paddle.
    push
        What it does against the water; None: not looked at.
    record
        Where rows go, in the order of ``records.paddle_table.columns``.
    """

    def __init__(
        self,
        rates: Mapping[str, Callable[[Any], Any]],
        *,
        record: Record,
        schedule: Schedule,
        push: Pushing | None = None,
    ):
        self._rates, self._record, self.schedule, self._push = rates, record, schedule, push

    def observe(self, moment: Moment) -> None:
        """Append one row; collective."""
        pushed = self._push.at(moment) if self._push else ()
        self._record.append([moment.t, *np.hstack([self._rates[name](moment.t) for name in RATES]), *pushed])
