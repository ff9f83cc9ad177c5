"""What the schemes carry from step to step: values continuous in time, or the traces on both sides of a jump."""

from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.integrators.contract import Evaluated, Map


class Point(NamedTuple):
    """Coordinates and momenta, continuous in time."""

    q: Vector
    p: Vector

    @property
    def known(self) -> tuple[Evaluated, ...]:
        """The point itself."""
        return (Evaluated(self.q, self.p),)

    @property
    def q_jump(self) -> None:
        """There is none."""
        return

    def mapped(self, of: Map) -> Self:
        """Return the state with q and p mapped."""
        return type(self)(*of(np.array([self]))[0])


class Traces(NamedTuple):
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
    def known(self) -> tuple[Evaluated, ...]:
        """The plus trace."""
        return (Evaluated(self.q_plus, self.p_plus),)

    @property
    def q_jump(self) -> Vector:
        """The jump of the coordinates."""
        return self.q_plus - self.q_minus

    def mapped(self, of: Map) -> Self:
        """Return the state with all four traces mapped."""
        q, p = of(np.array([self[::2], self[1::2]])).swapaxes(0, 1)
        return type(self)(*q, *p)


def rows(state: Any) -> Vector:
    """Return the vectors that a state consists of, one below the other, shape (m, n)."""
    return np.concatenate([part.reshape(-1, part.shape[-1]) for part in state])


def like(state: Any, rows: NDArray[Any]) -> Any:
    """Return a state of that kind of other vectors, shape (m, ...), which ``rows`` would return."""
    parts = np.split(rows, np.cumsum([part.size // part.shape[-1] for part in state])[:-1])
    return type(state)(*(part if one.ndim > 1 else part[0] for part, one in zip(parts, state, strict=True)))
