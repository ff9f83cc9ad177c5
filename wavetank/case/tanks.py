"""The tank: its layout and its depth."""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field

from wavetank.case.beds import Bed
from wavetank.mesh import Layout
from wavetank.values.noun import Noun
from wavetank.values.quantities import Density, Gravity, Length


class _Filled(Noun):
    """Water of some depth: over a bed, that at the paddle, by which waves are made."""

    fewest_cells: ClassVar[int] = 1
    usual_cell: ClassVar[float] = 0.2  # in depths
    depth: Length = Field(description="still-water depth d [m]; over a bed, that at the paddle, to 1 %")
    gravity: Gravity = Field(default=9.81, description="gravity g [m/s^2]")
    density: Density = Field(default=1000.0, description="density of the water [kg/m^3], of pressures and forces")


class SliceTank(_Filled):
    """A tank of one horizontal dimension: a slice along x, between two walls."""

    type: Literal["slice"] = "slice"
    length: Length = Field(description="length of the tank [m]")
    bed: Bed | None = Field(default=None, description="the bed; default: flat, at the depth")


class RingTank(_Filled):
    """A periodic tank of one horizontal dimension: what leaves at x = length enters at x = 0; it has no walls."""

    fewest_cells: ClassVar[int] = 3  # a polygon's
    type: Literal["ring"] = "ring"
    length: Length = Field(description="length along the ring [m]")
    bed: None = Field(default=None, description="a ring's bed is flat")


class BasinTank(_Filled):
    """A tank of two horizontal dimensions, of any layout."""

    usual_cell: ClassVar[float] = 0.5
    type: Literal["basin"] = "basin"
    layout: Layout = Field(description="where its walls are, seen from above")
    bed: Bed | None = Field(default=None, description="the bed; default: flat, at the depth")

    @property
    def length(self) -> float:
        """Distance from the paddle to the far end [m]; ``inf`` where only a mesh file knows it."""
        return np.inf if self.layout.box is None else self.layout.box[2] - self.layout.box[0]


def _slice_by_default(tank: Any) -> Any:
    return {"type": "slice", **tank} if isinstance(tank, dict) else tank


AnyTank = SliceTank | RingTank | BasinTank
Tank = Annotated[AnyTank, Field(discriminator="type", description="the tank"), BeforeValidator(_slice_by_default)]
