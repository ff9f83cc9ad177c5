"""What is seen of a state from a point near to it that is evaluated anyway: energies, the surface, how the wall stands.

Of a scheme that reports the mean of two traces the point is the later of these; of any other the state itself.
"""

from typing import NamedTuple, Protocol

import numpy as np

from wavetank.arrays import Vector
from wavetank.water.energy import Energies
from wavetank.water.walls.contract import Stood


class Seen(NamedTuple):
    """What is seen of a state.

    Attributes
    ----------
    energies
        Those of the state: H, and the potential energy, to the square of what lies between. W is that of the point, so
        that what it changes by is in the kinetic energy.
    eta
        The elevation [m], shape (owned,).
    rise
        How much higher that of the point is [m], shape (owned,).
    mass
        The water's volume, of a slice per width [m³, m²].
    stood, velocities
        How the wall stands then, and moves: see ``Placed`` and ``Wall``.
    power
        dH/dt of the point at fixed (Q, psi), in energy a second, where that costs nothing.
    """

    energies: Energies
    eta: Vector
    rise: Vector
    mass: float
    stood: Stood
    velocities: Vector
    power: float | None = None


class SeenWall(Protocol):
    """What is asked of a wall."""

    @property
    def stood(self) -> Stood:
        """How it stands now."""

    @property
    def velocities(self) -> Vector:
        """How it moves now [m/s]."""


class Evaluable(Protocol):
    """Water of which points can be evaluated; all methods are collective.

    Attributes
    ----------
    gravity
        [m/s²].
    """

    gravity: float

    @property
    def wall(self) -> SeenWall:
        """The wall."""

    def energies(self, q: Vector, p: Vector, t: float) -> Energies:
        """Return kinetic and potential energy and the wall's term."""

    def total_mass(self, q: Vector) -> float:
        """Return the water's volume, of a slice per width [m³, m²]."""

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,)."""

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dQ, shape (owned,)."""

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dpsi, shape (owned,)."""

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the degrees of freedom of all ranks."""


def seen_from(water: Evaluable, q: Vector, p: Vector, t: float, *, at: tuple[Vector, Vector]) -> Seen:
    """Return what is seen of a state at t [s] from a point; collective."""
    wall, energies, eta = water.wall, water.energies(*at, t), water.elevation(*at, t)
    mass = water.total_mass(q)
    if at[0] is q and at[1] is p:
        return Seen(energies, eta, np.zeros_like(eta), mass, wall.stood, wall.velocities)
    away = q - at[0]
    change = water.inner(water.H_q(*at, t), away) + water.inner(water.H_p(*at, t), p - at[1])
    lift, here = water.gravity * water.inner(eta, away), water.elevation(q, p, t)
    moved = Energies(energies.kinetic + change - lift, energies.potential + lift, energies.wall)
    return Seen(moved, here, eta - here, mass, wall.stood, wall.velocities)
