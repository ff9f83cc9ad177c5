"""Waves of a spectrum: what is said of their components, and of such as meet in one crest, wherever they come from."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from pydantic import Field

from wavetank import motion as motions
from wavetank.case.spectra import Spectrum, TableSpectrum
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Duration, Frequency, Height, Length, Ramp, metres
from wavetank.waves.wavemaker import PISTON, Wavemaker

KEY = ("wall", "motion")
MOST = 10_000  # components
MISSED = 1e-6  # of its peak: of so little there are no waves


class SpectralWaves(Noun):
    """Waves of equally spaced frequencies."""

    highest_of_peak: ClassVar[float] = 2.0  # fp, by default
    spectrum: Spectrum
    lowest_frequency: Frequency | None = Field(default=None, description="first component [Hz]; default fp / 2")
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 2 fp")
    components: int = Field(default=128, ge=2, le=MOST, description="number of components")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two peak periods")

    @property
    def reads_file(self) -> bool:
        """Whether the spectrum is a file's."""
        return isinstance(self.spectrum, TableSpectrum)

    def ramp_in(self, tank: AnyTank) -> float:
        """Return the ramp [s], default resolved."""
        return 2 / self.spectrum.build(tank).peak_frequency if self.ramp is None else self.ramp

    def band(self, tank: AnyTank) -> tuple[float, float]:
        """Return the first and the last frequency [Hz], defaults resolved."""
        peak = self.spectrum.build(tank).peak_frequency
        lowest = peak / 2 if self.lowest_frequency is None else self.lowest_frequency
        return lowest, self.highest_of_peak * peak if self.highest_frequency is None else self.highest_frequency

    def frequencies(self, tank: AnyTank) -> motions.Array:
        """Return the components' frequencies [Hz], shape (components,)."""
        return np.linspace(*self.band(tank), self.components, dtype=np.float64)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a band without its peak or without waves."""
        (lowest, highest), spectrum = self.band(scene.tank), self.spectrum.build(scene.tank)
        peak = spectrum.peak_frequency
        if not lowest < peak < highest:
            yield self._outside(peak, lowest, highest)
            return
        found = spectrum.density(self.frequencies(scene.tank)).sum()
        if not found > MISSED * float(spectrum.density(np.array([peak]))[0]):
            allowed = "must be more: none of their frequencies is where the spectrum has its waves"
            yield Problem((*KEY, "components"), self.components, allowed)
            return
        yield from self.timing_problems(scene)
        repetition = (self.components - 1) / (highest - lowest)
        if scene.run.duration > repetition:
            least = int(np.ceil(scene.run.duration * (highest - lowest))) + 1
            if least > MOST:
                longest = (MOST - 1) / (highest - lowest)
                allowed = f"must be at most {longest:.6g} s: {MOST} components, the most, repeat the waves after it"
                yield Problem(("run", "duration"), scene.run.duration, allowed)
                return
            allowed = f"must be {least} or more: so few repeat the waves every {repetition:.4g} s, within the run"
            yield Problem((*KEY, "components"), self.components, allowed)

    def _outside(self, peak: float, lowest: float, highest: float) -> Problem:
        """Return what is wrong with a peak [Hz] that is none of the components."""
        within, key = f"the components' {lowest:g} to {highest:g} Hz", (*KEY, "spectrum")
        if isinstance(self.spectrum, TableSpectrum):
            return Problem((*key, "file"), self.spectrum.file, f"must have its peak, {peak:g} Hz, between {within}")
        if self.spectrum.peak_period is not None:
            return Problem((*key, "peak_period"), self.spectrum.peak_period, f"must be that of one of {within}")
        return Problem((*key, "peak_frequency"), peak, f"must be between {within}")

    def timing_problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield what comes too early; by itself, nothing does."""
        yield from ()


class FocusingWaves(SpectralWaves):
    """Waves that meet, by linear theory, in one crest at focus_x and focus_time."""

    linear_crest: Height = Field(description="height of the crest at the focus above still water, by linear theory [m]")
    focus_x: Length = Field(description="where the crests meet [m]")
    focus_time: Duration = Field(description="when the crests meet [s]")
    phase: float = Field(default=0.0, ge=-360, le=360, description="at the focus [deg]: 0 of a crest, 180 of a trough")

    def group(self, tank: AnyTank, maker: Wavemaker = PISTON) -> motions.WaveGroup:
        """Return the group as of waves along x, without its ramp."""
        lowest, highest = self.band(tank)
        return motions.WaveGroup(
            amplitude=self.linear_crest,
            spectrum=self.spectrum.build(tank),
            lowest_frequency=lowest,
            highest_frequency=highest,
            components=self.components,
            focus_x=self.focus_x,
            focus_time=self.focus_time,
            depth=tank.depth,
            gravity=tank.gravity,
            phase=float(np.radians(self.phase)),
            maker=maker,
        )

    def earliest_focus(self, tank: AnyTank) -> float:
        """Return the earliest focus time [s] that the ramp allows."""
        return self.group(tank).earliest_focus(self.ramp_in(tank))

    def timing_problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a focus too early."""
        earliest = self.earliest_focus(scene.tank)
        if self.focus_time < earliest:
            allowed = (
                f"must be at least {earliest:.4g} s: the short waves need that long from the ramp's end to focus_x"
            )
            yield Problem((*KEY, "focus_time"), self.focus_time, allowed)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield as any waves of a spectrum, and a focus outside the tank."""
        if not self.focus_x < scene.tank.length:
            allowed = f"must be inside the tank, below {metres(scene.tank.length)} m"
            yield Problem((*KEY, "focus_x"), self.focus_x, allowed)
        yield from super().problems(scene)
