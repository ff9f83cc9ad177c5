"""A scheme with something that acts on the state between its steps, where it is needed: a penalty, or breaking."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Generic, Protocol

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.reported_energy import reported_energy


class Filter(Protocol):
    """What takes something out of a state; affine in the coordinates, linear in the momenta."""

    def needed(self, q: Vector, p: Vector, t: float) -> bool:
        """Return whether there is anything to do at t; collective, the same on all ranks."""

    def coordinate(self, q: Vector) -> Vector:
        """Return the coordinates afterwards; collective."""

    def momentum(self, p: Vector) -> Vector:
        """Return the momenta afterwards; collective."""

    def account(self, before: float, after: float) -> None:
        """Take note of the energy before and after."""


@dataclass(frozen=True)
class Filtered(Generic[S]):
    """A scheme, and after each step those filters that are needed then.

    A filter costs one evaluation where it acts (of the energy before it; that after it is where the next step begins),
    and none where it does not.
    """

    scheme: Integrator[S]
    filters: Sequence[Filter]

    def start(self, q: Vector, p: Vector) -> S:
        """Return the scheme's state of a smooth start."""
        return self.scheme.start(q, p)

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        state = self.scheme.step(system, state, t, dt)
        for one in self.filters:
            if one.needed(state.q, state.p, t + dt):
                before = reported_energy(system, state, t + dt)
                state = state.mapped(one.coordinate, one.momentum)
                one.account(before, reported_energy(system, state, t + dt))
        return state
