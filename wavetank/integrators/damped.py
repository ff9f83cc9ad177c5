"""Momentum damping dp/dt = -H_q - gamma p around any scheme ([G16] (38)-(45); [G16] is Gagarina et al. 2016).

With L multiplied by e^(gamma t), (38), the canonical momentum is P = e^(gamma t) p and the Hamiltonian

    H~(q, P; t) = e^(gamma t) H(q, e^(-gamma t) P; t)

has no damping left. A scheme applied to it, t counted from the beginning of the step, is exact in the damping:
symplectic Euler becomes (44), p' = e^(-gamma dt) p - dt H_q(q, p'), that is "damp, then step". No order is lost,
and with a uniform gamma every area in phase space shrinks by e^(-gamma dt) a step, as it must.
"""

from dataclasses import dataclass

import numpy as np

from wavetank.arrays import Vector
from wavetank.hamiltonian.contract import HamiltonianSystem, Stages
from wavetank.integrators.contract import Integrator, Map, S
from wavetank.integrators.wrapper import Wrapper


@dataclass(frozen=True)
class _Growing:
    """The system in (q, P), P = e^(gamma (t - t_0)) p."""

    system: HamiltonianSystem
    gamma: Vector
    t_0: float

    @property
    def stages(self) -> Stages:
        return self.system.stages

    def _growth(self, t: float) -> Vector:
        return np.asarray(np.exp(self.gamma * (t - self.t_0)), dtype=np.float64)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        growth = self._growth(t)
        return growth * self.system.H_q(q, p / growth, t)

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        return self.system.H_p(q, p / self._growth(t), t)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        return self.system.energy(q, p / self._growth(t), t)

    def inner(self, a: Vector, b: Vector) -> float:
        return self.system.inner(a, b)


class Damped(Wrapper[S]):
    """A scheme with damping, of the scheme's own order and stability limit.

    Parameters
    ----------
    scheme
        Any integrator.
    gamma
        Damping rate of the momenta [1/s], shape (1,) or one per unknown, (n,).
    """

    def __init__(self, scheme: Integrator[S], gamma: Vector):
        super().__init__(scheme)
        self.gamma = gamma

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""
        after = self.scheme.step(_Growing(system, self.gamma, t), state, t, dt)
        return after.mapped(same, times(np.exp(-self.gamma * dt)))


def same(values: Vector) -> Vector:
    """Return the values."""
    return values


def times(factor: Vector) -> Map:
    """Return the map that multiplies by a factor."""
    return lambda values: np.asarray(factor * values)
