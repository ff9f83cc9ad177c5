"""Oscillators of one degree of freedom, the test problems of integrators.

All are Hamiltonian systems with vectors of shape (1,); [G16] is Gagarina et al. 2016.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy

from wavetank.arrays import Vector
from wavetank.integrators.affine_stages import OnOneRank, OscillatorStages
from wavetank.integrators.hamiltonian import HamiltonianSystem, Stages
from wavetank.integrators.stage_solver import IteratedStages


def _stages() -> IteratedStages:
    return IteratedStages.serial(1)


@dataclass(frozen=True)
class Harmonic(OnOneRank):
    """H = (p² + omega² q²) / 2, the linear oscillator of [G16], section 4."""

    omega: float = 1.0
    stages: Stages = field(default_factory=OscillatorStages, compare=False)

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
        """Return (q, p) at t from their values at 0, [G16] (A.8)."""
        c, s = np.cos(self.omega * t), np.sin(self.omega * t)
        return float(q * c + p / self.omega * s), float(p * c - q * self.omega * s)

    def period(self, q: float, p: float) -> float:
        """Return the period, whatever the start."""
        return 2 * np.pi / self.omega


@dataclass(frozen=True)
class Forced(OnOneRank):
    """dp/dt = -q + slope t, dq/dt = p: the forced oscillator (50)-(51) of [G16], H = (p² + q²) / 2 - slope t q."""

    slope: float = 1.0
    stages: Stages = field(default_factory=OscillatorStages, compare=False)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return q - slope t."""
        return q - self.slope * t

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return p."""
        return p

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H."""
        return float(0.5 * (p[0] ** 2 + q[0] ** 2) - self.slope * t * q[0])

    def invariant(self, q: float, p: float, t: float) -> float:
        """Return (54), the energy in the coordinates (52) in which the system is autonomous."""
        Q = q - self.slope * t
        return 0.5 * p**2 + 0.5 * Q**2 - self.slope * p

    def exact(self, q: float, p: float, t: float) -> tuple[float, float]:
        """Return (q, p) at t from their values at 0, (55): slope t and an oscillation about it."""
        c, s = np.cos(t), np.sin(t)
        return float(self.slope * t + q * c + (p - self.slope) * s), float(self.slope - q * s + (p - self.slope) * c)


@dataclass(frozen=True)
class NonSeparable(OnOneRank):
    """H = (q² + 1)(p² + 1) / 2: nonlinear, and q and p do not separate, as in the water."""

    stages: Stages = field(default_factory=_stages, compare=False)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return q (p² + 1)."""
        return q * (p**2 + 1.0)

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return p (q² + 1)."""
        return p * (q**2 + 1.0)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H."""
        return float(0.5 * (q[0] ** 2 + 1.0) * (p[0] ** 2 + 1.0))

    def exact(self, q: float, p: float, t: float) -> tuple[float, float]:
        """Return (q, p) at t from their values at 0, in Jacobi's elliptic functions.

        With k² = 2 H - 1, m = k² / (1 + k²) and s = (1 + k²)^(1/2) t + constant: q = k sn(s) / dn(s) (1 - m)^(1/2)
        and p = k cn(s), because q' = p (q² + 1) and (q² + 1)(p² + 1) = 1 + k².
        """
        rate, m, amplitude = self._elliptic(q, p)
        phase = scipy.special.ellipkinc(np.arctan2(q * rate / np.sqrt(1 + q**2), p), m)
        sn, cn, dn, _ = scipy.special.ellipj(rate * t + phase, m)
        return float(amplitude * np.sqrt(1 - m) * sn / dn), float(amplitude * cn)

    def period(self, q: float, p: float) -> float:
        """Return the period of the orbit through (q, p)."""
        rate, m, _ = self._elliptic(q, p)
        return float(4 * scipy.special.ellipk(m) / rate)

    def _elliptic(self, q: float, p: float) -> tuple[float, float, float]:
        square = (q**2 + 1) * (p**2 + 1) - 1
        return float(np.sqrt(1 + square)), square / (1 + square), float(np.sqrt(square))


@dataclass
class Counted(OnOneRank):
    """A system that counts evaluations; successive H_q and H_p at one (q, p, t) count as one.

    Attributes
    ----------
    system
        The system.
    evaluations
        Points evaluated so far.
    """

    system: HamiltonianSystem
    evaluations: int = 0
    _last: tuple[bytes, bytes, float] | None = None

    @property
    def stages(self) -> Stages:
        """Stages of the system."""
        return self.system.stages

    def _count(self, q: Vector, p: Vector, t: float) -> None:
        point = (q.tobytes(), p.tobytes(), t)
        self.evaluations += point != self._last
        self._last = point

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return the system's."""
        self._count(q, p, t)
        return self.system.H_q(q, p, t)

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return the system's."""
        self._count(q, p, t)
        return self.system.H_p(q, p, t)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return the system's; not counted."""
        return self.system.energy(q, p, t)
