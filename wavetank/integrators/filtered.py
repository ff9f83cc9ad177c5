"""A scheme with something that acts on the state between its steps, where it is needed: a penalty, or breaking."""

from collections.abc import Sequence
from typing import Protocol

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.wrapper import Wrapper, mapped
from wavetank.stateful import Held, carry_over, give_back, held_by, named


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


class Filtered(Wrapper[S]):
    """A scheme, and after each step those filters that are needed then.

    A filter costs one evaluation where it acts (of the energy before it; that after it is where the next step begins),
    and none where it does not.
    """

    def __init__(self, scheme: Integrator[S], filters: Sequence[Filter]):
        super().__init__(scheme)
        self.filters = filters

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        state = self.scheme.step(system, state, t, dt)
        for one in self.filters:
            if one.needed(state.q, state.p, t + dt):
                state, energies = mapped(system, state, t + dt, coordinate=one.coordinate, momentum=one.momentum)
                one.account(*energies)
        return state

    def held(self) -> Held:
        """Return what scheme and filters remember."""
        return super().held() | held_by(named(self.filters))

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        super().take(held)
        give_back(named(self.filters), {name: one for name, one in held.items() if name != "scheme"})

    def carry(self, held: Held) -> None:
        """Take what of the filters outlives a change of numerics."""
        carry_over(named(self.filters), held)
