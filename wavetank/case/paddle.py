"""Motions of paddles without segments, and of segments that generate oblique waves.

Angles are in degrees from the normal of the wall into the water, positive towards y, at either end of a basin.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, Strict, model_validator

from wavetank import data
from wavetank import motion as motions
from wavetank.base.case_model import (
    CaseModel,
    Check,
    FilePath,
    Key,
    Problem,
    TimeFormulaText,
    TimeHelpers,
    about,
    one_of,
)
from wavetank.base.formula import Formula
from wavetank.base.python_file import load
from wavetank.base.quantities import Coordinate, Duration, Frequency, Height, Length, Ramp, Time
from wavetank.base.run_warning import RunWarning
from wavetank.case.elevation_file import ElevationFile
from wavetank.case.tank import AnyTank, BasinTank, Context, in_tank, read_file
from wavetank.mesh import MeshFile
from wavetank.motion.motion import widest_segment
from wavetank.motion.recorded import hermite, in_metres, read_record
from wavetank.waves import airy, spectra
from wavetank.waves.focusing import Fan, FocusedGroup, ReflectedGroup
from wavetank.waves.measured import TargetElevation, read_components, target_elevation
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.solitary_wave import HIGHEST_SOLITARY
from wavetank.waves.spectra import irregular, random_directions, uniform
from wavetank.waves.stream_function import maximum_height
from wavetank.waves.wavemaker import Wavemaker

# ---------------------------------------------------------------- motions
MOTION_KEY = ("wall", "motion")
SIZES = ("paddle_amplitude", "wave_amplitude", "linear_crest", "significant_height", "height", "heights")
PERIODS = ("period", "frequency", "wave_length", "periods", "frequencies", "spectrum")
VALUES = ("position", "velocity", "file")
FILE_KEY = (*MOTION_KEY, "file")


class MotionModel(CaseModel):
    """A motion of a paddle.

    Attributes
    ----------
    value_keys
        Keys that errors of the values name, for a motion by a user's function; None for others.
    units_note
        The units of its file, at the end of problems of its size or period; empty for motions without units.
    """

    value_keys: ClassVar[tuple[str, ...] | None] = None
    units_note: ClassVar[str] = ""

    @property
    def reads_file(self) -> bool:
        """Whether it is checked only when its file is read: true if it has a file."""
        return any(self.named_files())

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the motion of a paddle of a mode shape; raises ``CaseError`` if its file cannot be read."""
        raise NotImplementedError

    def generation_in(self, tank: AnyTank, physics: str) -> tuple[str | None, str]:
        """Return the order of generation, default resolved, and why it is linear by default in nonlinear water."""
        return None, ""

    def regular_period(self, tank: AnyTank) -> float | None:
        """Return the period [s] of a motion of one period; None for others."""
        return None

    def band_note(self) -> str:
        """Return the frequencies that are generated of a record; empty for motions without one."""
        return ""

    def problem(self, wall: str, keys: Sequence[str], allowed: str) -> Problem:
        """Return a problem of the motion of a wall at the first of some keys, or of its values, that is set."""
        key = next(key for key in (*keys, *VALUES, "type") if getattr(self, key, None) is not None)
        value = getattr(self, key)
        received = None if isinstance(value, CaseModel) else value
        return Problem((wall, "motion", key), received, f"{allowed}{self.units_note}")

    def warnings(self, tank: AnyTank) -> Iterator[RunWarning]:
        """Yield warnings of the motion; by default none."""
        yield from ()


class GeneratingMotion(MotionModel):
    """A motion that follows, by linear theory, from the generated waves, with a ramp."""

    if TYPE_CHECKING:
        ramp: Ramp | None  # each type has its default

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves by linear theory, without a ramp; raises ``CaseError`` if a file cannot be read."""
        raise NotImplementedError

    def default_ramp(self, tank: AnyTank) -> float:
        """Return the default length of the ramp [s]: two periods of the highest wave."""
        waves = self.target(tank)
        return 4.0 * np.pi / float(waves.omega[np.abs(waves.amplitudes).argmax()])

    def along(self, tank: AnyTank, f: ArrayLike, amplitudes: ArrayLike, phases: ArrayLike, **more: Any) -> PlaneWaves:
        """Return plane waves in a tank, with phases at (x, y) if the motion sets these; see ``waves_along``."""
        place = {key: getattr(self, key, 0.0) for key in ("x", "y")}
        return waves_along(f, amplitudes, phases, depth=tank.depth, gravity=tank.gravity, **place, **more)

    def ramp_in(self, tank: AnyTank) -> float:
        """Return the length of the ramp [s], default resolved."""
        return self.default_ramp(tank) if self.ramp is None else self.ramp


# ---------------------------------------------------------------- spectra
Gamma = Annotated[float, Field(ge=1, le=100)]


class _Peaked(CaseModel):
    """A spectrum with a given peak."""

    peak_frequency: Frequency | None = Field(default=None, description="peak frequency fp [Hz]; default: by period")
    peak_period: Duration | None = Field(default=None, description="peak period Tp [s]; default: by frequency")

    _one_peak = one_of("peak_frequency", "peak_period")

    @property
    def peak(self) -> float:
        """The peak frequency [Hz]."""
        return 1.0 / self.peak_period if self.peak_frequency is None else self.peak_frequency  # type: ignore[operator]

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f), JONSWAP's or, without ``gamma``, Pierson's and Moskowitz's."""
        return spectra.jonswap(self.peak, getattr(self, "gamma", 1.0))


class JonswapSpectrum(_Peaked):
    """The JONSWAP spectrum's shape."""

    type: Literal["jonswap"] = "jonswap"
    gamma: Gamma = Field(default=3.3, description="peak enhancement gamma [-]")


class PiersonMoskowitzSpectrum(_Peaked):
    """The Pierson-Moskowitz spectrum's shape, of a fully developed sea."""

    type: Literal["pierson-moskowitz"] = "pierson-moskowitz"


class TmaSpectrum(_Peaked):
    """The TMA spectrum's shape: JONSWAP's in the depth of the tank."""

    type: Literal["tma"] = "tma"
    gamma: Gamma = Field(default=3.3, description="peak enhancement gamma [-]")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f)."""
        return spectra.tma(super().build(tank), tank.depth, tank.gravity)


class GaussianSpectrum(_Peaked):
    """A Gaussian spectrum's shape."""

    type: Literal["gaussian"] = "gaussian"
    bandwidth: Frequency = Field(description="standard deviation [Hz]")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f)."""
        return spectra.gaussian(self.peak, self.bandwidth)


class TableSpectrum(CaseModel):
    """A spectrum's shape from a file, interpolated linearly between its rows."""

    type: Literal["table"] = "table"
    file: FilePath = Field(description="file of frequencies f [Hz], ascending, and densities S, up to a factor")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f); raises ``CaseError`` if the file cannot be read."""
        return read_file(self.file, spectra.read_spectrum, *MOTION_KEY, "spectrum", "file")


Spectrum = Annotated[
    JonswapSpectrum | PiersonMoskowitzSpectrum | TmaSpectrum | GaussianSpectrum | TableSpectrum,
    Field(discriminator="type", description="shape S(f)"),
]


# ---------------------------------------------------------------- waves of a spectrum
MAX_COMPONENTS = 10_000  # largest number of components
MIN_DENSITY = 1e-6  # spectral density over the peak below which there are no waves


class SpectralWaves(GeneratingMotion):
    """Waves of equally spaced frequencies."""

    highest_of_peak: ClassVar[float] = 2.0  # default highest frequency over fp
    spectrum: Spectrum
    lowest_frequency: Frequency | None = Field(default=None, description="first component [Hz]; default fp / 2")
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 2 fp")
    components: int = Field(default=128, ge=2, le=MAX_COMPONENTS, description="number of components")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two peak periods")

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two peak periods [s]."""
        return 2 / self.spectrum.build(tank).peak_frequency

    def band(self, tank: AnyTank) -> tuple[float, float]:
        """Return the first and the last frequency [Hz], defaults resolved."""
        peak = self.spectrum.build(tank).peak_frequency
        lowest = peak / 2 if self.lowest_frequency is None else self.lowest_frequency
        return lowest, self.highest_of_peak * peak if self.highest_frequency is None else self.highest_frequency

    def frequencies(self, tank: AnyTank) -> motions.Array:
        """Return the components' frequencies [Hz], shape (components,)."""
        return np.linspace(*self.band(tank), self.components, dtype=np.float64)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the band has the peak and waves, which do not repeat within the run."""
        (lowest, highest), spectrum = self.band(end.tank), self.spectrum.build(end.tank)
        peak = spectrum.peak_frequency
        within = f"must have its peak, {peak:g} Hz, within the components' band, {lowest:g} to {highest:g} Hz"
        yield "spectrum", lowest < peak < highest, within, True
        total = spectrum.density(self.frequencies(end.tank)).sum()
        allowed = "must be more: none of their frequencies is where the spectrum has its waves"
        yield "components", total > MIN_DENSITY * float(spectrum.density(np.array([peak]))[0]), allowed, True
        repetition, longest = ((count - 1) / (highest - lowest) for count in (self.components, MAX_COMPONENTS))
        allowed = f"must be at most {longest:.6g} s: {MAX_COMPONENTS} components, the most, repeat the waves after it"
        yield (("run", "duration"), end.duration), end.duration <= longest, allowed, True
        least = int(np.ceil(end.duration * (highest - lowest))) + 1
        allowed = f"must be {least} or more: so few repeat the waves every {repetition:.4g} s, within the run"
        yield "components", end.duration <= repetition, allowed
        yield from super().checks(end)


class IrregularWaves(SpectralWaves):
    """An irregular sea."""

    highest_of_peak: ClassVar[float] = 3.0
    significant_height: Height = Field(description="significant wave height Hm0 = 4 m0^(1/2) [m]")
    seed: int = Field(default=1, ge=0, le=2**53, description="seed of the random phases")
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 3 fp")
    components: int = Field(default=1000, ge=2, le=MAX_COMPONENTS, description="number of components")


class FocusingWaves(SpectralWaves):
    """Waves that meet, by linear theory, in one crest at focus_x and focus_time."""

    linear_crest: Height = Field(description="height of the crest at the focus above still water, by linear theory [m]")
    focus_x: Length = Field(description="x of the focus [m]")
    focus_time: Duration = Field(description="time of the focus [s]")
    phase: float = Field(
        default=0.0, ge=-360, le=360, description="phase at the focus [deg]: 0 for a crest, 180 for a trough"
    )

    def group(self, tank: AnyTank) -> FocusedGroup:
        """Return the group without side walls."""
        return FocusedGroup(
            amplitude=self.linear_crest,
            spectrum=self.spectrum.build(tank),
            frequencies=self.frequencies(tank),
            focus_x=self.focus_x,
            focus_y=getattr(self, "focus_y", 0.0),
            focus_time=self.focus_time,
            depth=tank.depth,
            gravity=tank.gravity,
            phase=float(np.radians(self.phase)),
            fan=self.fan,
        )

    @property
    def fan(self) -> Fan:
        """The directions of the waves: along x."""
        return Fan()

    def focused(self, tank: AnyTank) -> FocusedGroup | ReflectedGroup:
        """Return the group that is generated."""
        return self.group(tank)

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves by linear theory."""
        return self.focused(tank).target

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of a spectrum, a focus inside the tank, and the arrival of the waves in time."""
        yield in_tank(end.tank, self.focus_x, key="focus_x")
        yield from super().checks(end)
        earliest = self.focused(end.tank).earliest_focus(self.ramp_in(end.tank))
        allowed = f"must be at least {earliest:.4g} s: the short waves need that long from the ramp's end to focus_x"
        yield "focus_time", self.focus_time >= earliest, allowed


# ---------------------------------------------------------------- waves of a file
Column = Literal["frequency", "omega", "amplitude", "phase", "lag", "direction", "other"]


class ComponentFile(GeneratingMotion):
    """Components eta = scale sum a cos(omega (t - time) + phase) at a position, by linear theory."""

    file: FilePath = Field(description="file with a row for each component")
    columns: Annotated[tuple[Column, ...], Strict(False)] = Field(
        default=("frequency", "amplitude", "phase"),
        min_length=3,
        max_length=20,
        description="meaning of columns: frequency in Hz or omega in rad/s, amplitude in m, phase in rad or lag, its "
        "negative; for segmented paddles direction in degrees from the wall's normal, positive towards y; other",
    )
    x: Coordinate = Field(default=0.0, description="x to which the phases refer [m]")
    time: Time = Field(default=0.0, description="time to which the phases refer [s]")
    scale: float = Field(default=1.0, ge=1e-12, le=1e12, description="factor of the amplitudes [-]")
    phase: float = Field(default=0.0, ge=-360, le=360, description="added to all phases [deg]: 180 inverts the waves")
    ramp: Ramp | None = Field(
        default=None, description="length of the ramp [s]; default two periods of the highest wave"
    )

    @model_validator(mode="after")
    def _enough_columns(self) -> "ComponentFile":
        one_of_each = all(len({*pair} & {*self.columns}) == 1 for pair in (("frequency", "omega"), ("phase", "lag")))
        if "amplitude" not in self.columns or not one_of_each:
            raise ValueError("columns must have amplitude, one of frequency and omega, and one of phase and lag")
        named = [name for name in self.columns if name != "other"]
        if len({*named}) < len(named):
            raise ValueError("columns must each be named once, but for other")
        return self

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves with phases at (x, y); raises ``CaseError`` if the file cannot be read."""
        f, a, phase, angles = read_file(self.file, lambda path: read_components(path, self.columns), *FILE_KEY)
        return self.along(tank, f, self.scale * a, phase + np.radians(self.phase), angles=angles, time=self.time)


class SurfaceFile(GeneratingMotion, ElevationFile):
    """Waves with a given elevation at a position, from a file."""

    x: Length = Field(description="x of the elevation [m]")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two mean periods")

    def wished(self) -> TargetElevation:
        """Return the elevation; raises ``CaseError`` if the file cannot be read, or has no such waves."""
        t, eta = self.record(*MOTION_KEY)
        with about(*FILE_KEY, received=self.file):
            return target_elevation(t, eta, band=(self.lowest_frequency, self.highest_frequency))

    @property
    def direction(self) -> float:
        """The direction of the waves from the normal of the wall [rad]."""
        return float(np.radians(getattr(self, "angle", 0.0)))

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves of one direction with the elevation at (x, y)."""
        surface = self.wished()
        waves = surface.frequencies, surface.amplitudes, surface.phases
        return self.along(tank, *waves, angles=self.direction, time=surface.begin)

    def band_note(self) -> str:
        """Return the frequencies that are generated of the record, and the key of a limit that is by default."""
        return self.generated_band(self.wished())

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two mean periods [s]."""
        return 2.0 / self.wished().mean_frequency

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the position is in the tank, and that the waves arrive in time, and once."""
        yield in_tank(end.tank, self.x)
        surface, ramp = self.wished(), self.ramp_in(end.tank)
        k = airy.wave_number(2.0 * np.pi * surface.mean_frequency, end.tank.depth, end.tank.gravity)
        speed = float(airy.group_velocity(k, end.tank.depth, end.tank.gravity))
        travel, beyond = self.x / np.cos(self.direction) / speed, self.delay - surface.begin
        ramped = f"after a ramp of {ramp:.4g} s{', the default,' if self.ramp is None else ''}"
        allowed = f"must be at least {beyond + ramp + travel:.4g} s: {ramped} its waves need {travel:.4g} s to x"
        yield "delay", surface.begin >= ramp + travel, allowed
        allowed = f"must be at most {beyond + travel + surface.length:.4g} s: a copy comes before"
        yield "delay", surface.begin <= travel + surface.length, allowed
        again = surface.begin + 2.0 * surface.length
        allowed = f"must be at most {again:.4g} s, when the record's waves come again"
        yield (("run", "duration"), end.duration), end.duration <= again, allowed
        yield from super().checks(end)


# ---------------------------------------------------------------- motions by the waves that they make
MAX_SECOND_HARMONIC = 0.25  # second over first harmonic above which a trough has a second crest; H L² / d³ = 26
MIN_KD = 0.02  # least k d; in shallower water bound and free waves have equal speeds to second order
MIN_SOLITARY_HEIGHT = 1e-4  # least height of a solitary wave over the depth
MAX_PAIRED = 2000  # largest number of components; it has 4 million pairs
MAX_UNEVEN = 200  # largest number of components of uneven frequencies; its pairs cost 1.4 CPU s
SPACING_TOLERANCE = 1e-6  # deviation of the spacing of frequencies, over the mean, above which it is uneven

Heights = Annotated[tuple[Height, Height], Strict(False)]
Periods = Annotated[tuple[Duration, Duration], Strict(False)]
Frequencies = Annotated[tuple[Frequency, Frequency], Strict(False)]


class MadeWaves(GeneratingMotion):
    """Waves along x that a paddle generates by its transfer function."""

    generation: Literal["linear", "second-order"] | None = Field(
        default=None,
        description="second-order adds the motion that suppresses free waves at sums and differences of frequencies; "
        "default: second-order where its theory holds, otherwise linear",
    )

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion; that of many components from a table."""
        second_order = self.generation_in(tank, physics)[0] == "second-order"
        generate = motions.second_order_motion if second_order else motions.first_order_motion
        return motions.ramped(generate(self.target(tank), wavemaker).tabulated(), self.ramp_in(tank))

    def generation_in(self, tank: AnyTank, physics: str) -> tuple[str, str]:
        """Return the order of generation, default resolved, and why it is linear by default in nonlinear water."""
        if self.generation is not None:
            return self.generation, ""
        reason = "" if physics == "linear" else self.linear_reason(self.target(tank))
        return "linear" if physics == "linear" or reason else "second-order", reason

    def linear_reason(self, target: PlaneWaves) -> str:
        """Return why second-order generation is invalid or too expensive, and not the default; else empty."""
        count, second = target.omega.size, bound_harmonic(target)
        if reason := _no_second_order(target):
            return reason
        spacing = np.diff(np.sort(target.omega))
        if count > MAX_UNEVEN and np.ptp(spacing) > SPACING_TOLERANCE * np.ptp(target.omega) / count:
            return f"{count} components of uneven frequencies are more than {MAX_UNEVEN}"
        theory = f"{MAX_SECOND_HARMONIC:g} is the limit of the theory"
        limit = f"the bound second harmonic is {second:.2g} of the wave, and {theory}"
        return limit if second > MAX_SECOND_HARMONIC else ""

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that second-order generation is possible for the waves."""
        if self.generation == "second-order":
            target = self.target(end.tank)
            reason, second = _no_second_order(target), bound_harmonic(target)
            yield "generation", not reason, f"must be linear: {reason}"
            allowed = f"must be linear: the theory ends far below a second harmonic of {second:.3g} of the wave"
            yield "generation", second < 1.0, allowed

    def warnings(self, tank: AnyTank) -> Iterator[RunWarning]:
        """Yield a warning if second-order generation is beyond its theory."""
        if self.generation == "second-order" and (second := bound_harmonic(self.target(tank))) > MAX_SECOND_HARMONIC:
            yield RunWarning(
                "second-order-limit", key="wall.motion.generation", value=second, limit=MAX_SECOND_HARMONIC
            )


def _no_second_order(waves: PlaneWaves) -> str:
    """Return why second-order generation is impossible; empty if it is possible."""
    count, shallowest = waves.omega.size, float(waves.k_x.min() * waves.depth)
    if count > MAX_PAIRED:
        return f"{count} components are more than {MAX_PAIRED}"
    shallow = f"k d = {shallowest:.2g} of the longest wave is below {MIN_KD:g}"
    return shallow if shallowest < MIN_KD else ""


def bound_harmonic(waves: PlaneWaves) -> float:
    """Return Stokes' second harmonic over the first of a regular wave of the same height, at the mean wave number.

    It is k a (3 - sigma²) / (4 sigma³), sigma = tanh(k d), and a = (2 m0)^(1/2): in shallow water 3 / 32 pi² of
    Ursell's H L² / d³.
    """
    energy = np.abs(waves.amplitudes) ** 2
    k, a = float(energy @ waves.k_x / energy.sum()), float(np.sqrt(energy.sum()))
    sigma = float(np.tanh(k * waves.depth))
    return k * a * (3.0 - sigma**2) / (4.0 * sigma**3)


def _below_highest(key: str | tuple[Key, float], height: float, frequency: float, tank: AnyTank) -> Check:
    """Return the check that a wave of a height [m] and a frequency [Hz] exists."""
    length = 2.0 * np.pi / float(airy.wave_number(2.0 * np.pi * frequency, tank.depth, tank.gravity))
    highest = maximum_height(length, tank.depth)
    allowed = f"must be below that of the highest wave, {highest:.4g} m at a length of {length:.4g} m"
    return key, height < highest, allowed


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

    def regular_period(self, tank: AnyTank) -> float:
        """Return the period [s]."""
        return 1.0 / self.frequency_in(tank)

    def frequency_in(self, tank: AnyTank) -> float:
        """Return the frequency [Hz]."""
        if self.wave_length is not None:
            k = 2.0 * np.pi / self.wave_length
            return float(airy.angular_frequency(k, tank.depth, tank.gravity)) / (2.0 * np.pi)
        return 1.0 / self.period if self.frequency is None else self.frequency  # type: ignore[operator]

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the wave, with a crest at the paddle at t = 0."""
        return self.along(tank, [self.frequency_in(tank)], [self.height / 2.0], [0.0])

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the wave exists, and the conditions of second-order generation."""
        yield _below_highest("height", self.height, self.frequency_in(end.tank), end.tank)
        yield from super().checks(end)


class BichromaticMotion(MadeWaves):
    """Two regular waves, which form groups."""

    type: Literal["bichromatic"] = "bichromatic"
    heights: Heights = Field(description="heights of both waves, crest above trough [m]")
    periods: Periods | None = Field(default=None, description="periods of both waves [s]; default: by frequencies")
    frequencies: Frequencies | None = Field(
        default=None, description="frequencies of both waves [Hz]; default: by periods"
    )
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default twice the longer period")

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
        return self.along(tank, self.pair, np.divide(self.heights, 2.0), np.zeros(2))

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two of the longer periods [s]."""
        return 2.0 / min(self.pair)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the waves exist, and the conditions of second-order generation."""
        for n, (height, f) in enumerate(zip(self.heights, self.pair, strict=True)):
            yield _below_highest(((end.key, "motion", "heights", n), height), height, f, end.tank)
        yield from super().checks(end)


class IrregularMotion(IrregularWaves, MadeWaves):
    """An irregular sea; a seed gives the same waves on all machines and numbers of ranks."""

    type: Literal["irregular"] = "irregular"
    random_amplitudes: bool = Field(
        default=False, description="random amplitudes: Hm0 is then the mean over many seeds"
    )

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
        return self.along(tank, frequencies, amplitudes, phases)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of a spectrum, and a limit of the height."""
        yield from super().checks(end)
        peak = self.spectrum.build(end.tank).peak_frequency
        yield _below_highest("significant_height", self.significant_height, peak, end.tank)


class FocusedMotion(FocusingWaves, MadeWaves):
    """Waves that meet, by linear theory, in one crest at (focus_x, focus_time)."""

    type: Literal["focused"] = "focused"


class ComponentsMotion(ComponentFile, MadeWaves):
    """Waves by their components in a file: eta = scale sum a cos(omega (t - time) + phase) at x, by linear theory."""

    type: Literal["components"] = "components"

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the waves have no directions, and the conditions of second-order generation."""
        allowed = "must have no direction, unless wall.type is of segments: all waves go along x"
        yield "columns", "direction" not in self.columns, allowed
        yield from super().checks(end)


class SurfaceMotion(SurfaceFile, MadeWaves):
    """Waves with a given elevation at a position, from a file, by linear theory."""

    type: Literal["surface"] = "surface"

    def linear_reason(self, target: PlaneWaves) -> str:
        """Return that a recorded elevation is not of first order."""
        return "the record of a surface has its bound waves already"


class SolitaryWaveMotion(MotionModel):
    """A solitary wave: the paddle moves with the depth-averaged velocity of the water."""

    type: Literal["solitary-wave"] = "solitary-wave"
    height: Height = Field(description="height H of the crest above still water [m]")
    generation: Literal["exact", "goring"] = Field(
        default="exact", description="for the exact wave of permanent form, or by Goring for that of Boussinesq"
    )
    crest_time: Duration | None = Field(
        default=None, description="time of the crest at x = 0, extrapolated [s]; default: the earliest possible"
    )

    def push(self, tank: AnyTank) -> motions.SolitaryPush:
        """Return the motion of a piston that begins at t = 0."""
        make = motions.exact_solitary if self.generation == "exact" else motions.goring
        return make(self.height, depth=tank.depth, gravity=tank.gravity)

    def crest_time_in(self, tank: AnyTank) -> float:
        """Return the time [s] of the crest at x = 0, extrapolated, default resolved."""
        return self.push(tank).lead if self.crest_time is None else self.crest_time

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the motion."""
        push, factor = self.push(tank), tank.depth / wavemaker.volume(tank.depth)
        return push.motion(begin=self.crest_time_in(tank) - push.lead, factor=factor)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the wave exists, and that the paddle begins to move in time."""
        highest = HIGHEST_SOLITARY * end.tank.depth
        yield "height", self.height <= highest, f"must be at most {HIGHEST_SOLITARY:g} depths, {highest:.4g} m"
        allowed = f"must be at least {MIN_SOLITARY_HEIGHT:g} depths: the wave is hundreds of depths long"
        yield "height", self.height >= MIN_SOLITARY_HEIGHT * end.tank.depth, allowed
        if self.crest_time is not None:
            lead = self.push(end.tank).lead
            allowed = f"must be at least {lead:.4g} s: the paddle begins to move as long before"
            yield "crest_time", self.crest_time >= lead, allowed


# ---------------------------------------------------------------- motions by their position
class AtRestMotion(MotionModel):
    """The paddle does not move."""

    type: Literal["at-rest"] = "at-rest"

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return X = 0."""
        return motions.AT_REST


class SinusoidMotion(MotionModel):
    """X = r(t) a sin(2 pi t / T), with a smooth ramp r."""

    type: Literal["sinusoid"] = "sinusoid"
    paddle_amplitude: Height = Field(description="amplitude a of the paddle, half its stroke [m]")
    period: Duration = Field(description="period T [s]")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    def regular_period(self, tank: AnyTank) -> float:
        """Return the period [s]."""
        return self.period

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped sinusoid."""
        ramp = 2 * self.period if self.ramp is None else self.ramp
        return motions.ramped(motions.sinusoid(self.paddle_amplitude, self.period), ramp)


class RecordedMotion(MotionModel):
    """A measured motion from a file: a spline through its positions or its velocities.

    A file of `wavetank motion`, or `paddle.csv` of a run, which also has velocities and accelerations, reproduces the
    run.
    """

    type: Literal["recorded"] = "recorded"
    units_note: ClassVar[str] = "; its times must be in s, its values in m or m/s (wall.motion.gain converts them)"
    position: FilePath | None = Field(
        default=None, description="file of t [s] and X [m], or a run's paddle.csv; default: by velocity"
    )
    velocity: FilePath | None = Field(default=None, description="file of t [s] and dX/dt [m/s]; default: by position")
    column: str | None = Field(
        default=None,
        min_length=1,
        description="name of its column, in a file whose first column is the time; default: as above",
    )
    gain: Coordinate = Field(default=1.0, description="calibration factor of its values")
    highest_frequency: Frequency | None = Field(
        default=None, description="low-pass limit, for example against sensor noise [Hz]; default: none"
    )
    ramp: Ramp = Field(default=0.0, description="length of a ramp from the start of the record [s]; 0: none")

    _one_file = one_of("position", "velocity")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the motion by the spline; raises ``CaseError`` if the file cannot be read."""
        key, column, through = "position", "position [m]", motions.positions_motion
        if self.position is None:
            key, column, through = "velocity", "velocity [m/s]", motions.velocities_motion
        rows = read_file(self._file, lambda path: read_record(path, column=column, named=self.column), *MOTION_KEY, key)
        t, *values = rows[0], *(self.gain * one for one in rows[1:])
        if len(values) == 3:
            record = motions.spline_motion(hermite(t, *values), measured=False)
        else:
            with about(*MOTION_KEY, "highest_frequency"):
                record = through(t, *values, highest=self.highest_frequency)
        return motions.ramped(record, self.ramp, start=max(0.0, record.start))

    @property
    def _file(self) -> str:
        return str(self.position or self.velocity)

    @property
    def in_metres(self) -> bool:
        """Whether the header of its file has units of positions [m] or velocities [m/s]."""
        return in_metres(data.resolve(self._file), named=self.column)


class FormulaMotion(MotionModel):
    """X(t) by a formula, with exact derivatives."""

    type: Literal["formula"] = "formula"
    value_keys: ClassVar[tuple[str, ...]] = ("position",)
    where: TimeHelpers = Field(
        default={}, description="helpers of the formula by name, numbers or formulae; default: none"
    )
    position: TimeFormulaText = Field(description="position X(t) [m], positive into the water")
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion."""
        formula = Formula(self.position, where=self.where, variables=("t",))
        return motions.ramped(motions.formula_motion(formula), self.ramp)


class PythonMotion(MotionModel):
    """X(t) and its derivatives by a function in a Python file, which is executed only with `--trust`."""

    type: Literal["python"] = "python"
    value_keys: ClassVar[tuple[str, ...]] = ()
    file: FilePath = Field(description="Python file")
    function: str = Field(
        default="motion",
        min_length=1,
        description="name of a function of t [s] and the order of the derivative, 0 to 2",
    )
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion; raises ``CaseError`` if the file cannot be executed, or has no such function."""
        function = read_file(self.file, lambda path: load(path, self.function), *FILE_KEY)
        return motions.ramped(motions.programmed_motion(function), self.ramp)


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


# ---------------------------------------------------------------- segmented paddles
Spreading = Annotated[float, Field(ge=0, le=1000)]
Deviation = Annotated[float, Field(ge=0.1, le=90)]
SAMPLES = 101  # samples of a paddle without segments
MAX_UNRESOLVED_ENERGY = 1e-3  # part of the energy of a file's waves for which segments may be too wide
MAX_TERMS = 20_000_000  # terms of the sum over components, directions and places: 320 MB


def span(tank: AnyTank) -> tuple[float, float]:
    """Return the lowest and the highest y [m] of the paddle; infinite if they are in a mesh file only."""
    if not isinstance(tank, BasinTank) or isinstance(tank.layout, MeshFile):
        return -np.inf, np.inf
    y_min = tank.layout.box[1]  # y at which the paddle of each layout begins
    return y_min, y_min + tank.layout.width


class SegmentedWaves(GeneratingMotion):
    """Waves in any directions that a segmented paddle generates."""

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion; raises ``CaseError`` if a file cannot be read."""
        motion = motions.snake_motion(self.target(tank), wavemaker, self.power_period(tank, wavemaker))
        return motions.ramped(motion, self.ramp_in(tank))

    def power_period(self, tank: AnyTank, wavemaker: Wavemaker) -> float | None:
        """Return the period [s] that halves the power of the paddle's velocity; None: by the sum of all waves."""
        return None

    def generation_in(self, tank: AnyTank, physics: str) -> tuple[None, str]:
        """Return why the generation of segments is linear."""
        return None, "second-order generation is for paddles that move as a whole"

    def terms_per_component(self, end: Context) -> int:
        """Return the number of positions along the paddle at which the motion is summed."""
        return int(end.wall.places(end.tank).size)

    def few_enough(self, end: Context, key: str, waves: int) -> Check:
        """Return the check that the waves can be summed at all positions along the paddle."""
        terms = waves * self.terms_per_component(end)
        allowed = f"must be fewer: at all places of the paddle there are {terms:.2g} waves, {MAX_TERMS:.2g} allowed"
        return key, terms <= MAX_TERMS, allowed, True

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that segments are narrow enough for the waves."""
        width, widest = end.wall.segment, self.widest_segment(end.tank)
        allowed = (
            f"must be at most {widest:.4g} m, the shortest wave's length over 1 + sin of its angle: wider segments "
        )
        allowed += "make spurious waves in other directions"
        yield ((end.key, "segment"), width), width is None or width <= widest, allowed
        yield from super().checks(end)

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] above which segments generate spurious waves, for all but 0.001 of the energy."""
        waves = self.target(tank)
        widest = widest_segment(np.hypot(waves.k_x, waves.k_y), np.arctan2(waves.k_y, waves.k_x))
        narrow_first = np.argsort(widest)
        energy = np.cumsum(np.abs(waves.amplitudes[narrow_first]) ** 2)
        return float(widest[narrow_first][np.searchsorted(energy, MAX_UNRESOLVED_ENERGY * energy[-1])])


class ObliqueWaveMotion(SegmentedWaves):
    """A regular wave that leaves the paddle at an angle; side walls reflect it."""

    type: Literal["oblique-wave"] = "oblique-wave"
    wave_amplitude: Height = Field(description="amplitude a of the wave [m]")
    period: Duration = Field(description="period T [s]")
    angle: float = Field(gt=-90, lt=90, description="direction theta from the wall's normal [deg], positive towards y")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    def regular_period(self, tank: AnyTank) -> float:
        """Return the period [s]."""
        return self.period

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the wave, with a crest at (0, 0) at t = 0."""
        return self.along(tank, [1.0 / self.period], [self.wave_amplitude], [0.0], angles=np.radians(self.angle))


class _DirectionalFocus(FocusingWaves, SegmentedWaves):
    """Waves from many directions that meet, by linear theory, in one crest at (focus_x, focus_y, focus_time)."""

    focus_y: Coordinate = Field(default=0.0, description="y of the focus [m]")
    largest_angle: float = Field(default=30.0, ge=0, lt=90, description="angle of the outermost directions [deg]")
    directions: int = Field(default=21, ge=1, le=1000, description="number of directions")
    spreading: float = Field(
        default=0.0, ge=0, le=1000, description="exponent s of the directional spreading cos^2s(theta/2); 0: uniform"
    )

    @property
    def fan(self) -> Fan:
        """The directions of the waves."""
        return Fan(float(np.radians(self.largest_angle)), self.directions, self.spreading)

    def power_period(self, tank: AnyTank, wavemaker: Wavemaker) -> float:
        """Return the period of the group in one direction [s]."""
        return motions.first_order_motion(replace(self.group(tank), fan=Fan()).target, wavemaker).power_period

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] above which segments generate spurious waves, first the shortest and most oblique."""
        group = self.group(tank)
        return float(widest_segment(group.k[-1], group.fan.angles[-1]))

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield a limit of the number of waves, the conditions of a focus, and a focus in front of the paddle."""
        low, high = span(end.tank)
        yield self.few_enough(end, "components", self.components * self.directions)
        yield from super().checks(end)
        yield "focus_y", low <= self.focus_y <= high, f"must be before the paddle, {low:g} to {high:g} m", True


class DirectionalFocusMotion(_DirectionalFocus):
    """The waves travel directly to the focus, as in a sea without side walls."""

    type: Literal["directional-focus"] = "directional-focus"

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of a focus, and that all directions begin at the paddle."""
        yield from super().checks(end)
        low, high = span(end.tank)
        first, last = self.group(end.tank).sources
        widest = np.degrees(np.arctan(min(self.focus_y - low, high - self.focus_y) / self.focus_x))
        allowed = f"must be at most {widest:.4g} deg: waves from further aside would have to come from beyond the "
        allowed += "paddle's ends (type reflected-focus sends them by way of the side walls)"
        yield "largest_angle", low <= first and last <= high, allowed


class ReflectedFocusMotion(_DirectionalFocus):
    """The side walls reflect the waves; they must extend from the ends of the paddle to the focus along x."""

    type: Literal["reflected-focus"] = "reflected-focus"

    def terms_per_component(self, end: Context) -> int:
        """Return the number of positions, or of modes of the basin, over which the motion is summed."""
        low, high = span(end.tank)
        modes = (high - low) / np.pi * float(self.group(end.tank).k[-1])
        return max(super().terms_per_component(end), int(min(modes, MAX_TERMS)))

    def focused(self, tank: AnyTank) -> ReflectedGroup:
        """Return the group between the side walls."""
        y_min, y_max = span(tank)
        return ReflectedGroup(group=self.group(tank), y_min=y_min, y_max=y_max)


class DirectionalIrregularMotion(IrregularWaves, SegmentedWaves):
    """An irregular sea of many directions, one for each component, by a seed. Side walls reflect it."""

    type: Literal["directional-irregular"] = "directional-irregular"
    spreading: Spreading | None = Field(
        default=None, description="exponent s of the density of directions, cos^2s(theta/2); default: by deviation"
    )
    deviation: Deviation | None = Field(
        default=None, description="standard deviation of directions, for a normal density [deg]; default: by spreading"
    )
    largest_angle: float = Field(default=60.0, ge=0.1, lt=90, description="angle of the outermost directions [deg]")

    _one_spread = one_of("spreading", "deviation")

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves, one direction for each frequency, with phases at (0, 0)."""
        f, spectrum = self.frequencies(tank), self.spectrum.build(tank)
        height, seed = self.significant_height, self.seed
        amplitudes, phases = irregular(spectrum, f, significant_height=height, seed=seed)
        random = uniform(self.seed, 3, f.size)[2]
        angles = random_directions(self._density, random, largest=float(np.radians(self.largest_angle)))
        return self.along(tank, f, amplitudes, phases, angles=angles)

    def _density(self, angle: motions.Array) -> motions.Array:
        if self.spreading is not None:
            return np.asarray(np.cos(angle / 2.0) ** (2.0 * self.spreading))
        return np.asarray(np.exp(-0.5 * (np.degrees(angle) / self.deviation) ** 2))

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] above which segments generate spurious waves, first the shortest and most oblique."""
        k = airy.wave_number(2.0 * np.pi * self.band(tank)[1], tank.depth, tank.gravity)
        return float(widest_segment(k, np.radians(self.largest_angle)))

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield a limit of the number of waves, and the conditions of a spectrum."""
        yield self.few_enough(end, "components", self.components)
        yield from super().checks(end)


class _WavesOfFile(SegmentedWaves):
    """Plane waves from a file, each in its direction; side walls reflect them."""

    y: Coordinate = Field(default=0.0, description="y to which the phases refer [m]")

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield a limit of the number of waves, and of the width of segments."""
        yield self.few_enough(end, "file", self.target(end.tank).omega.size)
        yield from super().checks(end)


class DirectionalComponentsMotion(ComponentFile, _WavesOfFile):
    """Waves by their components in a file, each at an angle: sum a cos(omega (t - time) + phase) at (x, y)."""

    type: Literal["components"] = "components"


class DirectionalSurfaceMotion(SurfaceFile, _WavesOfFile):
    """Waves of one direction with a given elevation at a position, from a file."""

    type: Literal["surface"] = "surface"
    angle: float = Field(
        default=0.0,
        gt=-90,
        lt=90,
        description="direction of the waves from the wall's normal [deg], positive towards y",
    )


SegmentedPaddleMotion = Annotated[
    ObliqueWaveMotion
    | DirectionalFocusMotion
    | ReflectedFocusMotion
    | DirectionalIrregularMotion
    | DirectionalComponentsMotion
    | DirectionalSurfaceMotion,
    Field(discriminator="type", description="motion of the paddle's segments"),
]
