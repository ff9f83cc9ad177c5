"""Motions of a paddle that moves as a whole."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, Strict, model_validator

from wavetank import data
from wavetank import motion as motions
from wavetank.case.tank import AnyTank, Context
from wavetank.case.waves import (
    MAX_COMPONENTS,
    MOTION_KEY,
    ComponentFile,
    FocusingWaves,
    GeneratingMotion,
    MotionModel,
    SpectralWaves,
    SurfaceFile,
)
from wavetank.errors import InputError
from wavetank.motion.recorded import ColumnError, in_metres, read_record
from wavetank.run_warning import RunWarning
from wavetank.values.case_model import (
    CaseError,
    FilePath,
    Problem,
    TimeFormulaText,
    TimeHelpers,
    about,
    one_of,
)
from wavetank.values.formula import Formula
from wavetank.values.python_file import load
from wavetank.values.quantities import Coordinate, Duration, Frequency, Height, Length, Ramp
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.solitary_wave import HIGHEST_SOLITARY
from wavetank.waves.spectra import irregular
from wavetank.waves.stream_function import maximum_height
from wavetank.waves.wavemaker import Wavemaker

# ---------------------------------------------------------------- motions by the waves that they make
STOKES_ENDS = 0.25  # of the wave: with a second harmonic as high its trough has a second crest; H L² / d³ = 26
SHALLOWEST = 0.02  # k d: in less water bound and free waves go at one speed to second order
LOWEST_SOLITARY = 1e-4  # depths
MOST_PAIRS = 2000  # components: of so many there are 4 million pairs
MOST_UNEVEN = 200  # components of uneven frequencies: their pairs cost 1.4 CPU s
UNEVEN = 1e-6  # of the mean spacing of frequencies

Heights = Annotated[tuple[Height, Height], Strict(False)]
Periods = Annotated[tuple[Duration, Duration], Strict(False)]
Frequencies = Annotated[tuple[Frequency, Frequency], Strict(False)]


class MadeWaves(GeneratingMotion):
    """Waves that a paddle generates by its transfer function, all along x."""

    generation: Literal["linear", "second-order"] | None = Field(
        default=None,
        description="second-order adds the motion that suppresses free waves at sums and differences of frequencies; "
        "default: second-order where its theory holds, otherwise linear",
    )

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion, of many components from a table."""
        second_order = self.generation_in(tank, wavemaker, physics)[0] == "second-order"
        generate = motions.second_order_motion if second_order else motions.first_order_motion
        return motions.ramped(generate(self.target(tank), wavemaker).tabulated(), self.ramp_in(tank))

    def generation_in(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> tuple[str, str]:
        """Return the order of generation, default resolved, and why it is linear by default in nonlinear water."""
        if self.generation is not None:
            return self.generation, ""
        reason = "" if physics == "linear" else self._linear_reason(tank, wavemaker)
        return "linear" if physics == "linear" or reason else "second-order", reason

    def _linear_reason(self, tank: AnyTank, wavemaker: Wavemaker) -> str:
        """Return why second-order generation is not the default: it does not hold or costs too much; else empty."""
        target = self.target(tank)
        count, shallowest = target.omega.size, float(target.k_x.min() * tank.depth)
        if count > MOST_PAIRS:
            return f"{count} components are more than {MOST_PAIRS}"
        if count > MOST_UNEVEN and np.ptp(np.diff(np.sort(target.omega))) > UNEVEN * np.ptp(target.omega) / count:
            return f"{count} components of uneven frequencies are more than {MOST_UNEVEN}"
        if shallowest < SHALLOWEST:
            return f"k d = {shallowest:.2g} of the longest wave is below {SHALLOWEST:g}"
        if (second := bound_harmonic(target)) > STOKES_ENDS:
            return (
                f"the bound second harmonic is {second:.2g} of the wave, and {STOKES_ENDS:g} is the limit of the theory"
            )
        return ""

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield waves for which second-order generation has no meaning."""
        if self.generation != "second-order":
            return
        target = self.target(context.tank)
        if target.omega.size > MOST_PAIRS:
            allowed = f"must be linear: there are {target.omega.size} components, and it is for at most {MOST_PAIRS}"
            yield self.problem("generation", allowed)
        elif target.k_x.min() * context.tank.depth < SHALLOWEST:
            yield self.problem("generation", f"must be linear: its theory needs waves of k d of {SHALLOWEST:g} or more")
        elif (second := bound_harmonic(target)) >= 1.0:
            allowed = f"must be linear: the theory ends far below a second harmonic of {second:.3g} of the wave"
            yield self.problem("generation", allowed)

    def warnings(self, tank: AnyTank, wavemaker: Wavemaker) -> Iterator[RunWarning]:
        """Yield a warning if second-order generation is beyond its theory."""
        if self.generation != "second-order":
            return
        if (second := bound_harmonic(self.target(tank))) > STOKES_ENDS:
            yield RunWarning("second-order-limit", key="wall.motion.generation", value=second, limit=STOKES_ENDS)


def bound_harmonic(waves: PlaneWaves) -> float:
    """Return Stokes' second harmonic over the first of a regular wave as high as these, at their mean wave number.

    It is k a (3 - sigma²) / (4 sigma³), sigma = tanh(k d), and a = (2 m0)^(1/2): in shallow water 3 / 32 pi² of
    Ursell's H L² / d³.
    """
    energy = np.abs(waves.amplitudes) ** 2
    k, a = float(energy @ waves.k_x / energy.sum()), float(np.sqrt(energy.sum()))
    sigma = float(np.tanh(k * waves.depth))
    return k * a * (3.0 - sigma**2) / (4.0 * sigma**3)


def _too_high(key: tuple[str | int, ...], height: float, frequency: float, tank: AnyTank) -> Iterator[Problem]:
    """Yield a height [m] that no wave of a frequency [Hz] reaches."""
    length = 2.0 * np.pi / float(airy.wave_number(2.0 * np.pi * frequency, tank.depth, tank.gravity))
    if height >= (highest := maximum_height(length, tank.depth)):
        allowed = f"must be below that of the highest wave, {highest:.4g} m at a length of {length:.4g} m"
        yield Problem((*MOTION_KEY, *key), height, allowed)


class RegularMotion(MadeWaves):
    """Regular waves."""

    type: Literal["regular"] = "regular"
    height: Height = Field(description="height H of the waves, crest above trough [m]")
    period: Duration | None = Field(default=None, description="period T [s]; default: by frequency or wave length")
    frequency: Frequency | None = Field(default=None, description="frequency f [Hz]; default: by period or wave length")
    wave_length: Length | None = Field(
        default=None, description="wave length, by linear theory [m]; default: by period or frequency"
    )
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    _one_period = one_of("period", "frequency", "wave_length")

    def frequency_in(self, tank: AnyTank) -> float:
        """Return f [Hz]."""
        if self.wave_length is not None:
            k = 2.0 * np.pi / self.wave_length
            return float(airy.angular_frequency(k, tank.depth, tank.gravity)) / (2.0 * np.pi)
        return 1.0 / self.period if self.frequency is None else self.frequency  # type: ignore[operator]

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the wave, with a crest at the paddle at t = 0."""
        f, a = np.array([self.frequency_in(tank)]), np.array([self.height / 2.0])
        return waves_along(f, a, np.zeros(1), depth=tank.depth, gravity=tank.gravity)

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two periods [s]."""
        return 2.0 / self.frequency_in(tank)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a height that no wave reaches, and what second-order generation cannot do."""
        too_high = list(_too_high(("height",), self.height, self.frequency_in(context.tank), context.tank))
        yield from too_high or super().problems(context)


class BichromaticMotion(MadeWaves):
    """Two regular waves, which form groups."""

    type: Literal["bichromatic"] = "bichromatic"
    heights: Heights = Field(description="heights of both waves, crest above trough [m]")
    periods: Periods | None = Field(default=None, description="their periods [s]; default: by frequencies")
    frequencies: Frequencies | None = Field(default=None, description="their frequencies [Hz]; default: by periods")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two of the longer periods")

    _one_pair = one_of("periods", "frequencies")

    @model_validator(mode="after")
    def _two(self) -> "BichromaticMotion":
        if len(set(self.pair)) == 1:
            raise ValueError("must have two waves of different periods (type regular makes one)")
        return self

    @property
    def pair(self) -> tuple[float, float]:
        """Both frequencies [Hz]."""
        if self.frequencies is not None:
            return self.frequencies
        first, second = self.periods or (np.inf, np.inf)
        return 1.0 / first, 1.0 / second

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves, with both crests at the paddle at t = 0."""
        amplitudes = np.divide(self.heights, 2.0)
        return waves_along(self.pair, amplitudes, np.zeros(2), depth=tank.depth, gravity=tank.gravity)

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two of the longer periods [s]."""
        return 2.0 / min(self.pair)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield heights that no wave reaches, and what second-order generation cannot do."""
        both = zip(range(2), self.heights, self.pair, strict=True)
        too_high = [one for n, height, f in both for one in _too_high(("heights", n), height, f, context.tank)]
        yield from too_high or super().problems(context)


class IrregularMotion(SpectralWaves, MadeWaves):
    """An irregular sea: the same waves of a seed on any machine, and on any number of ranks."""

    highest_of_peak: ClassVar[float] = 3.0
    type: Literal["irregular"] = "irregular"
    significant_height: Height = Field(description="significant wave height Hm0 = 4 m0^(1/2) [m]")
    seed: int = Field(default=1, ge=0, le=2**53, description="seed of the random phases")
    random_amplitudes: bool = Field(
        default=False, description="amplitudes are random, too: Hm0 is then that of many seeds' mean"
    )
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 3 fp")
    components: int = Field(default=1000, ge=2, le=MAX_COMPONENTS, description="number of components")

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves, with phases at the paddle."""
        frequencies = self.frequencies(tank)
        amplitudes, phases = irregular(
            self.spectrum.build(tank),
            frequencies,
            significant_height=self.significant_height,
            seed=self.seed,
            random_amplitudes=self.random_amplitudes,
        )
        return waves_along(frequencies, amplitudes, phases, depth=tank.depth, gravity=tank.gravity)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield as any waves of a spectrum, a sea too high, and what second-order generation cannot do."""
        yield from super().problems(context)
        peak = self.spectrum.build(context.tank).peak_frequency
        yield from _too_high(("significant_height",), self.significant_height, peak, context.tank)


class FocusedMotion(FocusingWaves, MadeWaves):
    """Waves that meet, by linear theory, in one crest at (focus_x, focus_time)."""

    type: Literal["focused"] = "focused"


class ComponentsMotion(ComponentFile, MadeWaves):
    """Waves by their components in a file: eta = scale sum a cos(omega (t - time) + phase) at x, by linear theory."""

    type: Literal["components"] = "components"

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield directions, of which it has none, and what second-order generation cannot do."""
        if "direction" in self.columns:
            allowed = "must have no direction, unless wall.type is of segments: all waves go along x"
            yield Problem((*MOTION_KEY, "columns"), None, allowed)
            return
        yield from super().problems(context)


class SurfaceMotion(SurfaceFile, MadeWaves):
    """Waves with a given elevation at a position, from a file, by linear theory."""

    type: Literal["surface"] = "surface"

    def _linear_reason(self, tank: AnyTank, wavemaker: Wavemaker) -> str:
        """Return that a recorded elevation is not of first order."""
        return "the record of a surface has its bound waves already"


class SolitaryWaveMotion(MotionModel):
    """A solitary wave: the paddle moves as the water does in the mean over the depth."""

    generates: ClassVar[bool] = True

    type: Literal["solitary-wave"] = "solitary-wave"
    height: Height = Field(description="height H of the crest above still water [m]")
    generation: Literal["exact", "goring"] = Field(
        default="exact", description="for the exact wave of permanent form, or for Boussinesq's, as Goring's paddle"
    )
    crest_time: Duration | None = Field(
        default=None, description="when the crest would be at x = 0, as if from afar [s]; default: as early as can be"
    )

    def _pushed(self, tank: AnyTank) -> motions.SolitaryPush:
        make = motions.exact_solitary if self.generation == "exact" else motions.goring
        return make(self.height, depth=tank.depth, gravity=tank.gravity)

    def crest_time_in(self, tank: AnyTank) -> float:
        """Return when the crest would be at x = 0 [s], default resolved."""
        return self._pushed(tank).lead if self.crest_time is None else self.crest_time

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the motion."""
        push = self._pushed(tank).scaled(tank.depth / wavemaker.volume(tank.depth))
        return push if self.crest_time is None else replace(push, begin=self.crest_time - push.lead)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a wave too high, and one too early."""
        if self.height > HIGHEST_SOLITARY * context.tank.depth:
            allowed = f"must be at most {HIGHEST_SOLITARY:g} depths, {HIGHEST_SOLITARY * context.tank.depth:.4g} m"
            yield self.problem("height", allowed)
        elif self.height < LOWEST_SOLITARY * context.tank.depth:
            allowed = f"must be at least {LOWEST_SOLITARY:g} depths: the wave is hundreds of depths long"
            yield self.problem("height", allowed)
        elif self.crest_time is not None and self.crest_time < (lead := self._pushed(context.tank).lead):
            yield self.problem("crest_time", f"must be at least {lead:.4g} s: the paddle begins to move as long before")


# ---------------------------------------------------------------- motions by their position
class AtRestMotion(MotionModel):
    """The paddle does not move."""

    type: Literal["at-rest"] = "at-rest"

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return X = 0."""
        return motions.AtRest()


class SinusoidMotion(MotionModel):
    """X = r(t) a sin(2 pi t / T), with a smooth ramp r."""

    type: Literal["sinusoid"] = "sinusoid"
    paddle_amplitude: Height = Field(description="amplitude a of the paddle, half its stroke [m]")
    period: Duration = Field(description="period T [s]")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped sinusoid."""
        ramp = 2 * self.period if self.ramp is None else self.ramp
        return motions.ramped(motions.Sinusoid(self.paddle_amplitude, self.period), ramp)


class RecordedMotion(MotionModel):
    """A measured motion from a file: one spline through its positions or its velocities.

    A file of `wavetank motion`, or a run's `paddle.csv`, which has both and accelerations, gives the same run again.
    """

    type: Literal["recorded"] = "recorded"
    position: FilePath | None = Field(
        default=None, description="file of t [s] and X [m], or a run's paddle.csv; default: by velocity"
    )
    velocity: FilePath | None = Field(default=None, description="file of t [s] and dX/dt [m/s]; default: by position")
    column: str | None = Field(
        default=None,
        min_length=1,
        description="name of its column, of a file whose first column is the time; default: as above",
    )
    gain: Coordinate = Field(default=1.0, description="calibration factor of its values")
    highest_frequency: Frequency | None = Field(
        default=None, description="low-pass limit, for example against sensor noise [Hz]; default: nothing"
    )
    ramp: Ramp = Field(default=0.0, description="length of a ramp from the record's start [s]; 0 is none")

    _one_file = one_of("position", "velocity")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the spline's motion; raises ``CaseError`` if the file cannot be read."""
        if self.position is not None:
            t, *state = self._record("position", self.position, "position [m]")
            if len(state) == 3:
                record = motions.Recorded.of_states(t, *state)
            else:
                record = self._smooth(motions.Recorded.of_positions, t, *state)
        else:
            rows = self._record("velocity", str(self.velocity), "velocity [m/s]")
            record = self._smooth(motions.Recorded.of_velocities, *rows)
        return motions.ramped(record, self.ramp, start=max(0.0, record.start))

    @property
    def in_metres(self) -> bool:
        """See ``MotionModel``."""
        return in_metres(data.resolve(str(self.position or self.velocity), Path()), named=self.column)

    def _smooth(self, of: Callable[..., motions.Recorded], *rows: motions.Array) -> motions.Recorded:
        """Return the motion of a low-pass filtered record; raises ``CaseError`` for too few rows."""
        with about("wall", "motion", "highest_frequency"):
            return of(*rows, highest=self.highest_frequency)

    def _record(self, key: str, reference: str, column: str) -> tuple[motions.Array, ...]:
        """Return the times and the values, with their gain, of a file by its key; raises ``CaseError``."""
        try:
            t, *values = read_record(data.resolve(reference, Path()), column=column, named=self.column)
        except InputError as error:
            of, received = ("column", self.column) if isinstance(error, ColumnError) else (key, reference)
            raise CaseError([Problem(("wall", "motion", of), received, str(error).removesuffix("."))]) from None
        return t, *(self.gain * one for one in values)


class FormulaMotion(MotionModel):
    """X(t) as given, with its derivatives by the chain rule."""

    type: Literal["formula"] = "formula"
    value_keys: ClassVar[tuple[str, ...]] = ("position",)  # keys that errors of its values name
    where: TimeHelpers = Field(default={}, description="parts of it by name, numbers or formulae; default: none")
    position: TimeFormulaText = Field(description="position X(t) [m], positive into the water")
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion."""
        formula = Formula(self.position, where=self.where, variables=("t",))
        return motions.ramped(motions.ByFormula(formula), self.ramp)


class PythonMotion(MotionModel):
    """X(t) and its derivatives by a function in a Python file, which is executed only with `--trust`."""

    type: Literal["python"] = "python"
    value_keys: ClassVar[tuple[str, ...]] = ()
    file: FilePath = Field(description="Python file")
    function: str = Field(
        default="motion", min_length=1, description="name of a function of t [s] and the derivative's order, 0 to 2"
    )
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion; raises ``CaseError`` if the file cannot be executed, or has no such function."""
        with about("wall", "motion", "file"):
            function = load(data.resolve(self.file, Path()), self.function)
        return motions.ramped(motions.Programmed(function), self.ramp)


PaddleMotion = Annotated[
    AtRestMotion
    | SinusoidMotion
    | RegularMotion
    | BichromaticMotion
    | IrregularMotion
    | FocusedMotion
    | ComponentsMotion
    | SurfaceMotion
    | SolitaryWaveMotion
    | FormulaMotion
    | RecordedMotion
    | PythonMotion,
    Field(discriminator="type", description="motion of the paddle"),
]
