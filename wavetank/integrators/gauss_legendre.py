"""Gauss-Legendre collocation with two stages (Hairer, Lubich, Wanner, Geometric Numerical Integration, II.1.3).

z_i = z + dt sum_j a_ij f(z_j; t + c_j dt),   i = 1, 2,     f = (H_p, -H_q)
z'  = z + dt/2 [ f(z_1) + f(z_2) ],           c = 1/2 ∓ sqrt(3)/6
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Point, StepCosts

ROOT = 3**0.5 / 6
C = (1 / 2 - ROOT, 1 / 2 + ROOT)
A = np.array([[1 / 4, 1 / 4 - ROOT], [1 / 4 + ROOT, 1 / 4]])
INVERSE = np.linalg.inv(A)


@dataclass(frozen=True)
class GaussLegendre4:
    """Gauss-Legendre scheme: fourth order, symplectic, reversible, stable for every omega dt.

    Cost of a step: one implicit stage of two pairs, stacked as [q_1, p_1, q_2, p_2]; each of its evaluations is two
    evaluations of the derivatives.
    """

    name: ClassVar[str] = "gauss-legendre-4"
    order: ClassVar[int] = 4
    stability_limit: ClassVar[float] = np.inf
    frequency_error: ClassVar[tuple[float, int]] = (1 / 720, 4)
    nodes: ClassVar[tuple[float, ...]] = C
    solvable: ClassVar[float] = 3.0
    costs: ClassVar[StepCosts] = StepCosts(
        products=(0.6, 2.2),
        linear=(0.00093, 1.4e-06, 4.4e-10, 0.0007, 7.1e-07, 4.8e-08),
        nonlinear=(0.00012, 1.5e-07, 0, 0.00019, 7.8e-07, 1.9e-08),
        driven=(0.00024, 7.7e-08, 0, 0.00041, 9.8e-07, 2.2e-08),
    )

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return Point(q, p)

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        now = np.array([state.q, state.p])
        times = [t + c * dt for c in C]
        stages = system.solve_stages("all of the step", now, dt * np.array([A, A]), times, state.evaluation)
        slopes = np.tensordot(INVERSE, stages - now, 1) / dt
        q, p = now + dt / 2 * (slopes[0] + slopes[1])
        return Point(q, p)
