"""Loads: forces and moments of the water on walls."""

from pydantic import Field

from wavetank.values.noun import Noun
from wavetank.values.quantities import Label, Triple

PADDLE, FAR = "paddle", "far wall"
ENDS = PADDLE, FAR  # of a slice


class WallLoad(Noun):
    """A wall on which force and moment of the water's pressure are recorded, still water's included."""

    on: Label = Field(
        min_length=1,
        description="the wall: 'paddle', 'far wall' of a slice or a rectangle, or a group of walls of a basin's mesh",
    )
    name: Label | None = Field(default=None, min_length=1, description="name of the load; default: the wall's")
    about: Triple | None = Field(
        default=None, description="point that moments are taken about, x, y, z [m]; default: on the bed at x = y = 0"
    )

    @property
    def called(self) -> str:
        """Its name, default resolved."""
        return self.on if self.name is None else self.name

    def point(self, depth: float) -> tuple[float, float, float]:
        """Return the point that moments are taken about [m], default resolved for a still-water depth [m]."""
        return (0.0, 0.0, -depth) if self.about is None else self.about
