"""Symplectic Euler: constants in time ([G16], section 3.2 and (43)-(44) without damping), and its adjoint.

[G16] is Gagarina et al. 2016. With q = q⁺ at the left end of the slab, p = p⁻ at its right end and alpha = 1 in the
flux:

    p' = p - dt H_q(q, p'; t + dt)      implicit
    q' = q + dt H_p(q, p'; t + dt)

The adjoint uses q at the right end and p at the left, and H at t. Half a step of one and half a step of the other
give Störmer-Verlet (14).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Point


class _Euler:
    """Common part of both variants: first order, symplectic, not reversible, stable for omega dt < 2."""

    order: ClassVar[int] = 1
    stability_limit: ClassVar[float] = 2.0
    frequency_error: ClassVar[tuple[float, int]] = (1 / 24, 2)

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return Point(q, p)


@dataclass(frozen=True)
class SymplecticEuler(_Euler):
    """Scheme (44) without damping: momentum, coordinate. Cost of a step: one implicit stage."""

    name: ClassVar[str] = "symplectic-euler"
    nodes: ClassVar[tuple[float, ...]] = (1.0,)

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        q, p = system.solve_stage("p at 1", np.array([state.q, state.p]), (0.0, dt), t + dt, state.evaluation)
        return Point(q + dt * system.evaluate(q, p, t + dt).dq, p)


@dataclass(frozen=True)
class SymplecticEulerAdjoint(_Euler):
    """The adjoint of (44) without damping: coordinate, momentum. Cost of a step: one implicit stage."""

    name: ClassVar[str] = "symplectic-euler-adjoint"
    nodes: ClassVar[tuple[float, ...]] = (0.0,)

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        q, p = system.solve_stage("q at 1", np.array([state.q, state.p]), (dt, 0.0), t, state.evaluation)
        end = system.evaluate(q, p, t)
        return Point(state.q + dt * end.dq, p + dt * end.dp)  # keeps what the flow keeps, e.g. mass, exactly
