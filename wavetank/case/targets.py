"""What ``wavetank calibrate`` looks for a paddle's motion for; a run takes no notice of it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from wavetank import data
from wavetank import motion as motions
from wavetank.case.surroundings import Surroundings
from wavetank.errors import InputError
from wavetank.motion.record_file import read_record
from wavetank.values.noun import FilePath, Noun, Problem, about
from wavetank.values.quantities import Duration, Frequency, Height, Label, Length, Share, metres

KEY = "target"
Time = Annotated[float, Field(ge=-1e9, le=1e9)]


class _Placed(Noun):
    """A target at a place."""

    x: Length = Field(description="where [m]")

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a place outside the tank."""
        if not self.x < scene.tank.length:
            allowed = f"must be inside the tank, below {metres(scene.tank.length)} m"
            yield Problem((KEY, "x"), self.x, allowed)


class CrestTarget(_Placed):
    """A crest: how high, where and when; the waves of `wall.motion` are made higher or lower and moved."""

    type: Literal["crest"] = "crest"
    height: Height = Field(description="height above still water [m]")
    time: Duration = Field(description="when [s]")
    tolerance: Share = Field(
        default=0.01,
        description="of the height; of a wave length the place may miss twice as much, of a period the time",
    )

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a place outside the tank, and a time after the run."""
        yield from super().problems(scene)
        if not self.time < scene.run.duration:
            allowed = f"must be before the run ends, below {scene.run.duration:g} s"
            yield Problem((KEY, "time"), self.time, allowed)


class ComponentsTarget(_Placed):
    """The components that `wall.motion` means, at a place: amplitudes and phases of what is linear of the waves."""

    type: Literal["components"] = "components"
    tolerance: Share = Field(default=0.02, description="of their elevation's root mean square")


class RecordTarget(_Placed):
    """The elevation in a record at a place; what `wall.motion` is, is not asked."""

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
    tolerance: Share = Field(
        default=0.02, description="of the record's root mean square, both without other frequencies"
    )

    def record(self) -> tuple[motions.Array, motions.Array]:
        """Return times [s], delayed, and elevations [m], shapes (N,); raises ``SceneError`` if they cannot be had."""
        with about(KEY, "file"):
            t, eta = self._alone() if self.gauge is None else self._at(self.gauge)
            return t + self.delay, eta

    def _alone(self) -> tuple[motions.Array, ...]:
        return read_record(data.resolve(self.file, Path()), column="elevation [m]")

    def _at(self, gauge: str) -> tuple[motions.Array, ...]:
        series = data.gauge_records(data.opened(self.file.removeprefix("data:")))[0].series
        found = next((one for one in series if one.name == gauge), None)
        if found is None:
            have = ", ".join(one.name for one in series)
            raise InputError(f"{self.file}: has no gauge {gauge!r}; there are {have}.")
        return found.t, found.eta


Target = Annotated[
    CrestTarget | ComponentsTarget | RecordTarget,
    Field(discriminator="type", description="what `wavetank calibrate` looks for a motion for"),
]
