"""Waves of which a file tells: their components, or the elevation at a place."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, Strict, model_validator

from wavetank import data
from wavetank import motion as motions
from wavetank.case.groups import KEY
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank
from wavetank.motion.record_file import read_record
from wavetank.values.noun import FilePath, Noun, Problem, about
from wavetank.values.quantities import Coordinate, Frequency, Length, Ramp, metres
from wavetank.waves import airy
from wavetank.waves.plane_waves import PlaneWaves, waves_along

Column = Literal["frequency", "omega", "amplitude", "phase", "lag", "direction", "other"]


class WaveFile(Noun):
    """Waves that a file tells of."""

    @property
    def reads_file(self) -> bool:
        """Whether what fits it is known only when a file has been read: yes."""
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
    x: Coordinate = Field(default=0.0, description="where the phases hold [m]")
    time: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(default=0.0, description="when they hold [s]")
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

    def components(self) -> motions.Components:
        """Return the components that are not 0; raises ``SceneError`` if the file cannot be had or read."""
        with about(*KEY, "file"):
            return motions.read_components(data.resolve(self.file, Path()), self.columns)

    def target(self, tank: AnyTank, y: float = 0.0) -> PlaneWaves:
        """Return the waves, whose phases hold at (x, y)."""
        f, a, phase, angles = self.components()
        where = {"x": self.x, "y": y, "time": self.time, "depth": tank.depth, "gravity": tank.gravity}
        return waves_along(f, self.scale * a, phase + np.radians(self.phase), angles=angles, **where)

    def ramp_in(self, tank: AnyTank) -> float:
        """Return the length of the ramp [s], default resolved."""
        if self.ramp is not None:
            return self.ramp
        waves = self.components()
        return 2.0 / float(waves.frequencies[np.abs(waves.amplitudes).argmax()])


class SurfaceFile(WaveFile):
    """The elevation that is wished for at a place."""

    file: FilePath = Field(description="file of t [s] and eta [m]")
    x: Length = Field(description="where it is wished for [m]")
    delay: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(default=0.0, description="added to the file's times [s]")
    lowest_frequency: Frequency | None = Field(
        default=None, description="of waves that are made [Hz]; default a quarter of their mean"
    )
    highest_frequency: Frequency | None = Field(
        default=None, description="of waves that are made [Hz]; default four times their mean"
    )
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two of the mean periods")

    def wished(self) -> motions.WishedSurface:
        """Return the surface; raises ``SceneError`` if the file cannot be had or read, or has no such waves."""
        with about(*KEY, "file"):
            t, eta = read_record(data.resolve(self.file, Path()), column="elevation [m]")
            band = self.lowest_frequency, self.highest_frequency
            return motions.wished_surface(t + self.delay, eta, band=band)

    def target(self, tank: AnyTank, y: float = 0.0, angle: float = 0.0) -> PlaneWaves:
        """Return the waves, all at an angle to x [rad], of the elevation at (x, y)."""
        found = self.wished()
        where = {"x": self.x, "y": y, "time": found.begin, "depth": tank.depth, "gravity": tank.gravity}
        return waves_along(found.frequencies, found.amplitudes, found.phases, angles=angle, **where)

    def ramp_in(self, tank: AnyTank) -> float:
        """Return the length of the ramp [s], default resolved."""
        return 2.0 / self.wished().mean_frequency if self.ramp is None else self.ramp

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a place outside the tank, and waves that come too late."""
        if not self.x < scene.tank.length:
            allowed = f"must be inside the tank, below {metres(scene.tank.length)} m"
            yield Problem((*KEY, "x"), self.x, allowed)
            return
        found, ramp = self.wished(), self.ramp_in(scene.tank)
        k = airy.wave_number(2.0 * np.pi * found.mean_frequency, scene.tank.depth, scene.tank.gravity)
        travel = self.way / float(airy.group_velocity(k, scene.tank.depth, scene.tank.gravity))
        if found.begin < ramp + travel:
            least = self.delay + ramp + travel - found.begin
            ramped = f"after a ramp of {ramp:.4g} s{', the default,' if self.ramp is None else ''}"
            allowed = f"must be at least {least:.4g} s: {ramped} its waves need {travel:.4g} s to x"
            yield Problem((*KEY, "delay"), self.delay, allowed)
        elif found.begin > travel + found.length:
            allowed = f"must be at most {self.delay + travel + found.length - found.begin:.4g} s: a copy comes before"
            yield Problem((*KEY, "delay"), self.delay, allowed)
        elif scene.run.duration > (again := found.begin + 2.0 * found.length):
            allowed = f"must be at most {again:.4g} s, when the record's waves come again"
            yield Problem(("run", "duration"), scene.run.duration, allowed)

    @property
    def way(self) -> float:
        """How far the waves go from the paddle to x [m]."""
        return self.x
