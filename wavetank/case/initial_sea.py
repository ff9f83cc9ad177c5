"""Seas and groups of waves of a spectrum at t = 0: linear waves that go to +x, whole ones as long as the tank."""

from collections.abc import Iterator
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from wavetank import motion as motions
from wavetank.case.spectra import GaussianSpectrum, JonswapSpectrum, PiersonMoskowitzSpectrum, TmaSpectrum
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank, BasinTank, RingTank, SliceTank
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Coordinate, Frequency, Height, metres
from wavetank.waves.airy import angular_frequency, group_velocity
from wavetank.waves.plane_waves import PlaneWaves

Shape = Annotated[
    JonswapSpectrum | PiersonMoskowitzSpectrum | TmaSpectrum | GaussianSpectrum,
    Field(discriminator="type", description="shape S(f)"),
]
HIGHEST_OF_PEAK = 3.0
MOST = 10_000  # waves
FEWEST = 1.5  # waves, as many as would share the spectrum equally: (sum S df)² / sum (S df)²
STEEPEST = 0.14  # height over length of the highest waves, in depth times tanh k d (Miche)


class SpectralSurface(Noun):
    """Linear waves of a spectrum."""

    spectrum: Shape
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 3 fp")

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m], and psi [m²/s] of linear waves, at still water, at places x, y [m], each of shape (N,)."""
        waves = self.waves(tank)
        return waves.elevation(x), waves.potential(x, np.zeros_like(x))

    def waves(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves."""
        raise NotImplementedError

    def _along(self, tank: AnyTank) -> tuple[motions.Array, motions.Array]:
        """Return wave numbers [rad/m], whole waves along the tank, and S(f) df of each but for a factor."""
        highest, step = self._highest(tank), 2 * np.pi / tank.length
        k = step * np.arange(1, MOST + 1, dtype=np.float64)
        k = k[angular_frequency(k, tank.depth, tank.gravity) <= highest]
        frequencies = np.asarray(angular_frequency(k, tank.depth, tank.gravity) / (2 * np.pi), dtype=np.float64)
        speeds = group_velocity(k, tank.depth, tank.gravity)
        return k, np.asarray(self.spectrum.build(tank).density(frequencies) * speeds)

    def _highest(self, tank: AnyTank) -> float:
        """Return the last angular frequency [rad/s], default resolved."""
        peak = self.spectrum.build(tank).peak_frequency
        return 2 * np.pi * (HIGHEST_OF_PEAK * peak if self.highest_frequency is None else self.highest_frequency)

    def _waves(self, tank: AnyTank, k: motions.Array, amplitudes: NDArray[np.complex128]) -> PlaneWaves:
        omega = np.asarray(angular_frequency(k, tank.depth, tank.gravity))
        return PlaneWaves(amplitudes=amplitudes, k_x=k, k_y=0 * k, omega=omega, depth=tank.depth, gravity=tank.gravity)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a basin, and a spectrum of which no whole wave goes into the tank, or too many do."""
        tank = scene.tank
        if isinstance(tank, BasinTank):
            yield Problem(("initial", "type"), None, "needs a slice or ring (tank.type): waves go along it")
            return
        first = angular_frequency(2 * np.pi / tank.length, tank.depth, tank.gravity)
        last = angular_frequency(2 * np.pi * MOST / tank.length, tank.depth, tank.gravity)
        highest = self._highest(tank)
        if not first < highest < last:
            low, high = first / (2 * np.pi), last / (2 * np.pi)
            allowed = f"must be from {low:.4g} Hz, of a wave as long as the tank, to {high:.4g} Hz"
            yield Problem(("initial", "highest_frequency"), self.highest_frequency, allowed)
            return
        k, share = self._along(tank)
        if not share.sum() > 0.0:
            yield Problem(("initial", "spectrum"), None, "must have waves, whole ones as long as the tank")
        elif share.sum() ** 2 < FEWEST * np.square(share).sum():
            main, peak = k[share.argmax()], self.spectrum.build(tank).peak_frequency
            hertz = angular_frequency(main, tank.depth, tank.gravity) / (2 * np.pi)
            allowed = (
                f"must have more than one wave that fits: of whole ones along {metres(tank.length)} m nearly all is "
                f"in that of {hertz:.4g} Hz, the peak being at {peak:.4g} Hz; the tank may be longer"
            )
            yield Problem(("initial", "spectrum"), None, allowed)


class IrregularSurface(SpectralSurface):
    """An irregular sea all along the tank, of linear waves that go to +x: the same of a seed on any machine."""

    type: Literal["irregular"] = "irregular"
    significant_height: Height = Field(description="significant wave height Hm0 = 4 m0^(1/2) [m]")
    seed: int = Field(default=1, ge=0, le=2**53, description="which of all seas of the spectrum")

    def waves(self, tank: AnyTank) -> PlaneWaves:
        """Return the sea: its variance is (Hm0 / 4)²."""
        k, share = self._along(tank)
        amplitudes = self.significant_height / 4.0 * np.sqrt(2.0 * share / share.sum())
        return self._waves(tank, k, amplitudes * np.exp(2j * np.pi * motions.uniform(self.seed, k.size)))

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield as any, a slice, whose walls reflect such waves, and a sea too high."""
        if not isinstance(scene.tank, RingTank):
            yield Problem(("initial", "type"), self.type, "needs a ring (tank.type): walls reflect such waves")
            return
        found = list(super().problems(scene))
        yield from found
        highest = STEEPEST * scene.tank.length
        if not found and self.significant_height > min(highest, scene.tank.depth):
            yield Problem(
                ("initial", "significant_height"),
                self.significant_height,
                f"must be at most {min(highest, scene.tank.depth):.4g} m, of waves in that depth and tank",
            )


class FocusedSurface(SpectralSurface):
    """Waves of a spectrum that go to +x and meet in a crest at t = 0, or a trough: a sea's most probable (NewWave)."""

    type: Literal["focused"] = "focused"
    linear_crest: float = Field(
        ge=-1e6, le=1e6, description="elevation where all waves meet, by linear theory [m]; negative is a trough"
    )
    x: Coordinate = Field(description="where they meet [m]")

    def waves(self, tank: AnyTank) -> PlaneWaves:
        """Return the group: amplitudes go with S(f) df."""
        k, share = self._along(tank)
        return self._waves(tank, k, self.linear_crest * share / share.sum() * np.exp(-1j * k * self.x))

    def at_ends(self, tank: SliceTank) -> motions.Array:
        """Return the envelope at both ends of a slice over the crest, shape (2,)."""
        k, share = self._along(tank)
        phases = np.exp(1j * np.multiply.outer([-self.x, tank.length - self.x], k))
        return np.asarray(np.abs(phases @ share) / share.sum())

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield as any, a place outside the tank, and a trough below the bed."""
        found = list(super().problems(scene))
        yield from found
        if found:
            return
        if not 0.0 <= self.x <= scene.tank.length:
            yield Problem(("initial", "x"), self.x, f"must be inside the tank, 0 to {metres(scene.tank.length)} m")
        if abs(self.linear_crest) >= scene.tank.depth:
            allowed = f"must be less than the still-water depth, {scene.tank.depth:g} m, either way"
            yield Problem(("initial", "linear_crest"), self.linear_crest, allowed)
