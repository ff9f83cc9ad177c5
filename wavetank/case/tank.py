"""The tank: its layout, depth, bed and sponge.

The default strength of a sponge has the least reflection of one wave (measured, docs/absorption.md):

    gamma_0 = 15 c_g / (L lambda)^(1/2)

with the length L of the sponge and the group velocity c_g and length lambda of the wave. The reflection at L = lambda
is 0.2 to 2.3 %.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field

from wavetank import data
from wavetank import mesh as beds
from wavetank.base.case_model import CaseModel, Check, FilePath, FormulaModel, FormulaText, about
from wavetank.base.formula import Formula
from wavetank.base.python_file import load
from wavetank.base.quantities import Coordinate, Density, Duration, Gravity, Length, Rate, metres
from wavetank.mesh import Layout
from wavetank.mesh.layouts import Box
from wavetank.motion import Array
from wavetank.waves.airy import group_velocity, wave_number

T = TypeVar("T")


def read_file(reference: str, read: Callable[[Path], T], *key: str) -> T:
    """Return the result of reading a file at a key of a case; raises ``CaseError`` if it cannot be read."""
    with about(*key, received=reference):
        return read(data.resolve(reference))


# ---------------------------------------------------------------- the bed
Slope = Annotated[float, Field(ge=1e-6, le=10)]
Depth = Callable[[Array, Array], Array]  # function of x, y [m], shape (N,) each, that returns d [m], shape (N,)
BED_FILE = ("tank", "bed", "file")


class VaryingBedModel(CaseModel):
    """A bed of variable depth."""

    minimum_depth: Length | None = Field(
        default=None, description="minimum depth: a shallower or dry bed is lowered to it [m]; default: none"
    )

    def build(self, tank_depth: float) -> Depth:
        """Return d(x, y), at least the minimum, in a tank of some depth [m].

        Raises ``CaseError`` if its file cannot be used.
        """
        depth, minimum = self.as_given(tank_depth), self.minimum_depth
        return depth if minimum is None else lambda x, y: np.maximum(depth(x, y), minimum)

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y) without a minimum."""
        raise NotImplementedError


class BeachBed(VaryingBedModel):
    """A beach: flat at the depth of the tank up to x = start, then a slope up to the minimum depth."""

    type: Literal["beach"] = "beach"
    start: Coordinate = Field(description="x at which the slope begins [m]")
    slope: Slope = Field(description="rise of the bed over length [-]")

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y) without a minimum."""
        return lambda x, y: tank_depth - self.slope * np.maximum(x - self.start, 0.0)

    def checks(self, end: Any) -> Iterator[Check]:
        """Yield that the slope begins in the tank, and does not dry it."""
        length, depth = end.tank.length, end.tank.depth
        yield "start", self.start < length, f"must be below the tank's length, {metres(length)} m", True
        wet = depth / (length - self.start)
        lowered = self.minimum_depth is not None or not np.isfinite(length)
        allowed = f"must be below {wet:.4g} for a tank that is wet to its end, or have a tank.bed.minimum_depth"
        yield "slope", lowered or depth > self.slope * (length - self.start), allowed


class FormulaBed(VaryingBedModel, FormulaModel):
    """d(x, y) by a formula."""

    type: Literal["formula"] = "formula"
    depth: FormulaText = Field(description="still-water depth d(x, y) [m]")

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y) without a minimum."""
        return self.formula(self.depth)


class PythonBed(VaryingBedModel):
    """d(x, y) by a function in a Python file, which is executed only with `--trust`."""

    type: Literal["python"] = "python"
    file: FilePath = Field(description="Python file")
    function: str = Field(default="depth", min_length=1, description="name of a function of arrays x and y [m]")

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y); raises ``CaseError`` if the file cannot be executed, or has no such function."""
        function = read_file(self.file, lambda path: load(path, self.function), *BED_FILE)
        return lambda x, y: function.at({"x": x, "y": y})


class GriddedBed(VaryingBedModel):
    """d interpolated in data along x, or over x and y, on a grid or scattered, which must cover the water."""

    type: Literal["gridded"] = "gridded"
    file: FilePath = Field(description="NetCDF (.nc), CSV (.csv) or XYZ (.xyz) of x, or x and y, and depths [m]")
    variable: str | None = Field(
        default=None, min_length=1, description="name of the depths; default: the only variable"
    )
    interpolation: beds.Interpolation = Field(default="cubic", description="cubic has continuous slopes")
    positive: beds.Positive | None = Field(
        default=None, description="down for depths, up for elevations of the bed; default: as in the file, or down"
    )

    def as_given(self, tank_depth: float) -> Depth:
        """Return d(x, y); raises ``CaseError`` if the file cannot be used."""

        def read(path: Path) -> Depth:
            return beds.read_bed(path, variable=self.variable, interpolation=self.interpolation, positive=self.positive)

        return read_file(self.file, read, *BED_FILE)


Bed = Annotated[BeachBed | FormulaBed | PythonBed | GriddedBed, Field(discriminator="type", description="the bed")]


# ---------------------------------------------------------------- the tank
class _WaterBody(CaseModel):
    """Water of a depth; over a bed, that at the paddle, for the generation of waves."""

    fewest_cells: ClassVar[int] = 1
    usual_cell: ClassVar[float] = 0.2  # default size of a cell in depths
    depth: Length = Field(description="still-water depth d [m]; over a bed, that at the paddle, to 1 %")
    gravity: Gravity = Field(default=9.81, description="gravity g [m/s^2]")
    density: Density = Field(default=1000.0, description="density of the water [kg/m^3], for pressures and forces")


class _Channel(_WaterBody):
    """A tank of one horizontal dimension."""

    length: Length

    @property
    def box(self) -> Box | None:
        """The smallest box around the tank, (x_min, y_min, x_max, y_max) [m]."""
        return 0.0, 0.0, self.length, 0.0


class SliceTank(_Channel):
    """A tank of one horizontal dimension: a slice along x, between two walls."""

    type: Literal["slice"] = "slice"
    length: Length = Field(description="length of the tank [m]")
    bed: Bed | None = Field(default=None, description="the bed; default: flat, at the depth")


class RingTank(_Channel):
    """A periodic tank of one horizontal dimension: x = length is identified with x = 0; it has no walls."""

    fewest_cells: ClassVar[int] = 3  # least number of cells, as of a polygon
    type: Literal["ring"] = "ring"
    length: Length = Field(description="length along the ring [m]")
    bed: None = Field(default=None, description="a ring's bed is flat")


class BasinTank(_WaterBody):
    """A tank of two horizontal dimensions, of any layout."""

    usual_cell: ClassVar[float] = 0.5
    type: Literal["basin"] = "basin"
    layout: Layout = Field(description="plan view of its walls")
    bed: Bed | None = Field(default=None, description="the bed; default: flat, at the depth")

    @property
    def box(self) -> Box | None:
        """The smallest box around the tank, (x_min, y_min, x_max, y_max) [m]; None if it is in a mesh file only."""
        return self.layout.box

    @property
    def length(self) -> float:
        """Distance from the paddle to the far end [m]; ``inf`` if it is in a mesh file only."""
        return np.inf if self.box is None else self.box[2] - self.box[0]


def _slice_by_default(tank: Any) -> Any:
    return {"type": "slice", **tank} if isinstance(tank, dict) else tank


AnyTank = SliceTank | RingTank | BasinTank
Tank = Annotated[AnyTank, Field(discriminator="type", description="the tank"), BeforeValidator(_slice_by_default)]


def in_tank(tank: AnyTank, x: float, *, key: str = "x") -> Check:
    """Return the check that a distance x [m] from the paddle is less than the length of the tank."""
    return key, x < tank.length, f"must be inside the tank, below {metres(tank.length)} m"


def inside(tank: AnyTank, place: tuple[float, float], *keys: str) -> Iterator[Check]:
    """Yield that a position (x, y) [m] is inside the tank; keys are those of x and y."""
    width = isinstance(tank, BasinTank) or not place[1]
    yield keys[-1], width, f"must be left out: a {tank.type} has no width"
    x_min, y_min, x_max, y_max = tank.box or (-np.inf, -np.inf, np.inf, np.inf)
    for key, value, first, last in zip(keys, place, (x_min, y_min), (x_max, y_max), strict=True):
        yield key, first <= value <= last, f"must be inside the tank, {metres(first)} to {metres(last)} m"


# ---------------------------------------------------------------- what parts of a case are checked against
@dataclass(frozen=True)
class Context:
    """A wall at an end of the tank, with tank, water and run, for the checks of parts of a case.

    Two are equal if the motions of their walls are.

    Attributes
    ----------
    key
        Key of the wall in the case.
    wall, opposite
        Tables of the wall and of that at the other end.
    tank
        The tank.
    physics
        Type of the water, default resolved.
    duration
        Duration of the run [s].
    case
        The ``Case`` of the wall.
    """

    key: Literal["wall", "far_wall"]
    wall: Any
    opposite: Any
    tank: AnyTank
    physics: str
    duration: float
    case: Any = field(compare=False, repr=False)

    @property
    def far(self) -> bool:
        """Whether it is the far wall."""
        return self.key == "far_wall"


# ---------------------------------------------------------------- sponges
ABSORPTION = 15.0  # gamma_0 L / c_g of a sponge of one wave length
MAX_ALIASED_POWER = 0.1  # largest aliased part of the power beyond the fraction
MAX_TIMES = 2**18  # largest number of times; longer motions are truncated
TIME_OFFSET, MIN_STEP_RATIO = 1e-3, 1e-3  # interval for an acceleration over the step; least step over the first one
GOLDEN_RATIO = (5**0.5 - 1) / 2  # multiples, modulo 1, are evenly distributed
STEP = 0.1  # interval of samples of a motion over (d / g)^(1/2): shorter than the waves of paddles
RING = "must be left out: a ring has no end for waves to be absorbed at"


class _SpongeProfile(CaseModel):
    """A sponge whose damping rate increases with the distance from its inner edge, up to a strength."""

    type: str
    strength: Rate | None = Field(
        default=None, description="largest damping rate gamma_0 [1/s]; default: that of least reflection at the period"
    )
    period: Duration | None = Field(
        default=None,
        description="period of the waves to absorb [s]; default: the paddle's, or that of a wave as long as the sponge",
    )

    def strength_for(self, width: float, tank: AnyTank, *, paddle: float | None = None) -> float:
        """Return gamma_0 [1/s], default resolved.

        Parameters
        ----------
        width
            Width of the sponge from its inner edge [m].
        tank
            The tank.
        paddle
            Period of the paddle motion [s], if it moves (``paddle_period``).
        """
        if self.strength is not None:
            return self.strength
        period = self.period or paddle
        k = 2 * np.pi / width
        if period is not None:
            k = float(wave_number(2 * np.pi / period, tank.depth, tank.gravity))
        length, speed = 2 * np.pi / k, float(group_velocity(k, tank.depth, tank.gravity))
        return float(ABSORPTION * speed / np.sqrt(width * length))

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank has an absorbing end, and that a period is not unused."""
        yield "type", not isinstance(end.tank, RingTank), RING
        given = self.strength is not None and self.period is not None
        yield "period", not given, "must be left out: sponge.strength is given"


class EndSponge(_SpongeProfile):
    """The last ``length`` metres before the far wall."""

    type: Literal["end"] = "end"
    length: Length = Field(description="length of the sponge, along x [m]: one wave length or more")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of any sponge, and that it is shorter than the tank."""
        yield from super().checks(end)
        yield "length", self.length < end.tank.length, f"must be below the tank's length, {end.tank.length:g} m"


class GroupSponge(_SpongeProfile):
    """The cells of the mesh's group ``sponge``; its width is the largest distance of a point from its inner edge."""

    type: Literal["group"] = "group"

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of any sponge, and that cells have groups."""
        yield from super().checks(end)
        yield "type", isinstance(end.tank, BasinTank), "needs a basin (tank.type), whose mesh has groups of cells"


class FormulaSponge(FormulaModel):
    """Damping rate gamma(x, y)."""

    type: Literal["formula"] = "formula"
    gamma: FormulaText = Field(description="damping rate gamma(x, y) [1/s], not negative")

    def build(self) -> Formula:
        """Return gamma(x, y) [1/s]."""
        return self.formula(self.gamma)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank has an absorbing end."""
        yield "type", not isinstance(end.tank, RingTank), RING


def paddle_period(
    velocity: Callable[[Array], Array], *, duration: float, tank: AnyTank, fraction: float = 0.5
) -> float | None:
    """Return the period [s] above which a fraction of the power of a paddle's velocity lies; None for no motion.

    Frequencies above the Nyquist frequency are aliased. The sampling is therefore refined while the acceleration shows
    that these may have part of the power beyond the fraction (``MAX_ALIASED_POWER``).

    Parameters
    ----------
    velocity
        Velocity [m/s] at times [s], shape (T,): shape (T,), or (T, N) for positions along the paddle.
    duration
        Duration of the run [s].
    tank
        The tank.
    fraction
        0.5: the period that halves the power.
    """
    step = longest = STEP * float(np.sqrt(tank.depth / tank.gravity))
    while True:
        part = min(duration, MAX_TIMES * step)
        count = max(256, int(np.ceil(part / step)))
        times = np.arange(count, dtype=np.float64)
        t: Array = part / count * times
        velocities = velocity(t).reshape(count, -1)
        lines = (np.abs(np.fft.rfft(velocities, axis=0)) ** 2).sum(axis=1)[1:]
        number, power = np.arange(1.0, lines.size + 1), np.cumsum(lines)
        if not power[-1] > 0.0:
            return None
        soon = TIME_OFFSET * part / count
        between = np.minimum(t + part / count * np.modf(GOLDEN_RATIO * times)[0], part - soon)
        change = (velocity(between + soon) - velocity(between)).reshape(count, -1) / soon
        power_of_rates = (part / (2 * np.pi)) ** 2 * count / 2 * float((change**2).sum())  # squared line numbers
        aliased = (power_of_rates - float(number**2 @ lines)) / lines.size**2
        if aliased < MAX_ALIASED_POWER * (1 - fraction) * power[-1] or step < MIN_STEP_RATIO * longest:
            return float(part / np.interp(fraction * power[-1], power, number + 0.5))  # upper edges of the lines
        step /= 2


AnySponge = EndSponge | GroupSponge | FormulaSponge
Sponge = Annotated[AnySponge, Field(discriminator="type", description="the absorbing layer")]
