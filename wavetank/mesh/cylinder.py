"""A rectangular basin with a vertical circular cylinder in it.

Around the cylinder stands a box, from whose sides cells narrow towards the cylinder; rows of cells run on from the box
to the walls.
"""

from itertools import pairwise
from typing import Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from wavetank.mesh.blocks import Blocks, Part, Point, divisions
from wavetank.mesh.recipe import Box, Rectangular
from wavetank.values.quantities import Length, Pair

NEAREST = 0.3  # radii between the cylinder and what is beside it
FEWEST = 4, 2  # cells along a side of the box, and outwards: with less, curved cells beside coarse ones fold


class Cylinder(Rectangular):
    """A rectangle without a circle, which may be centred on a side wall; the paddle is its side at the smallest x."""

    type: Literal["cylinder"] = "cylinder"
    centre: Pair = Field(description="x and y of the cylinder's axis [m]")
    radius: Length = Field(description="radius of the cylinder [m]")
    factor: float = Field(
        default=0.5, ge=1e-3, le=0.6, description="width of the cells at the cylinder, over that elsewhere [-]"
    )
    geometry: int = Field(default=2, ge=1, le=2, description="order of the cells' geometry: 1 straight, 2 curved")

    @model_validator(mode="after")
    def _cylinder_inside(self) -> Self:
        to_paddle, down, to_sponge, up = self._gaps()
        gap = min(to_paddle, to_sponge, *(across for across in (down, up) if across != 0))  # half a cylinder is as good
        if gap < (1 + NEAREST) * self.radius:
            raise ValueError(
                f"must have the cylinder at least {NEAREST:g} radii, {NEAREST * self.radius:g} m, from walls and "
                f"sponge, or its axis on a side wall; it has {gap - self.radius:.4g} m"
            )
        return self

    def counted(self, cell_size: float) -> tuple[float, float]:
        """Return about how many cells of a size [m] there are, and the size of those at the cylinder [m]."""
        cells, size = super().counted(cell_size)
        around = 2 * np.pi * self.radius / (self.factor * size)
        return cells + around * max(FEWEST[1], self.radius / size), size * self.factor

    def _gaps(self) -> tuple[float, float, float, float]:
        """Return the distances of the axis from paddle, right-hand wall, sponge and left-hand wall [m]."""
        (left, low, right, high), (x, y) = self.box, self.centre
        return x - left, y - low, right - self.sponge_length - x, high - y

    def _box_around(self, cell_size: float) -> Box:
        """Return the box whose sides' cells are of a size if those at the cylinder are smaller by the factor."""
        (x, y), half = self.centre, 0.25 * np.pi * self.radius / self.factor
        to_left, down, to_right, up = (half if gap > half + 0.5 * cell_size else gap for gap in self._gaps())
        return x - to_left, y - down, x + to_right, y + up

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw the blocks between box and cylinder, and columns and rows of cells around the box."""
        left, low, right, high = self.box
        around, last = self._box_around(cell_size), right - self.sponge_length
        columns, column = _parts({left, last}, around[0], around[2], cell_size)
        rows, row = _parts({low, high}, around[1], around[3], cell_size)
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        blocks.add_grid(columns, rows, but=[(column, row)])
        self._add_ring(blocks, column, row, cell_size=cell_size)
        if self.sponge_length:
            blocks.add_grid([Part.of(last, right, cell_size)], rows, group="sponge")
        blocks.finish(paddle=left, arcs="cylinder")

    def _add_ring(self, blocks: Blocks, column: Part, row: Part, *, cell_size: float) -> None:
        """Add the blocks between cylinder and box: four, or three around half a cylinder."""
        (left, right, along), (low, high, across) = column, row
        outer: list[Point] = [(left, low), (right, low), (right, high), (left, high)]
        inner = [self._on_cylinder(corner) for corner in outer]
        gap = 0.5 * (right - left) - self.radius
        outwards = max(FEWEST[1], divisions(gap, 0.5 * (1 + self.factor) * cell_size))
        for side, beside in enumerate((along, across, along, across)):
            following = (side + 1) % 4
            if outer[side][1] == outer[following][1] == self.centre[1]:
                continue  # the axis is on this side, a wall
            corners = [inner[side], outer[side], outer[following], inner[following]]
            blocks.add(corners, (outwards, beside), centres={3: self.centre})

    def _on_cylinder(self, corner: Point) -> Point:
        """Return the point of the cylinder's wall on the diagonal, or the wall, towards a corner of the box."""
        away = np.sign(np.subtract(corner, self.centre))
        away *= self.radius / np.linalg.norm(away)
        return self.centre[0] + float(away[0]), self.centre[1] + float(away[1])


def _parts(ends: set[float], start: float, end: float, cell_size: float) -> tuple[list[Part], Part]:
    """Return the parts of an axis between its ends and those of the box, and the box's own."""
    parts = [Part.of(a, b, cell_size) for a, b in pairwise(sorted({*ends, start, end}))]
    n = next(n for n, part in enumerate(parts) if part.start == start)
    parts[n] = Part(start, end, max(FEWEST[0], parts[n].cells))
    return parts, parts[n]
