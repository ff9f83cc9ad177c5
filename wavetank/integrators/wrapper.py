"""A scheme around a scheme: an integrator itself. What those have in common that act between an inner one's steps."""

from typing import Generic

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import Integrator, S


class Wrapper(Generic[S]):
    """What is known of it is known of the inner scheme, unless it says otherwise; ``step`` is its own.

    Parameters
    ----------
    scheme
        Any integrator.
    """

    def __init__(self, scheme: Integrator[S]):
        self.scheme = scheme

    @property
    def name(self) -> str:
        """The name in a case file."""
        return self.scheme.name

    @property
    def order(self) -> int:
        """Order of accuracy."""
        return self.scheme.order

    @property
    def stability_limit(self) -> float:
        """Largest omega dt for which it is stable."""
        return self.scheme.stability_limit

    @property
    def frequency_error(self) -> tuple[float, int]:
        """The (c, m) of where nothing is added to the inner scheme."""
        return self.scheme.frequency_error

    @property
    def nodes(self) -> tuple[float, ...]:
        """The times (t - t_n) / dt at which the inner scheme evaluates H."""
        return self.scheme.nodes

    def start(self, q: Vector, p: Vector) -> S:
        """Return the state of a smooth start."""
        return self.scheme.start(q, p)
