"""What is seen of states from points near them that are evaluated anyway: energies, the surface, how the wall stands.

Of a scheme that reports the mean of two traces the point is the later of these; of any other the state itself. What is
seen of many moments stands in rows of arrays, so that who looks at all of them takes no step of Python for each.
"""

from collections.abc import Sequence
from typing import Protocol

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


class Sight:
    """Room for what is seen of moments that follow each other.

    Parameters
    ----------
    most
        The number of rows.
    owned
        The number of degrees of freedom of this rank.
    wall
        Whose way is seen, too.

    Attributes
    ----------
    filled
        How many rows are.
    eta
        The elevation [m], shape (most, owned); beside a paddle that leans to the square of what lies between.
    rise
        How much higher it is after the state's jump than in the mean of both sides [m], shape (most, owned).
    psi
        The surface potential [m²/s], shape (most, owned).
    numbers
        Kinetic and potential energy and the wall's part, those of the states: H, and the potential energy, to the
        square of what lies between, and W as of the points, so that what that changes by is in the kinetic energy; the
        water's volume, of a slice per width [m³, m²]; the power dH/dt at fixed (Q, psi), in energy a
        second, of the mean of first and last of the known points, or of the last where the first would cost a solve;
        what damping takes of H, likewise, of the state's momenta and dH/dp at these points;
        of the elevation the highest and the largest magnitude [m], on this rank, nan where any is. Shape (most, 8).
    rates
        X_p, X_p' and X_p'' of each paddle, nan of one that does not move as a whole [m, m/s, m/s²], shape (most,
        paddles, 3).
    velocities
        How the wall moves [m/s], shape (most, owned) or (most, 1).
    """

    def __init__(self, most: int, *, owned: int, wall: SeenWall):
        self.eta: Vector = np.zeros((most, owned))
        self.rise: Vector = np.zeros((most, owned))
        self.psi: Vector = np.zeros((most, owned))
        self.numbers: Vector = np.full((most, len(NUMBERS)), np.nan)
        self.numbers[:, DAMPED] = 0.0
        self.rates: Vector = np.full((most, *wall.rates.shape), np.nan)
        self.velocities: Vector = np.zeros((most, wall.velocities.size))
        self.filled = 0

    def clear(self) -> None:
        """Make room for others."""
        self.filled = 0

    def energy(self, row: int) -> float:
        """Return H of a state."""
        kinetic, potential, wall, *_ = self.numbers[row]
        return float(kinetic + potential + wall)


class Seen:
    """What is seen of K moments: which rows of the arrays of a ``Sight``, which says what is what, by their names."""

    def __init__(self, sight: Sight, rows: NDArray[np.int64]):
        together = rows[-1] - rows[0] == len(rows) - 1
        self.sight, self.rows, self._some = sight, rows, slice(rows[0], rows[-1] + 1) if together else rows

    def __getattr__(self, name: str) -> Vector:
        rows: Vector = getattr(self.sight, name)[self._some]
        return rows


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

    def see_from(self, at: tuple[Vector, Vector], state: State, t: float, into: Sight, row: int) -> None:
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


def see(water: Evaluable, state: State, t: float, into: Sight, row: int) -> None:
    """See a state at t [s] from the last of its known points, into a row; collective.

    Power, and what damping takes, are the means of those at the first and at the last, unless the first would cost a
    solve.
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


def see_from(water: Evaluable, at: tuple[Vector, Vector], state: State, t: float, into: Sight, row: int) -> None:
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
