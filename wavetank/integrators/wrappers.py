"""Wrappers of schemes: filters between steps, damping of the momenta, and controlled paddles.

Damping of the momenta is dp/dt = -H_q - gamma p, equations (38)-(45) of Gagarina et al. 2016. With L multiplied by
e^(gamma t), (38), the canonical momentum is P = e^(gamma t) p and the Hamiltonian

    H~(q, P; t) = e^(gamma t) H(q, e^(-gamma t) P; t)

has no damping. A scheme applied to it, with t from the beginning of the step, is exact in the damping:
symplectic Euler becomes (44), p' = e^(-gamma dt) p - dt H_q(q, p'), that is "damp, then step". The order and the
stability limit of the scheme are unchanged. With a uniform gamma every area in phase space decreases by the factor
e^(-gamma dt) in a step, which is exact. Stages differ from each other by factors of e^(gamma dt), by which those of
Gauss-Legendre grow where gamma dt > 4. Damping within a step is therefore limited to ``MOST_DAMPING``; the rest is
applied at the end of the step.

Controlled paddles: before each step a controller measures the water and extends the motion. Within the step the motion
is a given function of time: the scheme, its order and its conserved quantities are unchanged. The only error of the
control is that it measures at the beginning of steps.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import (
    Evaluation,
    HamiltonianSystem,
    Integrator,
    S,
    State,
    Weights,
    energy_change,
)


class Wrapper(Generic[S]):
    """An integrator that wraps another one and has its properties by default; derived classes define ``step``.

    Parameters
    ----------
    scheme
        The inner integrator.
    """

    def __init__(self, scheme: Integrator[S]):
        self.scheme = scheme

    @property
    def name(self) -> str:
        """Name in a case file."""
        return self.scheme.name

    @property
    def order(self) -> int:
        """Order of accuracy."""
        return self.scheme.order

    @property
    def stability_limit(self) -> float:
        """Largest omega dt for which the inner scheme is stable."""
        return self.scheme.stability_limit

    @property
    def frequency_error(self) -> tuple[float, int]:
        """The pair (c, m) of the inner scheme."""
        return self.scheme.frequency_error

    @property
    def nodes(self) -> tuple[float, ...]:
        """Times (t - t_n) / dt at which the inner scheme evaluates H."""
        return self.scheme.nodes

    def start(self, q: Vector, p: Vector) -> S:
        """Return the state of a smooth start."""
        return self.scheme.start(q, p)


class Filter(Protocol):
    """A map of the state between steps: dissipation or smoothing.

    Attributes
    ----------
    state
        Plain data; the filter replaces it and never changes it in place.
    """

    state: Any

    def needed(self, state: State, t: float) -> bool:
        """Return whether the filter acts on the state at the end of a step; the first of its evaluations decides.

        The result is the same on all ranks; collective.
        """

    def passed(self, pairs: Vector) -> Vector:
        """Return the filtered points [q, p], shape (m, 2, n); affine in q, linear in p; collective."""

    def account(self, loss: float, *, of: float) -> None:
        """Record the dissipated energy; ``of`` is the energy before the filter."""


class Filtered(Wrapper[S]):
    """A scheme with filters, which act in sequence after each step that needs them.

    Filters cost no evaluation. The energy before the filters is expanded about the evaluation at the end of the step,
    the energy after them about the evaluation at which the next step begins. The loss by each filter follows from the
    derivatives there, with an error of third order in its change of the state. The difference between the total loss
    and the sum of these is attributed to the filter with the largest loss.
    """

    def __init__(self, scheme: Integrator[S], filters: Sequence[Filter]):
        super().__init__(scheme)
        self.filters = filters

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt with the evaluation at which the next step begins; collective."""
        state, t = self.scheme.step(system, state, t, dt), t + dt
        before = [one.state for one in self.filters]
        try:
            if self.filters and state.end is None:
                state = state.evaluated(system, t)
            acting = [one for one in self.filters if one.needed(state, t)]
            return self._filtered(system, state, t, acting) if acting else state.evaluated(system, t)
        except Exception:
            for one, state_before in zip(self.filters, before, strict=True):  # a resumed run repeats the step
                one.state = state_before
            raise

    def _filtered(self, system: HamiltonianSystem, state: S, t: float, acting: Sequence[Filter]) -> S:
        """Return the state at t after the acting filters, at least one; collective."""
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
    """Return the change of coordinates and momenta between two states, shape (2, n)."""
    return np.array([end.q - start.q, end.p - start.p])


def _energy(system: HamiltonianSystem, at: Evaluation, state: State) -> float:
    """Return the energy of a state, expanded to first order about an evaluation; collective."""
    return at.energy + energy_change(system, at, np.array([state.q - at.q, state.p - at.p]))


MOST_DAMPING = 2.0  # largest gamma dt within a step
DIGITS = 10  # to which nodes are rounded, so that all steps have the same factors


@dataclass(frozen=True)
class DampingState:
    """The damping rate [1/s], shape (1,) or (n,)."""

    gamma: Vector


class Damping:
    """The damping rate of the momenta, with the factors for a step.

    Parameters
    ----------
    gamma
        Rate [1/s], not negative, shape (1,), or (n,) with one value per unknown.
    """

    def __init__(self, gamma: Vector):
        self.gamma = gamma
        self._factors = dict[tuple[object, ...], Vector]()  # key: time within a step, largest rate

    def factor(self, time: float, *, most: float = np.inf) -> Vector:
        """Return e^(-gamma t), the factor of momenta after a time [s], shape of gamma; ``most`` limits the rate."""
        return np.asarray(np.exp(-np.minimum(self.gamma, most) * time), dtype=np.float64)

    def of_pairs(self, time: float, size: int, *, most: float = np.inf) -> Vector:
        """Return these factors for pairs [q, p], shape (2, size), 1 for the coordinates; cached."""
        if (time, most) not in self._factors:
            self._factors[time, most] = np.array([np.ones(size), np.ones(size) * self.factor(time, most=most)])
        return self._factors[time, most]

    @property
    def state(self) -> DampingState:
        """The rate. A resumed run has the rate of the original run, even if its waves differ; the array is shared."""
        return DampingState(self.gamma.copy())

    @state.setter
    def state(self, state: DampingState) -> None:
        self.gamma[:] = state.gamma
        self._factors.clear()


@dataclass(frozen=True)
class _Undamped:
    """The undamped system in (q, P), P = e^(gamma (t - t_0)) p; it solves its stages as stages in (q, p)."""

    system: HamiltonianSystem
    damping: Damping
    t_0: float
    dt: float

    @property
    def evaluation_type(self) -> type[Any]:
        return self.system.evaluation_type

    def factor(self, t: float, size: int) -> Any:
        """Return the factors of coordinates and momenta at t, shape (2, size); 1 at the beginning of the step."""
        node = round((t - self.t_0) / self.dt, DIGITS)
        return self.damping.of_pairs(node * self.dt, size, most=MOST_DAMPING / abs(self.dt)) if node else 1.0

    def evaluate(self, q: Vector, p: Vector, t: float, guess: Any = None) -> Evaluation:
        factor = self.factor(t, q.size)
        q, p = factor * np.array([q, p])
        at: Evaluation = self.system.evaluate(q, p, t, self._damped(guess))
        return replace(at, z=at.z / factor, flow=at.flow / factor)

    def _damped(self, guess: Any) -> Any:
        """Return an evaluation at (q, P) as an evaluation of the system at (q, p)."""
        if guess is None:
            return None
        factor = self.factor(guess.t, guess.q.size)
        return replace(guess, z=factor * guess.z, flow=factor * guess.flow)

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Any = None) -> Vector:
        factor = self.factor(t, c.shape[-1])
        return np.asarray(self.system.solve_stage(name, factor * c, a, t, self._damped(guess)) / factor)

    def solve_stages(
        self, name: str, c: Vector, a: Vector, times: Sequence[float], guess: Any = None, scale: Any = 1.0
    ) -> Vector:
        factors = np.array([self.factor(t, c.shape[-1]) * np.ones_like(c) for t in times])
        stages = self.system.solve_stages(name, factors * c, a, times, self._damped(guess), factors * scale)
        return np.asarray(stages / factors)

    def inner(self, a: Vector, b: Vector) -> float:
        return self.system.inner(a, b)


class Damped(Wrapper[S]):
    """A scheme with damping; order and stability limit are those of the scheme."""

    def __init__(self, scheme: Integrator[S], damping: Damping):
        super().__init__(scheme)
        self.damping = damping

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        after = self.scheme.step(_Undamped(system, self.damping, t, dt), state, t, dt)
        return after.mapped(lambda pairs: np.asarray(self.damping.of_pairs(dt, after.q.size) * pairs))


def damped(scheme: Integrator[Any], damping: Damping) -> Integrator[Any]:
    """Return a scheme with damping: by the method ``damped`` of its class, else by a wrapper."""
    own = vars(type(scheme)).get("damped")  # not inherited: a derived class may have another step
    return own(scheme, damping) if own else Damped(scheme, damping)


CONTROL_LIMIT = 2.0  # stability limit omega dt with one measurement per step
EARLIER = 0.1  # time of the first measurement before the first step, relative to dt


class Controller(Protocol):
    """A controller of a paddle, which measures the water before each step."""

    @property
    def begins(self) -> bool:
        """Whether the control has not yet begun."""

    def begin(self, q: Vector, p: Vector, t: float) -> None:
        """Measure the water at t, shortly before the first step; collective."""

    def go_on(self, q: Vector, p: Vector, t: float, dt: float) -> None:
        """Measure the water at t, and extend the motion to t + dt; collective."""


class ControlledPaddles(Wrapper[S]):
    """A scheme with controlled paddles, which evaluates the system at the beginning of a step only.

    Parameters
    ----------
    scheme
        The inner integrator.
    paddles
        Controllers of the paddles.
    """

    def __init__(self, scheme: Integrator[S], paddles: Sequence[Controller]):
        super().__init__(scheme)
        self.paddles = paddles

    @property
    def stability_limit(self) -> float:
        """Largest omega dt on the oscillator: limited by the inner scheme, and by one measurement per step."""
        return min(self.scheme.stability_limit, CONTROL_LIMIT)

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        for paddle in self.paddles:
            if paddle.begins:
                earlier, now = EARLIER * dt, system.evaluate(state.q, state.p, t)
                paddle.begin(state.q - earlier * now.dq, state.p - earlier * now.dp, t - earlier)
            paddle.go_on(state.q, state.p, t, dt)
        return self.scheme.step(system, state, t, dt)
