"""The bed: still-water depth d(x, y) [m], positive everywhere; in a slice y = 0."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import Field

from wavetank import data
from wavetank import mesh as beds
from wavetank.case.formulae import FormulaNoun, FormulaText
from wavetank.errors import InputError
from wavetank.values.formula import Array
from wavetank.values.noun import FilePath, Noun, Problem, SceneError
from wavetank.values.python_file import load
from wavetank.values.quantities import Coordinate, Length, metres

T = TypeVar("T")
Slope = Annotated[float, Field(ge=1e-6, le=10)]
Depth = Callable[[Array, Array], Array]  # places x, y [m], each of shape (N,), to d [m], shape (N,)


class BedNoun(Noun):
    """What all beds that vary have."""

    minimum_depth: Length | None = Field(
        default=None, description="where the bed is shallower, or dry, it is sunk to this depth [m]; default: nowhere"
    )

    def build(self, tank_depth: float) -> Depth:
        """Return d(x, y), nowhere below the minimum, in a tank of some depth [m].

        Raises ``SceneError`` if a file it needs cannot be used.
        """
        depth, minimum = self.as_given(tank_depth), self.minimum_depth
        return depth if minimum is None else lambda x, y: np.maximum(depth(x, y), minimum)

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y) without a minimum."""
        raise NotImplementedError


class BeachBed(BedNoun):
    """A beach: flat at the tank's depth up to x = start, from there on a slope, up to the minimum depth."""

    type: Literal["beach"] = "beach"
    start: Coordinate = Field(description="where the slope begins, x [m]")
    slope: Slope = Field(description="how much the bed rises over how much x grows [-]")

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y) without a minimum."""
        return lambda x, y: tank_depth - self.slope * np.maximum(x - self.start, 0.0)

    def problems(self, scene: Any) -> Iterator[Problem]:
        """Yield a slope that comes out of the water, or does not begin in the tank."""
        length, depth = scene.tank.length, scene.tank.depth
        if self.start >= length:
            yield Problem(("tank", "bed", "start"), self.start, f"must be below the tank's length, {metres(length)} m")
        elif self.minimum_depth is None and np.isfinite(length) and depth <= self.slope * (length - self.start):
            wet = depth / (length - self.start)
            allowed = f"must be below {wet:.4g} for a tank that is wet to its end, or have a tank.bed.minimum_depth"
            yield Problem(("tank", "bed", "slope"), self.slope, allowed)


class FormulaBed(BedNoun, FormulaNoun):
    """d(x, y) as given."""

    type: Literal["formula"] = "formula"
    depth: FormulaText = Field(description="still-water depth d(x, y) [m]")

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y) without a minimum."""
        return self.formula(self.depth)


class PythonBed(BedNoun):
    """d(x, y) by a function in a Python file, which is executed only with `--trust`."""

    type: Literal["python"] = "python"
    file: FilePath = Field(description="Python file")
    function: str = Field(default="depth", min_length=1, description="name of a function of arrays x and y [m]")

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y); raises ``SceneError`` if the file cannot be had or run, or has no such function."""
        function = _of_file(self.file, lambda path: load(path, self.function))
        return lambda x, y: function.at({"x": x, "y": y})


class GriddedBed(BedNoun):
    """d interpolated in data along x, or over x and y, on a grid or not; these must reach wherever there is water."""

    type: Literal["gridded"] = "gridded"
    file: FilePath = Field(description="NetCDF (.nc), CSV (.csv) or XYZ (.xyz) of x, or x and y, and depths [m]")
    variable: str | None = Field(
        default=None, min_length=1, description="the depths' name; default: the only one there is"
    )
    interpolation: beds.Interpolation = Field(default="cubic", description="cubic has continuous slopes")
    positive: beds.Positive | None = Field(
        default=None, description="down for depths, up for elevations of the bed; default: as the file says, or down"
    )

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y); raises ``SceneError`` if the file cannot be had or used."""

        def read(path: Path) -> Depth:
            return beds.read_bed(path, variable=self.variable, interpolation=self.interpolation, positive=self.positive)

        return _of_file(self.file, read)


def _of_file(reference: str, read: Callable[[Path], T]) -> T:
    try:
        return read(data.resolve(reference, Path()))
    except InputError as error:
        raise SceneError([Problem(("tank", "bed", "file"), reference, str(error).removesuffix("."))]) from None


Bed = Annotated[BeachBed | FormulaBed | PythonBed | GriddedBed, Field(discriminator="type", description="the bed")]
