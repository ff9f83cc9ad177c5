"""The interfaces of a Hamiltonian system, of the states of a scheme, and of a time integrator.

A system has coordinates q and momenta p with

    dq/dt = H_p(q, p, t),        dp/dt = -H_q(q, p, t).

An integrator treats an oscillator of the paper and a complete wave tank alike. Vectors are numpy arrays of the values
that this rank owns (shape (1,) for an oscillator). The arithmetic of an integrator is therefore written as in the
paper, without communication. Operations that couple the ranks (norms, ghosts, solves) are inside the system.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector

Weights = float | tuple[float, float]
"""The factor a of a stage z = c + a f(z), or two: of the coordinates and of the momenta. One that is 0 leaves its part
as it is, so that q = c + a H_p(q, p) for a given p has the weights (a, 0)."""


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """The evaluation of a Hamiltonian system at (q, p, t): its derivatives and its energy.

    Attributes
    ----------
    t
        Time [s].
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
        """Coordinates, shape (n,)."""
        q: Vector = self.z[0]
        return q

    @property
    def p(self) -> Vector:
        """Momenta, shape (n,)."""
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
    """A Hamiltonian system, as integrators use it. All methods are collective."""

    @property
    def evaluation_type(self) -> type[Any]:
        """Class of the evaluations."""

    def evaluate(self, q: Vector, p: Vector, t: float, guess: Any = None) -> Any:
        """Return the ``Evaluation`` at a point; ``guess`` is a nearby one, which affects cost and round-off only."""

    def solve_stage(self, name: str, c: Vector, a: Weights, t: float, guess: Any = None) -> Vector:
        """Return the solution z = c + a f(z, t), shape (2, n), of a scheme's stage, identified by its name.

        ``guess`` is an evaluation near z, or None. Raises ``ConvergenceError`` with time, stage and residual.
        """

    def solve_stages(
        self, name: str, c: Vector, a: Vector, times: Sequence[float], guess: Any = None, scale: Any = 1.0
    ) -> Vector:
        """Return the coupled stages z_i = c + s_i sum_j a_ij f(z_j, t_j) / s_j, shape (stages, 2, n).

        ``a`` contains the coefficients of the coordinates and those of the momenta [s], shape (2, stages, stages);
        ``scale`` is s, broadcastable to the shape of the result.
        """

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the unknowns of all ranks: with the derivative a, the change of H along b."""


def energy_change(system: HamiltonianSystem, at: Evaluation, dz: Vector) -> float:
    """Return dH/dz dz at an evaluation, for a change dz of coordinates and momenta, shape (2, n); collective."""
    dq, dp = dz
    return system.inner(at.dq, dp) - system.inner(at.dp, dq)


def pair(a: Weights) -> tuple[Any, Any]:
    """Return the factors of the coordinates and of the momenta."""
    return a if isinstance(a, tuple) else (a, a)


def coupled(c: Vector, a: Vector, flows: Vector, scale: Any = 1.0) -> Vector:
    """Return c + s_i sum_j a_ij f_j / s_j; see ``HamiltonianSystem.solve_stages``."""
    scaled = flows / scale
    return np.asarray(c + scale * np.stack([a[part] @ scaled[:, part] for part in (0, 1)], axis=1))


# ------------------------------------------------------------------------------------------ states
Map = Callable[[Vector], Vector]
"""What acts on points of a state alike, of pairs [q, p], shape (m, 2, n), and makes such of them."""


@dataclass(frozen=True, eq=False)
class State(ABC):
    """The state of a scheme at the end of a step; derived classes have the reported coordinates q and momenta p.

    Attributes
    ----------
    evaluation
        Evaluation at which the next step begins; None before the first request.
    end
        Evaluation at the end of the step, before filters; None if it is the one at which the next step begins.
    """

    evaluation: Any = field(default=None, kw_only=True)
    end: Any = field(default=None, kw_only=True)

    if TYPE_CHECKING:  # fields or properties

        @property
        def q(self) -> Vector:
            """The coordinates at the state's time."""

        @property
        def p(self) -> Vector:
            """The momenta at the state's time."""

    @property
    def evaluations(self) -> tuple[Any, ...]:
        """The evaluations whose mean is (q, p): at the end of the step, and at the beginning of the next one."""
        return (self.evaluation,) if self.end is None else (self.end, self.evaluation)

    def evaluated(self, system: HamiltonianSystem, t: float) -> Self:
        """Return the state at t with its evaluation; collective."""
        if self.evaluation is not None:
            return self
        q, p = self.next_point
        return replace(self, evaluation=system.evaluate(q, p, t, self.end))

    @property
    def next_point(self) -> Vector:
        """Coordinates and momenta at which the next step begins, shape (2, n)."""
        return np.array([self.q, self.p])

    @property
    def q_jump(self) -> Vector | None:
        """Jump of the coordinates at the time of the state; None for a scheme without jumps."""
        return None

    @abstractmethod
    def mapped(self, of: Map) -> Self:
        """Return the state with its points mapped."""


S = TypeVar("S", bound=State)


@dataclass(frozen=True, eq=False)
class Point(State):
    """Coordinates and momenta, continuous in time."""

    q: Vector
    p: Vector

    def mapped(self, of: Map) -> Self:
        """Return the state with q and p mapped."""
        return type(self)(*of(np.array([[self.q, self.p]]))[0])


@dataclass(frozen=True, eq=False)
class Traces(State):
    """The traces of q and p before and after the jump at t; the reported values are the plus trace."""

    q_minus: Vector
    q_plus: Vector
    p_minus: Vector
    p_plus: Vector

    @property
    def q(self) -> Vector:
        """Reported coordinates."""
        return self.q_plus

    @property
    def p(self) -> Vector:
        """Reported momenta."""
        return self.p_plus

    @property
    def q_jump(self) -> Vector:
        """Jump of the coordinates."""
        return self.q_plus - self.q_minus

    def mapped(self, of: Map) -> Self:
        """Return the state with all four traces mapped."""
        minus, plus = of(np.array([[self.q_minus, self.p_minus], [self.q_plus, self.p_plus]]))
        return type(self)(minus[0], plus[0], minus[1], plus[1])


def vectors(state: Any) -> dict[str, Vector]:
    """Return the vectors of a state by their names."""
    values = {one.name: getattr(state, one.name) for one in fields(state)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def rows(state: Any) -> Vector:
    """Return the vectors of a state as rows, shape (m, n)."""
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in vectors(state).values()])


def like(state: Any, rows: NDArray[Any]) -> Any:
    """Return a state of the same class with other vectors, shape (m, ...), in the order of ``rows``."""
    parts, start = dict[str, Any](), 0
    for name, vector in vectors(state).items():
        count = vector.size // vector.shape[-1]
        part, start = rows[start : start + count], start + count
        parts[name] = part.reshape(*vector.shape[:-1], *part.shape[1:])
    return replace(state, **parts, evaluation=None)


# ------------------------------------------------------------------------------------------ integrators
class StepCosts(NamedTuple):
    """Costs of a step, measured on one machine by ``python -m benchmarks --only costs`` (``planning/cost.py``).

    Attributes
    ----------
    products
        dt omega_max of the measured steps.
    linear, nonlinear, driven
        Constants (a, b, c, a', b', c') [s] for each kind of waves.
    """

    products: tuple[float, ...]
    linear: tuple[float, ...]
    nonlinear: tuple[float, ...]
    driven: tuple[float, ...]


class Integrator(Protocol[S]):
    """A time integrator: one step of size dt from time t, independent of finite elements."""

    @property
    def name(self) -> str:
        """Name in a case file."""

    @property
    def order(self) -> int:
        """Order of accuracy."""

    @property
    def stability_limit(self) -> float:
        """Largest omega dt for which the scheme is stable on the oscillator."""

    @property
    def frequency_error(self) -> tuple[float, int]:
        """The pair (c, m): the relative frequency error is c (omega dt)^m to leading order."""

    @property
    def nodes(self) -> tuple[float, ...]:
        """Times (t - t_n) / dt at which H is evaluated, the nodes of the scheme's quadrature rule."""

    def start(self, q: Vector, p: Vector) -> S:
        """Return the state of a smooth start, without jumps."""

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""


class CaseIntegrator(Integrator[S], Protocol[S]):
    """An integrator that a case can name, with the data that plans need."""

    @property
    def solvable(self) -> float:
        """Largest dt omega_max for which the iteration of the implicit stages converges; inf for an explicit scheme."""

    @property
    def costs(self) -> StepCosts:
        """Costs of a step."""
