"""A rectangular basin with a vertical circular cylinder in it."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, Strict, model_validator

from wavetank.meshes.graded import draw_graded
from wavetank.meshes.recipe import Box, Recipe

Pair = Annotated[tuple[float, float], Strict(False)]  # a list of two in a case file


class Cylinder(Recipe):
    """A rectangle without a circle; the paddle is its side at the smallest x."""

    type: Literal["cylinder"] = "cylinder"
    length: float = Field(gt=0, description="along x [m]")
    width: float = Field(gt=0, description="along y [m]")
    origin: Pair = Field(default=(0.0, 0.0), description="the corner of smallest x and y [m]")
    centre: Pair = Field(description="x and y of the cylinder's axis [m]")
    radius: float = Field(gt=0, description="radius of the cylinder [m]")
    factor: float = Field(default=0.5, gt=0, le=1, description="size of the cells at the cylinder, over that elsewhere")
    geometry: Literal[1, 2] = Field(default=2, description="order of the cells' geometry: 1 straight, 2 curved")

    @model_validator(mode="after")
    def _cylinder_inside(self) -> Self:
        (left, low, right, high), (x, y), r = self.box, self.centre, self.radius
        last = right - self.sponge_length
        if not (left < x - r and x + r < last and low < y - r and y + r < high):
            where = f"{left:g} to {last:g} m along x, {low:g} to {high:g} m along y"
            raise ValueError(f"must have its cylinder between walls and sponge: {where}")
        return self

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        x, y = self.origin
        return x, y, x + self.length, y + self.width

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw a graded mesh."""
        hole = (*self.centre, self.radius)
        draw_graded(geometry, self.box, cell_size, sponge_length=self.sponge_length, hole=hole, hole_factor=self.factor)
