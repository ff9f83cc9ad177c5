"""The bed: still-water depth d(x, y) [m], positive everywhere; in a slice y = 0."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import numpy as np
from pydantic import Field

from wavetank import beds, data
from wavetank.case.formulae import FormulaNoun, FormulaText
from wavetank.errors import InputError
from wavetank.values.formula import Array
from wavetank.values.noun import FilePath, Noun, Problem, SceneError
from wavetank.values.python_file import load
from wavetank.values.quantities import Length

T = TypeVar("T")
Depth = Callable[[Array, Array], Array]  # places x, y [m], each of shape (N,), to d [m], shape (N,)


class BedNoun(Noun):
    """What all beds that vary have."""

    minimum_depth: Length | None = Field(
        default=None, description="where the bed is shallower, or dry, it is sunk to this depth [m]; default: nowhere"
    )

    def build(self) -> Depth:
        """Return d(x, y), nowhere below the minimum; raises ``SceneError`` if a file it needs cannot be used."""
        depth, minimum = self.as_given(), self.minimum_depth
        return depth if minimum is None else lambda x, y: np.maximum(depth(x, y), minimum)

    def as_given(self) -> Depth:
        """Return d(x, y) without a minimum."""
        raise NotImplementedError


class FormulaBed(BedNoun, FormulaNoun):
    """d(x, y) as given."""

    type: Literal["formula"] = "formula"
    depth: FormulaText = Field(description="still-water depth d(x, y) [m]")

    def as_given(self) -> Depth:
        """Return d(x, y) without a minimum."""
        return self.formula(self.depth)


class PythonBed(BedNoun):
    """d(x, y) by a function in a Python file, which is run: it must be one that is trusted."""

    type: Literal["python"] = "python"
    file: FilePath = Field(description="Python file")
    function: str = Field(default="depth", min_length=1, description="name of a function of arrays x and y [m]")

    def as_given(self) -> Depth:
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

    def as_given(self) -> Depth:
        """Return d(x, y); raises ``SceneError`` if the file cannot be had or used."""

        def read(path: Path) -> Depth:
            return beds.read_bed(path, variable=self.variable, interpolation=self.interpolation, positive=self.positive)

        return _of_file(self.file, read)


def _of_file(reference: str, read: Callable[[Path], T]) -> T:
    try:
        return read(data.resolve(reference, Path()))
    except InputError as error:
        raise SceneError([Problem(("tank", "bed", "file"), reference, str(error).removesuffix("."))]) from None


Bed = Annotated[FormulaBed | PythonBed | GriddedBed, Field(discriminator="type", description="the bed")]
