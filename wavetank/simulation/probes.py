"""Probes: velocity, acceleration and pressure at fixed points of the laboratory, where there is water."""

import numpy as np

from wavetank.errors import OutsideError
from wavetank.simulation.contract import Moment
from wavetank.simulation.passing import Called, Passing
from wavetank.simulation.record import Record
from wavetank.simulation.schedule import EverySteps, Schedule
from wavetank.stateful import Held, Stateful
from wavetank.tank.rates import MovingWater
from wavetank.tank.sounding import Sounding


class Probes:
    """What the water does at points: see ``records.probe_table`` for the columns; empty where there is none.

    Parameters
    ----------
    sounding
        The points.
    record
        Where rows go.
    called
        What they and the paddles are called in a case.
    """

    added = True

    def __init__(
        self,
        water: MovingWater,
        sounding: Sounding,
        *,
        record: Record,
        schedule: Schedule,
        called: Called | None = None,
    ):
        self._water, self._sounding, self._record, self.schedule = water, sounding, record, schedule
        self._places = sounding.places
        self._points = [f"x = {x:g}, y = {y:g}, z = {z:g} m" for x, y, z in sounding.points]
        self._passing = Passing(water.wall, self._places, called or Called.unnamed(water.wall, "probe", self._places))
        self._axes = axes_of(water)
        self._wet: dict[str, bool] = {}  # by a probe's place: whether there has been water

    def observe(self, moment: Moment) -> None:
        """Append one row; raises ``PaddleError`` if a paddle has passed a probe; collective."""
        self._water.find_rates(moment.q, moment.p, moment.t)
        try:
            found = self._sounding.take()
        except OutsideError as error:
            raise self._passing.error(moment.t, error.index, self._water.wall.stand(self._places)) from None
        for name, dry in zip(self._points, found.dry, strict=True):
            self._wet[name] = self._wet.get(name, False) or not bool(dry)
        vectors = (vector[:, self._axes] for vector in (found.velocity, found.local, found.acceleration))
        each = np.column_stack([*vectors, found.pressure])
        rows = ([None] * len(row) if dry else row for row, dry in zip(each, found.dry, strict=True))
        self._record.extend([[moment.t, *(value for row in rows for value in row)]])

    def verdict(self) -> list[str]:
        """Return a sentence for probes without water at any time."""
        dry = [point for point, wet in self._wet.items() if not wet]
        return [f"probes without water at any time, their columns are empty: {'; '.join(dry)}"] if dry else []

    def held(self) -> Held:
        """Return at which places there has been water."""
        return dict(self._wet)

    def take(self, held: Held) -> None:
        """Take that back."""
        self._wet = dict(held)

    carry = take


def axes_of(water: MovingWater) -> list[int]:
    """Return which of x, y and z vectors have components along."""
    return [0, 1, 2] if water.plane.mesh.topology.dim == 2 else [0, 2]


class WaterKept:
    """Remembers the water that others look into, so that a run that goes on looks into the same."""

    added = True

    def __init__(self, water: Stateful):
        self.schedule, self._water = EverySteps(), water

    def observe(self, moment: Moment) -> None:
        """Do nothing."""

    def held(self) -> Held:
        """Return what the water holds."""
        return self._water.held()

    def take(self, held: Held) -> None:
        """Let it take that back; collective."""
        self._water.take(held)
