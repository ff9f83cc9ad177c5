"""The contract of an observer."""

from typing import NamedTuple, Protocol

from wavetank.hamiltonian.contract import Vector
from wavetank.observers.schedule import Schedule


class Moment(NamedTuple):
    """The state at one step: t = step dt [s], coordinates and momenta."""

    step: int
    t: float
    q: Vector
    p: Vector


class Observer(Protocol):
    """Something that is recorded when its schedule says so."""

    @property
    def schedule(self) -> Schedule:
        """When it acts."""

    def observe(self, moment: Moment) -> None:
        """Record the moment; collective."""
