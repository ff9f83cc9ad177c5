"""P2N3Q4Lob of Ober-Blöbaum and Saake 2015: continuous quadratics and Simpson's rule, all values of a step coupled.

Reference [22] of [G16] (Gagarina et al. 2016). It has the polynomials and the quadrature of (20), without a jump.
Variation of q(t) among continuous quadratics gives the pair Lobatto IIIA (for q) and IIIB (for p) with three stages:

    Q_i = q + dt sum_j a_ij  H_p(Q_j, P_j; t + c_j dt)      i = 1, 2, 3;  Q_1 = q,  q' = Q_3
    P_i = p - dt sum_j a'_ij H_q(Q_j, P_j; t + c_j dt)      i = 1, 2, 3
    p'  = p - dt sum_j b_j   H_q(Q_j, P_j; t + c_j dt),     b = (1, 4, 1) / 6,  c = (0, 1/2, 1)
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Point

C = (0.0, 0.5, 1.0)
A = ((0.0, 0.0, 0.0), (5 / 24, 1 / 3, -1 / 24), (1 / 6, 2 / 3, 1 / 6))
A_PRIME = ((1 / 6, -1 / 6, 0.0), (1 / 6, 1 / 3, 0.0), (1 / 6, 5 / 6, 0.0))
B = (1 / 6, 2 / 3, 1 / 6)


@dataclass(frozen=True)
class P2N3Q4Lob:
    """Fourth order, symplectic, reversible; stable for omega dt < 2 sqrt(2), and again from sqrt(12) to sqrt(24).

    Cost of a step: one implicit stage of three pairs, stacked as [Q_1, P_1, Q_2, P_2, Q_3, P_3]; each evaluation of
    it is three of the derivatives.
    """

    name: ClassVar[str] = "p2n3q4lob"
    order: ClassVar[int] = 4
    stability_limit: ClassVar[float] = 8**0.5
    frequency_error: ClassVar[tuple[float, int]] = (1 / 2880, 4)
    nodes: ClassVar[tuple[float, ...]] = C

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return Point(q, p)

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        now, times = np.array([state.q, state.p]), [t + c * dt for c in C]
        stages = system.solve_stages("all of the step", now, dt * np.array([A, A_PRIME]), times, state.evaluation)
        flows = [system.evaluate(one[0], one[1], at).flow for one, at in zip(stages, times, strict=True)]
        q, p = now + dt * sum(weight * flow for weight, flow in zip(B, flows, strict=True))
        return Point(q, p)
