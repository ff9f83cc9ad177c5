"""The scene: what stands in the laboratory, and what is to be computed of it, as frozen and validated data.

A case file (TOML) says it in these nouns; a ``Scene`` can also be built in Python from the same classes, which then
raise pydantic's own ``ValidationError``. All lengths are in metres, times in seconds. Knows nothing of finite elements.
"""

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationInfo,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

from wavetank import data, motions
from wavetank.errors import InputError
from wavetank.motions.record_file import read_record
from wavetank.reference.conformal import SteadyWave
from wavetank.reference.solitary_wave import HIGHEST_SOLITARY, solitary_wave
from wavetank.reference.stream_function import maximum_height, stream_function_wave


class Problem(NamedTuple):
    """What does not fit together in a scene whose values are each allowed.

    Attributes
    ----------
    key
        The place in the scene, e.g. ``("gauges", 0, "x")``.
    received, allowed
        The value there, and what it may be.
    """

    key: tuple[str | int, ...]
    received: Any
    allowed: str

    def __str__(self) -> str:
        """Return the sentence, e.g. ``tank.depth = -1: must be greater than 0``; a value of None was not given."""
        shown = "" if self.received is None else f" = {json.dumps(self.received, default=str)[:80]}"
        return f"{'.'.join(map(str, self.key))}{shown}: {self.allowed}"


class SceneError(InputError):
    """A scene that cannot be built, with what is wrong in it."""

    def __init__(self, problems: Sequence[Problem]):
        super().__init__("\n".join(f"{problem}." for problem in problems))
        self.problems = problems


class Noun(BaseModel):
    """A part of the scene: frozen, unknown keys refused, numbers finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield what does not fit the rest of the scene; by itself, nothing."""
        yield from ()


# ---------------------------------------------------------------- the tank
class SliceTank(Noun):
    """A tank of one horizontal dimension: a slice along x, between two walls."""

    fewest_cells: ClassVar[int] = 1
    type: Literal["slice"] = "slice"
    length: float = Field(gt=0, description="length of the tank [m]")
    depth: float = Field(gt=0, description="still-water depth d [m]")
    gravity: float = Field(default=9.81, gt=0, description="gravity g [m/s^2]")


class RingTank(Noun):
    """A periodic tank of one horizontal dimension: what leaves at x = length enters at x = 0; it has no walls."""

    fewest_cells: ClassVar[int] = 3  # a polygon's
    type: Literal["ring"] = "ring"
    length: float = Field(gt=0, description="length along the ring [m]")
    depth: float = Field(gt=0, description="still-water depth d [m]")
    gravity: float = Field(default=9.81, gt=0, description="gravity g [m/s^2]")


def _slice_by_default(tank: Any) -> Any:
    return {"type": "slice", **tank} if isinstance(tank, dict) else tank


AnyTank = SliceTank | RingTank
Tank = Annotated[AnyTank, Field(discriminator="type", description="the tank"), BeforeValidator(_slice_by_default)]


# ---------------------------------------------------------------- the paddle's motion
def _located(reference: str, info: ValidationInfo) -> str:
    """Return a path made absolute from the case file's folder; data:NAME/FILE is kept, it is looked up when read."""
    folder = (info.context or {}).get("folder", Path())
    return reference if reference.startswith("data:") else str(data.resolve(reference, folder))


RecordPath = Annotated[str, Field(min_length=1), AfterValidator(_located)]


class AtRestMotion(Noun):
    """The paddle stands still."""

    type: Literal["at-rest"] = "at-rest"

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return X = 0."""
        return motions.AtRest()


class SinusoidMotion(Noun):
    """X = r(t) a sin(2 pi t / T), with a smooth ramp r."""

    type: Literal["sinusoid"] = "sinusoid"
    amplitude: float = Field(gt=0, description="paddle amplitude a, half the stroke [m]")
    period: float = Field(gt=0, description="period T [s]")
    ramp: float | None = Field(default=None, ge=0, description="length of the ramp [s]; default two periods")

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the ramped sinusoid."""
        ramp = 2 * self.period if self.ramp is None else self.ramp
        return _ramped(motions.Sinusoid(self.amplitude, self.period), ramp)


class JonswapSpectrum(Noun):
    """The JONSWAP spectrum's shape."""

    type: Literal["jonswap"] = "jonswap"
    peak_frequency: float = Field(gt=0, description="peak frequency fp [Hz]")
    gamma: float = Field(default=3.3, ge=1, description="peak enhancement gamma [-]")

    def build(self) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Jonswap(self.peak_frequency, self.gamma)


class GaussianSpectrum(Noun):
    """A Gaussian spectrum's shape."""

    type: Literal["gaussian"] = "gaussian"
    peak_frequency: float = Field(gt=0, description="peak frequency fp [Hz]")
    bandwidth: float = Field(gt=0, description="standard deviation [Hz]")

    def build(self) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Gaussian(self.peak_frequency, self.bandwidth)


class WaveGroupMotion(Noun):
    """Waves that meet, by linear theory, in one crest at (focus_x, focus_time)."""

    type: Literal["wave-group"] = "wave-group"
    amplitude: float = Field(gt=0, description="height of the linear crest at the focus [m]")
    focus_x: float = Field(gt=0, description="where the crests meet [m]")
    focus_time: float = Field(gt=0, description="when the crests meet [s]")
    spectrum: Annotated[JonswapSpectrum | GaussianSpectrum, Field(discriminator="type", description="shape S(f)")]
    lowest_frequency: float | None = Field(default=None, gt=0, description="first component [Hz]; default fp / 2")
    highest_frequency: float | None = Field(default=None, gt=0, description="last component [Hz]; default 2 fp")
    components: int = Field(default=128, ge=2, le=10_000, description="number of components")
    ramp: float | None = Field(default=None, ge=0, description="length of the ramp [s]; default two peak periods")

    @property
    def ramp_length(self) -> float:
        """The ramp [s], default resolved."""
        return 2 / self.spectrum.peak_frequency if self.ramp is None else self.ramp

    def group(self, tank: AnyTank) -> motions.WaveGroup:
        """Return the group without its ramp."""
        peak = self.spectrum.peak_frequency
        return motions.WaveGroup(
            amplitude=self.amplitude,
            spectrum=self.spectrum.build(),
            lowest_frequency=peak / 2 if self.lowest_frequency is None else self.lowest_frequency,
            highest_frequency=2 * peak if self.highest_frequency is None else self.highest_frequency,
            components=self.components,
            focus_x=self.focus_x,
            focus_time=self.focus_time,
            depth=tank.depth,
            gravity=tank.gravity,
        )

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the ramped group."""
        return _ramped(self.group(tank), self.ramp_length)

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield a focus outside the tank or too early, a band without its peak, and a group that comes twice."""
        key = ("wall", "motion")
        group = self.group(scene.tank)
        if not self.focus_x < scene.tank.length:
            yield Problem((*key, "focus_x"), self.focus_x, f"must be inside the tank, below {scene.tank.length:g} m")
        if not group.lowest_frequency < self.spectrum.peak_frequency < group.highest_frequency:
            band = f"{group.lowest_frequency:g} to {group.highest_frequency:g} Hz"
            received = self.spectrum.peak_frequency
            yield Problem((*key, "spectrum", "peak_frequency"), received, f"must be between the components' {band}")
            return
        earliest = group.earliest_focus(self.ramp_length)
        if self.focus_time < earliest:
            allowed = (
                f"must be at least {earliest:.4g} s: the short waves need that long from the ramp's end to focus_x"
            )
            yield Problem((*key, "focus_time"), self.focus_time, allowed)
        if scene.run.duration > group.repetition:
            allowed = f"must be more: so few repeat the group every {group.repetition:.4g} s, within the run's duration"
            yield Problem((*key, "components"), self.components, allowed)


class RecordedMotion(Noun):
    """A measured motion from a file of two columns: one spline through its positions or its velocities."""

    type: Literal["recorded"] = "recorded"
    position: RecordPath | None = Field(default=None, description="file of t [s] and X [m]")
    velocity: RecordPath | None = Field(default=None, description="file of t [s] and dX/dt [m/s]")
    ramp: float = Field(default=0.0, ge=0, description="length of a ramp from the record's start [s]; 0 is none")

    @model_validator(mode="after")
    def _one_file(self) -> Self:
        if (self.position is None) == (self.velocity is None):
            raise ValueError("must have exactly one of the keys 'position' and 'velocity'")
        return self

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the spline's motion; raises ``SceneError`` if the file cannot be had or read."""
        if self.position is not None:
            record = motions.Recorded.of_positions(*_record("position", self.position))
        else:
            record = motions.Recorded.of_velocities(*_record("velocity", str(self.velocity)))
        return _ramped(record, self.ramp, start=max(0.0, record.start))


def _record(key: str, reference: str) -> tuple[motions.Array, motions.Array]:
    try:
        return read_record(data.resolve(reference, Path()))
    except InputError as error:
        raise SceneError([Problem(("wall", "motion", key), reference, str(error).removesuffix("."))]) from None


def _ramped(motion: motions.Motion, ramp: float, *, start: float = 0.0) -> motions.Motion:
    return motions.Ramped(motion, ramp, start) if ramp > 0 else motion


PaddleMotion = Annotated[
    AtRestMotion | SinusoidMotion | WaveGroupMotion | RecordedMotion,
    Field(discriminator="type", description="motion of the paddle"),
]


# ---------------------------------------------------------------- the wall at x = 0
class FixedWall(Noun):
    """A wall that stands still."""

    type: Literal["fixed"] = "fixed"

    def paddle(self, tank: AnyTank) -> motions.Motion:
        """Return the motion of a paddle at rest."""
        return motions.AtRest()

    def reach_in(self, tank: AnyTank) -> float:
        """Return inf: there is no mapping to die out."""
        return np.inf


class PistonWall(Noun):
    """A vertical wall that moves as a whole."""

    type: Literal["piston"] = "piston"
    motion: PaddleMotion
    reach: float | None = Field(
        default=None,
        gt=0,
        description="where the mapping x = X + s(X) X_p has died out [m]; default: the length, at most ten depths",
    )

    def paddle(self, tank: AnyTank) -> motions.Motion:
        """Return the paddle's motion; raises ``SceneError`` if its file cannot be had or read."""
        return self.motion.build(tank)

    def reach_in(self, tank: AnyTank) -> float:
        """Return the reach [m], default resolved."""
        return min(tank.length, 10 * tank.depth) if self.reach is None else self.reach

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield a tank without walls, a reach beyond the tank, and what is wrong with the motion."""
        if isinstance(scene.tank, RingTank):
            yield Problem(("wall", "type"), self.type, "must be left out: a ring has no walls, hence no paddle")
            return
        if self.reach is not None and self.reach > scene.tank.length:
            yield Problem(("wall", "reach"), self.reach, f"must be at most the tank's length, {scene.tank.length:g} m")
        yield from self.motion.problems(scene)


Wall = Annotated[FixedWall | PistonWall, Field(discriminator="type", description="the wall at x = 0")]


# ---------------------------------------------------------------- the water
class NonlinearWater(Noun):
    """Waves of any steepness short of breaking."""

    type: Literal["nonlinear"] = "nonlinear"


class LinearWater(Noun):
    """Waves of small steepness: one factorisation serves the whole run."""

    type: Literal["linear"] = "linear"


Water = Annotated[NonlinearWater | LinearWater, Field(discriminator="type", description="the theory of the waves")]
Physics = Literal["nonlinear", "linear"]


# ---------------------------------------------------------------- the initial state
class StillWater(Noun):
    """eta = 0, psi = 0."""

    type: Literal["still-water"] = "still-water"

    def surface(self, tank: AnyTank, x: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x [m], each of shape (N,)."""
        return np.zeros_like(x), np.zeros_like(x)


class StandingWave(Noun):
    """eta = a cos(m pi x / length), psi = 0."""

    type: Literal["standing-wave"] = "standing-wave"
    amplitude: float = Field(gt=0, description="amplitude a [m]")
    mode: int = Field(default=1, ge=1, description="number m of half waves in the tank")

    def surface(self, tank: AnyTank, x: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x [m], each of shape (N,)."""
        return self.amplitude * np.cos(self.mode * np.pi * x / tank.length), np.zeros_like(x)

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield an amplitude that lays the bed dry, and half a wave too many for a ring."""
        if self.amplitude >= scene.tank.depth:
            allowed = f"must be below the still-water depth, {scene.tank.depth:g} m"
            yield Problem(("initial", "amplitude"), self.amplitude, allowed)
        if isinstance(scene.tank, RingTank) and self.mode % 2:
            yield Problem(("initial", "mode"), self.mode, "must be even: whole waves, two halves each, fit a ring")


class StreamFunctionWave(Noun):
    """Waves of permanent form in a ring, travelling to +x, a crest at x = 0: exact, without mean Eulerian current."""

    type: Literal["stream-function"] = "stream-function"
    height: float | None = Field(default=None, gt=0, description="height, crest above trough [m]")
    steepness: float | None = Field(default=None, gt=0, lt=1, description="height over that of the highest wave [-]")
    waves: int = Field(default=1, ge=1, description="number of waves around the ring")

    @model_validator(mode="after")
    def _one_height(self) -> Self:
        if (self.height is None) == (self.steepness is None):
            raise ValueError("must have exactly one of the keys 'height' and 'steepness'")
        return self

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return one of the waves; raises ``InputError`` if it cannot be had."""
        length = tank.length / self.waves
        height = self.height or (self.steepness or 0.0) * maximum_height(length, tank.depth)
        try:
            return stream_function_wave(height, length, depth=tank.depth, gravity=tank.gravity)
        except InputError as error:
            raise InputError(f"initial: {error}") from None

    def surface(self, tank: AnyTank, x: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x [m], each of shape (N,); raises as ``wave`` does."""
        return self.wave(tank).surface(x)

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield a tank that is no ring, and a height that no wave has."""
        if not isinstance(scene.tank, RingTank):
            yield Problem(("initial", "type"), self.type, "needs a ring (tank.type): walls reflect such waves")
            return
        highest = maximum_height(scene.tank.length / self.waves, scene.tank.depth)
        if self.height is not None and self.height >= highest:
            allowed = f"must be below that of the highest wave of this length, {highest:.4g} m"
            yield Problem(("initial", "height"), self.height, allowed)


class SolitaryWave(Noun):
    """The solitary wave, travelling to +x; exact where both ends of the tank are far."""

    type: Literal["solitary-wave"] = "solitary-wave"
    height: float = Field(gt=0, description="height of the crest above still water [m]")
    x: float = Field(description="where the crest is [m]")

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return the wave."""
        return solitary_wave(self.height, depth=tank.depth, gravity=tank.gravity)

    def surface(self, tank: AnyTank, x: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x [m], each of shape (N,)."""
        return self.wave(tank).surface(x - self.x)

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield a tank without ends, a crest outside and a wave too high."""
        if isinstance(scene.tank, RingTank):
            yield Problem(("initial", "type"), self.type, "needs a slice (tank.type): its potential is not periodic")
        if not 0 <= self.x <= scene.tank.length:
            yield Problem(("initial", "x"), self.x, f"must be inside the tank, 0 to {scene.tank.length:g} m")
        if self.height > HIGHEST_SOLITARY * scene.tank.depth:
            allowed = f"must be at most {HIGHEST_SOLITARY:g} depths, {HIGHEST_SOLITARY * scene.tank.depth:.4g} m"
            yield Problem(("initial", "height"), self.height, allowed)


Initial = Annotated[
    StillWater | StandingWave | StreamFunctionWave | SolitaryWave,
    Field(discriminator="type", description="the state at t = 0"),
]


# ---------------------------------------------------------------- gauges, run, numerics, output
class Gauge(Noun):
    """A place where the elevation is recorded."""

    name: str = Field(min_length=1, description="name of the gauge")
    x: float = Field(description="distance from the paddle's rest position, or along the ring [m]")


def _named(gauges: Any) -> Any:
    """Return gauges given as numbers or without a name as tables with the names 1, 2, ...; the rest as it is."""
    if not isinstance(gauges, Sequence) or isinstance(gauges, str):
        return gauges
    tables = (gauge if isinstance(gauge, dict | Gauge) else {"x": gauge} for gauge in gauges)
    return tuple(
        gauge if isinstance(gauge, Gauge) else {"name": str(n), **gauge} for n, gauge in enumerate(tables, start=1)
    )


class Run(Noun):
    """How long is computed."""

    duration: float = Field(gt=0, description="simulated time [s]")
    on_breaking: Literal["stop", "dissipate"] = Field(default="stop", description="what to do when a wave breaks")


IntegratorName = Literal["third-order", "stormer-verlet", "stormer-verlet-adjoint", "gauss-legendre-4"]


class Numerics(Noun):
    """How it is computed. Where an accuracy is asked for, what is not set is planned."""

    accuracy: float | None = Field(
        default=None, gt=0, lt=1, description="relative error of the elevation to plan the numerics for"
    )
    cells: int | None = Field(default=None, ge=1, description="number of cells along the tank")
    cell_size: float | None = Field(default=None, gt=0, description="size of a cell [m], rounded to divide the length")
    order: int = Field(default=3, ge=1, le=8, description="horizontal polynomial order p")
    vertical_order: int = Field(default=8, ge=1, le=16, description="vertical polynomial order n")
    dt: float | None = Field(default=None, gt=0, description="time step [s]; default: from accuracy and stability")
    integrator: IntegratorName = Field(default="third-order", description="time integrator")
    tolerance: float = Field(default=1e-7, gt=0, lt=1, description="relative tolerance of implicit stages")
    edge_penalty: float = Field(
        default=0.25, ge=0, le=10, description="strength of the penalty on kinks under steep crests [-]; 0 is none"
    )

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        if self.cells is not None and self.cell_size is not None:
            raise ValueError("must have at most one of the keys 'cells' and 'cell_size'")
        return self

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield too few cells for the tank."""
        fewest = scene.tank.fewest_cells
        if self.cells is not None and self.cells < fewest:
            yield Problem(("numerics", "cells"), self.cells, f"must be at least {fewest} in a {scene.tank.type}")

    def cells_in(self, tank: AnyTank) -> int:
        """Return the number of cells; where neither number nor size is given, cells of about a fifth of the depth."""
        size = tank.depth / 5 if self.cell_size is None else self.cell_size
        return max(tank.fewest_cells, round(tank.length / size)) if self.cells is None else self.cells

    @model_serializer(mode="wrap")
    def _without_what_is_planned(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values: dict[str, Any] = dump(self)
        return {key: values[key] for key in values if self.accuracy is None or key in self.model_fields_set}


class Output(Noun):
    """What is recorded, and how often."""

    energy_every: int = Field(default=1, ge=1, description="steps between rows of the energy budget")
    gauges_every: int = Field(default=1, ge=1, description="steps between rows of the gauges' record")
    surface_every: float | None = Field(
        default=None, gt=0, description="time between snapshots of the surface [s]; default: 200 to 1000 snapshots"
    )


# ---------------------------------------------------------------- the scene
class Scene(Noun):
    """What stands in the laboratory, and what is to be computed of it.

    ``Scene.model_validate(scene.model_dump(mode="json"))`` is the same scene.
    """

    title: str = Field(default="", description="what the case is, in a few words")
    tank: Tank
    wall: Wall = FixedWall()
    water: Water | None = Field(default=None, description="the waves' theory; default: nonlinear, or by accuracy")
    initial: Initial = StillWater()
    gauges: Annotated[tuple[Gauge, ...], BeforeValidator(_named)] = Field(default=(), description="the gauges")
    run: Run = Field(description="how long is computed")
    numerics: Numerics = Numerics()
    output: Output = Output()

    @classmethod
    def from_toml(cls, path: Path | str, overrides: Sequence[str] = ()) -> "Scene":
        """Return the scene of a case file, with ``KEY=VALUE`` overrides such as ``"numerics.dt=0.01"``.

        Raises ``InputError`` that lists everything that is wrong, one line each: the file, the line, the key, the value
        received and what is allowed.
        """
        from wavetank.case_file import read_case  # which needs Scene

        return read_case(Path(path), overrides)

    @property
    def physics(self) -> Physics:
        """The type of the water, default resolved."""
        return "nonlinear" if self.water is None else self.water.type

    @property
    def cells(self) -> int:
        """The number of cells along the tank, default resolved."""
        return self.numerics.cells_in(self.tank)

    @property
    def reach(self) -> float:
        """Where the wall's mapping has died out [m], default resolved; ``inf`` for a fixed wall."""
        return self.wall.reach_in(self.tank)

    @property
    def surface_every(self) -> float:
        """Time between snapshots of the surface [s]; by default short against a wave period, 200 to 1000 of them."""
        if self.output.surface_every is not None:
            return self.output.surface_every
        short = 0.5 * (self.tank.depth / self.tank.gravity) ** 0.5
        return float(np.clip(short, self.run.duration / 1000, self.run.duration / 200))

    def motion(self) -> motions.Motion:
        """Return the paddle's motion, checked against the run and the tank.

        Raises ``SceneError`` if its file cannot be had or read, ends before the run, or leaves the mapping's reach.
        """
        motion = self.wall.paddle(self.tank)
        if problems := list(self._motion_problems(motion)):
            raise SceneError(problems)
        return motion

    def _motion_problems(self, motion: motions.Motion) -> Iterator[Problem]:
        if motion.duration < self.run.duration:
            allowed = f"must be at most {motion.duration:g} s, where the recorded motion ends"
            yield Problem(("run", "duration"), self.run.duration, allowed)
        end = min(self.run.duration, motion.duration)
        stroke = np.abs(motion.position(np.linspace(0.0, end, 4001, dtype=np.float64))).max()
        if stroke >= self.reach:
            allowed = f"must be more than {stroke:.4g} m, the paddle's largest distance from rest"
            yield Problem(("wall", "reach"), self.reach, allowed)

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        nouns = (self.wall, self.initial, self.numerics)
        problems = [*self._gauge_problems(), *(problem for noun in nouns for problem in noun.problems(self))]
        if problems:
            text = "; ".join(str(problem) for problem in problems)
            raise PydanticCustomError("scene", "{text}", {"text": text, "problems": problems})
        return self

    def _gauge_problems(self) -> Iterator[Problem]:
        count = Counter(gauge.name for gauge in self.gauges)
        for n, gauge in enumerate(self.gauges):
            if not 0 <= gauge.x <= self.tank.length:
                yield Problem(("gauges", n, "x"), gauge.x, f"must be inside the tank, 0 to {self.tank.length:g} m")
            if count[gauge.name] > 1:
                yield Problem(("gauges", n, "name"), gauge.name, "must be a name that no other gauge has")
