"""A rectangle, with equal cells or with narrower rows of cells where they are asked for."""

from itertools import pairwise
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from wavetank.mesh.blocks import Blocks, Part
from wavetank.mesh.recipe import Rectangular
from wavetank.values.noun import Noun
from wavetank.values.quantities import Pair


class Refinement(Noun):
    """Where the columns of cells, the rows, or both are narrower; they are so from wall to wall."""

    x: Pair | None = Field(default=None, description="from where to where along x [m]; default: nowhere")
    y: Pair | None = Field(default=None, description="from where to where along y [m]; default: nowhere")
    factor: float = Field(ge=1e-3, lt=1, description="width of the cells there, over that elsewhere [-]")


class Rectangle(Rectangular):
    """A rectangle; the paddle is its side at the smallest x."""

    type: Literal["rectangle"] = "rectangle"
    refine: Refinement | None = Field(default=None, description="where cells are narrower; default: nowhere")

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.sponge_length >= self.length:
            raise ValueError(f"must have a sponge_length below the length, {self.length:g} m")
        left, low, right, high = self.box
        if self.refine is not None:
            _check_between("x", self.refine.x, left, right)
            _check_between("y", self.refine.y, low, high)
        return self

    def counted(self, cell_size: float) -> tuple[float, float]:
        """Return about how many cells of a size [m] there are, and the width of the narrowest [m]."""
        cells, size = super().counted(cell_size)
        if self.refine is None:
            return cells, size
        more = 1 / self.refine.factor - 1
        for fine, length in ((self.refine.x, self.length), (self.refine.y, self.width)):
            cells *= 1 if fine is None else 1 + more * (fine[1] - fine[0]) / length
        return cells, size * self.refine.factor

    def outline(self, geometry: Any, cell_size: float) -> None:
        """Draw columns and rows of cells."""
        left, low, right, high = self.box
        last = right - self.sponge_length
        fine, factor = (self.refine, self.refine.factor) if self.refine else (Refinement(factor=0.5), 1.0)
        columns = _parts([left, last, right], fine.x, cell_size, factor=factor)
        rows = _parts([low, high], fine.y, cell_size, factor=factor)
        blocks = Blocks(geometry, quadrilaterals=self.cells == "quadrilaterals")
        blocks.add_grid([column for column in columns if column.end <= last], rows)
        blocks.add_grid([column for column in columns if column.end > last], rows, group="sponge")
        blocks.finish(paddle=left)


def _check_between(axis: str, fine: Pair | None, start: float, end: float) -> None:
    if fine is not None and not start <= fine[0] < fine[1] <= end:
        received, allowed = f"[{fine[0]:g}, {fine[1]:g}]", f"{start:g} to {end:g} m"
        raise ValueError(f"must have refine.{axis} = {received} ascending and in the layout, {allowed}")


def _parts(ends: list[float], fine: Pair | None, cell_size: float, *, factor: float) -> list[Part]:
    """Return the parts between all ends, with cells smaller by a factor in the fine one."""
    start, end = fine or (0.0, 0.0)
    parts = pairwise(sorted({*ends, *(fine or ())}))
    return [Part.of(a, b, cell_size * (factor if start <= a and b <= end else 1.0)) for a, b in parts]
