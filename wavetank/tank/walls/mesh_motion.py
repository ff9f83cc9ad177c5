"""The motion of the mesh beside a paddle: displacement, velocity and acceleration, as fields."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from wavetank.base.arrays import Vector, summed
from wavetank.fem.plane import Field, Plane
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.tank.walls.side import Side


class MeshMotion:
    """s X_p, s X_p' and s X_p'' in the horizontal space [m, m/s, m/s²], so that uniform flow is exact on any mesh.

    Their sign is that of x, for both directions of a paddle; X_p alone is positive into the water.

    Parameters
    ----------
    motion
        X_p(y, t) with its exact derivatives; for a rigid paddle the same at all y.
    s
        Field of the horizontal space.

    Attributes
    ----------
    kinematics
        X_p, X_p' and X_p''.
    position, speed, acceleration, blending
        s X_p, s X_p', s X_p'' and s.
    t
        Time of the values [s].
    velocities
        X_p' at the y of the owned degrees of freedom [m/s], shape (owned,), in a permanent array; for a rigid paddle
        ().
    rates
        X_p, X_p' and X_p'' of a rigid paddle [m, m/s, m/s²], shape (3,), in a permanent array; otherwise nan.
    """

    def __init__(self, motion: Motion, *, plane: Plane, side: Side, s: Field):
        self._comm, self.t, self._s = plane.comm, np.nan, side.sign * s.owned
        self.kinematics = PaddleKinematics(motion, side.along(plane.places))
        names = "s X_p", "s X_p'", "s X_p''", "s"
        self.position, self.speed, self.acceleration, self.blending = (plane.function(name) for name in names)
        self.blending.set(self._s)
        rigid = self.kinematics.rigid
        self._rates: Vector = np.zeros(3 if rigid else (3, plane.owned))
        self.rates: Vector = self._rates if rigid else np.full(3, np.nan)
        self.velocities: Vector = self._rates[1, ...]

    @property
    def displaced(self) -> float:
        """Largest displacement of the paddle from rest [m]."""
        positions = self._rates[0]
        return float(np.abs(positions).max(initial=0.0)) if np.ndim(positions) else abs(float(positions))

    def look_up(self, t: float) -> Vector:
        """Set X_p, X_p' and X_p'' to those at t [s], and return them."""
        rates = self.kinematics.table.get(t)
        if rates is None:
            rates = self.kinematics.at(t)
        self.t, self._rates[...] = t, rates
        return rates

    def set_time(self, t: float) -> bool:
        """Move to the position at t [s]; return whether the position has changed; collective."""
        if t == self.t:
            return False
        before = self._rates[0].copy()
        rates = self.look_up(t)
        self._set(self.position, rates[0])
        self._set(self.speed, rates[1])
        return summed(self._comm, float((before != rates[0]).any())) > 0

    @contextmanager
    def at_speed(self, speed: float) -> Iterator[None]:
        """Set another velocity [m/s], positive into the water, within a context; collective."""
        velocities, self.velocities = self.velocities, np.array(speed)
        self._set(self.speed, self.velocities)
        yield
        self.velocities = velocities
        self._set(self.speed, velocities)

    def accelerate(self, acceleration: float | None) -> None:
        """Set the acceleration [m/s²], positive into the water, by default that of the motion; collective."""
        self._set(self.acceleration, self._rates[2] if acceleration is None else acceleration)

    def _set(self, field: Field, values: Vector | float) -> None:
        np.multiply(self._s, values, out=field.owned)
        if self._comm.size > 1:
            field.fetch()

    def positions(self, t: float, y: Vector) -> Vector:
        """Return X_p at t [s] and positions y along the paddle [m], shape (N,)."""
        return np.full(y.shape, self.kinematics.motion.position(t, y))

    def speeds(self, y: Vector) -> Vector:
        """Return X_p' at positions y along the paddle [m/s], shape (N,)."""
        return np.full(y.shape, self.kinematics.motion.velocity(self.t, y) if self.velocities.ndim else self.velocities)
