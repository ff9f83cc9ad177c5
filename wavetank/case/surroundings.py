"""What a part of a scene may ask of the whole that it stands in, to say what does not fit."""

from typing import Protocol

from wavetank.case.tanks import AnyTank
from wavetank.motion import Array
from wavetank.waves.wavemaker import Wavemaker


class Lasting(Protocol):
    """What takes time."""

    @property
    def duration(self) -> float:
        """How long it takes [s]."""


class Placed(Protocol):
    """A wall."""

    @property
    def maker(self) -> Wavemaker:
        """Its shape, by which it makes waves."""

    def places(self, tank: AnyTank) -> Array | None:
        """Return the places y along it at which it is looked at [m], shape (N,); None where all are alike."""


class Surroundings(Protocol):
    """The scene, as its parts know it; nothing else of it may decide what they allow."""

    @property
    def tank(self) -> AnyTank:
        """The tank."""

    @property
    def wall(self) -> Placed:
        """The wall at x = 0, of whatever type."""

    @property
    def physics(self) -> str:
        """The type of the water, default resolved."""

    @property
    def run(self) -> Lasting:
        """How long is computed."""
