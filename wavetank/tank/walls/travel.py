"""How far a paddle has carried the water, and how fast it does."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from wavetank.base.arrays import Vector, summed
from wavetank.fem.plane import Field, Plane
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.tank.walls.side import Side


class Travel:
    """How far a paddle carries the water, and how fast: s X_p, s X_p' and s X_p'' in UFL, in m, m/s, m/s².

    They count along x, whichever way the paddle faces; X_p alone is positive into the water. All are in the horizontal
    space, so that x is, and uniform flow is exact on any mesh.

    Parameters
    ----------
    motion
        X_p(y, t) with its exact derivatives; of a paddle that moves as a whole the same at all y.
    s
        A field of the horizontal space.

    Attributes
    ----------
    kinematics
        X_p, X_p' and X_p''.
    blending
        The displacement for X_p = 1 m: s.
    t
        When it stands as it does [s].
    offsets, velocities, accelerations
        X_p, X_p' and X_p'' at the y of the owned degrees of freedom [m, m/s, m/s²], shape (owned,), in one array for
        good; of a paddle that moves as a whole ().
    moves
        The same of one that moves as a whole, shape (3,), for good; nan of any other.
    """

    def __init__(self, motion: Motion, *, plane: Plane, side: Side, s: Field):
        self._comm, self.t, self._s = plane.comm, np.nan, side.sign * s.owned
        self.kinematics = PaddleKinematics(motion, side.along(plane.places))
        self._fields = [plane.function(name) for name in ("s X_p", "s X_p'", "s X_p''", "s")]
        self.position, self.speed, self.acceleration, self.blending = (field.function for field in self._fields)
        self._fields[3].set(self._s)
        rigid = self.kinematics.rigid
        self._rates = np.zeros(3 if rigid else (3, plane.owned))
        self.moves: Vector = self._rates if rigid else np.full(3, np.nan)
        self.offsets: Vector
        self.velocities: Vector
        self.accelerations: Vector
        self.offsets, self.velocities, self.accelerations = (self._rates[order, ...] for order in range(3))

    @property
    def displaced(self) -> float:
        """How far from rest the paddle stands at most [m]."""
        return float(np.abs(self.offsets).max(initial=0.0)) if self.offsets.ndim else abs(float(self.offsets))

    def look_up(self, t: float) -> Vector:
        """Set X_p, X_p' and X_p'' to those at t [s], and return them."""
        rates = self.kinematics.table.get(t)
        if rates is None:
            rates = self.kinematics.at(t)
        self.t, self._rates[...] = t, rates
        return rates

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether its position has changed; collective."""
        if t == self.t:
            return False
        before = self.offsets.copy()
        rates = self.look_up(t)
        moved = (before != rates[0]).any()
        for order in (0, 1):
            self._set(order, rates[order])
        return summed(self._comm, float(moved)) > 0

    @contextmanager
    def going(self, speed: float) -> Iterator[None]:
        """Go, for a while, at another speed [m/s], positive into the water, and acceleration; collective."""
        velocities, accelerations = self.velocities, self.accelerations
        self.velocities = np.array(speed)
        self._set(1, self.velocities)
        yield
        self.velocities, self.accelerations = velocities, accelerations
        self._set(1, self.velocities)

    def accelerate(self, acceleration: float) -> None:
        """Have an acceleration [m/s²], positive into the water, while it is ``going``."""
        self.accelerations = np.array(acceleration)

    def show_acceleration(self) -> None:
        """Let forms see it; collective."""
        self._set(2, self.accelerations)

    def _set(self, order: int, values: Vector) -> None:
        field = self._fields[order]
        np.multiply(self._s, values, out=field.owned)
        if self._comm.size > 1:
            field.fetch()

    @property
    def at_nodes(self) -> tuple[Vector, Vector]:
        """S X_p and s X_p' at the owned degrees of freedom [m, m/s], shape (owned,) each; views."""
        return self._fields[0].owned, self._fields[1].owned

    @property
    def rigid_position(self) -> float | None:
        """X_p now [m]; None of a paddle whose X_p depends on y."""
        return None if self.offsets.ndim else float(self.offsets)

    @property
    def timed_position(self) -> tuple[float, float | None]:
        """The time [s] and X_p [m]; None of a paddle whose X_p depends on y."""
        return self.t, self.rigid_position

    def rates(self, t: float, y: Vector | None) -> Vector | list[float]:
        """Return X_p, X_p' and X_p'' at t [s] and places y along the paddle; what is known is not found again."""
        if self.offsets.ndim or t != self.t:
            return self.kinematics.motion.rates(t, y)
        return [*map(float, self.moves)]

    def positions(self, t: float, y: Vector) -> Vector:
        """Return X_p at t [s] and places y along the paddle [m], shape (N,)."""
        return np.full(y.shape, self.kinematics.motion.position(t, y))

    def speeds(self, y: Vector) -> Vector:
        """Return X_p' at places y along the paddle [m/s], shape (N,)."""
        return np.full(y.shape, self.kinematics.motion.velocity(self.t, y) if self.velocities.ndim else self.velocities)
