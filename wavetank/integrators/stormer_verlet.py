"""Störmer-Verlet, scheme (14) of Gagarina et al. 2016, and its adjoint (15)-(16).

(14) is the discontinuous Galerkin scheme with linear p and q, the trapezoidal rule in p and the midpoint rule in q:

    q½ = q  + dt/2 H_p(p, q½; t)                              implicit
    p' = p  - dt/2 [ H_q(p, q½; t) + H_q(p', q½; t + dt) ]     implicit
    q' = q½ + dt/2 H_p(p', q½; t + dt)

The adjoint exchanges p and q; with forcing it is (57). The jumps of q and p in the discontinuous schemes do not appear:
see ``DiscontinuousVerlet`` in examples. H is evaluated at t and t + dt, the times t* and t** of (56) that belong to the
values of the trapezoidal rule.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Point, StepCosts


class _Verlet:
    """Base class of both variants: second order, symplectic, reversible, stable for omega dt < 2."""

    order: ClassVar[int] = 2
    stability_limit: ClassVar[float] = 2.0
    frequency_error: ClassVar[tuple[float, int]] = (1 / 24, 2)
    nodes: ClassVar[tuple[float, ...]] = (0.0, 1.0)

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return Point(q, p)


@dataclass(frozen=True)
class StormerVerlet(_Verlet):
    """Scheme (14): coordinate, momentum, coordinate. Cost of a step: two implicit stages."""

    name: ClassVar[str] = "stormer-verlet"
    solvable: ClassVar[float] = 1.0
    costs: ClassVar[StepCosts] = StepCosts(
        products=(0.3, 0.8),
        linear=(0.00016, 4.5e-08, 1.5e-09, 1.2e-05, 0, 0),
        nonlinear=(0.00016, 0, 1.5e-08, 0.00012, 5.8e-07, 6.5e-09),
        driven=(0.00022, 1.8e-07, 1.8e-08, 0.00022, 4.2e-07, 4.4e-09),
    )

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        q, p, now = state.q, state.p, state.evaluation
        q_half, _ = system.solve_stage("q at 1/2", np.array([q, p]), (dt / 2, 0.0), t, now)
        half = system.evaluate(q_half, p, t, now)
        q_half = q + dt / 2 * half.dq  # conserves the linear invariants of the flow, e.g. mass, exactly
        half_way = p + dt / 2 * half.dp
        _, p_new = system.solve_stage("p at 1", np.array([q_half, half_way]), (0.0, dt / 2), t + dt, half)
        end = system.evaluate(q_half, p_new, t + dt, half)
        return Point(q_half + dt / 2 * end.dq, p_new)


@dataclass(frozen=True)
class StormerVerletAdjoint(_Verlet):
    """Scheme (15)-(16), with forcing (57): momentum, coordinate, momentum. Cost of a step: two implicit stages."""

    name: ClassVar[str] = "stormer-verlet-adjoint"
    solvable: ClassVar[float] = 1.0
    costs: ClassVar[StepCosts] = StepCosts(
        products=(0.3, 0.8),
        linear=(0.00019, 4.8e-08, 2.5e-09, 1.7e-05, 4e-08, 0),
        nonlinear=(0.00016, 1.8e-07, 1.6e-08, 0.00011, 3.3e-07, 5.8e-09),
        driven=(0.00026, 9.1e-08, 1.8e-08, 9.8e-05, 3.2e-07, 1.2e-08),
    )

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        q, p, now = state.q, state.p, state.evaluation
        _, p_half = system.solve_stage("p at 1/2", np.array([q, p]), (0.0, dt / 2), t, now)
        half = system.evaluate(q, p_half, t, now)
        half_way = q + dt / 2 * half.dq
        q_new, _ = system.solve_stage("q at 1", np.array([half_way, p_half]), (dt / 2, 0.0), t + dt, half)
        end = system.evaluate(q_new, p_half, t + dt, half)
        return Point(half_way + dt / 2 * end.dq, p_half + dt / 2 * end.dp)  # q conserves linear invariants
