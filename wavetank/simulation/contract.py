"""The contract of an observer, and what observers ask of waves."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector, read_only
from wavetank.fem.plane import Plane
from wavetank.simulation.clock import Schedule
from wavetank.tank.energy import Energies
from wavetank.tank.seen import Seen, Sight, State
from wavetank.tank.walls.contract import Heights, Paddle, Stood, stands, stood

Steps = NDArray[np.int64]


class Moment:
    """The state at one step.

    Attributes
    ----------
    step, t
        t = step dt [s].
    state
        Coordinates, momenta and what else the scheme knows.
    sights
        What has been seen of waves, by their ids.
    row
        Where it is there.
    """

    __slots__ = "row", "sights", "state", "step", "t"

    def __init__(self, step: int, t: float, state: State, *, sights: dict[int, Sight] | None = None, row: int = 0):
        self.step, self.t, self.state = step, t, state
        self.sights, self.row = {} if sights is None else sights, row

    @property
    def q(self) -> Vector:
        """The coordinates, shape (owned,), to be read: who writes into them is refused."""
        return read_only(self.state.q)

    @property
    def p(self) -> Vector:
        """The momenta, likewise."""
        return read_only(self.state.p)

    @property
    def points(self) -> Sequence[tuple[Vector, Vector]]:
        """Points next to (q, p) at which the system is evaluated anyway, in that order, to be read likewise."""
        return [(read_only(q), read_only(p)) for q, p in self.state.known]

    def look(self, waves: "ObservedWaves") -> Sight:
        """Return where what is seen of waves at this moment is, found once for all who look; collective."""
        sight = self.sights.get(id(waves))
        if sight is None:  # it stands alone, or has been worked off with others
            self.sights, self.row = {id(waves): waves.sight(1)}, 0
            sight = self.sights[id(waves)]
        if self.row >= sight.filled:
            waves.see(self.state, self.t, sight, self.row)
            sight.filled = self.row + 1
        return sight

    def elevation(self, waves: "ObservedWaves") -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,), to be read as q; collective."""
        return read_only(self.look(waves).eta[self.row])


class Moments:
    """Moments that are worked off together: their states are gone, what has been seen of them stands in rows.

    Of hundreds of states the vectors would take the caches that a step lives in. These rows are of the run, which takes
    others into them when these moments have been worked off.

    Attributes
    ----------
    steps, times
        Ascending, times in seconds, shape (K,) each.
    """

    def __init__(self, steps: Steps, times: Vector, sights: dict[int, Sight], rows: Steps):
        self.steps, self.times, self._sights, self._rows = steps, times, sights, rows
        self._seen = dict[int, Seen]()

    @classmethod
    def of(cls, moment: Moment) -> "Moments":
        """Return one alone."""
        return cls(np.array([moment.step]), np.array([moment.t]), moment.sights, np.array([moment.row]))

    def __len__(self) -> int:
        return len(self.steps)

    def some(self, which: Any) -> "Moments":
        """Return those of some indices, one at least."""
        return Moments(self.steps[which], self.times[which], self._sights, self._rows[which])

    def seen(self, waves: "ObservedWaves") -> Seen:
        """Return what is seen of waves, of all moments."""
        if id(waves) not in self._seen:
            self._seen[id(waves)] = Seen(self._sights[id(waves)], self._rows)
        return self._seen[id(waves)]

    def elevations(self, waves: "ObservedWaves") -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (K, owned)."""
        return self.seen(waves).eta

    def stood(self, waves: "ObservedWaves", number: int) -> Stood:
        """Return how the wall stood at one of them, as its ``stand`` asks for it."""
        return stood(float(self.times[number]), self.seen(waves).rates[number, :, 0])

    def stands(self, waves: "ObservedWaves", places: Vector) -> Vector:
        """Return how far from rest the wall's paddles stood beside places [m], shape (paddles, K, N); collective."""
        return stands(waves.wall.stand, places, self.times, self.seen(waves).rates[:, :, 0])


class Observer(Protocol):
    """Something that is recorded when its schedule says so."""

    @property
    def schedule(self) -> Schedule:
        """When it acts."""

    def observe(self, moment: Moment) -> None:
        """Record the moment; collective."""


class Patient(ABC):
    """An observer whose record nobody needs at once: it is given the moments of many steps together.

    A step of a slice takes a millisecond, and what looks at it through caches that are not its own takes most of its
    time to begin. What comes of a moment must not depend, by a bit, on how many are worked off together.

    Attributes
    ----------
    sees
        The waves that are looked at, of each moment when it comes, for ``Moment.look``; None: they are not needed.
    foreseen
        Whether no moment can end the run, so that it never ``hurries``.
    """

    sees: "ObservedWaves | None" = None
    foreseen = True

    @property
    def hurries(self) -> bool:
        """Whether all moments are to be worked off now, as the last of them may end the run; the same on all ranks."""
        return False

    @abstractmethod
    def work_off(self, moments: Moments) -> None:
        """Record moments, in their order: those since the last time, one at least; collective."""

    def observe(self, moment: Moment) -> None:
        """Record the moment; collective."""
        if self.sees is not None:
            moment.look(self.sees)
        self.work_off(Moments.of(moment))


class Keeping(Patient):
    """One that looks at moments when they come, too."""

    schedule: Schedule

    @property
    def keeps(self) -> Schedule | None:
        """When there is something that does not last; None: never."""
        return self.schedule

    @abstractmethod
    def keep(self, moment: Moment) -> None:
        """Keep what does not last of a moment that will be worked off; collective."""

    def observe(self, moment: Moment) -> None:
        """Record the moment; collective."""
        self.keep(moment)
        super().observe(moment)


@runtime_checkable
class Filtering(Protocol):
    """An observer that is also told when filters have acted on a state."""

    def acted(self, t: float) -> None:
        """Take note of that, before they do of what they have taken."""


@runtime_checkable
class Judge(Protocol):
    """An observer that has something to say of the run when it has ended."""

    def verdict(self) -> list[str]:
        """Return what readers must know of the run, a sentence each, the same on all ranks; none if all is well."""


class ObservedWall(Protocol):
    """What observers ask of a wall: where the reference tank lies in the laboratory."""

    @property
    def paddles(self) -> Sequence[Paddle]:
        """What moves of it."""

    @property
    def leans(self) -> bool:
        """Whether that is not the same at all heights."""

    @property
    def velocities(self) -> Vector:
        """How it moves now [m/s], shape (owned,) or (1,)."""

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """Return whether its paddles can carry what is at places [m], shape (N,)."""

    @property
    def stood(self) -> Stood:
        """How it stands now, as ``stand`` asks for it."""

    def stand(self, places: Vector, stood: Stood | None = None) -> Vector:
        """Return how far from rest its paddles stand beside places [m], or stood, shape (paddles, N)."""

    def to_reference(self, places: Vector, z: Heights = 0.0, stand: Vector | None = None) -> Vector:
        """Return the reference places of physical ones, (x, y) [m], shape (N, 2), at heights z [m]; see ``Placed``."""

    def to_physical(self, places: Vector, z: Heights = 0.0, stand: Vector | None = None) -> Vector:
        """Return the physical places of reference ones, (x, y) [m], shape (N, 2), at heights z [m]; see ``Placed``."""


class ObservedWaves(Protocol):
    """What observers ask of waves, linear or nonlinear; all methods are collective.

    Attributes
    ----------
    plane, depth, gravity
        The horizontal space, the mean still-water depth d [m] and gravity [m/s²].
    """

    plane: Plane
    depth: float
    gravity: float

    @property
    def wall(self) -> ObservedWall:
        """The wall at x = 0."""

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,)."""

    def energies(self, q: Vector, p: Vector, t: float) -> Energies:
        """Return kinetic and potential energy and the wall's term (see ``Energies``)."""

    def explicit_rate(self, q: Vector, p: Vector, t: float) -> float:
        """Return dH/dt at fixed (Q, psi), in energy a second."""

    def slopes(self, q: Vector, p: Vector, t: float) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' of each paddle at fixed (Q, psi)."""

    def sight(self, most: int) -> Sight:
        """Return room for what is seen of so many moments."""

    def see(self, state: State, t: float, into: Sight, row: int) -> None:
        """See a state at t [s] from the last of its known points, which is evaluated then: into a row."""

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the degrees of freedom of all ranks."""

    def total_mass(self, q: Vector) -> float:
        """Return the water's volume, of a slice per width [m³, m²]."""
