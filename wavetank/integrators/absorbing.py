"""A sponge around any scheme: half of the exact damping factor, an undamped step, half of the factor.

    p <- e^(-gamma dt/2) p,     one step of the scheme,     p <- e^(-gamma dt/2) p

is the damping dp/dt = -H_q - gamma p of [G16] (38)-(45) ([G16] is Gagarina et al. 2016), composed symmetrically: second
order with any scheme of order two or more (Strang), reversible but for the damping, and the coordinates, hence mass,
are never touched. What the factors take of H is counted from H before and after each; the scheme's own error is not in
it, so that the energy budget shows that error alone.
"""

import numpy as np

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.damped import same, times
from wavetank.integrators.wrapper import Wrapper, mapped
from wavetank.stateful import Held


class Absorbing(Wrapper[S]):
    """A scheme with damping of the momenta, which counts the energy taken; stable where the scheme is.

    A system that remembers its last point evaluates one or two points a step more than the bare scheme, those between
    which the second factor acts: the first is for the count alone, unless the scheme knows that it ended there, at the
    second observers look. The first factor's are where that ended and where the scheme begins.

    Parameters
    ----------
    scheme
        Any integrator.
    gamma
        Damping rate of the momenta [1/s], not negative, shape (1,) or one per unknown, (n,).

    Attributes
    ----------
    energy_taken
        Of H since the start, the scheme's unit of energy.
    gives
        In words, what makes it give energy instead.
    """

    gives = "a sponge that is too strong, begins too abruptly or meets a current or far longer waves does so"

    def __init__(self, scheme: Integrator[S], gamma: Vector):
        super().__init__(scheme)
        self.gamma, self.energy_taken = gamma, 0.0

    @property
    def order(self) -> int:
        """Order of accuracy: that of the scheme, but two at most."""
        return min(self.scheme.order, 2)

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        state = self._damp(system, state, t, dt / 2)
        state = self.scheme.step(system, state, t, dt)
        return self._damp(system, state, t + dt, dt / 2)

    def _damp(self, system: HamiltonianSystem, state: S, t: float, duration: float) -> S:
        factor = times(np.exp(-self.gamma * duration))
        state, (before, after) = mapped(system, state, t, coordinate=same, momentum=factor)
        self.energy_taken += before - after
        return state

    def held(self) -> Held:
        """Return what has been taken, and the rate, which may have been made for the waves of a shorter run."""
        return super().held() | {"energy_taken": self.energy_taken, "gamma": self.gamma}

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        super().take(held)
        self.energy_taken, self.gamma = held["energy_taken"], held["gamma"]
