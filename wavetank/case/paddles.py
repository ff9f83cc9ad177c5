"""The paddle's motion."""

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from wavetank import data, motions
from wavetank.case.groups import FocusingWaves
from wavetank.case.tanks import AnyTank
from wavetank.errors import InputError
from wavetank.motions.record_file import read_record
from wavetank.values.noun import FilePath, Noun, Problem, SceneError, about, one_of
from wavetank.values.python_file import load
from wavetank.values.quantities import Duration, Height, Ramp


class AtRestMotion(Noun):
    """The paddle stands still."""

    type: Literal["at-rest"] = "at-rest"

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return X = 0."""
        return motions.AtRest()


class SinusoidMotion(Noun):
    """X = r(t) a sin(2 pi t / T), with a smooth ramp r."""

    type: Literal["sinusoid"] = "sinusoid"
    formerly: ClassVar[dict[str, str]] = {"amplitude": "paddle_amplitude"}
    paddle_amplitude: Height = Field(description="amplitude a of the paddle, half its stroke [m]")
    period: Duration = Field(description="period T [s]")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the ramped sinusoid."""
        ramp = 2 * self.period if self.ramp is None else self.ramp
        return _ramped(motions.Sinusoid(self.paddle_amplitude, self.period), ramp)


class WaveGroupMotion(FocusingWaves):
    """Waves that meet, by linear theory, in one crest at (focus_x, focus_time)."""

    type: Literal["wave-group"] = "wave-group"

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the ramped group."""
        return _ramped(self.group(tank), self.ramp_length)


class RecordedMotion(Noun):
    """A measured motion from a file of two columns: one spline through its positions or its velocities."""

    type: Literal["recorded"] = "recorded"
    position: FilePath | None = Field(default=None, description="file of t [s] and X [m]; default: by velocity")
    velocity: FilePath | None = Field(default=None, description="file of t [s] and dX/dt [m/s]; default: by position")
    ramp: Ramp = Field(default=0.0, description="length of a ramp from the record's start [s]; 0 is none")

    _one_file = one_of("position", "velocity")

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the spline's motion; raises ``SceneError`` if the file cannot be had or read."""
        if self.position is not None:
            record = motions.Recorded.of_positions(*_record("position", self.position))
        else:
            record = motions.Recorded.of_velocities(*_record("velocity", str(self.velocity)))
        return _ramped(record, self.ramp, start=max(0.0, record.start))


class PythonMotion(Noun):
    """X(t) and its derivatives by a function in a Python file, which is run: it must be one that is trusted."""

    type: Literal["python"] = "python"
    file: FilePath = Field(description="Python file")
    function: str = Field(
        default="motion", min_length=1, description="name of a function of t [s] and the derivative's order, 0 to 2"
    )
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank) -> motions.Motion:
        """Return the ramped motion; raises ``SceneError`` if the file cannot be had or run, or has no such function."""
        with about("wall", "motion", "file"):
            function = load(data.resolve(self.file, Path()), self.function)
        return _ramped(motions.Programmed(function), self.ramp)


def _record(key: str, reference: str) -> tuple[motions.Array, motions.Array]:
    try:
        return read_record(data.resolve(reference, Path()))
    except InputError as error:
        raise SceneError([Problem(("wall", "motion", key), reference, str(error).removesuffix("."))]) from None


def _ramped(motion: motions.Motion, ramp: float, *, start: float = 0.0) -> motions.Motion:
    return motions.Ramped(motion, ramp, start) if ramp > 0 else motion


PaddleMotion = Annotated[
    AtRestMotion | SinusoidMotion | WaveGroupMotion | RecordedMotion | PythonMotion,
    Field(discriminator="type", description="motion of the paddle"),
]
