"""Energies, elevation and paddle kinematics of reported states, by first-order expansion about the nearest evaluation.

A scheme that reports the mean of two traces evaluates these traces, not their mean: the expansion is about the later
trace. Any other scheme evaluates the reported state. States of consecutive steps are rows of a ``Block``.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.base.arrays import Vector, summed

NUMBERS = KINETIC, POTENTIAL, WALL, MASS, POWER, DAMPED, HIGHEST, LARGEST = range(8)  # columns of a row


@dataclass(eq=False)
class Block:
    """Reported states of K consecutive steps as arrays over time, for diagnostics.

    The arrays are views of memory that the next block overwrites: copy values for later use.

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
        Elevation after the jump of the state, relative to the mean of both sides [m], shape (K, owned).
    numbers
        The columns ``kinetic`` to ``largest``, shape (K, 8).
    rates
        X_p, X_p' and X_p'' of each paddle; nan if they vary along the paddle [m, m/s, m/s²], shape (K, paddles, 3).
    velocities
        Horizontal velocity of the wall [m/s], shape (K, owned) or (K, 1).
    dissipated
        Energy that each filter has dissipated, shape (K, filters that dissipate).
    work
        Energy that paddles with feedback have supplied, and have absorbed of it, shape (K, 2); nan without.
    dt
        Time step [s].
    state
        State of the integrator at the last computed step.
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
        """Return the storage of a block for a number of steps."""
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
        """Return the first steps for reading: writing into the arrays raises ``ValueError``."""
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
    damped = property(lambda self: self.numbers[:, DAMPED], doc="Power that the sponge dissipates.")
    highest = property(lambda self: self.numbers[:, HIGHEST], doc="Highest elevation on this rank [m].")
    largest = property(lambda self: self.numbers[:, LARGEST], doc="Largest magnitude of the elevation there [m].")


Parts = tuple[float, float, float]
"""This rank's parts of sums at a state: changes of the energy and of the potential energy, power of damping."""


def write_sums(comm: MPI.Comm, block: Block, parts: Sequence[Parts]) -> None:
    """Complete the numbers of a block by the sums over all ranks; collective."""
    sums = np.column_stack([np.array(parts, dtype=np.float64), block.q.sum(axis=1)])
    change, lift, damped, mass = summed(comm, sums).T
    numbers, highest = block.numbers, block.eta.max(axis=1, initial=-np.inf)
    numbers[:, KINETIC] += change - lift
    numbers[:, POTENTIAL] += lift
    numbers[:, MASS], numbers[:, DAMPED], numbers[:, HIGHEST] = mass, damped, highest
    lowest = block.eta.min(axis=1, initial=np.inf)
    numbers[:, LARGEST] = np.maximum(highest, -lowest) if block.eta.size else 0.0  # nan if any value is nan
