"""Oscillators of one degree of freedom, the test problems of integrators.

All are Hamiltonian systems with vectors of shape (1,); [G16] is Gagarina et al. 2016.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import Weights
from wavetank.integrators.oscillators import Oscillators
from wavetank.integrators.stages import CoupledStages, PairStage, StageHistories, StageSolver


@dataclass(frozen=True)
class Harmonic(Oscillators):
    """H = (p² + omega² q²) / 2, the linear oscillator of [G16], section 4."""

    omega: float = 1.0

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
class Forced(Oscillators):
    """dp/dt = -q + slope t, dq/dt = p: the forced oscillator (50)-(51) of [G16], H = (p² + q²) / 2 - slope t q."""

    slope: float = 1.0

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
class NonSeparable(Oscillators):
    """H = (q² + 1)(p² + 1) / 2: nonlinear, and q and p do not separate, as in the water."""

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


class Iterated:
    """An oscillator whose stages are iterated as those of the tank are, without a preconditioner."""

    def __init__(self, system: Oscillators, *, tolerance: float = 1e-14):
        self.system, self.stages, self.evaluation_type = system, StageHistories(), system.evaluation_type
        self._solver = StageSolver(MPI.COMM_SELF, np.ones((2, 1)), tolerance=tolerance, floor=1e-6)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.system, name)

    def begin_stage(self, *stage: Any) -> None:
        """See ``StagedSystem``."""

    def precondition(self, weight: float, residual: Vector) -> Vector:
        """See ``StagedSystem``."""
        return residual

    def flow(self, z: Vector, t: float, history: Any) -> tuple[Vector, float]:
        """See ``StagedSystem``."""
        return self.system.flow(z, t), float(np.linalg.norm(z) / np.sqrt(2))

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Any = None) -> Vector:
        """See ``HamiltonianSystem``."""
        return self._solver.solve(PairStage(self, None, name, c, a, t, guess), self.stages)

    def solve_stages(self, name: str, c: Vector, a: Vector, times: Any, guess: Any = None, scale: Any = 1.0) -> Vector:
        """See ``HamiltonianSystem``."""
        return self._solver.solve(CoupledStages(self, None, name, c, a, times, guess, scale), self.stages)


class Counted:
    """A system that counts its evaluations: those of steps, and those within implicit stages.

    Attributes
    ----------
    system
        What is evaluated.
    evaluations
        Points evaluated so far.
    """

    def __init__(self, system: Any):
        self.system, self.evaluations = system, 0
        self.evaluation_type = system.evaluation_type

    def evaluate(self, q: Vector, p: Vector, t: float, guess: Any = None) -> Any:
        """Return the system's."""
        self.evaluations += 1
        return self.system.evaluate(q, p, t, guess)

    def _stages(self, solve: str, points: int, *stage: Any) -> Vector:
        before = self.system.stages.counters.evaluations
        z: Vector = getattr(self.system, solve)(*stage)
        self.evaluations += points * (self.system.stages.counters.evaluations - before)
        return z

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Any = None) -> Vector:
        """Return the system's."""
        return self._stages("solve_stage", 1, name, c, a, t, guess)

    def solve_stages(self, name: str, c: Vector, a: Vector, times: Any, guess: Any = None, scale: Any = 1.0) -> Vector:
        """Return the system's; each evaluation within it is one at each of the times."""
        return self._stages("solve_stages", len(times), name, c, a, times, guess, scale)

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the system's."""
        return self.system.inner(a, b)
