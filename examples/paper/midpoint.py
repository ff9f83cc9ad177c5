"""The modified midpoint scheme: H at the middle of the slab alone ([G16], section 3.2).

    q½ = q + dt/2 H_p(p½, q½; t + dt/2)      implicit,
    p½ = p - dt/2 H_q(p½, q½; t + dt/2)      coupled
    q' = 2 q½ - q,   p' = 2 p½ - p

In the unknowns of the half step it is the implicit midpoint rule, and Gauss-Legendre collocation with one stage.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Point


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
        now = np.array([state.q, state.p])
        half = system.solve_stage("(q, p) at 1/2", now, dt / 2, t + dt / 2, state.evaluation)
        q, p = now + dt * system.evaluate(half[0], half[1], t + dt / 2).flow
        return Point(q, p)
