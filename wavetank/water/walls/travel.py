"""How far a paddle has carried the water, and how fast it does."""

import numpy as np
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.fe.plane import Field, Plane
from wavetank.motions import Motion
from wavetank.water.walls.side import Side


class Travel:
    """How far a paddle carries the water, and how fast: s X_p, s X_p' and s X_p'' in UFL, in m, m/s, m/s².

    All are in the horizontal space, so that x is, and uniform flow is exact on any mesh.

    Parameters
    ----------
    motion
        X_p(y, t) with its exact derivatives; of a paddle that moves as a whole the same at all y.
    s
        A field of the horizontal space.

    Attributes
    ----------
    velocities
        X_p' at the y of the owned degrees of freedom [m/s], shape (owned,).
    """

    def __init__(self, motion: Motion, *, plane: Plane, side: Side, s: Field):
        self._motion, self._comm, self._t, self._s = motion, plane.comm, np.nan, s.owned.copy()
        self._y, self._place = np.unique(np.round(side.along(plane.places), 9), return_inverse=True)
        self._fields = [plane.function(name) for name in ("s X_p", "s X_p'", "s X_p''")]
        self.position, self.speed, self.acceleration = (field.function for field in self._fields)
        self._at: Vector = np.zeros(self._y.size)
        self.velocities: Vector = np.zeros(self._place.size)

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether its position has changed; collective.

        The acceleration stays as it is.
        """
        if t == self._t:
            return False
        self._t, before = t, self._at
        self._at, self.velocities = self.positions(self._y), self.speeds(self._y)[self._place]
        self._set(0, self._at[self._place])
        self._set(1, self.velocities)
        return bool(self._comm.allreduce(int(not np.array_equal(before, self._at)), op=MPI.MAX))

    def set_acceleration(self) -> None:
        """Bring the acceleration to the time of the position; collective."""
        values = np.broadcast_to(self._motion.acceleration(self._t, self._y), self._y.shape)
        self._set(2, values[self._place])

    def _set(self, order: int, values: Vector) -> None:
        self._fields[order].set(self._s * values)

    def positions(self, y: Vector) -> Vector:
        """Return X_p at places y along the paddle [m], shape (N,)."""
        return np.broadcast_to(self._motion.position(self._t, y), y.shape)

    def speeds(self, y: Vector) -> Vector:
        """Return X_p' at places y along the paddle [m/s], shape (N,)."""
        return np.broadcast_to(self._motion.velocity(self._t, y), y.shape)
