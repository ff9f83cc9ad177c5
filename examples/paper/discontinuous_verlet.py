"""Störmer-Verlet as the discontinuous schemes (14) and (15)-(16) of [G16], with weight and jump.

[G16] is Gagarina et al. 2016; beta = 1 - alpha. In (14) p has no jump: (14a) multiplies a jump by alpha / beta a step,
and the start has none. q has one. With the traces q⁻ = 2 q½ - q of the previous slab and q⁺, (14) is

    q½  = alpha q⁺ + beta q⁻ + dt/2 H_p(p, q½; t)                            (14b), implicit
    p'  = p - dt/2 [ H_q(p, q½; t) + H_q(p', q½; t + dt) ]                    (14c), implicit
    q⁻' = 2 q½ - q⁺
    alpha q⁺' = q½ + dt/2 H_p(p', q½; t + dt) - beta q⁻'                      (14d)

The mean alpha q⁺ + beta q⁻ equals the classical scheme for every alpha. Nothing depends on the jump, which is
multiplied by beta / alpha a step: hence alpha in [1/2, 1]. In (15)-(16) p and q, alpha and beta are exchanged.
"""

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Map, State


@dataclass(frozen=True, eq=False)
class JumpInQ(State):
    """A jump in q, none in p."""

    q_minus: Vector
    q_plus: Vector
    p: Vector
    alpha: float

    @property
    def q(self) -> Vector:
        """The weighted mean of the traces, which is the coordinate of the classical scheme."""
        return self.alpha * self.q_plus + (1 - self.alpha) * self.q_minus

    @property
    def q_jump(self) -> Vector:
        """The jump of the coordinates."""
        return self.q_plus - self.q_minus

    def mapped(self, of: Map) -> Self:
        """Return the state with all three traces mapped."""
        (q_minus, p), (q_plus, _) = of(np.array([[self.q_minus, self.p], [self.q_plus, self.p]]))
        return type(self)(q_minus, q_plus, p, self.alpha)


@dataclass(frozen=True, eq=False)
class JumpInP(State):
    """A jump in p, none in q."""

    q: Vector
    p_minus: Vector
    p_plus: Vector
    alpha: float

    @property
    def p(self) -> Vector:
        """The weighted mean of the traces, which is the momentum of the classical scheme."""
        return self.alpha * self.p_minus + (1 - self.alpha) * self.p_plus

    def mapped(self, of: Map) -> Self:
        """Return the state with all three traces mapped."""
        (q, p_minus), (_, p_plus) = of(np.array([[self.q, self.p_minus], [self.q, self.p_plus]]))
        return type(self)(q, p_minus, p_plus, self.alpha)


class _Discontinuous:
    """Common part of both variants, with the properties of Störmer-Verlet."""

    order: ClassVar[int] = 2
    stability_limit: ClassVar[float] = 2.0
    frequency_error: ClassVar[tuple[float, int]] = (1 / 24, 2)
    nodes: ClassVar[tuple[float, ...]] = (0.0, 1.0)


@dataclass(frozen=True)
class DiscontinuousVerlet(_Discontinuous):
    """Scheme (14), its jump in q bounded for alpha in [1/2, 1]. Cost of a step: two implicit stages."""

    name: ClassVar[str] = "discontinuous-verlet"
    alpha: float = 1.0

    def start(self, q: Vector, p: Vector) -> JumpInQ:
        """Return the state of a start without jumps."""
        return JumpInQ(q, q, p, self.alpha)

    def step(self, system: HamiltonianSystem, state: JumpInQ, t: float, dt: float) -> JumpInQ:
        """Return the state at t + dt; collective."""
        mean, p, beta = state.q, state.p, 1 - self.alpha
        q_half, _ = system.solve_stage("q at 1/2", np.array([mean, p]), (dt / 2, 0.0), t, state.evaluation)
        half = system.evaluate(q_half, p, t)
        _, p_new = system.solve_stage("p at 1", np.array([q_half, p + dt / 2 * half.dp]), (0.0, dt / 2), t + dt, half)
        q_minus = 2 * q_half - state.q_plus
        q_plus = 1 / self.alpha * (q_half + dt / 2 * system.evaluate(q_half, p_new, t + dt).dq - beta * q_minus)
        return JumpInQ(q_minus, q_plus, p_new, self.alpha)


@dataclass(frozen=True)
class DiscontinuousVerletAdjoint(_Discontinuous):
    """Scheme (15)-(16), its jump in p bounded for alpha in [0, 1/2]. Cost of a step: two implicit stages."""

    name: ClassVar[str] = "discontinuous-verlet-adjoint"
    alpha: float = 0.0

    def start(self, q: Vector, p: Vector) -> JumpInP:
        """Return the state of a start without jumps."""
        return JumpInP(q, p, p, self.alpha)

    def step(self, system: HamiltonianSystem, state: JumpInP, t: float, dt: float) -> JumpInP:
        """Return the state at t + dt; collective."""
        q, mean, beta = state.q, state.p, 1 - self.alpha
        _, p_half = system.solve_stage("p at 1/2", np.array([q, mean]), (0.0, dt / 2), t, state.evaluation)
        half = system.evaluate(q, p_half, t)
        q_new, _ = system.solve_stage("q at 1", np.array([q + dt / 2 * half.dq, p_half]), (dt / 2, 0.0), t + dt, half)
        p_minus = 2 * p_half - state.p_plus
        p_plus = 1 / beta * (p_half + dt / 2 * system.evaluate(q_new, p_half, t + dt).dp - self.alpha * p_minus)
        return JumpInP(q_new, p_minus, p_plus, self.alpha)
