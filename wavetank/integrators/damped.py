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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import Integrator, S
from wavetank.integrators.hamiltonian import Evaluation, HamiltonianSystem, Weights
from wavetank.integrators.wrapper import Wrapper

MOST = 2.0  # gamma dt, within a step
DIGITS = 10  # of nodes, so that factors are found once for all steps


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

    def of_pairs(self, time: float, size: int, *, most: float = np.inf) -> Vector:
        """Return the same for pairs [q, p], shape (2, size), found once: 1 for the coordinates."""
        if (time, most) not in self._factors:
            self._factors[time, most] = np.array([np.ones(size), np.ones(size) * self.factor(time, most=most)])
        return self._factors[time, most]

    @property
    def state(self) -> DampingState:
        """The rate, which may have been made for the waves of a shorter run; the array of all who use it."""
        return DampingState(self.gamma.copy())

    @state.setter
    def state(self, state: DampingState) -> None:
        self.gamma[:] = state.gamma
        self._factors.clear()


@dataclass(frozen=True)
class _Growing:
    """The system in (q, P), P = e^(gamma (t - t_0)) p: a stage of it is one of the system in (q, p)."""

    system: HamiltonianSystem
    damping: Damping
    t_0: float
    dt: float

    @property
    def evaluation_type(self) -> type[Any]:
        return self.system.evaluation_type

    def factor(self, t: float, size: int) -> Any:
        """Return what is left of coordinates and momenta at t, shape (2, size); 1 at the beginning of the step."""
        node = round((t - self.t_0) / self.dt, DIGITS)
        return self.damping.of_pairs(node * self.dt, size, most=MOST / abs(self.dt)) if node else 1.0

    def evaluate(self, q: Vector, p: Vector, t: float, guess: Any = None) -> Evaluation:
        left = self.factor(t, q.size)
        q, p = left * np.array([q, p])
        at: Evaluation = self.system.evaluate(q, p, t, self._within(guess))
        return replace(at, z=at.z / left, flow=at.flow / left)

    def _within(self, guess: Any) -> Any:
        """Return an evaluation in (q, P) as one of the system."""
        if guess is None:
            return None
        left = self.factor(guess.t, guess.q.size)
        return replace(guess, z=left * guess.z, flow=left * guess.flow)

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Any = None) -> Vector:
        left = self.factor(t, c.shape[-1])
        return np.asarray(self.system.solve_stage(name, left * c, a, t, self._within(guess)) / left)

    def solve_stages(
        self, name: str, c: Vector, a: Vector, times: Sequence[float], guess: Any = None, scale: Any = 1.0
    ) -> Vector:
        left = np.array([self.factor(t, c.shape[-1]) * np.ones_like(c) for t in times])
        stages = self.system.solve_stages(name, left * c, a, times, self._within(guess), left * scale)
        return np.asarray(stages / left)

    def inner(self, a: Vector, b: Vector) -> float:
        return self.system.inner(a, b)


class Damped(Wrapper[S]):
    """A scheme with damping, of the scheme's own order and stability limit."""

    def __init__(self, scheme: Integrator[S], damping: Damping):
        super().__init__(scheme)
        self.damping = damping

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        after = self.scheme.step(_Growing(system, self.damping, t, dt), state, t, dt)
        return after.mapped(lambda pairs: np.asarray(self.damping.of_pairs(dt, after.q.size) * pairs))


def damped(scheme: Integrator[Any], damping: Damping) -> Integrator[Any]:
    """Return a scheme with damping: in its own formulae, if its very class has that, else around it."""
    own = vars(type(scheme)).get("damped")  # one derived of it may have another step
    return own(scheme, damping) if own else Damped(scheme, damping)
