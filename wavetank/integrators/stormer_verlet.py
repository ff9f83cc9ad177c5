"""Störmer-Verlet, scheme (14) of Gagarina et al. 2016, and its adjoint (15)-(16).

(14) is the discontinuous Galerkin scheme with linear p and q, the trapezoidal rule in p and the midpoint rule in q:

    p½ = p  - dt/2 H_q(q, p½; t)                              implicit
    q' = q  + dt/2 [ H_p(q, p½; t) + H_p(q', p½; t + dt) ]     implicit
    p' = p½ - dt/2 H_q(q', p½; t + dt)

The adjoint variant swaps the roles of p and q.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from wavetank.hamiltonian.contract import HamiltonianSystem, Stage, Vector


class Point(NamedTuple):
    """Coordinates and momenta, continuous in time."""

    q: Vector
    p: Vector


class _Verlet:
    """What both variants have in common: second order, symplectic, reversible, stable for omega dt <= 2."""

    order: ClassVar[int] = 2
    stability_limit: ClassVar[float] = 2.0
    frequency_error: ClassVar[tuple[float, int]] = (1 / 24, 2)
    nodes: ClassVar[tuple[float, ...]] = (0.0, 1.0)

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return Point(q, p)


@dataclass(frozen=True)
class StormerVerlet(_Verlet):
    """Scheme (14): momentum, coordinate, momentum. Cost of a step: two implicit stages."""

    name: ClassVar[str] = "stormer-verlet"

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


@dataclass(frozen=True)
class StormerVerletAdjoint(_Verlet):
    """Scheme (15)-(16): coordinate, momentum, coordinate. Cost of a step: two implicit stages."""

    name: ClassVar[str] = "stormer-verlet-adjoint"

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
