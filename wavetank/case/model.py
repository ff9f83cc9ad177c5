"""The case: all tables of an experiment, and their consistency."""

from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, Strict, model_validator
from pydantic_core import PydanticCustomError

from wavetank import motion as motions
from wavetank.base.case_model import CaseModel, Problem
from wavetank.base.quantities import Label
from wavetank.case.ends import EndWall, MeasuringPoint
from wavetank.case.initial import Initial, StillWater
from wavetank.case.numerics import Numerics, RunControl
from wavetank.case.output import Gauge, GaugeLine, Output, Probe, Target, WallLoad, Window, named
from wavetank.case.tank import BasinTank, Depth, Sponge, Tank
from wavetank.case.wall import FarWall, FixedWall, Wall
from wavetank.mesh import MeshFile

CACHED = {"ends", "_depths"}  # names of attributes that are computed once
SENSORS = {"gauges": "gauge", "gauge_lines": "row", "probes": "probe", "windows": "window", "loads": "load"}
HEIGHTS = 21  # number of heights of a column at which it is compared with the paddle
MAX_DEPTH_RATIO = 50  # largest depth over the length of a tank; at twice this depth the interior solve diverged


class NonlinearWater(CaseModel):
    """Waves of any steepness below breaking."""

    type: Literal["nonlinear"] = "nonlinear"


class LinearWater(CaseModel):
    """Waves of small steepness: one factorisation per run."""

    type: Literal["linear"] = "linear"


Water = Annotated[NonlinearWater | LinearWater, Field(discriminator="type", description="wave theory")]
Physics = Literal["nonlinear", "linear"]


class Case(CaseModel):
    """The experiment in the laboratory, and its computation.

    ``Case.model_validate(case.model_dump(mode="json"))`` is the same case.
    """

    title: Label = Field(default="", description="title of the case")
    tank: Tank
    wall: Wall = FixedWall()
    far_wall: FarWall = FixedWall()
    water: Water | None = Field(default=None, description="wave theory; default: nonlinear, or by accuracy")
    initial: Initial = StillWater()
    sponge: Sponge | None = Field(default=None, description="absorbing layer; default: none")
    gauges: Annotated[tuple[Gauge, ...], BeforeValidator(named)] = Field(default=(), description="the gauges")
    gauge_lines: Annotated[tuple[GaugeLine, ...], Strict(False)] = Field(default=(), description="rows of gauges")
    probes: Annotated[tuple[Probe, ...], BeforeValidator(named)] = Field(
        default=(), description="points where velocity, acceleration and pressure are recorded"
    )
    loads: Annotated[tuple[WallLoad, ...], Strict(False)] = Field(
        default=(), description="walls on which force and moment are recorded"
    )
    target: Target | None = Field(default=None, description="target of `wavetank calibrate`; default: by the motion")
    windows: Annotated[tuple[Window, ...], Strict(False)] = Field(
        default=(), description="columns of water recorded for other programs"
    )
    run: RunControl = Field(description="duration of the run")
    numerics: Numerics = Field(default=Numerics(), description="numerics")
    output: Output = Field(default=Output(), description="records and their intervals")

    @property
    def physics(self) -> Physics:
        """The type of the water, default resolved."""
        return "nonlinear" if self.water is None else self.water.type

    @property
    def cells(self) -> int:
        """The number of cells along a slice or ring, default resolved."""
        if isinstance(self.tank, BasinTank):
            raise ValueError("a basin has no number of cells along the tank.")
        return self.numerics.cells_in(self.tank)

    @property
    def cell_size(self) -> float:
        """The size of a cell [m], default resolved; in a basin the approximate size."""
        if isinstance(self.tank, BasinTank):
            return self.numerics.cell_size_in(self.tank)
        return self.tank.length / self.cells

    @cached_property
    def ends(self) -> tuple[EndWall, EndWall]:
        """The walls at x = 0 and at the far end, fixed or moving."""
        water = self.tank, self.physics, self.run.duration
        first = EndWall("wall", self.wall, self.far_wall, *water, case=self)
        return first, EndWall("far_wall", self.far_wall, self.wall, *water, case=self)

    @property
    def paddles(self) -> tuple[EndWall, ...]:
        """The walls that move."""
        return tuple(end for end in self.ends if end.wall.moves)

    @property
    def absorbing(self) -> list[int]:
        """Indices of the absorbing walls in ``paddles``."""
        return [n for n, paddle in enumerate(self.paddles) if paddle.wall.absorb is not None]

    @property
    def paddle_periods(self) -> tuple[float, ...]:
        """The periods [s] of the driven walls in ``paddles``; those that only absorb have none."""
        return tuple(period for paddle in self.paddles if (period := paddle.period) is not None)

    @property
    def regular_period(self) -> float | None:
        """The period [s] of all paddle motions; None if there is no motion, or none of one period."""
        periods = {paddle.wall.motion.regular_period(self.tank) for paddle in self.paddles if paddle.motion().moves}
        return periods.pop() if len(periods) == 1 else None

    def motion(self) -> motions.Motion:
        """Return the checked motion of the wall at x = 0; raises ``CaseError`` as ``EndWall.motion``."""
        return self.ends[0].motion()

    @property
    def linear_generation(self) -> list[str]:
        """A line for each paddle whose generation is linear by default in nonlinear water, with the reason."""
        reasons = {paddle.key: paddle.generation[1] for paddle in self.paddles}
        return [f"generation of {key}.motion: linear, as {reason}" for key, reason in reasons.items() if reason]

    @property
    def generated_bands(self) -> list[str]:
        """A line for each paddle that generates the waves of a record, with their frequencies."""
        notes = {paddle.key: paddle.wall.motion.band_note() for paddle in self.paddles}
        return [f"{key}.motion: {note}" for key, note in notes.items() if note]

    @property
    def motions_end(self) -> float:
        """The end of the first motion that ends [s]; ``inf`` if none does."""
        return min((paddle.motion().duration for paddle in self.paddles), default=np.inf)

    @property
    def frequency_shift(self) -> float:
        """Largest factor by which paddles raise the frequency of the mesh's shortest waves during the run."""
        return max(end.frequency_shift for end in self.ends)

    @property
    def x_min(self) -> float:
        """Smallest x of the tank [m]; 0 for a basin whose extent is in its mesh file only."""
        return self.tank.box[0] if self.tank.box else 0.0

    @property
    def surface_every(self) -> float:
        """Time between snapshots of the surface [s]; default: short compared with a wave period, 200 to 1000 in all."""
        if self.output.surface_every is not None:
            return self.output.surface_every
        short = 0.5 * (self.tank.depth / self.tank.gravity) ** 0.5
        return float(np.clip(short, self.run.duration / 1000, self.run.duration / 200))

    @property
    def on_mesh_file(self) -> bool:
        """Whether the mesh is that of a file, whose cells have given sizes."""
        return isinstance(self.tank, BasinTank) and isinstance(self.tank.layout, MeshFile)

    def depths(self) -> float | Depth:
        """Return the still-water depth [m], or d(x, y) over a bed, whose file is read once.

        Raises ``CaseError`` if it is missing or cannot be read.
        """
        return self._depths

    @cached_property
    def _depths(self) -> float | Depth:
        return self.tank.depth if self.tank.bed is None else self.tank.bed.build(self.tank.depth)

    def __getstate__(self) -> dict[Any, Any]:
        """Return the state to pickle, without cached attributes: functions, which other ranks compute themselves."""
        state = super().__getstate__()
        own = {name: value for name, value in state["__dict__"].items() if name not in CACHED}
        return {**state, "__dict__": own}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some fields changed, without cached attributes that depend on them."""
        copied = super().model_copy(update=update, deep=deep)
        if "tank" in {*(update or ())}:
            copied.__dict__.pop("_depths", None)
        copied.__dict__.pop("ends", None)
        for new, old in zip(copied.ends, self.ends, strict=True):
            if new == old:
                new.with_motion_of(old)
        return copied

    def measuring_points(self) -> Iterator[MeasuringPoint]:
        """Yield gauges, probes and columns of windows."""
        column, always = self.tank.depth * np.linspace(-1.0, 0.0, HEIGHTS), (0.0, np.inf)
        yield from (
            MeasuringPoint(self.gauge_key(n), g.x, g.y, np.zeros(1), always) for n, g in enumerate(self.all_gauges)
        )
        yield from (MeasuringPoint(("probes", n), p.x, p.y, np.array([p.z]), always) for n, p in enumerate(self.probes))
        for n, window in enumerate(self.windows):
            span = window.begin, np.inf if window.until is None else window.until
            yield from (MeasuringPoint(("windows", n), x, y, column, span) for x, y in window.places)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        """Raise an error with the problems of all tables."""
        first, far = self.ends
        problems = [*self._own_problems()]
        for part, key in self.models_inside():
            problems += part.problems(far if key == ("far_wall",) else first, *key)
        if problems:
            text = "; ".join(str(problem) for problem in problems)
            raise PydanticCustomError("inconsistent", "{text}", {"text": text, "problems": problems})
        return self

    def _own_problems(self) -> Iterator[Problem]:
        """Yield a tank that is too deep, and names of several sensors of a kind."""
        if self.tank.depth > MAX_DEPTH_RATIO * self.tank.length:
            allowed = f"must be at most {MAX_DEPTH_RATIO} lengths of the tank: two lengths are deep water for its waves"
            yield Problem(("tank", "depth"), self.tank.depth, allowed)
        gauges = Counter(gauge.name for gauge in self.all_gauges)
        for table, kind in SENSORS.items():
            sensors = getattr(self, table)
            count = gauges if "gauge" in table else Counter(name for one in sensors for name in _names(one))
            for n, sensor in enumerate(sensors):
                if any(count[name] > 1 for name in _names(sensor)):
                    yield Problem((table, n, "name"), sensor.name, f"must be a name that no other {kind} has")

    @property
    def all_gauges(self) -> tuple[Gauge, ...]:
        """The gauges, including those of the rows of gauges."""
        rows = (Gauge(name=name, x=x, y=y) for line in self.gauge_lines for name, x, y in line.gauges())
        return (*self.gauges, *rows)

    def gauge_key(self, index: int) -> tuple[str | int, ...]:
        """Return the key of one of ``all_gauges``."""
        index -= len(self.gauges)
        if index < 0:
            return "gauges", index + len(self.gauges)
        ends = np.cumsum([line.count for line in self.gauge_lines])
        return "gauge_lines", int(np.searchsorted(ends, index, side="right"))


def _names(sensor: Gauge | GaugeLine | Window | WallLoad) -> list[str]:
    """Return the names of the records of a sensor."""
    if isinstance(sensor, GaugeLine):
        return [name for name, _, _ in sensor.gauges()]
    return [sensor.called if isinstance(sensor, WallLoad) else sensor.name]
