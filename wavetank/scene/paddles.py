"""The paddle's motion."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from wavetank import data, motions
from wavetank.errors import InputError
from wavetank.motions.record_file import read_record
from wavetank.scene.noun import FilePath, Noun, Problem, SceneError
from wavetank.scene.tanks import AnyTank

if TYPE_CHECKING:
    from wavetank.scene.scene import Scene


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
    position: FilePath | None = Field(default=None, description="file of t [s] and X [m]")
    velocity: FilePath | None = Field(default=None, description="file of t [s] and dX/dt [m/s]")
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
