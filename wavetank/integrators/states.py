"""States of schemes: values continuous in time, or the traces on both sides of a jump."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.integrators.hamiltonian import HamiltonianSystem

Map = Callable[[Vector], Vector]
"""What acts on points of a state alike, of pairs [q, p], shape (m, 2, n), and makes such of them."""


@dataclass(frozen=True, eq=False)
class State(ABC):
    """A scheme's state at the end of a step; a class of its own has the coordinates q and the momenta p it reports.

    Attributes
    ----------
    evaluation
        Of the system where the next step begins; None until it is asked for.
    end
        The evaluation where the step has ended, before filters; None if that is where the next one begins.
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
        """The evaluations of which (q, p) is the mean: where the step has ended, and where the next one begins."""
        return (self.evaluation,) if self.end is None else (self.end, self.evaluation)

    def evaluated(self, system: HamiltonianSystem, t: float) -> Self:
        """Return the state at t with its evaluation; collective."""
        if self.evaluation is not None:
            return self
        q, p = self.next_point
        return replace(self, evaluation=system.evaluate(q, p, t, self.end))

    @property
    def next_point(self) -> Vector:
        """Coordinates and momenta where the next step begins, shape (2, n)."""
        return np.array([self.q, self.p])

    @property
    def q_jump(self) -> Vector | None:
        """The jump of the coordinates at the state's time; None of a scheme that lets them have none."""
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
    """The traces of q and p before and after the jump at t; the result of a step is the plus trace."""

    q_minus: Vector
    q_plus: Vector
    p_minus: Vector
    p_plus: Vector

    @property
    def q(self) -> Vector:
        """The coordinates the scheme reports."""
        return self.q_plus

    @property
    def p(self) -> Vector:
        """The momenta the scheme reports."""
        return self.p_plus

    @property
    def q_jump(self) -> Vector:
        """The jump of the coordinates."""
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
    """Return the vectors that a state consists of, one below the other, shape (m, n)."""
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in vectors(state).values()])


def like(state: Any, rows: NDArray[Any]) -> Any:
    """Return a state of that kind of other vectors, shape (m, ...), which ``rows`` would return."""
    parts, start = dict[str, Any](), 0
    for name, vector in vectors(state).items():
        count = vector.size // vector.shape[-1]
        part, start = rows[start : start + count], start + count
        parts[name] = part.reshape(*vector.shape[:-1], *part.shape[1:])
    return replace(state, **parts, evaluation=None)
