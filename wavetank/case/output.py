"""What is recorded: gauges, probes, loads, windows, and the target of a calibration."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from wavetank import data
from wavetank import motion as motions
from wavetank.base.case_model import CaseModel, Check, FilePath, about
from wavetank.base.errors import InputError
from wavetank.base.quantities import (
    Coordinate,
    Count,
    Duration,
    Fraction,
    Frequency,
    Height,
    Label,
    Length,
    Pair,
    Ramp,
    Time,
    Triple,
    metres,
)
from wavetank.case.tank import BasinTank, Context, in_tank, inside, read_file
from wavetank.motion.recorded import read_record


# ---------------------------------------------------------------- gauges
class Gauge(CaseModel):
    """A position at which the elevation is recorded."""

    name: Label = Field(min_length=1, description="name of the gauge")
    x: Coordinate = Field(description="distance from the paddle at rest, or along the ring; in a basin its x [m]")
    y: Coordinate = Field(default=0.0, description="in a basin its y [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that it is inside the tank."""
        yield from inside(end.tank, (self.x, self.y), "x", "y")


def named(gauges: Any) -> Any:
    """Return gauges given as numbers or without a name as tables with the names 1, 2, ...; the rest as it is."""
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
        """Yield that it is inside the tank."""
        yield from inside(end.tank, self.start, "start", "start")
        yield from inside(end.tank, self.end, "end", "end")

    def gauges(self) -> tuple[tuple[str, float, float], ...]:
        """Return name, x and y [m] of each gauge."""
        places = np.linspace(self.start, self.end, self.count)
        return tuple((f"{self.name}/{n}", float(x), float(y)) for n, (x, y) in enumerate(places, start=1))


class Probe(Gauge):
    """A point at which velocity, acceleration and pressure are recorded while there is water."""

    z: Coordinate = Field(description="height above still water, negative below [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that it is inside the tank, and above a flat bed."""
        yield from super().checks(end)
        above = end.tank.bed is not None or self.z >= -end.tank.depth
        yield "z", above, f"must be in the water, above the bed at {metres(-end.tank.depth)} m"


# ---------------------------------------------------------------- loads on walls
PADDLE, FAR = "paddle", "far wall"
ENDS = PADDLE, FAR  # the walls of a slice


class WallLoad(CaseModel):
    """A wall on which force and moment of the water's pressure are recorded, still water's included."""

    on: Label = Field(
        min_length=1,
        description="the wall: 'paddle', 'far wall' of a slice or a rectangle, or a group of walls of a basin's mesh",
    )
    name: Label | None = Field(default=None, min_length=1, description="name of the load; default: the wall's")
    about: Triple | None = Field(
        default=None, description="reference point of moments, x, y, z [m]; default: on the bed at x = y = 0"
    )

    @property
    def called(self) -> str:
        """Its name, default resolved."""
        return self.on if self.name is None else self.name

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the tank has such a wall."""
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
        description="name, by which its file is called: letters, digits, - and _",
    )
    start: Pair = Field(description="x and y of the first column [m]")
    end: Pair | None = Field(default=None, description="x and y of the last column [m]; default: there is one")
    columns: int = Field(default=1, ge=1, le=10_000, description="number of columns")
    levels: int = Field(default=11, ge=2, le=1000, description="points in each, from the bed to the surface")
    begin: Ramp = Field(default=0.0, description="from when on [s]: the first row is at or before it")
    until: Duration | None = Field(
        default=None, description="until when [s]: the last row is at or after it; default: the end of the run"
    )
    every: Duration = Field(description="largest time between two rows [s]: as many steps as fit, at least one")
    format: Literal["netcdf", "csv"] = Field(
        default="netcdf", description="CF-NetCDF, or a table with a row for each point at each time"
    )

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that it is inside the tank, a point or a line, and recorded within the run."""
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
        """Where the columns are, (x, y) [m]."""
        ends = (self.start, self.start if self.end is None else self.end)
        return [(float(x), float(y)) for x, y in np.linspace(*ends, self.columns)]


# ---------------------------------------------------------------- targets of `wavetank calibrate`
TARGET_KEY = "target"


class _Placed(CaseModel):
    """A target at a place."""

    x: Length = Field(description="where [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the place is inside the tank."""
        yield in_tank(end.tank, self.x)


class CrestTarget(_Placed):
    """A crest: height, position and time; amplitude, position and time of `wall.motion` are changed."""

    type: Literal["crest"] = "crest"
    height: Height = Field(description="height above still water [m]")
    time: Duration = Field(description="when [s]")
    tolerance: Fraction = Field(
        default=0.01,
        description="of the height; of a wave length the place may miss twice as much, of a period the time",
    )

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that place and time are inside the tank and the run."""
        yield from super().checks(end)
        yield "time", self.time < end.duration, f"must be before the run ends, below {end.duration:g} s"


class ComponentsTarget(_Placed):
    """The components of `wall.motion` at a position: amplitudes and phases of the linear part of the waves."""

    type: Literal["components"] = "components"
    tolerance: Fraction = Field(default=0.02, description="of their elevation's root mean square")


class RecordTarget(_Placed):
    """The elevation of a record at a position; the type of `wall.motion` does not matter."""

    type: Literal["record"] = "record"
    file: FilePath = Field(description="file of t [s] and eta [m]; with a gauge a CSV file or data set, as in compare")
    gauge: Label | None = Field(default=None, description="name of the gauge in it; default: there is one record alone")
    delay: Time = Field(default=0.0, description="added to the file's times [s]")
    start: Time | None = Field(default=None, description="from when the record counts [s]; default: its beginning")
    end: Time | None = Field(default=None, description="till when it counts [s]; default: its end, or the run's")
    lowest_frequency: Frequency | None = Field(
        default=None, description="of waves that are made [Hz]; default a quarter of their mean"
    )
    highest_frequency: Frequency | None = Field(
        default=None, description="of waves that are made [Hz]; default four times their mean"
    )
    tolerance: Fraction = Field(
        default=0.02, description="of the record's root mean square, both without other frequencies"
    )

    def record(self) -> tuple[motions.Array, motions.Array]:
        """Return times [s], delayed, and elevations [m], shapes (N,); raises ``CaseError`` if they cannot be read."""
        if self.gauge is None:
            t, eta = read_file(self.file, lambda path: read_record(path, column="elevation [m]"), TARGET_KEY, "file")
            return t + self.delay, eta
        with about(TARGET_KEY, "file", received=self.file):
            records = data.gauge_records(data.opened(self.file.removeprefix("data:")))[0]
            if self.gauge not in records.gauge:
                have = ", ".join(records.gauge.values)
                raise InputError(f"{self.file}: has no gauge {self.gauge!r}; there are {have}.")
        record = records.sel(gauge=self.gauge).dropna("time")
        return record.time.values + self.delay, record.values


Target = Annotated[
    CrestTarget | ComponentsTarget | RecordTarget,
    Field(discriminator="type", description="what `wavetank calibrate` looks for a motion for"),
]


# ---------------------------------------------------------------- intervals
class Output(CaseModel):
    """What is recorded, and how often."""

    energy_every: Count = Field(default=1, description="steps between rows of the energy budget")
    gauges_every: Count = Field(default=1, description="steps between rows of the gauges' record")
    probes_every: Count = Field(default=1, description="steps between rows of the probes' and loads' records")
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
