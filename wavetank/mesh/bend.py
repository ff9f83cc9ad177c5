"""A channel with a bend: a straight leg along x, an arc, and a straight leg away from it."""

from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from wavetank.mesh.blocks import Blocks, Point, divisions
from wavetank.mesh.recipe import Box, Recipe
from wavetank.values.quantities import Length


class Bend(Recipe):
    """A channel of constant width; the paddle is its entrance at x = 0, 0 < y < width."""

    type: Literal["bend"] = "bend"
    width: Length = Field(description="width of the channel [m]")
    first: Length = Field(description="length of the leg along x [m]")
    second: Length = Field(description="length of the leg behind the bend [m]")
    angle: float = Field(ge=0.1, le=150, description="by which the channel turns, towards +y [deg]")
    radius: Length = Field(description="of the bend's centre line [m]")
    geometry: int = Field(default=2, ge=1, le=2, description="order of the cells' geometry: 1 straight, 2 curved")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.radius <= self.width / 2:
            raise ValueError(f"must have a radius of more than half the width, {self.width / 2:g} m")
        if self.sponge_length >= self.second:
            raise ValueError(f"must have a sponge_length below the second leg's length, {self.second:g} m")
        return self

    def _section(self, turned: float, beyond: float = 0.0) -> tuple[Point, Point]:
        """Return the right and the left bank where the channel has turned by an angle [rad], and ran on straight."""
        centre = np.array([self.first, self.width / 2 + self.radius])
        out, ahead = np.array([np.sin(turned), -np.cos(turned)]), np.array([np.cos(turned), np.sin(turned)])
        right, left = (centre + (self.radius + side * self.width / 2) * out + beyond * ahead for side in (1.0, -1.0))
        return (float(right[0]), float(right[1])), (float(left[0]), float(left[1]))

    @property
    def box(self) -> Box:
        """(x_min, y_min, x_max, y_max) [m]."""
        angles = np.radians(np.linspace(0.0, self.angle, 301))
        banks = [*self._section(0.0, -self.first), *self._section(float(angles[-1]), self.second)]
        banks += [bank for angle in angles for bank in self._section(float(angle))]
        x, y = np.transpose(banks)
        return float(x.min()), float(y.min()), float(x.max()), float(y.max())

    @property
    def area(self) -> float:
        """Of legs and arc [m²]."""
        return self.width * (self.first + self.second + self.radius * float(np.radians(self.angle)))

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw rows of cells along the channel."""
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        angle, across = float(np.radians(self.angle)), divisions(self.width, cell_size)
        centre = (self.first, self.width / 2 + self.radius)
        entrance, begin, end = self._section(0.0, -self.first), self._section(0.0), self._section(angle)
        last = self._section(angle, self.second - self.sponge_length)

        def add(start: tuple[Point, Point], stop: tuple[Point, Point], length: float, **options: Any) -> None:
            cells = divisions(length, cell_size), across
            blocks.add([start[0], stop[0], stop[1], start[1]], cells, **options)

        add(entrance, begin, self.first)
        middle = self._section(angle / 2)  # two arcs, each of less than half a circle
        for start, stop in ((begin, middle), (middle, end)):
            add(start, stop, self.radius * angle / 2, centres={0: centre, 2: centre})
        add(end, last, self.second - self.sponge_length)
        if self.sponge_length:
            add(last, self._section(angle, self.second), self.sponge_length, group="sponge")
        blocks.finish(paddle=0.0)
