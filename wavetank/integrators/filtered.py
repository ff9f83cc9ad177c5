"""A scheme with what acts on the state between its steps, where it is needed: breaking, or a penalty."""

import itertools
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.hamiltonian import Evaluation, HamiltonianSystem, energy_change
from wavetank.integrators.states import State
from wavetank.integrators.wrapper import Wrapper


class Filter(Protocol):
    """What takes something out of a state.

    Attributes
    ----------
    state
        Plain data that is replaced, never changed, as the filter acts.
    """

    state: Any

    def needed(self, state: State, t: float) -> bool:
        """Return whether there is anything to do where a step has ended, at the first of a state's evaluations.

        Collective, the same on all ranks.
        """

    def passed(self, pairs: Vector) -> Vector:
        """Return points [q, p] afterwards, shape (m, 2, n); affine in q, linear in p; collective."""

    def account(self, loss: float, *, of: float) -> None:
        """Take note of the energy taken, of that before."""


class Filtered(Wrapper[S]):
    """A scheme, and after each step those filters that are needed then, one after the other.

    Filters cost no evaluation: the energy before them all is expanded about the evaluation where the step has ended,
    the energy after them about that where the next one begins. What each has taken of that is told by the derivatives
    there, to the cube of what it changes; the little that is left to the whole is that of the one which has taken most.
    """

    def __init__(self, scheme: Integrator[S], filters: Sequence[Filter]):
        super().__init__(scheme)
        self.filters = filters

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt, evaluated where the next step begins; collective."""
        state, t = self.scheme.step(system, state, t, dt), t + dt
        before = [one.state for one in self.filters]
        try:
            if self.filters and state.end is None:
                state = state.evaluated(system, t)
            acting = [one for one in self.filters if one.needed(state, t)]
            return self._filtered(system, state, t, acting) if acting else state.evaluated(system, t)
        except Exception:
            for one, its in zip(self.filters, before, strict=True):  # a resumed run takes the step again
                one.state = its
            raise

    def _filtered(self, system: HamiltonianSystem, state: S, t: float, acting: Sequence[Filter]) -> S:
        """Return the state at t after the filters that act then, one at least; collective."""
        passed = list(itertools.accumulate(acting, lambda before, one: before.mapped(one.passed), initial=state))
        ways = [_between(*pair) for pair in itertools.pairwise(passed)] if len(acting) > 1 else []
        begin, after = state.end or state.evaluation, passed[-1].evaluated(system, t)
        end = after.evaluation
        energy, remaining = (_energy(system, at, one) for at, one in ((begin, state), (end, after)))
        taken = [-(energy_change(system, begin, way) + energy_change(system, end, way)) / 2 for way in ways] or [0.0]
        most = max(range(len(taken)), key=lambda n: abs(taken[n]))
        taken[most] += energy - remaining - sum(taken)
        for one, part in zip(acting, taken, strict=True):
            one.account(part, of=energy)
        return after


def _between(start: State, end: State) -> Vector:
    """Return what coordinates and momenta change by from a state to another, shape (2, n)."""
    return np.array([end.q - start.q, end.p - start.p])


def _energy(system: HamiltonianSystem, at: Evaluation, state: State) -> float:
    """Return the energy of a state to the square of what lies between its (q, p) and an evaluation; collective."""
    return at.energy + energy_change(system, at, np.array([state.q - at.q, state.p - at.p]))
