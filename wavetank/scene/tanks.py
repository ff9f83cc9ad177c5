"""The tank: its plan and its depth."""

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field

from wavetank.scene.noun import Noun


class SliceTank(Noun):
    """A tank of one horizontal dimension: a slice along x, between two walls."""

    fewest_cells: ClassVar[int] = 1
    type: Literal["slice"] = "slice"
    length: float = Field(gt=0, description="length of the tank [m]")
    depth: float = Field(gt=0, description="still-water depth d [m]")
    gravity: float = Field(default=9.81, gt=0, description="gravity g [m/s^2]")


class RingTank(Noun):
    """A periodic tank of one horizontal dimension: what leaves at x = length enters at x = 0; it has no walls."""

    fewest_cells: ClassVar[int] = 3  # a polygon's
    type: Literal["ring"] = "ring"
    length: float = Field(gt=0, description="length along the ring [m]")
    depth: float = Field(gt=0, description="still-water depth d [m]")
    gravity: float = Field(default=9.81, gt=0, description="gravity g [m/s^2]")


def _slice_by_default(tank: Any) -> Any:
    return {"type": "slice", **tank} if isinstance(tank, dict) else tank


AnyTank = SliceTank | RingTank
Tank = Annotated[AnyTank, Field(discriminator="type", description="the tank"), BeforeValidator(_slice_by_default)]
