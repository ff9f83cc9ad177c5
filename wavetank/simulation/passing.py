"""Places that a paddle may reach: there nobody can look at the water any longer."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import PaddleError
from wavetank.simulation.contract import ObservedWall
from wavetank.tank.walls.contract import Stood

NEAR = 0.5  # of the way to a place, at still water: from there on it is looked at once whether a paddle is there


class Called(NamedTuple):
    """What places and paddles are called in a case, such as ``gauges.0`` and ``far_wall``."""

    places: Sequence[str]
    paddles: Sequence[str]

    @classmethod
    def unnamed(cls, wall: ObservedWall, what: str, places: Vector) -> "Called":
        """Return what they are called outside of cases: ``gauge 1`` and ``wall 1``."""
        named = ((what, len(places)), ("wall", len(wall.paddles)))
        return cls(*([f"{one} {n + 1}" for n in range(count)] for one, count in named))


class Passing:
    """Places that paddles may reach.

    Parameters
    ----------
    places
        (x, y) [m], shape (N, 2).
    called
        What they and the paddles are called.
    """

    def __init__(self, wall: ObservedWall, places: Vector, called: Called):
        self._places, self._called = places, called
        self._distances = np.array([paddle.side.distances(places) for paddle in wall.paddles])
        self._shares = np.array([[float(np.max(paddle.shape.at(np.zeros(1))))] for paddle in wall.paddles])
        each = zip(self._distances, self._shares, strict=True)
        self._nearest = [NEAR * float(distances.min(initial=np.inf)) / float(share[0]) for distances, share in each]

    def near(self, stood: Stood) -> bool:
        """Return whether a paddle that stood so may be near a place; one that does not move as a whole always may."""
        return any(x is None or x > near for (_, x), near in zip(stood, self._nearest, strict=True))

    def error(self, t: float, place: int, stand: Vector) -> PaddleError:
        """Return what there is to say of a place that is behind a paddle at t [s], as they stand, (paddles, N)."""
        which = int(np.argmax((self._shares * stand - self._distances)[:, place]))
        (x, y), (names, paddles) = self._places[place], self._called
        where = f"x = {x:.6g} m{f', y = {y:.6g} m' if y else ''}"
        who = f"the paddle of {paddles[which]} has reached {names[place]}, {where}"
        return PaddleError(f"t = {t:.6g} s: {who}: it must stand farther from the wall", t=t)
