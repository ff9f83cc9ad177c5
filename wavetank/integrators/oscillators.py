"""Small Hamiltonian systems that are defined by formulae, such as the oscillators of the paper."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import ConvergenceError
from wavetank.integrators.contract import Evaluation, Weights, coupled, pair

ITERATIONS = 50  # largest number of Newton iterations
DIFFERENCE = 1e-6  # step of the finite differences in Newton's method
ROUND_OFF = 1e-15


class Oscillators(ABC):
    """Independent systems of one degree of freedom each, as vectors, on one rank: a ``HamiltonianSystem``.

    Derived classes define ``H_q``, ``H_p`` and ``energy``, with arguments of shape (n,).
    """

    evaluation_type: ClassVar[type[Evaluation]] = Evaluation

    @abstractmethod
    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dq, shape (n,)."""

    @abstractmethod
    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dp, shape (n,)."""

    @abstractmethod
    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H, the sum over all systems."""

    def flow(self, z: Vector, t: float) -> Vector:
        """Return [dH/dp, -dH/dq], shape (2, n)."""
        q, p = z
        return np.array([self.H_p(q, p, t), -self.H_q(q, p, t)])

    def evaluate(self, q: Vector, p: Vector, t: float, guess: Evaluation | None = None) -> Evaluation:
        """Return the evaluation at (q, p, t)."""
        z = np.array([q, p])
        return Evaluation(t, z, self.flow(z, t), self.energy(q, p, t))

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Evaluation | None = None) -> Vector:
        """See ``HamiltonianSystem``."""
        a_q, a_p = pair(a)
        c = np.asarray(c)

        def image(z: Vector) -> Vector:
            dq, dp = self.flow(z, t)
            return np.asarray(c + np.array([a_q * dq, a_p * dp]))

        return self.fixed_point(image, c)

    def solve_stages(
        self,
        name: str,
        c: Vector,
        a: Vector,
        times: Sequence[float],
        guess: Evaluation | None = None,
        scale: Any = 1.0,
    ) -> Vector:
        """See ``HamiltonianSystem``."""

        def image(z: Vector) -> Vector:
            return coupled(c, a, np.array([self.flow(*at) for at in zip(z, times, strict=True)]), scale)

        return self.fixed_point(image, np.broadcast_to(c, (len(times), *np.shape(c)[-2:])))

    def fixed_point(self, image: Callable[[Vector], Vector], start: Vector) -> Vector:
        """Return the solution z = image(z), shape (..., n) as the start value, by Newton's method to round-off."""
        z, n = np.array(start, dtype=np.float64), start.shape[-1]
        units = np.eye(z.size // n)[:, :, None]
        last = np.inf
        for _ in range(ITERATIONS):
            residual = z - image(z)
            away = np.abs(residual).max()
            if away <= ROUND_OFF * np.abs(z).max() or (away >= last and away <= 1e3 * ROUND_OFF * np.abs(z).max()):
                return z
            last, step = away, DIFFERENCE * (1 + np.abs(z).max())
            moved = [z + step * (unit * np.ones(n)).reshape(z.shape) for unit in units]
            columns = np.array([(one - image(one) - residual).reshape(-1, n) / step for one in moved])
            change = np.linalg.solve(columns.transpose(2, 1, 0), residual.reshape(-1, n).T[..., None])
            z = z - change[..., 0].T.reshape(z.shape)
        raise ConvergenceError(f"Newton's method did not converge: residual {last:.3g}")

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b."""
        return float(a @ b)
