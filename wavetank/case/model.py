"""The scene as a whole."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, partial
from itertools import chain
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import BeforeValidator, Field, Strict, model_validator
from pydantic_core import PydanticCustomError

from wavetank import motion as motions
from wavetank.case.initial import Initial, StillWater
from wavetank.case.numerics import Numerics, RunNoun
from wavetank.case.output import ENDS, FAR, PADDLE, Gauge, GaugeLine, Output, Probe, Target, WallLoad, Window, named
from wavetank.case.tank import BasinTank, Depth, Sponge, Tank, paddle_period
from wavetank.case.wall import FarWall, FixedWall, MovingWall, Wall
from wavetank.motion.motion import Extent, ValidatedMotion, extent, times, values
from wavetank.values.case_model import CaseError, CaseModel, Problem, about, renamed
from wavetank.values.quantities import Label, metres

CLOSE = 0.05  # of (d / g)^(1/2): times as close miss 0.1 % of the largest value for waves of k d = 4
CHECK_TIMES = 50  # times at which derivatives of a user's function are compared
CACHED = {"_motion", "_depths", "mirrored"}  # attributes that are computed once
PLACED = ("gauges", "gauge_lines", "probes", "windows")  # tables of places in the tank
HEIGHTS = 21  # heights of a column that the paddle is compared with
DEEPEST = 50  # lengths of a tank; measured, the interior potential of twice as deep ones no longer converges


class NonlinearWater(CaseModel):
    """Waves of any steepness short of breaking."""

    type: Literal["nonlinear"] = "nonlinear"


class LinearWater(CaseModel):
    """Waves of small steepness: one factorisation serves the whole run."""

    type: Literal["linear"] = "linear"


class MeasuringPoint(NamedTuple):
    """A place that is recorded, such as a gauge: its key, x and y [m], heights z [m], first and last time [s]."""

    key: tuple[str | int, ...]
    x: float
    y: float
    z: motions.Array
    span: tuple[float, float]


Water = Annotated[NonlinearWater | LinearWater, Field(discriminator="type", description="the theory of the waves")]
Physics = Literal["nonlinear", "linear"]


class Case(CaseModel):
    """What stands in the laboratory, and what is to be computed of it.

    ``Case.model_validate(scene.model_dump(mode="json"))`` is the same scene.

    Attributes
    ----------
    key, end
        Whose key ``wall`` is, and the end of the tank that it is at, as loads name it.
    """

    key: ClassVar[str] = "wall"
    end: ClassVar[str] = PADDLE

    title: Label = Field(default="", description="what the case is, in a few words")
    tank: Tank
    wall: Wall = FixedWall()
    far_wall: FarWall = FixedWall()
    water: Water | None = Field(default=None, description="the waves' theory; default: nonlinear, or by accuracy")
    initial: Initial = StillWater()
    sponge: Sponge | None = Field(default=None, description="where waves are absorbed; default: nowhere")
    gauges: Annotated[tuple[Gauge, ...], BeforeValidator(named)] = Field(default=(), description="the gauges")
    gauge_lines: Annotated[tuple[GaugeLine, ...], Strict(False)] = Field(default=(), description="rows of gauges")
    probes: Annotated[tuple[Probe, ...], BeforeValidator(named)] = Field(
        default=(), description="points where velocity, acceleration and pressure are recorded"
    )
    loads: Annotated[tuple[WallLoad, ...], Strict(False)] = Field(
        default=(), description="walls on which force and moment are recorded"
    )
    target: Target | None = Field(default=None, description="what `wavetank calibrate` aims at; default: by the motion")
    windows: Annotated[tuple[Window, ...], Strict(False)] = Field(
        default=(), description="columns of water whose motion is kept for other programs"
    )
    run: RunNoun = Field(description="how long is computed")
    numerics: Numerics = Field(default=Numerics(), description="how it is computed")
    output: Output = Field(default=Output(), description="what is recorded, and how often")

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
        """The size of a cell [m], default resolved; in a basin, that to aim at."""
        if isinstance(self.tank, BasinTank):
            return self.numerics.cell_size_in(self.tank)
        return self.tank.length / self.cells

    @property
    def reach(self) -> float:
        """Where the wall's mapping has died out [m], default resolved; ``inf`` for a fixed wall."""
        return self.wall.reach_in(self.tank, self.available_reach)

    @property
    def available_reach(self) -> float:
        """Largest reach of the wall's mapping [m]: up to that of a moving far wall, by default half the length."""
        length, own, other = self.tank.length, *(getattr(wall, "reach", None) for wall in (self.wall, self.far_wall))
        if not self.far_wall.moves:
            return length
        return 0.5 * length if own is None and other is None else length - (other or 0.0)

    @cached_property
    def mirrored(self) -> "Case":
        """The same scene as seen from its far wall, which is the ``wall`` of it.

        Gauges, probes and windows stand at their mirror images, so that they are where they were as seen from the other
        wall; the tank, with its bed and its walls' names, is as it was.
        """
        ends = 2 * self.x_min + self.tank.length
        walls = {"wall": self.far_wall, "far_wall": self.wall}
        placed = {name: tuple(one.mirrored(ends) for one in getattr(self, name)) for name in PLACED}
        same = {name: getattr(self, name) for name in Case.model_fields}
        return MirroredCase.model_construct(self.model_fields_set, **{**same, **walls, **placed})

    @property
    def x_min(self) -> float:
        """Smallest x of the tank [m]; 0 for a basin whose extent only its mesh file has."""
        box = self.tank.layout.box if isinstance(self.tank, BasinTank) else None
        return box[0] if box else 0.0

    def amid_end(self, end: str) -> tuple[float, float]:
        """Return a place (x, y) [m] at the paddle or at the far wall, halfway along it."""
        box = self.tank.layout.box if isinstance(self.tank, BasinTank) else None
        x_min, low, right, high = box or (0.0, 0.0, self.tank.length, 0.0)
        return (x_min if end == PADDLE else right), (low + high) / 2

    @property
    def absorbing(self) -> list[int]:
        """Indices of the absorbing ones of ``paddles``."""
        return [n for n, view in enumerate(self.paddles) if getattr(view.wall, "absorb", None) is not None]

    @property
    def paddles(self) -> tuple["Case", ...]:
        """The scene as seen from each wall that moves."""
        return (*((self,) if self.wall.moves else ()), *((self.mirrored,) if self.far_wall.moves else ()))

    @property
    def linear_generation(self) -> list[str]:
        """A line for each paddle whose generation is linear by default in nonlinear water, with the reason."""
        reasons = {view.key: view.wall.generation_reason(view.tank, view.physics) for view in self.paddles}
        return [f"generation of {key}.motion: linear, as {reason}" for key, reason in reasons.items() if reason]

    @property
    def motions_end(self) -> float:
        """Until when all motions are known [s]; ``inf`` where none ends."""
        return min((scene.motion().duration for scene in self.paddles), default=np.inf)

    @property
    def surface_every(self) -> float:
        """Time between snapshots of the surface [s]; by default short against a wave period, 200 to 1000 of them."""
        if self.output.surface_every is not None:
            return self.output.surface_every
        short = 0.5 * (self.tank.depth / self.tank.gravity) ** 0.5
        return float(np.clip(short, self.run.duration / 1000, self.run.duration / 200))

    def depths(self) -> float | Depth:
        """Return the still water's depth [m], or d(x, y) over a bed, whose file is read once.

        Raises ``CaseError`` if that cannot be had or read.
        """
        return self._depths

    @cached_property
    def _depths(self) -> float | Depth:
        return self.tank.depth if self.tank.bed is None else self.tank.bed.build(self.tank.depth)

    def motion(self) -> motions.Motion:
        """Return the paddle's motion, checked against the run and the tank; its file is read once.

        Raises ``CaseError`` if its file cannot be read, ends before the run, or leaves the mapping's reach.
        """
        return self._motion

    @cached_property
    def _motion(self) -> motions.Motion:
        return self._checked_motion()

    def _checked_motion(self) -> motions.Motion:
        wall = self.wall
        if isinstance(wall, MovingWall) and wall.reads_file and (problems := list(wall.motion_problems(self))):
            raise CaseError(problems)
        motion, value_keys = (
            wall.paddle(self.tank, self.physics),
            getattr(getattr(wall, "motion", None), "value_keys", None),
        )
        with about("wall", "motion", *(value_keys or ())):
            motion.check(self.run.duration * (np.arange(CHECK_TIMES, dtype=np.float64) + 0.5) / CHECK_TIMES)
            problems = list(self._motion_problems(motion))
        if problems:
            raise CaseError(problems)
        return (
            motion
            if value_keys is None
            else ValidatedMotion(motion, self.key, "motion", *value_keys, run=self.run.duration)
        )

    def __getstate__(self) -> dict[Any, Any]:
        """Return the state to pickle, without cached attributes: functions, which other ranks compute themselves."""
        state = super().__getstate__()
        own = {name: value for name, value in state["__dict__"].items() if name not in CACHED}
        return {**state, "__dict__": own}

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with some fields changed, without cached attributes that depend on them."""
        copied = super().model_copy(update=update, deep=deep)
        if {"tank", "wall", "run"} & {*(update or ())} or copied.physics != self.physics:
            copied.__dict__.pop("_motion", None)
        if "tank" in {*(update or ())}:
            copied.__dict__.pop("_depths", None)
        copied.__dict__.pop("mirrored", None)
        return copied

    @property
    def paddle_period(self) -> float | None:
        """The period [s] that halves the power of the paddle's velocity; None if it does not move.

        Of a record it is found in all of it, and over the run of what is known as far only: formulae and functions.
        """
        motion = self.motion()
        until = motion.duration if np.isfinite(motion.duration) else self.run.duration
        return motion.power_period or paddle_period(self.of_paddle(motion, "velocity"), duration=until, tank=self.tank)

    @property
    def paddle_periods(self) -> tuple[float, ...]:
        """The periods [s] of those of ``paddles`` that are driven; none of one that only absorbs."""
        return tuple(period for view in self.paddles if (period := view.paddle_period) is not None)

    def of_paddle(self, motion: motions.Motion, what: str) -> Callable[[motions.Array], motions.Array]:
        """Return a motion's position or velocity as a function of times alone, at all places where it has several."""
        return partial(getattr(motion, what), y=self.wall.places(self.tank))

    def _motion_problems(self, motion: motions.Motion) -> Iterator[Problem]:
        if motion.duration < self.run.duration:
            allowed = f"must be at most {motion.duration:g} s, where the recorded motion ends"
            yield Problem(("run", "duration"), self.run.duration, allowed)
        if motion.start >= self.run.duration:
            allowed = f"must be more than {motion.start:g} s, where the recorded motion begins"
            yield Problem(("run", "duration"), self.run.duration, allowed)
        if isinstance(self.wall, MovingWall):
            yield from self.wall.reach_problems(self.tank, self.available_reach, self.excursion(motion))
            if self.wall.limits is not None:
                yield from self.wall.limits.exceeded(self.extent(motion))
            yield from self._reached(self.wall, motion)

    def _reached(self, wall: MovingWall, motion: motions.Motion) -> Iterator[Problem]:
        """Yield the first gauge, probe or window that a paddle of prescribed motion reaches."""
        prescribed = self.physics == "nonlinear" and getattr(wall, "absorb", None) is None
        if not prescribed or (isinstance(self.tank, BasinTank) and self.tank.layout.type != "rectangle"):
            return  # of small strokes nothing travels
        places, times, uniform = [*self.measuring_points()], self._times(motion), wall.places(self.tank) is None
        farthest = wall.max_mode_shape(self.tank) * self.excursion(motion) if places else 0.0
        for key, x, y, z, (begin, until) in places:
            away, t = x - self.x_min, times[(begin <= times) & (times <= until)]
            if farthest <= away:
                continue
            position = values(partial(motion.position, y=None if uniform else np.array([y])), t).reshape(-1)
            into = np.multiply.outer(wall.wavemaker.share(z, self.tank.depth), position).max(axis=0)
            if into.max(initial=0.0) > away:
                there = f"stands {away:.4g} m from the paddle of {self.key} at rest, which is there at"
                allowed = f"must stand farther from it than {into.max():.4g} m, as far as that goes"
                yield Problem(key, None, f"{there} t = {t[np.argmax(into > away)]:.4g} s: {allowed}")
                return

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

    def excursion(self, motion: motions.Motion) -> float:
        """Return the paddle's largest distance from rest in the run [m]."""
        return float(np.abs(values(self.of_paddle(motion, "position"), self._times(motion))).max())

    @property
    def quickened(self) -> float:
        """How much faster the mesh's shortest waves get, at most, where its paddles go farthest."""
        factors = (
            one.wall.quickened(one.tank, one.reach, one.excursion(one.motion()))
            for one in self.paddles
            if isinstance(one.wall, MovingWall) and self.physics == "nonlinear"
        )
        return max(factors, default=1.0)

    def extent(self, motion: motions.Motion) -> Extent:
        """Return the paddle's stroke, largest speed and acceleration in the run."""
        return extent(motion, self._times(motion), self.wall.places(self.tank))

    def _times(self, motion: motions.Motion) -> motions.Array:
        """Return the times at which a motion is sampled [s]."""
        return times(min(self.run.duration, motion.duration), CLOSE * (self.tank.depth / self.tank.gravity) ** 0.5)

    @model_validator(mode="after")
    def _check_consistency(self) -> Self:
        parts = (self.wall, self.initial, self.target, self.numerics, self.output, self.sponge, self.tank.bed)
        tank = chain(self._depth_problems(), self._far_problems())
        places = chain(self._gauge_problems(), self._probe_problems(), self._load_problems(), self._window_problems())
        problems = [*chain(tank, places, *(part.problems(self) for part in parts if part is not None))]
        if problems:
            text = "; ".join(str(problem) for problem in problems)
            raise PydanticCustomError("scene", "{text}", {"text": text, "problems": problems})
        return self

    @property
    def all_gauges(self) -> tuple[Gauge, ...]:
        """The gauges, and those of the rows of gauges."""
        rows = (Gauge(name=name, x=x, y=y) for line in self.gauge_lines for name, x, y in line.gauges())
        return (*self.gauges, *rows)

    def gauge_key(self, index: int) -> tuple[str | int, ...]:
        """Return the key of one of ``all_gauges``."""
        index -= len(self.gauges)
        if index < 0:
            return "gauges", index + len(self.gauges)
        ends = np.cumsum([line.count for line in self.gauge_lines])
        return "gauge_lines", int(np.searchsorted(ends, index, side="right"))

    def _depth_problems(self) -> Iterator[Problem]:
        if self.tank.depth > DEEPEST * self.tank.length:
            allowed = f"must be at most {DEEPEST} lengths of the tank: two lengths are as deep for any of its waves"
            yield Problem(("tank", "depth"), self.tank.depth, allowed)

    def _far_problems(self) -> Iterator[Problem]:
        """Yield a far wall that the tank does not allow, overlapping reaches, and the problems of any wall."""
        far, kind = self.far_wall, ("far_wall", "type")
        if not far.moves:
            return
        tank = "basin that is no rectangle" if isinstance(self.tank, BasinTank) else self.tank.type
        if self.tank.type == "ring" or (isinstance(self.tank, BasinTank) and self.tank.layout.type != "rectangle"):
            yield Problem(kind, far.type, f"must be fixed or left out: in a {tank} no far wall moves")
            return
        if self.sponge is not None and self.sponge.type in ("end", "group"):
            yield Problem(kind, far.type, "must be fixed or left out: there is a sponge before it (sponge.type)")
            return
        yield from (problem.at("wall", "far_wall") for problem in far.problems(self.mirrored))
        length, own, other = self.tank.length, self.reach, self.mirrored.reach
        if self.wall.moves and own + other > length * (1 + 1e-9) and max(own, other) <= length:
            allowed = f"must be at most {metres(length - own)} m, not to overlap with wall.reach = {metres(own)} m"
            yield Problem(("far_wall", "reach"), other, f"{allowed} in a tank of {metres(length)} m")
        for view, reach, rest in ((self, own, other), (self.mirrored, other, own)):
            if self.wall.moves and reach == length and not rest:
                yield Problem((view.key, "reach"), reach, "must leave some of the tank to the other wall")

    def _gauge_problems(self) -> Iterator[Problem]:
        count = Counter(gauge.name for gauge in self.all_gauges)
        for n, line in enumerate(self.gauge_lines):
            for end, (x, y) in (("start", line.start), ("end", line.end)):
                yield from self._place_problems(("gauge_lines", n, end), x, y)
            if any(count[name] > 1 for name, _, _ in line.gauges()):
                yield Problem(("gauge_lines", n, "name"), line.name, "must be a name that no other row has")
        for n, gauge in enumerate(self.gauges):
            yield from self._place_problems(("gauges", n), gauge.x, gauge.y)
            if count[gauge.name] > 1:
                yield Problem(("gauges", n, "name"), gauge.name, "must be a name that no other gauge has")

    def _probe_problems(self) -> Iterator[Problem]:
        count = Counter(probe.name for probe in self.probes)
        for n, probe in enumerate(self.probes):
            yield from self._place_problems(("probes", n), probe.x, probe.y)
            if self.tank.bed is None and probe.z < -self.tank.depth:
                allowed = f"must be in the water, above the bed at {metres(-self.tank.depth)} m"
                yield Problem(("probes", n, "z"), probe.z, allowed)
            if count[probe.name] > 1:
                yield Problem(("probes", n, "name"), probe.name, "must be a name that no other probe has")

    def _window_problems(self) -> Iterator[Problem]:
        count = Counter(window.name for window in self.windows)
        for n, window in enumerate(self.windows):
            for end, place in (("start", window.start), ("end", window.end)):
                if place is not None:
                    yield from self._place_problems(("windows", n, end), *place)
            if (window.end is None) != (window.columns == 1):
                allowed = "must be at least 2 with an end of the line, and 1 without"
                yield Problem(("windows", n, "columns"), window.columns, allowed)
            elif window.columns > 1 and window.end == window.start:
                yield Problem(("windows", n, "end"), window.end, "must be another place than the start")
            if not window.begin <= self.run.duration:
                allowed = f"must be before the end of the run, {self.run.duration:g} s"
                yield Problem(("windows", n, "begin"), window.begin, allowed)
            if window.until is not None and not window.begin <= window.until:
                yield Problem(("windows", n, "until"), window.until, f"must be from {window.begin:g} s on, its begin")
            if count[window.name] > 1:
                yield Problem(("windows", n, "name"), window.name, "must be a name that no other window has")

    def _load_problems(self) -> Iterator[Problem]:
        count = Counter(load.called for load in self.loads)
        for n, load in enumerate(self.loads):
            if self.tank.type == "ring":
                yield Problem(("loads", n, "on"), load.on, "must be left out: a ring has no walls")
            elif self.tank.type == "slice" and load.on not in ENDS:
                yield Problem(("loads", n, "on"), load.on, f"must be {' or '.join(map(repr, ENDS))} in a slice")
            if count[load.called] > 1:
                yield Problem(("loads", n), load.called, "must have a name that no other load has")

    def _place_problems(self, key: tuple[str | int, ...], x: float, y: float) -> Iterator[Problem]:
        x_min, low, right, high = 0.0, 0.0, self.tank.length, 0.0
        if isinstance(self.tank, BasinTank):
            x_min, low, right, high = self.tank.layout.box or (-np.inf, -np.inf, np.inf, np.inf)
        elif y:
            yield Problem((*key, "y"), y, f"must be left out: a {self.tank.type} has no width")
            return
        for name, value, first, last in (("x", x, x_min, right), ("y", y, low, high)):
            if not first <= value <= last:
                yield Problem((*key, name), value, f"must be inside the tank, {metres(first)} to {metres(last)} m")


class MirroredCase(Case):
    """A scene as seen from its far wall."""

    key: ClassVar[str] = "far_wall"
    end: ClassVar[str] = FAR

    @cached_property
    def _motion(self) -> motions.Motion:
        with renamed("wall", self.key):
            return self._checked_motion()
