"""The paddle's motion."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from wavetank import data
from wavetank import motion as motions
from wavetank.case.formulae import TimeFormulaText, TimeHelpers
from wavetank.case.seas import (
    BichromaticMotion,
    ComponentsMotion,
    FocusedMotion,
    IrregularMotion,
    PaddleNoun,
    RegularMotion,
    SolitaryWaveMotion,
    SurfaceMotion,
)
from wavetank.case.tanks import AnyTank
from wavetank.errors import InputError
from wavetank.motion.record_file import ColumnError, read_record, says_metres
from wavetank.values.formula import Formula
from wavetank.values.noun import FilePath, Problem, SceneError, about, one_of
from wavetank.values.python_file import load
from wavetank.values.quantities import Coordinate, Duration, Frequency, Height, Ramp
from wavetank.waves.wavemaker import Wavemaker


class AtRestMotion(PaddleNoun):
    """The paddle stands still."""

    type: Literal["at-rest"] = "at-rest"

    def build(self, tank: AnyTank, maker: Wavemaker) -> motions.Motion:
        """Return X = 0."""
        return motions.AtRest()


class SinusoidMotion(PaddleNoun):
    """X = r(t) a sin(2 pi t / T), with a smooth ramp r."""

    type: Literal["sinusoid"] = "sinusoid"
    paddle_amplitude: Height = Field(description="amplitude a of the paddle, half its stroke [m]")
    period: Duration = Field(description="period T [s]")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    def build(self, tank: AnyTank, maker: Wavemaker) -> motions.Motion:
        """Return the ramped sinusoid."""
        ramp = 2 * self.period if self.ramp is None else self.ramp
        return motions.ramped(motions.Sinusoid(self.paddle_amplitude, self.period), ramp)


class RecordedMotion(PaddleNoun):
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
    gain: Coordinate = Field(default=1.0, description="what calibration says that its values are to be multiplied by")
    highest_frequency: Frequency | None = Field(
        default=None, description="what is faster, as a sensor's noise, is left out [Hz]; default: nothing"
    )
    ramp: Ramp = Field(default=0.0, description="length of a ramp from the record's start [s]; 0 is none")

    _one_file = one_of("position", "velocity")

    def build(self, tank: AnyTank, maker: Wavemaker) -> motions.Motion:
        """Return the spline's motion; raises ``SceneError`` if the file cannot be had or read."""
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
    def says_metres(self) -> bool:
        """Whether the file says that its values are positions [m] or velocities [m/s]."""
        return says_metres(data.resolve(str(self.position or self.velocity), Path()), named=self.column)

    def _smooth(self, of: Callable[..., motions.Recorded], *rows: motions.Array) -> motions.Recorded:
        """Return the motion of a record without what is too fast; raises ``SceneError`` where its rows are too few."""
        with about("wall", "motion", "highest_frequency"):
            return of(*rows, highest=self.highest_frequency)

    def _record(self, key: str, reference: str, column: str) -> tuple[motions.Array, ...]:
        """Return the times and the values, with their gain, of a file by its key; raises ``SceneError``."""
        try:
            t, *values = read_record(data.resolve(reference, Path()), column=column, named=self.column)
        except InputError as error:
            of, received = ("column", self.column) if isinstance(error, ColumnError) else (key, reference)
            raise SceneError([Problem(("wall", "motion", of), received, str(error).removesuffix("."))]) from None
        return t, *(self.gain * one for one in values)


class FormulaMotion(PaddleNoun):
    """X(t) as given, with its derivatives by the chain rule."""

    type: Literal["formula"] = "formula"
    said_by: ClassVar[tuple[str, ...]] = ("position",)  # of its keys, by which its values are told to be wrong
    where: TimeHelpers = Field(default={}, description="parts of it by name, numbers or formulae; default: none")
    position: TimeFormulaText = Field(description="position X(t) [m], positive into the water")
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank, maker: Wavemaker) -> motions.Motion:
        """Return the ramped motion."""
        formula = Formula(self.position, where=self.where, variables=("t",))
        return motions.ramped(motions.ByFormula(formula), self.ramp)


class PythonMotion(PaddleNoun):
    """X(t) and its derivatives by a function in a Python file, which is executed only with `--trust`."""

    type: Literal["python"] = "python"
    said_by: ClassVar[tuple[str, ...]] = ()
    file: FilePath = Field(description="Python file")
    function: str = Field(
        default="motion", min_length=1, description="name of a function of t [s] and the derivative's order, 0 to 2"
    )
    ramp: Ramp = Field(default=0.0, description="length of the ramp [s]; 0 is none")

    def build(self, tank: AnyTank, maker: Wavemaker) -> motions.Motion:
        """Return the ramped motion; raises ``SceneError`` if the file cannot be had or run, or has no such function."""
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
