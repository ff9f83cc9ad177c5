"""Symmetric composition of Störmer-Verlet to fourth order (Suzuki 1990; Hairer, Lubich, Wanner, II.4.2).

Five steps of sizes a dt, a dt, (1 - 4 a) dt, a dt, a dt with a = 1 / (4 - 4^(1/3)) = 0.4145. The middle step is
negative.
"""

from dataclasses import dataclass, field
from itertools import accumulate
from typing import ClassVar

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Point
from wavetank.integrators.stormer_verlet import StormerVerlet

OUTER = 1 / (4 - 4 ** (1 / 3))
SIZES = (OUTER, OUTER, 1 - 4 * OUTER, OUTER, OUTER)
BEGINS = (0.0, *accumulate(SIZES[:-1]))


@dataclass(frozen=True)
class SuzukiVerlet:
    """Fourth order, symplectic, reversible. Cost of a step: ten implicit stages."""

    name: ClassVar[str] = "suzuki-verlet"
    order: ClassVar[int] = 4
    stability_limit: ClassVar[float] = 2.720974
    frequency_error: ClassVar[tuple[float, int]] = (9.29e-4, 4)
    nodes: ClassVar[tuple[float, ...]] = (*BEGINS, 1.0)
    verlet: StormerVerlet = field(default_factory=StormerVerlet)

    def start(self, q: Vector, p: Vector) -> Point:
        """Return the state of a smooth start."""
        return self.verlet.start(q, p)

    def step(self, system: HamiltonianSystem, state: Point, t: float, dt: float) -> Point:
        """Return the state at t + dt; collective."""
        for begin, size in zip(BEGINS, SIZES, strict=True):
            state = self.verlet.step(system, state, t + begin * dt, size * dt)
        return state
