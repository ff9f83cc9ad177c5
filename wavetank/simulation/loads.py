"""Loads: force and moment of the water on walls, and what a paddle does against it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from wavetank.arrays import Vector
from wavetank.simulation.contract import Moment
from wavetank.simulation.record import Record
from wavetank.simulation.schedule import Schedule
from wavetank.tank.wall_pressure import PaddlePush, WallPressure


class Loads:
    """Force and moment on walls.

    Parameters
    ----------
    about
        The point of each wall that its moments are taken about, (x, y, z) [m].
    record
        Where rows go, in the order of ``load_columns``.
    """

    def __init__(self, pressure: WallPressure, about: Sequence[Vector], *, record: Record, schedule: Schedule):
        self._pressure, self._about, self._record, self.schedule = pressure, about, record, schedule
        basin = pressure.plane.mesh.topology.dim == 2
        self._shown = [0, 1, 2, 3, 4, 5] if basin else [0, 2, 4]

    def observe(self, moment: Moment) -> None:
        """Append one row; collective."""
        self._pressure.find(moment.q, moment.p, moment.t)
        loads = [self._pressure.load(wall, point) for wall, point in enumerate(self._about)]
        self._record.extend([[moment.t, *np.concatenate([np.concatenate(load)[self._shown] for load in loads])]])


class Pushing:
    """Force and power of a paddle, at a moment.

    Parameters
    ----------
    velocity
        X_p' at times t and places y along the paddle.
    """

    def __init__(self, push: PaddlePush, velocity: Callable[..., Any]):
        self._push, self._velocity = push, velocity

    def at(self, moment: Moment) -> tuple[float, float]:
        """Return force [N, N/m] and power [W, W/m]; collective."""
        self._push.pressure.find(moment.q, moment.p, moment.t)
        speed = self._velocity(moment.t, self._push.y)
        return self._push.against(1.0), self._push.against(speed)
