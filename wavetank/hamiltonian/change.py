"""What H changes by between two points that lie close to each other."""

from typing import Protocol

from wavetank.arrays import Vector


class Derivatives(Protocol):
    """What is asked of a system: its derivatives, and their product with a change."""

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dq; collective."""

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dp; collective."""

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the unknowns of all ranks; collective."""


def change(system: Derivatives, start: tuple[Vector, Vector], end: tuple[Vector, Vector], t: float) -> float:
    """Return H at one (q, p) less that at another, to the square of what lies between; collective.

    The start is evaluated, and no other point.
    """
    (q, p), (q_end, p_end) = start, end
    return system.inner(system.H_q(q, p, t), q_end - q) + system.inner(system.H_p(q, p, t), p_end - p)
