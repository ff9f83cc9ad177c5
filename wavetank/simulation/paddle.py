"""What the paddle does: position, velocity and acceleration, and on request force and power, with the gauges."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np

from wavetank.output.tables import RATES as RATES
from wavetank.simulation.contract import Keeping, Moment, Moments, ObservedWaves, Patient
from wavetank.simulation.loads import Pushing
from wavetank.simulation.record import Record
from wavetank.simulation.schedule import EverySteps, Schedule
from wavetank.stateful import Held

LIMITED = ("stroke", "speed", "acceleration")


class PaddleMotion(Keeping):
    """Position [m], velocity [m/s] and acceleration [m/s²] of a paddle.

    Parameters
    ----------
    rates
        Returns these three at t [s], numbers, or one for each place along the paddle.
    push
        What it does against the water; None: not looked at.
    record
        Where rows go, in the order of ``records.paddle_table.columns``.
    """

    def __init__(
        self,
        rates: Callable[[float], Sequence[Any]],
        *,
        record: Record,
        schedule: Schedule,
        push: Pushing | None = None,
    ):
        self._rates, self._record, self.schedule, self._push = rates, record, schedule, push
        self._kept: list[list[Any]] = []  # times, what there is of it, numbers or one for each place, and how it pushes

    def keep(self, moment: Moment) -> None:
        """Keep what it does; collective."""
        pushed = self._push.at(moment) if self._push else ()
        self._kept.append([moment.t, *self._rates(moment.t), *pushed])

    def work_off(self, moments: Moments) -> None:
        """Append a row for each moment."""
        kept, self._kept = self._kept[: len(moments)], []  # one more is kept of what a later look has ended
        if np.ndim(kept[0][1]):
            self._record.extend(np.array([np.hstack(row) for row in kept]))
        else:
            self._record.extend(np.fromiter(chain.from_iterable(kept), dtype=np.float64).reshape(len(kept), -1))


class SeenPaddle(Patient):
    """The same of a paddle that moves as a whole, which does not push: what is seen of its waves tells it.

    Parameters
    ----------
    number
        Which of their wall's paddles it is.
    record
        As above.
    """

    def __init__(self, waves: ObservedWaves, number: int, *, record: Record, schedule: Schedule):
        self._number, self._record, self.schedule = number, record, schedule
        self._waves = self.sees = waves

    def work_off(self, moments: Moments) -> None:
        """Append a row for each moment; collective."""
        self._record.extend(np.column_stack([moments.times, moments.seen(self._waves).rates[:, self._number]]))


class PaddleLimits:
    """Whether a paddle that absorbs keeps to what its drive can do: that is known afterwards only.

    Parameters
    ----------
    rates
        Functions of t [s] by name, that return numbers.
    limits
        The largest of what is ``LIMITED``, in m, m/s and m/s², as much as is.
    key
        What the paddle is called in a case.
    """

    def __init__(self, rates: Mapping[str, Callable[[Any], Any]], limits: Mapping[str, float], *, key: str):
        self.schedule, self._rates, self._limits, self._key = EverySteps(), rates, limits, key
        self._least, self._most = [np.inf] * len(RATES), [-np.inf] * len(RATES)

    def observe(self, moment: Moment) -> None:
        """See how far and how fast it goes."""
        now = [float(self._rates[name](moment.t)) for name in RATES]
        self._least, self._most = [*map(min, self._least, now)], [*map(max, self._most, now)]

    def verdict(self) -> list[str]:
        """Return a sentence for each limit that it has been beyond."""
        (least, most), *ends = zip(self._least, self._most, strict=True)
        sizes = (most - least, *(max(map(abs, of_rate)) for of_rate in ends))
        return [
            f"absorbing took the paddle of {self._key} to a {name} of {size:.4g} {unit}; {self._key}.limits.{name} "
            f"allows {self._limits[name]:.4g} {unit}: no such drive does that"
            for name, size, unit in zip(LIMITED, sizes, RATES.values(), strict=True)
            if size > self._limits.get(name, np.inf)
        ]

    def held(self) -> Held:
        """Return the ends of its ways."""
        return {"least": self._least, "most": self._most}

    def take(self, held: Held) -> None:
        """Take them back."""
        self._least, self._most = held["least"], held["most"]

    carry = take
