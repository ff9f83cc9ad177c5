"""The records: gauges, probes, loads, windows, and the target of a calibration."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from wavetank.base.case_model import CaseModel, Check
from wavetank.base.quantities import (
    Coordinate,
    Count,
    Duration,
    Fraction,
    Height,
    Label,
    Length,
    Pair,
    Ramp,
    Time,
    Triple,
    metres,
)
from wavetank.case.elevation_file import ElevationFile
from wavetank.case.tank import BasinTank, Context, in_tank, inside


# ---------------------------------------------------------------- gauges
class Gauge(CaseModel):
    """A position at which the elevation is recorded."""

    name: Label = Field(min_length=1, description="name of the gauge")
    x: Coordinate = Field(description="distance from the paddle at rest, or along the ring; in a basin x [m]")
    y: Coordinate = Field(default=0.0, description="y in a basin [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the gauge is inside the tank."""
        yield from inside(end.tank, (self.x, self.y), "x", "y")


def named(gauges: Any) -> Any:
    """Return gauges that are numbers or have no name as tables with the names 1, 2, ...; other values unchanged."""
    if not isinstance(gauges, Sequence) or isinstance(gauges, str):
        return gauges
    tables = (gauge if isinstance(gauge, dict | Gauge) else {"x": gauge} for gauge in gauges)
    return tuple(
        gauge if isinstance(gauge, Gauge) else {"name": str(n), **gauge} for n, gauge in enumerate(tables, start=1)
    )


class GaugeLine(CaseModel):
    """Gauges at equal distances on a straight line, both ends included; gauge 3 of the line ``A`` is ``A/3``."""

    name: Label = Field(min_length=1, description="name of the line")
    start: Pair = Field(description="x and y of the first gauge [m]")
    end: Pair = Field(description="x and y of the last gauge [m]")
    count: int = Field(ge=2, le=10_000, description="number of gauges")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the line is inside the tank."""
        yield from inside(end.tank, self.start, "start", "start")
        yield from inside(end.tank, self.end, "end", "end")

    def gauges(self) -> tuple[tuple[str, float, float], ...]:
        """Return name, x and y [m] of each gauge."""
        places = np.linspace(self.start, self.end, self.count)
        return tuple((f"{self.name}/{n}", float(x), float(y)) for n, (x, y) in enumerate(places, start=1))


class Probe(Gauge):
    """A point at which velocity, acceleration and pressure are recorded while it is in water."""

    z: Coordinate = Field(description="height above still water, negative below [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the probe is inside the tank, and above a flat bed."""
        yield from super().checks(end)
        above = end.tank.bed is not None or self.z >= -end.tank.depth
        yield "z", above, f"must be in the water, above the bed at {metres(-end.tank.depth)} m"


# ---------------------------------------------------------------- loads on walls
PADDLE, FAR = "paddle", "far wall"
ENDS = PADDLE, FAR  # the walls of a slice


class WallLoad(CaseModel):
    """A wall on which force and moment of the pressure are recorded, including that of still water."""

    on: Label = Field(
        min_length=1,
        description="the wall: 'paddle', 'far wall' of a slice or a rectangle, or a group of walls of a basin's mesh",
    )
    name: Label | None = Field(default=None, min_length=1, description="name of the load; default: that of the wall")
    about: Triple | None = Field(
        default=None, description="reference point of moments, x, y, z [m]; default: on the bed at x = y = 0"
    )

    @property
    def called(self) -> str:
        """The name, default resolved."""
        return self.on if self.name is None else self.name

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank has the wall."""
        yield "on", end.tank.type != "ring", "must be left out: a ring has no walls"
        exists = isinstance(end.tank, BasinTank) or self.on in ENDS
        yield "on", exists, f"must be {' or '.join(map(repr, ENDS))} in a slice"

    def point(self, depth: float) -> tuple[float, float, float]:
        """Return the reference point of moments [m], default resolved for a still-water depth [m]."""
        return (0.0, 0.0, -depth) if self.about is None else self.about


# ---------------------------------------------------------------- columns of water for other programs
class Window(CaseModel):
    """Columns of water from the bed to the surface at equal distances on a line, recorded for other programs."""

    name: str = Field(
        min_length=1,
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$",
        max_length=60,
        description="name, also of its file: letters, digits, - and _",
    )
    start: Pair = Field(description="x and y of the first column [m]")
    end: Pair | None = Field(default=None, description="x and y of the last column [m]; default: one column")
    columns: int = Field(default=1, ge=1, le=10_000, description="number of columns")
    levels: int = Field(default=11, ge=2, le=1000, description="points in each column, from the bed to the surface")
    begin: Ramp = Field(default=0.0, description="start [s]: the first row is at or before it")
    until: Duration | None = Field(
        default=None, description="end [s]: the last row is at or after it; default: the end of the run"
    )
    every: Duration = Field(description="largest time between two rows [s], rounded down to steps, at least one")
    format: Literal["netcdf", "csv"] = Field(
        default="netcdf", description="CF-NetCDF, or a table with a row for each point at each time"
    )

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the window is inside the tank, a point or a line, and recorded during the run."""
        yield from inside(end.tank, self.start, "start", "start")
        if self.end is not None:
            yield from inside(end.tank, self.end, "end", "end")
        alone = "must be at least 2 with an end of the line, and 1 without"
        yield "columns", (self.end is None) == (self.columns == 1), alone
        yield "end", self.end != self.start, "must be another place than the start"
        yield "begin", self.begin <= end.duration, f"must be before the end of the run, {end.duration:g} s"
        later = self.until is None or self.begin <= self.until
        yield "until", later, f"must be from {self.begin:g} s on, its begin"

    @property
    def places(self) -> list[tuple[float, float]]:
        """Positions of the columns, (x, y) [m]."""
        ends = (self.start, self.start if self.end is None else self.end)
        return [(float(x), float(y)) for x, y in np.linspace(*ends, self.columns)]


# ---------------------------------------------------------------- targets of `wavetank calibrate`
class _Placed(CaseModel):
    """A target at a position."""

    x: Length = Field(description="position x [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the position is inside the tank."""
        yield in_tank(end.tank, self.x)


class CrestTarget(_Placed):
    """A crest: height, position and time; amplitude, position and time of `wall.motion` are changed."""

    type: Literal["crest"] = "crest"
    height: Height = Field(description="height above still water [m]")
    time: Duration = Field(description="time of the crest [s]")
    tolerance: Fraction = Field(
        default=0.01,
        description="relative error of the height; twice that, in wave lengths and periods, of position and time",
    )

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that position and time are inside the tank and the run."""
        yield from super().checks(end)
        yield "time", self.time < end.duration, f"must be before the run ends, below {end.duration:g} s"


class ComponentsTarget(_Placed):
    """The components of `wall.motion` at a position: amplitudes and phases of the linear part of the waves."""

    type: Literal["components"] = "components"
    tolerance: Fraction = Field(default=0.02, description="relative rms error of their elevation")


class RecordTarget(_Placed, ElevationFile):
    """The elevation of a record at a position; the type of `wall.motion` does not matter."""

    type: Literal["record"] = "record"
    start: Time | None = Field(default=None, description="start of the target [s]; default: that of the record")
    end: Time | None = Field(default=None, description="end of the target [s]; default: that of the record or run")
    tolerance: Fraction = Field(default=0.02, description="relative rms error of the record, at these frequencies only")


Target = Annotated[
    CrestTarget | ComponentsTarget | RecordTarget,
    Field(discriminator="type", description="target of `wavetank calibrate`"),
]


# ---------------------------------------------------------------- intervals
class Output(CaseModel):
    """Records of the run and their intervals."""

    energy_every: Count = Field(default=1, description="steps between rows of the energy budget")
    gauges_every: Count = Field(default=1, description="steps between rows of gauges")
    probes_every: Count = Field(default=1, description="steps between rows of probes and loads")
    surface_every: Duration | None = Field(
        default=None, description="time between snapshots of the surface [s]; default: 200 to 1000 snapshots"
    )
    velocity_every: Duration | None = Field(
        default=None, description="time between snapshots of the velocity field [s]; default: none"
    )

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that velocities are recorded in nonlinear water: linear water has no potential below the surface."""
        without = self.velocity_every is None or end.physics != "linear"
        yield "velocity_every", without, "must be left out with linear water"
