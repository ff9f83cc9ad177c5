"""The contract between a Hamiltonian system and an integrator.

A system has coordinates q and momenta p with

    dq/dt = H_p(q, p, t),        dp/dt = -H_q(q, p, t).

An oscillator of the paper and the whole wave tank look the same to an integrator. Vectors are numpy arrays of the
values this rank owns (shape (1,) for an oscillator), so that an integrator's arithmetic is written as in the paper
and costs nothing; whatever couples the ranks (norms, ghosts, solves) happens inside the system.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from wavetank.base.arrays import Vector

Weights = float | tuple[float, float]
"""The factor a of a stage z = c + a f(z), or two: of the coordinates and of the momenta. One that is 0 leaves its part
as it is, so that q = c + a H_p(q, p) for a given p has the weights (a, 0)."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """A Hamiltonian system at (q, p, t): its derivatives and its energy.

    Attributes
    ----------
    t
        The time [s].
    z
        Coordinates and momenta [q, p], shape (2, n).
    flow
        Their rates f(z, t) = [dH/dp, -dH/dq], shape (2, n).
    energy
        H.
    """

    t: float
    z: Vector
    flow: Vector
    energy: float

    @property
    def q(self) -> Vector:
        """The coordinates, shape (n,)."""
        q: Vector = self.z[0]
        return q

    @property
    def p(self) -> Vector:
        """The momenta, shape (n,)."""
        p: Vector = self.z[1]
        return p

    @property
    def dq(self) -> Vector:
        """dq/dt = dH/dp, shape (n,)."""
        dq: Vector = self.flow[0]
        return dq

    @property
    def dp(self) -> Vector:
        """dp/dt = -dH/dq, shape (n,)."""
        dp: Vector = self.flow[1]
        return dp


class HamiltonianSystem(Protocol):
    """What an integrator may ask of a system. All methods are collective."""

    @property
    def evaluation_type(self) -> type[Any]:
        """The class of its evaluations."""

    def evaluate(self, q: Vector, p: Vector, t: float, guess: Any = None) -> Any:
        """Return the ``Evaluation`` at a point; ``guess`` is one near it, which affects cost and round-off only."""

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Any = None) -> Vector:
        """Return z = c + a f(z, t), shape (2, n), of a scheme's stage of that name.

        ``guess`` is an evaluation near z, if there is one. Raises ``ConvergenceError`` naming time, stage and residual.
        """

    def solve_stages(
        self, name: str, c: Vector, a: Vector, times: Sequence[float], guess: Any = None, scale: Any = 1.0
    ) -> Vector:
        """Return the coupled stages z_i = c + s_i sum_j a_ij f(z_j, t_j) / s_j, shape (stages, 2, n).

        ``a`` has the coefficients of the coordinates and those of the momenta [s], shape (2, stages, stages), and
        ``scale`` s, broadcastable to the shape of the result.
        """

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the unknowns of all ranks: what H changes by along b, a being its derivative."""


def energy_change(system: HamiltonianSystem, at: Evaluation, dz: Vector) -> float:
    """Return dH/dz dz at an evaluation, for a change of coordinates and momenta dz, shape (2, n); collective."""
    dq, dp = dz
    return system.inner(at.dq, dp) - system.inner(at.dp, dq)


def pair(a: Weights) -> tuple[Any, Any]:
    """Return the factors of the coordinates and of the momenta."""
    return a if isinstance(a, tuple) else (a, a)


def coupled(c: Vector, a: Vector, flows: Vector, scale: Any = 1.0) -> Vector:
    """Return c + s_i sum_j a_ij f_j / s_j; see ``HamiltonianSystem.solve_stages``."""
    scaled = flows / scale
    return np.asarray(c + scale * np.stack([a[part] @ scaled[:, part] for part in (0, 1)], axis=1))
