"""A sponge around any scheme: half of the exact damping factor, an undamped step, half of the factor.

    p <- e^(-gamma dt/2) p,     one step of the scheme,     p <- e^(-gamma dt/2) p

is the damping dp/dt = -H_q - gamma p of [G16] (38)-(45) ([G16] is Gagarina et al. 2016), composed symmetrically: second
order with any scheme of order two or more (Strang), reversible but for the damping, and the coordinates, hence mass,
are never touched. What the factors take of H is counted from H before and after each; the scheme's own error is not in
it, so that the energy budget shows that error alone.
"""

from typing import Generic

import numpy as np

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.damped import same, times
from wavetank.integrators.reported_energy import reported_energy


class Absorbing(Generic[S]):
    """A scheme with damping of the momenta, which counts the energy taken; stable where the scheme is.

    A system that remembers its last point evaluates two points a step more than the bare scheme, those between which
    the second factor acts: the first is for the count alone, at the second observers look. The first factor's are where
    that ended and where the scheme begins.

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
    """

    def __init__(self, scheme: Integrator[S], gamma: Vector):
        self.scheme, self.gamma = scheme, gamma
        self.energy_taken = 0.0

    @property
    def name(self) -> str:
        """The scheme's name in a case file."""
        return self.scheme.name

    @property
    def order(self) -> int:
        """Order of accuracy: that of the scheme, but two at most."""
        return min(self.scheme.order, 2)

    @property
    def stability_limit(self) -> float:
        """Largest omega dt for which the scheme is stable."""
        return self.scheme.stability_limit

    @property
    def frequency_error(self) -> tuple[float, int]:
        """The scheme's (c, m), which holds where nothing is damped."""
        return self.scheme.frequency_error

    @property
    def nodes(self) -> tuple[float, ...]:
        """The times (t - t_n) / dt at which the scheme evaluates H."""
        return self.scheme.nodes

    def start(self, q: Vector, p: Vector) -> S:
        """Return the scheme's state of a smooth start."""
        return self.scheme.start(q, p)

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        state = self._damp(system, state, t, dt / 2)
        state = self.scheme.step(system, state, t, dt)
        return self._damp(system, state, t + dt, dt / 2)

    def _damp(self, system: HamiltonianSystem, state: S, t: float, duration: float) -> S:
        before = reported_energy(system, state, t)
        state = state.mapped(same, times(np.exp(-self.gamma * duration)))
        self.energy_taken += before - reported_energy(system, state, t)
        return state
