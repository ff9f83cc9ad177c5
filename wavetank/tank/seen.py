"""Energies, elevation and paddle kinematics of reported states, by first-order expansion about the nearest evaluation.

A scheme that reports the mean of two traces evaluates these traces, not their mean: the expansion is about the later
trace. Of any other scheme the reported state is evaluated itself. States of consecutive steps are rows of a ``Block``.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.tank.energy import Energies

NUMBERS = KINETIC, POTENTIAL, WALL, MASS, POWER, DAMPED, HIGHEST, LARGEST = range(8)  # in a row


class SeenWall(Protocol):
    """What is asked of a wall."""

    @property
    def rates(self) -> Vector:
        """How its paddles stand and move now; see ``Placed``."""

    @property
    def velocities(self) -> Vector:
        """How it moves now [m/s]."""


@dataclass(eq=False)
class Block:
    """Reported states of K consecutive steps as arrays over time, for diagnostics.

    The arrays are views of memory that the next block overwrites: copy what is needed later.

    Attributes
    ----------
    step, t
        Numbers of the steps, and their times [s], ascending, shape (K,).
    q
        Column masses, shape (K, owned).
    psi
        Surface potential [m²/s], shape (K, owned).
    eta
        Surface elevation at the owned degrees of freedom [m], shape (K, owned); next to a leaning paddle it is accurate
        to second order in the jump.
    rise
        Elevation behind the jump of the state, less that of the mean of both sides [m], shape (K, owned).
    numbers
        The columns that ``kinetic`` to ``largest`` name, shape (K, 8).
    rates
        X_p, X_p' and X_p'' of each paddle; nan for one that does not move as one [m, m/s, m/s²], shape (K, paddles, 3).
    velocities
        Horizontal velocity of the wall [m/s], shape (K, owned) or (K, 1).
    dissipated
        Energy that each filter has taken by then, shape (K, filters that dissipate).
    work
        Energy that paddles with feedback have put in, and what they have absorbed of it, shape (K, 2); nan without.
    dt
        Time step [s].
    state
        State of the integrator at the last step computed.
    """

    step: NDArray[np.int64]
    t: Vector
    q: Vector
    psi: Vector
    eta: Vector
    rise: Vector
    numbers: Vector
    rates: Vector
    velocities: Vector
    dissipated: Vector
    work: Vector
    dt: float = 0.0
    state: Any = None

    @classmethod
    def empty(cls, most: int, *, owned: int, paddles: int = 0, velocities: int = 1, sinks: int = 0) -> Self:
        """Return memory for a block of so many steps."""
        numbers = np.full((most, len(NUMBERS)), np.nan)
        numbers[:, DAMPED] = 0.0
        return cls(
            step=np.zeros(most, dtype=np.int64),
            t=np.zeros(most),
            q=np.zeros((most, owned)),
            psi=np.zeros((most, owned)),
            eta=np.zeros((most, owned)),
            rise=np.zeros((most, owned)),
            numbers=numbers,
            rates=np.full((most, paddles, 3), np.nan),
            velocities=np.zeros((most, velocities)),
            dissipated=np.zeros((most, sinks)),
            work=np.full((most, 2), np.nan),
        )

    def __len__(self) -> int:
        return len(self.step)

    def at(self, which: Any) -> Self:
        """Return the block of some of the steps, by their indices, a slice or a mask."""
        return replace(self, **{name: array[which] for name, array in self.arrays().items()})

    def arrays(self) -> dict[str, Any]:
        """Return the arrays by their names."""
        return {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}

    def read_only(self, count: int, *, dt: float, state: Any) -> Self:
        """Return the first steps for reading: whoever writes into their arrays meets a ``ValueError``."""
        result = replace(self.at(slice(count)), dt=dt, state=state)
        for array in result.arrays().values():
            array.flags.writeable = False
        return result

    def states(self) -> Iterator[tuple[Vector, Vector, float]]:
        """Return column masses, surface potential and time of each step."""
        return zip(self.q, self.psi, map(float, self.t), strict=True)

    def until(self, t: float) -> Self:
        """Return the steps up to a time [s]."""
        if t >= self.t[-1]:
            return self
        return self.at(self.t <= t)

    kinetic = property(lambda self: self.numbers[:, KINETIC], doc="Kinetic energy, to second order in the jump.")
    potential = property(lambda self: self.numbers[:, POTENTIAL], doc="Potential energy, to second order in the jump.")
    wall_energy = property(lambda self: self.numbers[:, WALL], doc="The wall's term W of the Hamiltonian.")
    mass = property(lambda self: self.numbers[:, MASS], doc="Volume of the water [m³], in a slice per width [m²].")
    power = property(lambda self: self.numbers[:, POWER], doc="Power dH/dt at fixed (Q, psi), of the paddles.")
    damped = property(lambda self: self.numbers[:, DAMPED], doc="Power that the sponge takes.")
    highest = property(lambda self: self.numbers[:, HIGHEST], doc="Highest elevation on this rank [m].")
    largest = property(lambda self: self.numbers[:, LARGEST], doc="Largest magnitude of the elevation there [m].")


class State(Protocol):
    """A scheme's state."""

    @property
    def q(self) -> Vector:
        """Column masses."""

    @property
    def p(self) -> Vector:
        """Surface potential."""

    @property
    def known(self) -> Sequence[tuple[Vector, Vector]]:
        """Points next to them, of which the last is evaluated anyway."""

    @property
    def q_jump(self) -> Vector | None:
        """The jump of the column masses; None where the scheme lets them have none."""


class Evaluable(Protocol):
    """Water of which points can be evaluated; all methods are collective.

    Attributes
    ----------
    gravity
        [m/s²].
    damping
        The rate at which momenta are damped [1/s], shape (owned,); None where they are not.
    """

    gravity: float
    damping: Vector | None

    @property
    def wall(self) -> SeenWall:
        """The wall."""

    def knows(self, q: Vector, p: Vector, t: float) -> bool:
        """Return whether that point was evaluated last."""

    def see_from(self, at: tuple[Vector, Vector], state: State, t: float, into: Block, row: int) -> None:
        """See a state at t [s] from a point near it, into a row."""

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

    def explicit_rate(self, q: Vector, p: Vector, t: float) -> float:
        """Return dH/dt at fixed (Q, psi), in energy a second."""

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the degrees of freedom of all ranks."""


def see(water: Evaluable, state: State, t: float, into: Block, row: int) -> None:
    """Write energies, elevation and kinematics of a state at t [s] into a row of a block; collective.

    The expansion is about the last of its known points. Power and damping are means of the first and the last of these,
    unless the first would cost a solve.
    """
    first, last = state.known[0], state.known[-1]
    before = _rates(water, state.p, first, t) if first is not last and water.knows(*first, t) else None
    water.see_from(last, state, t, into, row)
    if before is not None:
        into.numbers[row, POWER:HIGHEST] = (before + into.numbers[row, POWER:HIGHEST]) / 2


def _rates(water: Evaluable, p: Vector, at: tuple[Vector, Vector], t: float) -> Vector:
    """Return the power at a point, and what damping takes of momenta p as seen from there, shape (2,); collective."""
    taken = 0.0 if water.damping is None else water.inner(water.damping * p, water.H_p(*at, t))
    return np.array([water.explicit_rate(*at, t), taken])


def see_from(water: Evaluable, at: tuple[Vector, Vector], state: State, t: float, into: Block, row: int) -> None:
    """See a state at t [s] from a point near it, into a row; collective."""
    wall, q, p = water.wall, state.q, state.p
    energies, eta, here, change, lift = water.energies(*at, t), water.elevation(*at, t), None, 0.0, 0.0
    if at[0] is not q or at[1] is not p:
        away = q - at[0]
        change = water.inner(water.H_q(*at, t), away) + water.inner(water.H_p(*at, t), p - at[1])
        lift, here = water.gravity * water.inner(eta, away), water.elevation(q, p, t)
    into.rise[row] = 0.0 if here is None else eta - here  # of the two sides of a jump it is half of what is between
    into.eta[row] = eta = eta if here is None else here
    moved = energies.kinetic + change - lift, energies.potential + lift, energies.wall, water.total_mass(q)
    into.numbers[row, :POWER] = moved
    into.numbers[row, POWER:HIGHEST] = _rates(water, p, at, t)
    into.numbers[row, HIGHEST:] = eta.max(initial=-np.inf), np.abs(eta).max(initial=0.0)
    into.psi[row], into.rates[row] = p, wall.rates
    into.velocities[row] = wall.velocities
