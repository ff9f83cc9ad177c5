"""Oscillators of one degree of freedom: what an integrator is tried on before it meets the water.

All are Hamiltonian systems of ``contract.py`` with vectors of shape (1,); [G16] is Gagarina et al. 2016.
"""

from dataclasses import dataclass, field

import numpy as np

from wavetank.hamiltonian.contract import Vector
from wavetank.hamiltonian.stage_solver import SnesStages


def _stages() -> SnesStages:
    return SnesStages.serial(1)


@dataclass(frozen=True)
class Harmonic:
    """H = (p² + omega² q²) / 2, the linear oscillator of [G16], section 4."""

    omega: float = 1.0
    stages: SnesStages = field(default_factory=_stages, compare=False)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return omega² q."""
        return self.omega**2 * q

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return p."""
        return p

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H."""
        return float(0.5 * (p[0] ** 2 + self.omega**2 * q[0] ** 2))

    def exact(self, q: float, p: float, t: float) -> tuple[float, float]:
        """Return (q, p) at t from their values at 0."""
        c, s = np.cos(self.omega * t), np.sin(self.omega * t)
        return float(q * c + p / self.omega * s), float(p * c - q * self.omega * s)


@dataclass(frozen=True)
class Forced:
    """dp/dt = -q + slope t, dq/dt = p: the forced oscillator (50) of [G16], H = (p² + q²) / 2 - slope t q."""

    slope: float = 1.0
    stages: SnesStages = field(default_factory=_stages, compare=False)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return q - slope t."""
        return q - self.slope * t

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return p."""
        return p

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H."""
        return float(0.5 * (p[0] ** 2 + q[0] ** 2) - self.slope * t * q[0])

    def exact(self, q: float, p: float, t: float) -> tuple[float, float]:
        """Return (q, p) at t from their values at 0: slope t and an oscillation about it."""
        c, s = np.cos(t), np.sin(t)
        return float(self.slope * t + q * c + (p - self.slope) * s), float(self.slope - q * s + (p - self.slope) * c)


@dataclass(frozen=True)
class NonSeparable:
    """H = (q² + 1)(p² + 1) / 2: nonlinear, and q and p do not separate, as in the water."""

    stages: SnesStages = field(default_factory=_stages, compare=False)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return q (p² + 1)."""
        return q * (p**2 + 1.0)

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return p (q² + 1)."""
        return p * (q**2 + 1.0)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H."""
        return float(0.5 * (q[0] ** 2 + 1.0) * (p[0] ** 2 + 1.0))
