"""A rectangle, with equal cells or with finer ones where they are asked for."""

from itertools import pairwise
from typing import Annotated, Any, Literal, Self

from pydantic import Field, Strict, model_validator

from wavetank.meshes.blocks import Blocks
from wavetank.meshes.graded import draw_graded
from wavetank.meshes.recipe import Box, Recipe, divisions
from wavetank.noun import Noun

Pair = Annotated[tuple[float, float], Strict(False)]  # a list of two in a case file


class Refinement(Noun):
    """A part of the plan with finer cells."""

    x: Pair = Field(description="from where to where along x [m]")
    y: Pair = Field(description="from where to where along y [m]")
    factor: float = Field(gt=0, lt=1, description="size of the cells there, over that elsewhere [-]")


class Rectangle(Recipe):
    """A rectangle; the paddle is its side at the smallest x."""

    type: Literal["rectangle"] = "rectangle"
    length: float = Field(gt=0, description="along x [m]")
    width: float = Field(gt=0, description="along y [m]")
    origin: Pair = Field(default=(0.0, 0.0), description="the corner of smallest x and y [m]")
    refine: Refinement | None = Field(default=None, description="a part with finer cells; default: none")

    @model_validator(mode="after")
    def _room_for_water(self) -> Self:
        if self.sponge_length >= self.length:
            raise ValueError(f"must have a sponge_length below the length, {self.length:g} m")
        return self

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        x, y = self.origin
        return x, y, x + self.length, y + self.width

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw rows of cells, or a graded mesh."""
        left, low, right, high = self.box
        if self.refine is not None:
            draw_graded(geometry, self.box, cell_size, sponge_length=self.sponge_length, refine=self.refine)
            return
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        ends = [left, right - self.sponge_length, right] if self.sponge_length else [left, right]
        for (start, end), group in zip(pairwise(ends), ("water", "sponge"), strict=False):
            cells = divisions(end - start, cell_size), divisions(self.width, cell_size)
            blocks.add([(start, low), (end, low), (end, high), (start, high)], cells, group=group)
        blocks.finish(paddle=((left, low), (left, high)))
