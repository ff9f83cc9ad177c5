"""An L-shaped harbour: a fairway along x, and a basin beside its end."""

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from wavetank.mesh.blocks import Blocks, Part
from wavetank.mesh.recipe import Box, Recipe
from wavetank.values.quantities import Length


class Harbour(Recipe):
    """A fairway, 0 < x < length, 0 < y < width, and an arm from its far end towards +y; the paddle is at x = 0."""

    type: Literal["harbour"] = "harbour"
    length: Length = Field(description="length of the fairway, along x [m]")
    width: Length = Field(description="width of the fairway, along y [m]")
    arm_length: Length = Field(description="length of the arm, along y [m]")
    arm_width: Length = Field(description="width of the arm, along x [m]")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.arm_width >= self.length:
            raise ValueError(f"must have an arm_width below the fairway's length, {self.length:g} m")
        if self.sponge_length >= self.arm_length:
            raise ValueError(f"must have a sponge_length below the arm's length, {self.arm_length:g} m")
        return self

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        return 0.0, 0.0, self.length, self.width + self.arm_length

    @property
    def area(self) -> float:
        """Of fairway and arm [m²]."""
        return self.length * self.width + self.arm_length * self.arm_width

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw rows of cells through fairway, corner and arm."""
        size, top = cell_size, self.width + self.arm_length
        fairway = Part.of(0.0, self.length - self.arm_width, size)
        arm, width = Part.of(fairway.end, self.length, size), Part.of(0.0, self.width, size)
        last = top - self.sponge_length
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        blocks.add_grid([fairway, arm], [width])
        blocks.add_grid([arm], [Part.of(self.width, last, size)])
        if self.sponge_length:
            blocks.add_grid([arm], [Part.of(last, top, size)], group="sponge")
        blocks.finish(paddle=0.0)
