"""A scheme with what acts on the state between its steps, where it is needed: breaking, or a penalty."""

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem, Seeing
from wavetank.integrators.contract import Evaluated, Integrator, S, State
from wavetank.integrators.wrapper import Wrapper
from wavetank.stateful import Held, Undoing, carry_over, give_back, held_by, named


class Filter(Protocol):
    """What takes something out of a state; affine in the coordinates, linear in the momenta."""

    def needed(self, state: State, t: float) -> bool:
        """Return whether there is anything to do where a step has ended, at the first of the points known of a state.

        Collective, the same on all ranks.
        """

    def coordinate(self, q: Vector) -> Vector:
        """Return the coordinates afterwards; collective."""

    def momentum(self, p: Vector) -> Vector:
        """Return the momenta afterwards; collective."""

    def account(self, taken: float, *, of: float) -> None:
        """Take note of the energy taken, of that before."""


class Filtered(Wrapper[S]):
    """A scheme, and after each step those filters that are needed then, one after the other.

    Filters cost no evaluation: the energy before them all is that where the step has ended, the energy after them that
    where the next one begins. What each has taken of that is told by the derivatives there, to the cube of what it
    changes; the little that is left to the whole is that of the one which has taken most.

    Parameters
    ----------
    ended
        Told where and when a step has ended, before filters act; collective.
    """

    def __init__(
        self,
        scheme: Integrator[S],
        filters: Sequence[Filter],
        *,
        ended: Callable[[Evaluated, float], None] = lambda at, t: None,
    ):
        super().__init__(scheme)
        self.filters, self._ended = filters, ended

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        state, t = self.scheme.step(system, state, t, dt), t + dt
        acting = [one for one in self.filters if one.needed(state, t)]
        try:
            return self._filtered(system, state, t, acting) if acting else state
        except Exception:
            for one in (one for one in self.filters if isinstance(one, Undoing)):
                one.undo()
            raise

    def _filtered(self, system: HamiltonianSystem, state: S, t: float, acting: Sequence[Filter]) -> S:
        """Return the state at t after the filters that act then, one at least; collective."""
        passed = [state]
        for one in acting:
            passed.append(passed[-1].mapped(one.coordinate, one.momentum))
        ways = [_way(*pair) for pair in itertools.pairwise(passed)] if len(acting) > 1 else []
        begin = _look(system, state, state.known[0], ways, t)
        self._ended(state.known[0], t)  # of which more is known by now
        end = _look(system, passed[-1], passed[-1].known[-1], ways, t)
        taken = [-(a + b) / 2 for a, b in zip(begin.changes, end.changes, strict=True)] or [0.0]
        most = max(range(len(taken)), key=lambda n: abs(taken[n]))
        taken[most] += begin.energy - end.energy - sum(taken)
        for one, part in zip(acting, taken, strict=True):
            one.account(part, of=begin.energy)
        return passed[-1]

    def held(self) -> Held:
        """Return what scheme and filters remember."""
        return super().held() | held_by(named(self.filters))

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        super().take(held)
        give_back(named(self.filters), {name: one for name, one in held.items() if name != "scheme"})

    def carry(self, held: Held) -> None:
        """Take what of scheme and filters outlives a change of numerics."""
        super().carry(held)
        carry_over(named(self.filters), held)


Way = tuple[Vector, Vector]


def _way(start: State | Evaluated, end: State) -> Way:
    """Return what coordinates and momenta change by from a point to a state."""
    return end.q - start.q, end.p - start.p


class _Look(NamedTuple):
    """The energy of a state, and what it changes by on some ways, as seen from there."""

    energy: float
    changes: list[float]


def _look(system: HamiltonianSystem, state: State, at: Evaluated, ways: Sequence[Way], t: float) -> _Look:
    """Return how a state and some ways look from a point known of it; collective."""
    return _Look(_energy(system, state, at, t), [_change(system, at, way, t) for way in ways])


def _energy(system: HamiltonianSystem, state: State, at: Evaluated, t: float) -> float:
    """Return the energy of a state to the square of what lies between its (q, p) and a point; collective."""
    near = system.energy_near(state.q, state.p, t, at=at) if isinstance(system, Seeing) else None
    return system.energy(*at, t) + _change(system, at, _way(at, state), t) if near is None else near


def _change(system: HamiltonianSystem, at: Evaluated, way: Way, t: float) -> float:
    """Return what the energy changes by on a way, as seen from a point; collective."""
    return system.inner(system.H_q(*at, t), way[0]) + system.inner(system.H_p(*at, t), way[1])
