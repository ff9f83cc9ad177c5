"""A scheme with what acts on the state between its steps, where it is needed: breaking, or a penalty."""

import itertools
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from wavetank.arrays import Vector
from wavetank.integrators.contract import Evaluated, Integrator, S, State
from wavetank.integrators.hamiltonian import HamiltonianSystem, Seeing
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
        """Return whether there is anything to do where a step has ended, at the first of the points known of a state.

        Collective, the same on all ranks.
        """

    def passed(self, pairs: Vector) -> Vector:
        """Return points [q, p] afterwards, shape (m, 2, n); affine in q, linear in p; collective."""

    def account(self, taken: float, *, of: float) -> None:
        """Take note of the energy taken, of that before."""


class Filtered(Wrapper[S]):
    """A scheme, and after each step those filters that are needed then, one after the other.

    Filters cost no evaluation: the energy before them all is seen from where the step has ended, the energy after them
    from where the next one begins. What each has taken of that is told by the derivatives there, to the cube of what it
    changes; the little that is left to the whole is that of the one which has taken most.

    Parameters
    ----------
    seen
        What sees the state that they leave, as observers do, and returns its energy, or None; collective.
    """

    def __init__(
        self,
        scheme: Integrator[S],
        filters: Sequence[Filter],
        *,
        seen: Callable[[S], float | None] = lambda state: None,
    ):
        super().__init__(scheme)
        self.filters, self._seen = filters, seen

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        state, t = self.scheme.step(system, state, t, dt), t + dt
        before = [one.state for one in self.filters]
        try:
            acting = [one for one in self.filters if one.needed(state, t)]
            return self._filtered(system, state, t, acting) if acting else state
        except Exception:
            for one, its in zip(self.filters, before, strict=True):  # a resumed run takes the step again
                one.state = its
            raise

    def _filtered(self, system: HamiltonianSystem, state: S, t: float, acting: Sequence[Filter]) -> S:
        """Return the state at t after the filters that act then, one at least; collective."""
        passed = list(itertools.accumulate(acting, lambda before, one: before.mapped(one.passed), initial=state))
        ways = [_way(*pair) for pair in itertools.pairwise(passed)] if len(acting) > 1 else []
        first, after = state.known[0], passed[-1]
        energy = system.energy_near(state, t) if isinstance(system, Seeing) else None
        energy = _energy(system, state, first, t) if energy is None else energy
        begin = [_change(system, first, way, t) for way in ways]
        left = self._seen(after)
        left = _energy(system, after, after.known[-1], t) if left is None else left
        end = [_change(system, after.known[-1], way, t) for way in ways]
        taken = [-(a + b) / 2 for a, b in zip(begin, end, strict=True)] or [0.0]
        most = max(range(len(taken)), key=lambda n: abs(taken[n]))
        taken[most] += energy - left - sum(taken)
        for one, part in zip(acting, taken, strict=True):
            one.account(part, of=energy)
        return after


Way = tuple[Vector, Vector]


def _way(start: State | Evaluated, end: State) -> Way:
    """Return what coordinates and momenta change by from a point to a state."""
    return end.q - start.q, end.p - start.p


def _energy(system: HamiltonianSystem, state: State, at: Evaluated, t: float) -> float:
    """Return the energy of a state to the square of what lies between its (q, p) and a point; collective."""
    return system.energy(*at, t) + _change(system, at, _way(at, state), t)


def _change(system: HamiltonianSystem, at: Evaluated, way: Way, t: float) -> float:
    """Return what the energy changes by on a way, as seen from a point; collective."""
    return system.inner(system.H_q(*at, t), way[0]) + system.inner(system.H_p(*at, t), way[1])
