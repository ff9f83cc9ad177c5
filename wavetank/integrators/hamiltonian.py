"""The contract between a Hamiltonian system and an integrator.

A system has coordinates q and momenta p with

    dq/dt = H_p(q, p, t),        dp/dt = -H_q(q, p, t).

An oscillator of the paper and the whole wave tank look the same to an integrator. Vectors are numpy arrays of the
values this rank owns (shape (1,) for an oscillator), so that an integrator's arithmetic is written as in the paper
and costs nothing; whatever couples the ranks (norms, ghosts, solves) happens inside the system.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol, Self, runtime_checkable

from wavetank.arrays import Vector


class Stage(NamedTuple):
    """Which implicit stage is being solved: for start values, preconditioning and messages.

    Attributes
    ----------
    name
        The stage's own name, as in the paper, e.g. ``"p at 1/2"``; one name per implicit stage of a scheme.
    t
        The time the stage belongs to [s].
    dt
        The step [s].
    weight
        The factor a of the implicit derivative: the stage reads z = c + a f(z), in seconds.
    """

    name: str
    t: float
    dt: float
    weight: float


class Near(NamedTuple):
    """What a scheme knows next to a stage z = c + a f(z).

    Attributes
    ----------
    known
        c.
    z, slope
        A point next to the stage's solution, and f there.
    """

    known: Vector
    z: Vector
    slope: Vector


class StageSolver(Protocol):
    """Solves the implicit stages in which one set of unknowns takes part."""

    def solve(
        self, stage: Stage, residual: Callable[[Vector], Vector], start: Vector, *, near: Near | None = None
    ) -> Vector:
        """Return z with ``residual(z) = 0``; collective.

        ``start`` is the integrator's own start value; the solver may replace it by a better one found among earlier
        steps, and of what is known ``near`` the solution. The residual is written so that its derivative is close to
        the identity: z - c - a f(z).
        Raises ``ConvergenceError`` naming time, stage and residual.
        """


class Stages(Protocol):
    """The solvers for each kind of implicit stage: q alone, p alone, both stacked as [q, p], or several such pairs."""

    @property
    def coordinate(self) -> StageSolver:
        """For q alone."""

    @property
    def momentum(self) -> StageSolver:
        """For p alone."""

    @property
    def pair(self) -> StageSolver:
        """For both, stacked as [q, p]."""

    def coupled(self, pairs: int) -> StageSolver:
        """For that many of both at once, stacked as [q_1, p_1, q_2, p_2, ...]."""


class HamiltonianSystem(Protocol):
    """What an integrator may ask of a system. All methods are collective."""

    @property
    def stages(self) -> Stages:
        """The solvers of implicit stages."""

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dq, so that dp/dt = -H_q."""

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dp, so that dq/dt = H_p."""

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H(q, p, t)."""

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the unknowns of all ranks: what H changes by along b, a being its derivative."""


class Flowing(Protocol):
    """A system that tells both derivatives of a point as one."""

    def flow(self, z: Vector, t: float) -> Vector:
        """Return dz/dt of z = [q, p], one behind the other, in the same way; collective."""


class BetweenTwo:
    """A state between two points at which its system is evaluated anyway.

    Attributes
    ----------
    mean
        The state, (q, p), shape (2, n).
    """

    mean: Vector

    @property
    def points(self) -> tuple[Vector, Vector]:
        """The points before and after it, where a step has ended and where the next one begins.

        They are as ``flow`` is asked of them: [q, p], one behind the other, shape (2n,) each.
        """
        raise NotImplementedError

    def ended(self, at: Vector) -> Self:
        """Return it with another point where its step has ended, (q, p), shape (2, n)."""
        raise NotImplementedError


@runtime_checkable
class Seeing(Protocol):
    """A system that can tell the energy of a state in less than from the derivatives at the first of its points."""

    def energy_near(self, state: Any, t: float) -> float | None:
        """Return H from there, to the square of what lies between; None where it cannot; collective."""
