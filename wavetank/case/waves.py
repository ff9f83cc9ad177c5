"""Motions of paddles: what all have, and waves by a spectrum or a file, of paddles of any kind."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, Strict, model_validator

from wavetank import data
from wavetank import motion as motions
from wavetank.case.tank import AnyTank, Context
from wavetank.motion.recorded import read_record
from wavetank.run_warning import RunWarning
from wavetank.values.case_model import CaseModel, FilePath, Problem, about, one_of
from wavetank.values.quantities import Coordinate, Duration, Frequency, Height, Length, Ramp, metres
from wavetank.waves import airy, spectra
from wavetank.waves.focusing import Fan, FocusedGroup, ReflectedGroup
from wavetank.waves.measured import Components, WishedSurface, read_components, wished_surface
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.wavemaker import Wavemaker

# ---------------------------------------------------------------- motions
MOTION_KEY = ("wall", "motion")


class MotionModel(CaseModel):
    """A motion of a paddle.

    Attributes
    ----------
    generates
        Whether the motion follows from the waves to be generated.
    reads_file
        Whether it is checked when its file is read, and not before.
    in_metres
        Whether the header of its file has units of positions [m] or velocities [m/s].
    """

    location: ClassVar[tuple[str, ...]] = MOTION_KEY
    generates: ClassVar[bool] = False

    @property
    def reads_file(self) -> bool:
        """See the class."""
        return False

    @property
    def in_metres(self) -> bool:
        """See the class."""
        return False

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the motion of a paddle of a mode shape; raises ``CaseError`` if its file cannot be read."""
        raise NotImplementedError

    def generation_in(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> tuple[str | None, str]:
        """Return the order of generation, default resolved, and why it is linear by default in nonlinear water."""
        return None, ""

    def warnings(self, tank: AnyTank, wavemaker: Wavemaker) -> Iterator[RunWarning]:
        """Yield warnings of the motion; by default none."""
        yield from ()


class GeneratingMotion(MotionModel):
    """A motion that follows from the waves to be generated, by linear theory, with a ramp."""

    if TYPE_CHECKING:
        ramp: Ramp | None  # of its own default in each type

    generates: ClassVar[bool] = True

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves by linear theory, without a ramp; raises ``CaseError`` if a file cannot be read."""
        raise NotImplementedError

    def default_ramp(self, tank: AnyTank) -> float:
        """Return the default length of the ramp [s]."""
        raise NotImplementedError

    def ramp_in(self, tank: AnyTank) -> float:
        """Return the length of the ramp [s], default resolved."""
        return self.default_ramp(tank) if self.ramp is None else self.ramp


# ---------------------------------------------------------------- spectra
SPECTRUM_KEY = ("wall", "motion", "spectrum")
Gamma = Annotated[float, Field(ge=1, le=100)]


class _Peaked(CaseModel):
    """A spectrum whose peak is given."""

    peak_frequency: Frequency | None = Field(default=None, description="peak frequency fp [Hz]; default: by period")
    peak_period: Duration | None = Field(default=None, description="peak period Tp [s]; default: by frequency")

    _one_peak = one_of("peak_frequency", "peak_period")

    @property
    def peak(self) -> float:
        """Fp [Hz]."""
        return 1.0 / self.peak_period if self.peak_frequency is None else self.peak_frequency  # type: ignore[operator]


class JonswapSpectrum(_Peaked):
    """The JONSWAP spectrum's shape."""

    type: Literal["jonswap"] = "jonswap"
    gamma: Gamma = Field(default=3.3, description="peak enhancement gamma [-]")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f)."""
        return spectra.Jonswap(self.peak, self.gamma)


class PiersonMoskowitzSpectrum(_Peaked):
    """The Pierson-Moskowitz spectrum's shape, of a fully developed sea."""

    type: Literal["pierson-moskowitz"] = "pierson-moskowitz"

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f)."""
        return spectra.Jonswap(self.peak, 1.0)


class TmaSpectrum(_Peaked):
    """The TMA spectrum's shape: JONSWAP's in the tank's depth."""

    type: Literal["tma"] = "tma"
    gamma: Gamma = Field(default=3.3, description="peak enhancement gamma [-]")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f)."""
        return spectra.Tma(spectra.Jonswap(self.peak, self.gamma), tank.depth, tank.gravity)


class GaussianSpectrum(_Peaked):
    """A Gaussian spectrum's shape."""

    type: Literal["gaussian"] = "gaussian"
    bandwidth: Frequency = Field(description="standard deviation [Hz]")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f)."""
        return spectra.Gaussian(self.peak, self.bandwidth)


class TableSpectrum(CaseModel):
    """A spectrum's shape from a file, straight between its rows."""

    type: Literal["table"] = "table"
    file: FilePath = Field(description="file of frequencies f [Hz], ascending, and densities S, up to a factor")

    def build(self, tank: AnyTank) -> spectra.Spectrum:
        """Return the shape S(f); raises ``CaseError`` if the file cannot be read."""
        with about(*SPECTRUM_KEY, "file"):
            return spectra.read_spectrum(data.resolve(self.file, Path()))


Spectrum = Annotated[
    JonswapSpectrum | PiersonMoskowitzSpectrum | TmaSpectrum | GaussianSpectrum | TableSpectrum,
    Field(discriminator="type", description="shape S(f)"),
]


# ---------------------------------------------------------------- waves of a spectrum
MAX_COMPONENTS = 10_000  # components
MISSED = 1e-6  # of its peak: of so little there are no waves


class SpectralWaves(GeneratingMotion):
    """Waves of equally spaced frequencies."""

    highest_of_peak: ClassVar[float] = 2.0  # fp, by default
    spectrum: Spectrum
    lowest_frequency: Frequency | None = Field(default=None, description="first component [Hz]; default fp / 2")
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 2 fp")
    components: int = Field(default=128, ge=2, le=MAX_COMPONENTS, description="number of components")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two peak periods")

    @property
    def reads_file(self) -> bool:
        """Whether the spectrum is a file's."""
        return isinstance(self.spectrum, TableSpectrum)

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

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a band without its peak or without waves."""
        (lowest, highest), spectrum = self.band(context.tank), self.spectrum.build(context.tank)
        peak = spectrum.peak_frequency
        if not lowest < peak < highest:
            yield self._outside(peak, lowest, highest)
            return
        total = spectrum.density(self.frequencies(context.tank)).sum()
        if not total > MISSED * float(spectrum.density(np.array([peak]))[0]):
            allowed = "must be more: none of their frequencies is where the spectrum has its waves"
            yield self.problem("components", allowed)
            return
        timing = list(self.timing_problems(context))
        yield from timing
        repetition = (self.components - 1) / (highest - lowest)
        if context.duration > repetition:
            least = int(np.ceil(context.duration * (highest - lowest))) + 1
            if least > MAX_COMPONENTS:
                longest = (MAX_COMPONENTS - 1) / (highest - lowest)
                most = f"{MAX_COMPONENTS} components, the most,"
                allowed = f"must be at most {longest:.6g} s: {most} repeat the waves after it"
                yield Problem(("run", "duration"), context.duration, allowed)
                return
            allowed = f"must be {least} or more: so few repeat the waves every {repetition:.4g} s, within the run"
            yield self.problem("components", allowed)
        elif not timing:
            yield from super().problems(context)

    def _outside(self, peak: float, lowest: float, highest: float) -> Problem:
        """Return the problem of a peak [Hz] outside the components' band."""
        within, key = f"the components' {lowest:g} to {highest:g} Hz", (*MOTION_KEY, "spectrum")
        if isinstance(self.spectrum, TableSpectrum):
            return Problem((*key, "file"), self.spectrum.file, f"must have its peak, {peak:g} Hz, between {within}")
        if self.spectrum.peak_period is not None:
            return Problem((*key, "peak_period"), self.spectrum.peak_period, f"must be that of one of {within}")
        return Problem((*key, "peak_frequency"), peak, f"must be between {within}")

    def timing_problems(self, context: Context) -> Iterator[Problem]:
        """Yield times that are too early; by default none."""
        yield from ()


class FocusingWaves(SpectralWaves):
    """Waves that meet, by linear theory, in one crest at focus_x and focus_time."""

    linear_crest: Height = Field(description="height of the crest at the focus above still water, by linear theory [m]")
    focus_x: Length = Field(description="x of the focus [m]")
    focus_time: Duration = Field(description="when the crests meet [s]")
    phase: float = Field(default=0.0, ge=-360, le=360, description="at the focus [deg]: 0 of a crest, 180 of a trough")

    def group(self, tank: AnyTank, *, fan: Fan | None = None, focus_y: float = 0.0) -> FocusedGroup:
        """Return the group, by default of waves along x."""
        return FocusedGroup(
            amplitude=self.linear_crest,
            spectrum=self.spectrum.build(tank),
            frequencies=self.frequencies(tank),
            focus_x=self.focus_x,
            focus_y=focus_y,
            focus_time=self.focus_time,
            depth=tank.depth,
            gravity=tank.gravity,
            phase=float(np.radians(self.phase)),
            fan=fan or Fan(),
        )

    def focused(self, tank: AnyTank) -> FocusedGroup | ReflectedGroup:
        """Return the group as it is to be generated."""
        return self.group(tank)

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves by linear theory."""
        return self.focused(tank).target

    def timing_problems(self, context: Context) -> Iterator[Problem]:
        """Yield a focus too early."""
        earliest = self.focused(context.tank).earliest_focus(self.ramp_in(context.tank))
        if self.focus_time < earliest:
            allowed = (
                f"must be at least {earliest:.4g} s: the short waves need that long from the ramp's end to focus_x"
            )
            yield self.problem("focus_time", allowed)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield as any waves of a spectrum, and a focus outside the tank."""
        if not self.focus_x < context.tank.length:
            yield self.problem("focus_x", f"must be inside the tank, below {metres(context.tank.length)} m")
        yield from super().problems(context)


# ---------------------------------------------------------------- waves of a file
Column = Literal["frequency", "omega", "amplitude", "phase", "lag", "direction", "other"]


class WaveFile(GeneratingMotion):
    """Waves from a file."""

    @property
    def reads_file(self) -> bool:
        """Whether it is checked when its file is read: yes."""
        return True


class ComponentFile(WaveFile):
    """Components eta = scale sum a cos(omega (t - time) + phase) at a place, by linear theory."""

    file: FilePath = Field(description="file with a row for each component")
    columns: Annotated[tuple[Column, ...], Strict(False)] = Field(
        default=("frequency", "amplitude", "phase"),
        min_length=3,
        max_length=20,
        description="what its columns are: frequency in Hz or omega in rad/s, amplitude in m, phase in rad or lag, its "
        "opposite; of paddles in segments direction in degrees from the wall's normal, positive towards y; other",
    )
    x: Coordinate = Field(default=0.0, description="x to which the phases refer [m]")
    time: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(default=0.0, description="time to which they refer [s]")
    scale: float = Field(default=1.0, ge=1e-12, le=1e12, description="factor of the amplitudes [-]")
    phase: float = Field(default=0.0, ge=-360, le=360, description="added to all phases [deg]: 180 turns crests over")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods of the highest")

    @model_validator(mode="after")
    def _enough_columns(self) -> "ComponentFile":
        one_of_each = all(len({*pair} & {*self.columns}) == 1 for pair in (("frequency", "omega"), ("phase", "lag")))
        if "amplitude" not in self.columns or not one_of_each:
            raise ValueError("columns must have amplitude, one of frequency and omega, and one of phase and lag")
        named = [name for name in self.columns if name != "other"]
        if len({*named}) < len(named):
            raise ValueError("columns must each be named once, but for other")
        return self

    def components(self) -> Components:
        """Return the components that are not 0; raises ``CaseError`` if the file cannot be read."""
        with about(*MOTION_KEY, "file"):
            return read_components(data.resolve(self.file, Path()), self.columns)

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves, whose phases hold at (x, y)."""
        f, a, phase, angles = self.components()
        where = {
            "x": self.x,
            "y": getattr(self, "y", 0.0),
            "time": self.time,
            "depth": tank.depth,
            "gravity": tank.gravity,
        }
        return waves_along(f, self.scale * a, phase + np.radians(self.phase), angles=angles, **where)

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two periods of the highest wave [s]."""
        waves = self.components()
        return 2.0 / float(waves.frequencies[np.abs(waves.amplitudes).argmax()])


class SurfaceFile(WaveFile):
    """The elevation that is wished for at a place."""

    file: FilePath = Field(description="file of t [s] and eta [m]")
    x: Length = Field(description="x of the elevation [m]")
    delay: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(default=0.0, description="added to the file's times [s]")
    lowest_frequency: Frequency | None = Field(
        default=None, description="of waves that are made [Hz]; default a quarter of their mean"
    )
    highest_frequency: Frequency | None = Field(
        default=None, description="of waves that are made [Hz]; default four times their mean"
    )
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two of the mean periods")

    def wished(self) -> WishedSurface:
        """Return the surface; raises ``CaseError`` if the file cannot be read, or has no such waves."""
        with about(*MOTION_KEY, "file"):
            t, eta = read_record(data.resolve(self.file, Path()), column="elevation [m]")
            band = self.lowest_frequency, self.highest_frequency
            return wished_surface(t + self.delay, eta, band=band)

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves, all at one angle, of the elevation at (x, y)."""
        surface, angle = self.wished(), np.radians(getattr(self, "angle", 0.0))
        where = {
            "x": self.x,
            "y": getattr(self, "y", 0.0),
            "time": surface.begin,
            "depth": tank.depth,
            "gravity": tank.gravity,
        }
        return waves_along(surface.frequencies, surface.amplitudes, surface.phases, angles=angle, **where)

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two mean periods [s]."""
        return 2.0 / self.wished().mean_frequency

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a place outside the tank, and waves that come too late."""
        if not self.x < context.tank.length:
            yield self.problem("x", f"must be inside the tank, below {metres(context.tank.length)} m")
            return
        surface, ramp = self.wished(), self.ramp_in(context.tank)
        k = airy.wave_number(2.0 * np.pi * surface.mean_frequency, context.tank.depth, context.tank.gravity)
        travel = self.travel_distance / float(airy.group_velocity(k, context.tank.depth, context.tank.gravity))
        if surface.begin < ramp + travel:
            least = self.delay + ramp + travel - surface.begin
            ramped = f"after a ramp of {ramp:.4g} s{', the default,' if self.ramp is None else ''}"
            yield self.problem("delay", f"must be at least {least:.4g} s: {ramped} its waves need {travel:.4g} s to x")
        elif surface.begin > travel + surface.length:
            allowed = (
                f"must be at most {self.delay + travel + surface.length - surface.begin:.4g} s: a copy comes before"
            )
            yield self.problem("delay", allowed)
        elif context.duration > (again := surface.begin + 2.0 * surface.length):
            allowed = f"must be at most {again:.4g} s, when the record's waves come again"
            yield Problem(("run", "duration"), context.duration, allowed)
        else:
            yield from super().problems(context)

    @property
    def travel_distance(self) -> float:
        """Distance from the paddle to x along the waves' direction [m]."""
        return self.x
