"""The contract of an observer, and what observers ask of waves."""

from typing import NamedTuple, Protocol

from wavetank.fe.plane import Field, Plane
from wavetank.hamiltonian.contract import Vector
from wavetank.observers.schedule import Schedule
from wavetank.water.waves import Energies


class Moment(NamedTuple):
    """The state at one step: t = step dt [s], coordinates and momenta."""

    step: int
    t: float
    q: Vector
    p: Vector


class Observer(Protocol):
    """Something that is recorded when its schedule says so."""

    @property
    def schedule(self) -> Schedule:
        """When it acts."""

    def observe(self, moment: Moment) -> None:
        """Record the moment; collective."""


class ObservedWall(Protocol):
    """What observers ask of a wall: where the reference tank lies in the laboratory."""

    def to_reference(self, x: Vector) -> Vector:
        """Return X for physical positions x [m]."""

    def to_physical(self, X: Vector) -> Vector:
        """Return x for reference positions X [m]."""


class ObservedWaves(Protocol):
    """What observers ask of waves, linear or nonlinear; all methods are collective.

    Attributes
    ----------
    plane, depth
        The horizontal space and the still-water depth d [m].
    h
        The water column of the state last evaluated [m].
    """

    plane: Plane
    depth: float
    h: Field

    @property
    def wall(self) -> ObservedWall:
        """The wall at x = 0."""

    def evaluate(self, q: Vector, p: Vector, t: float) -> None:
        """Find what belongs to a state."""

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,)."""

    def energies(self, q: Vector, p: Vector, t: float) -> Energies:
        """Return kinetic and potential energy and the wall's term [m^4/s²]."""

    def explicit_rate(self, q: Vector, p: Vector, t: float) -> float:
        """Return dH/dt at fixed (Q, psi) [m^4/s³]."""

    def total_mass(self, q: Vector) -> float:
        """Return the water's volume per width [m²]."""
