"""What the schemes carry from step to step: values continuous in time, or the traces on both sides of a jump."""

from typing import NamedTuple, Self

from wavetank.hamiltonian.contract import Vector


class Point(NamedTuple):
    """Coordinates and momenta, continuous in time."""

    q: Vector
    p: Vector

    def damped(self, factor: Vector) -> Self:
        """Return the state with its momenta multiplied by ``factor``."""
        return self._replace(p=factor * self.p)


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

    def damped(self, factor: Vector) -> Self:
        """Return the state with its momenta multiplied by ``factor``."""
        return self._replace(p_minus=factor * self.p_minus, p_plus=factor * self.p_plus)
