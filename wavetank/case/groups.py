"""Waves that meet in one crest: what is said of them, however many directions they come from."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wavetank import motions
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Duration, Frequency, Height, Length, Ramp, metres

KEY = ("wall", "motion")
MISSED = 1e-6  # of its peak: of so little there are no waves


class JonswapSpectrum(Noun):
    """The JONSWAP spectrum's shape."""

    type: Literal["jonswap"] = "jonswap"
    peak_frequency: Frequency = Field(description="peak frequency fp [Hz]")
    gamma: float = Field(default=3.3, ge=1, le=100, description="peak enhancement gamma [-]")

    def build(self) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Jonswap(self.peak_frequency, self.gamma)


class GaussianSpectrum(Noun):
    """A Gaussian spectrum's shape."""

    type: Literal["gaussian"] = "gaussian"
    peak_frequency: Frequency = Field(description="peak frequency fp [Hz]")
    bandwidth: Frequency = Field(description="standard deviation [Hz]")

    def build(self) -> motions.Spectrum:
        """Return the shape S(f)."""
        return motions.Gaussian(self.peak_frequency, self.bandwidth)


class FocusingWaves(Noun):
    """Waves that meet, by linear theory, in one crest at focus_x and focus_time."""

    formerly: ClassVar[dict[str, str]] = {"amplitude": "linear_crest"}
    linear_crest: Height = Field(description="height of the crest at the focus above still water, by linear theory [m]")
    focus_x: Length = Field(description="where the crests meet [m]")
    focus_time: Duration = Field(description="when the crests meet [s]")
    spectrum: Annotated[JonswapSpectrum | GaussianSpectrum, Field(discriminator="type", description="shape S(f)")]
    lowest_frequency: Frequency | None = Field(default=None, description="first component [Hz]; default fp / 2")
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 2 fp")
    components: int = Field(default=128, ge=2, le=10_000, description="number of components")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two peak periods")

    @property
    def ramp_length(self) -> float:
        """The ramp [s], default resolved."""
        return 2 / self.spectrum.peak_frequency if self.ramp is None else self.ramp

    def group(self, tank: AnyTank) -> motions.WaveGroup:
        """Return the group as of waves along x, without its ramp."""
        peak = self.spectrum.peak_frequency
        return motions.WaveGroup(
            amplitude=self.linear_crest,
            spectrum=self.spectrum.build(),
            lowest_frequency=peak / 2 if self.lowest_frequency is None else self.lowest_frequency,
            highest_frequency=2 * peak if self.highest_frequency is None else self.highest_frequency,
            components=self.components,
            focus_x=self.focus_x,
            focus_time=self.focus_time,
            depth=tank.depth,
            gravity=tank.gravity,
        )

    def earliest_focus(self, tank: AnyTank) -> float:
        """Return the earliest focus time [s] that the ramp allows."""
        return self.group(tank).earliest_focus(self.ramp_length)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a focus outside the tank or too early, a band without its peak, and a group that comes twice."""
        group = self.group(scene.tank)
        if not self.focus_x < scene.tank.length:
            yield Problem(
                (*KEY, "focus_x"), self.focus_x, f"must be inside the tank, below {metres(scene.tank.length)} m"
            )
        if not group.lowest_frequency < self.spectrum.peak_frequency < group.highest_frequency:
            band = f"{group.lowest_frequency:g} to {group.highest_frequency:g} Hz"
            received = self.spectrum.peak_frequency
            yield Problem((*KEY, "spectrum", "peak_frequency"), received, f"must be between the components' {band}")
            return
        shape = group.spectrum.density
        if not shape(group.frequencies).sum() > MISSED * float(shape(np.array([self.spectrum.peak_frequency]))[0]):
            allowed = "must be more: none of their frequencies is where the spectrum has its waves"
            yield Problem((*KEY, "components"), self.components, allowed)
            return
        earliest = self.earliest_focus(scene.tank)
        if self.focus_time < earliest:
            allowed = (
                f"must be at least {earliest:.4g} s: the short waves need that long from the ramp's end to focus_x"
            )
            yield Problem((*KEY, "focus_time"), self.focus_time, allowed)
        if scene.run.duration > group.repetition:
            allowed = f"must be more: so few repeat the group every {group.repetition:.4g} s, within the run's duration"
            yield Problem((*KEY, "components"), self.components, allowed)
