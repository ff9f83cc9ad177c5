"""Störmer-Verlet, scheme (14) of Gagarina et al. 2016, and its adjoint (15)-(16).

(14) is the discontinuous Galerkin scheme with linear p and q, the trapezoidal rule in p and the midpoint rule in q:

    q½ = q  + dt/2 H_p(p, q½; t)                              implicit
    p' = p  - dt/2 [ H_q(p, q½; t) + H_q(p', q½; t + dt) ]     implicit
    q' = q½ + dt/2 H_p(p', q½; t + dt)

The adjoint swaps the roles of p and q; with forcing it is (57). The jumps that the discontinuous schemes have in q
and in p do not enter: see ``DiscontinuousVerlet`` in examples. H is taken at t and t + dt, the times t* and t** of (56)
that belong to the values of the trapezoidal rule.
"""

from dataclasses import dataclass
from typing import ClassVar

from wavetank.arrays import Vector
from wavetank.integrators.contract import StepCosts
from wavetank.integrators.hamiltonian import HamiltonianSystem, Stage
from wavetank.integrators.states import Point


class _Verlet:
    """What both variants have in common: second order, symplectic, reversible, stable for omega dt < 2."""

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
        q, p = state
        q_half = system.stages.coordinate.solve(
            Stage("q at 1/2", t, dt, dt / 2),
            lambda z: z - q - dt / 2 * system.H_p(z, p, t),
            q,
        )
        half_way = p - dt / 2 * system.H_q(q_half, p, t)
        q_half = q + dt / 2 * system.H_p(q_half, p, t)  # keeps what the flow keeps, e.g. mass, exactly
        p_new = system.stages.momentum.solve(
            Stage("p at 1", t + dt, dt, dt / 2),
            lambda z: z - half_way + dt / 2 * system.H_q(q_half, z, t + dt),
            2 * half_way - p,
        )
        return Point(q_half + dt / 2 * system.H_p(q_half, p_new, t + dt), p_new)


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
        q, p = state
        p_half = system.stages.momentum.solve(
            Stage("p at 1/2", t, dt, dt / 2),
            lambda z: z - p + dt / 2 * system.H_q(q, z, t),
            p,
        )
        half_way = q + dt / 2 * system.H_p(q, p_half, t)
        q_new = system.stages.coordinate.solve(
            Stage("q at 1", t + dt, dt, dt / 2),
            lambda z: z - half_way - dt / 2 * system.H_p(z, p_half, t + dt),
            2 * half_way - q,
        )
        return Point(  # q once more from its flow: keeps what the flow keeps, e.g. mass, exactly
            half_way + dt / 2 * system.H_p(q_new, p_half, t + dt),
            p_half - dt / 2 * system.H_q(q_new, p_half, t + dt),
        )
