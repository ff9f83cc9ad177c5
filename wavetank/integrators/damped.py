"""Momentum damping dp/dt = -H_q - gamma p around any scheme ([G16] (38)-(45); [G16] is Gagarina et al. 2016).

With L multiplied by e^(gamma t), (38), the canonical momentum is P = e^(gamma t) p and the Hamiltonian

    H~(q, P; t) = e^(gamma t) H(q, e^(-gamma t) P; t)

has no damping left. A scheme applied to it, t counted from the beginning of the step, is exact in the damping:
symplectic Euler becomes (44), p' = e^(-gamma dt) p - dt H_q(q, p'), that is "damp, then step". No order is lost,
with a uniform gamma every area in phase space shrinks by e^(-gamma dt) a step, as it must, and a step is stable where
the scheme is. Stages tell each other by e^(gamma dt), though, by which those of Gauss-Legendre grow where gamma dt > 4:
of stronger damping a step has ``MOST``, and the rest comes after it. What damping takes, gamma p H_p in a unit of time,
is seen with each moment.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.hamiltonian import BetweenTwo, HamiltonianSystem, Near, Stage, Stages, StageSolver
from wavetank.integrators.wrapper import Wrapper

MOST = 2.0  # gamma dt, within a step


@dataclass(frozen=True)
class DampingState:
    """The rate of damping [1/s], shape (1,) or one per unknown, (n,)."""

    gamma: Vector


class Damping:
    """How fast momenta are damped.

    Parameters
    ----------
    gamma
        The rate [1/s], not negative, shape (1,) or one per unknown, (n,).
    """

    def __init__(self, gamma: Vector):
        self.gamma = gamma
        self._factors = dict[tuple[object, ...], Vector]()  # of the times in a step

    def factor(self, time: float, *, most: float = np.inf) -> Vector:
        """Return e^(-gamma t), what is left of momenta after a time [s], of rates up to ``most``, shape as gamma."""
        return np.asarray(np.exp(-np.minimum(self.gamma, most) * time), dtype=np.float64)

    def at_node(self, time: float, *, most: float) -> Vector:
        """Return the same, found once: of times that come in each step."""
        if (time, most) not in self._factors:
            self._factors[time, most] = self.factor(time, most=most)
        return self._factors[time, most]

    def of_pairs(self, time: float, size: int) -> Vector:
        """Return the same for pairs [q, p], one behind the other, shape (2 size,): 1 for the coordinates."""
        if (time,) not in self._factors:
            self._factors[time,] = _of_pairs(self.factor(time), size)
        return self._factors[time,]

    @property
    def state(self) -> DampingState:
        """The rate, which may have been made for the waves of a shorter run; the array of all who use it."""
        return DampingState(self.gamma.copy())

    @state.setter
    def state(self, state: DampingState) -> None:
        self.gamma[:] = state.gamma
        self._factors.clear()


def _of_pairs(factor: Any, size: int) -> Vector:
    """Return 1 for coordinates and a factor for momenta, shape (2 size,)."""
    return np.concatenate([np.ones(size), np.ones(size) * factor])


@dataclass(frozen=True)
class _Growing:
    """The system in (q, P), P = e^(gamma (t - t_0)) p."""

    system: HamiltonianSystem
    damping: Damping
    t_0: float
    dt: float
    nodes: tuple[float, ...]

    @property
    def stages(self) -> "_Stages":
        return _Stages(self)

    @cached_property
    def _left(self) -> dict[float, Any]:
        times, most = [node * self.dt for node in self.nodes if node], MOST / abs(self.dt)
        return {self.t_0: 1.0} | {self.t_0 + time: self.damping.at_node(time, most=most) for time in times}

    def factor(self, t: float) -> Any:
        """Return what is left of momenta at t; 1 at the beginning of the step."""
        left = self._left.get(t)
        return self.damping.factor(t - self.t_0, most=MOST / abs(self.dt)) if left is None else left

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        left = self.factor(t)
        return np.asarray(self.system.H_q(q, left * p, t) / left)

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        return self.system.H_p(q, self.factor(t) * p, t)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        return self.system.energy(q, self.factor(t) * p, t)

    def inner(self, a: Vector, b: Vector) -> float:
        return self.system.inner(a, b)


class _Stages:
    """The solvers of a system's stages, which find p = e^(-gamma (t - t_0)) P: a stage of that is one of the system."""

    def __init__(self, growing: _Growing):
        self._growing = growing
        self._stages: Stages = growing.system.stages

    @property
    def coordinate(self) -> StageSolver:
        return self._stages.coordinate

    @property
    def momentum(self) -> StageSolver:
        return _Solver(self._stages.momentum, lambda stage, size: self._growing.factor(stage.t))

    @property
    def pair(self) -> StageSolver:
        return _Solver(self._stages.pair, lambda stage, size: _of_pairs(self._growing.factor(stage.t), size // 2))

    def coupled(self, pairs: int) -> StageSolver:
        def factors(stage: Stage, size: int) -> Vector:
            times = [self._growing.t_0 + node * stage.dt for node in self._growing.nodes]
            return np.concatenate([_of_pairs(self._growing.factor(t), size // 2 // pairs) for t in times])

        return _Solver(self._stages.coupled(pairs), factors)


@dataclass(frozen=True)
class _Solver:
    """A stage solver that finds what is left of its unknowns by factors, of stage and size."""

    solver: StageSolver
    factors: Callable[[Stage, int], Any]

    def solve(
        self, stage: Stage, residual: Callable[[Vector], Vector], start: Vector, *, near: Near | None = None
    ) -> Vector:
        left = self.factors(stage, start.size)
        near = near and near._replace(known=left * near.known)
        return np.asarray(self.solver.solve(stage, lambda z: left * residual(z / left), left * start, near=near) / left)


class Damped(Wrapper[S]):
    """A scheme with damping, of the scheme's own order and stability limit."""

    def __init__(self, scheme: Integrator[S], damping: Damping):
        super().__init__(scheme)
        self.damping = damping

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        after = self.scheme.step(_Growing(system, self.damping, t, dt, self.nodes), state, t, dt)
        left = _of_pairs(self.damping.at_node(dt, most=np.inf), after.p.size).reshape(2, -1)
        mapped = after.mapped(lambda pairs: np.asarray(left * pairs))
        return mapped.ended(left * after.known[0]) if isinstance(mapped, BetweenTwo) else mapped


def damped(scheme: Integrator[Any], damping: Damping) -> Integrator[Any]:
    """Return a scheme with damping: in its own formulae, if its very class has that, else around it."""
    own = vars(type(scheme)).get("damped")  # one derived of it may have another step
    return own(scheme, damping) if own else Damped(scheme, damping)
