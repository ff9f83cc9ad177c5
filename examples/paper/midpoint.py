"""The modified midpoint scheme: H at the middle of the slab alone ([G16], section 3.2).

    q½ = q + dt/2 H_p(p½, q½; t + dt/2)      implicit,
    p½ = p - dt/2 H_q(p½, q½; t + dt/2)      coupled
    q' = 2 q½ - q,   p' = 2 p½ - p

In the unknowns of the half step it is the implicit midpoint rule, and Gauss-Legendre collocation with one stage.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.flow import flow
from wavetank.integrators.hamiltonian import HamiltonianSystem, Stage
from wavetank.integrators.states import Point


@dataclass(frozen=True)
class ModifiedMidpoint:
    """Second order, symplectic, reversible, stable for every omega dt. Cost of a step: one implicit stage."""

    name: ClassVar[str] = "modified-midpoint"
    order: ClassVar[int] = 2
    stability_limit: ClassVar[float] = np.inf
    frequency_error: ClassVar[tuple[float, int]] = (1 / 12, 2)
    nodes: ClassVar[tuple[float, ...]] = (0.5,)

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return Point(q, p)

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        q, p = state

        def residual(z: Vector) -> Vector:
            q_half, p_half = z.reshape(2, -1)
            dq, dp = flow(system, q_half, p_half, t + dt / 2)
            return np.concatenate([q_half - q - dt / 2 * dq, p_half - p - dt / 2 * dp])

        stage = Stage("(q, p) at 1/2", t + dt / 2, dt, dt / 2)
        half = system.stages.pair.solve(stage, residual, np.concatenate([q, p]))
        q_half, p_half = half.reshape(2, -1)
        dq, dp = flow(system, q_half, p_half, t + dt / 2)
        return Point(q + dt * dq, p + dt * dp)
