"""A sponge: the exact damping factor between the steps of any scheme.

    p <- e^(-gamma dt) p     after each step, and half of that before the first

is the damping dp/dt = -H_q - gamma p of [G16] (38)-(45) ([G16] is Gagarina et al. 2016), half of it before and half of
it after each step: symmetric, of second order with any scheme of order two or more (Strang). What a step ends with has
the second half and the next one's first: coordinates are those of second order, momenta e^(-gamma dt/2) of them. The
coordinates, hence mass, are never touched.
"""

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.contract import State
from wavetank.integrators.damped import same
from wavetank.stateful import Held


class Absorbing:
    """A filter that damps the momenta after every step; stable where the scheme is.

    Parameters
    ----------
    gamma
        Damping rate of the momenta [1/s], not negative, shape (1,) or one per unknown, (n,).
    dt
        Step [s].

    Attributes
    ----------
    energy_taken
        Of H since the start, the system's unit of energy.
    called, gives
        In words, what it is, and what makes it give energy instead.
    """

    called = "the sponge"
    gives = (
        "waves far longer than it, as go before a train or a group, make it do so, or a current, "
        "or it is too strong or begins too abruptly"
    )

    def __init__(self, gamma: Vector, *, dt: float):
        self._dt, self.energy_taken = dt, 0.0
        self._take(gamma)

    def _take(self, gamma: Vector) -> None:
        self.gamma, self._kept = gamma, np.exp(-gamma * self._dt)

    def begun(self, p: Vector) -> Vector:
        """Return the momenta of a start as its first step begins with them, half of the factor taken."""
        return np.asarray(np.exp(-self.gamma * self._dt / 2) * p)

    def needed(self, state: State, t: float) -> bool:
        """Return that it always is."""
        return True

    def coordinate(self, q: Vector) -> Vector:
        """Return the coordinates as they are."""
        return same(q)

    def momentum(self, p: Vector) -> Vector:
        """Return the momenta damped."""
        return np.asarray(self._kept * p)

    def account(self, taken: float, *, of: float) -> None:
        """Add what has been taken."""
        self.energy_taken += taken

    def held(self) -> Held:
        """Return what has been taken, and the rate, which may have been made for the waves of a shorter run."""
        return {"energy_taken": self.energy_taken, "gamma": self.gamma}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        self.energy_taken = held["energy_taken"]
        self._take(held["gamma"])
