"""The state at t = 0."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from wavetank import motion as motions
from wavetank.case.initial_file import FileSurface
from wavetank.case.initial_formula import FormulaSurface
from wavetank.case.initial_run import RunState
from wavetank.case.initial_sea import FocusedSurface, IrregularSurface
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank, BasinTank, RingTank, SliceTank
from wavetank.mesh import Rectangle
from wavetank.values.noun import Noun, Problem, about, one_of
from wavetank.values.quantities import Coordinate, Count, Height, Share, metres
from wavetank.waves.conformal import SteadyWave
from wavetank.waves.solitary_wave import HIGHEST_SOLITARY, solitary_wave
from wavetank.waves.standing_wave import ThirdOrderStandingWave
from wavetank.waves.stream_function import maximum_height, stream_function_wave
from wavetank.waves.wave import Wave

BREAKING = 0.109 * 2 * np.pi  # k a / tanh(k d) of the highest standing wave, H / L = 0.218 tanh(k d) (Danel, 1952)


def _box(tank: AnyTank) -> tuple[float, float, float, float]:
    """Return (x_min, y_min, x_max, y_max) [m]; a slice is of width 1."""
    if isinstance(tank, BasinTank) and tank.layout.box is not None:
        return tank.layout.box
    return 0.0, 0.0, tank.length, 1.0


class StillWater(Noun):
    """eta = 0, psi = 0."""

    type: Literal["still-water"] = "still-water"

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x, y [m], each of shape (N,)."""
        return np.zeros_like(x), np.zeros_like(x)


class KnownWave(Noun):
    """A wave of a theory, as it is at t = 0."""

    def wave(self, tank: AnyTank) -> Wave:
        """Return the wave."""
        raise NotImplementedError

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x, y [m], each of shape (N,); raises as ``wave`` does."""
        return self.wave(tank).surface(x, y=y)


class StandingWave(KnownWave):
    """eta = a cos(m pi x / length), psi = 0; in a rectangular basin times cos(n pi y / width)."""

    type: Literal["standing-wave"] = "standing-wave"
    wave_amplitude: Height = Field(description="amplitude a of the elevation [m]")
    mode: Count = Field(default=1, description="number m of half waves along the tank")
    mode_across: int = Field(default=0, ge=0, le=10**9, description="number n of half waves across a basin")

    def wave(self, tank: AnyTank) -> ThirdOrderStandingWave:
        """Return the linear wave that this is the start of."""
        left, low, right, high = _box(tank)
        return ThirdOrderStandingWave(
            amplitude=self.wave_amplitude,
            length=right - left,
            width=high - low,
            depth=tank.depth,
            gravity=tank.gravity,
            modes=(self.mode, self.mode_across),
            order=1,
            origin=(left, low),
        )

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield an amplitude that lays the bed dry, half a wave too many for a ring, and a basin of another shape."""
        if isinstance(scene.tank, BasinTank) and not isinstance(scene.tank.layout, Rectangle):
            yield Problem(("initial", "type"), self.type, "needs a rectangle (tank.layout.type)")
        if self.mode_across and not isinstance(scene.tank, BasinTank):
            yield Problem(("initial", "mode_across"), self.mode_across, f"must be 0: a {scene.tank.type} has no width")
        depth, (left, low, right, high) = scene.tank.depth, _box(scene.tank)
        k = float(np.hypot(self.mode / (right - left), self.mode_across / (high - low))) * np.pi
        if scene.physics == "linear":
            if self.wave_amplitude >= depth:
                allowed = f"must be below the still-water depth, {depth:g} m"
                yield Problem(("initial", "wave_amplitude"), self.wave_amplitude, allowed)
        elif self.wave_amplitude > (highest := BREAKING * float(np.tanh(k * depth)) / k):
            allowed = (
                f"must be at most {highest:.4g} m, where standing waves of this length break in {depth:g} m of water"
            )
            yield Problem(("initial", "wave_amplitude"), self.wave_amplitude, allowed)
        if isinstance(scene.tank, RingTank) and self.mode % 2:
            yield Problem(("initial", "mode"), self.mode, "must be even: whole waves, two halves each, fit a ring")


class StreamFunctionWave(KnownWave):
    """Waves of permanent form in a ring, travelling to +x, a crest at x = 0: exact, without mean Eulerian current."""

    type: Literal["stream-function"] = "stream-function"
    height: Height | None = Field(default=None, description="height, crest above trough [m]; default: by steepness")
    steepness: Share | None = Field(
        default=None, description="height over that of the highest wave [-]; default: by height"
    )
    waves: Count = Field(default=1, description="number of waves around the ring")

    _one_height = one_of("height", "steepness")

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return one of the waves; raises ``SceneError`` if it cannot be had."""
        length = tank.length / self.waves
        height = self.height or (self.steepness or 0.0) * maximum_height(length, tank.depth)
        with about("initial"):
            return stream_function_wave(height, length, depth=tank.depth, gravity=tank.gravity)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a tank that is no ring, and a height that no wave has."""
        if not isinstance(scene.tank, RingTank):
            yield Problem(("initial", "type"), self.type, "needs a ring (tank.type): walls reflect such waves")
            return
        highest = maximum_height(scene.tank.length / self.waves, scene.tank.depth)
        if self.height is not None and self.height >= highest:
            allowed = f"must be below that of the highest wave of this length, {highest:.4g} m"
            yield Problem(("initial", "height"), self.height, allowed)


class SolitaryWave(KnownWave):
    """The solitary wave, travelling to +x; exact where both ends of the tank are far."""

    type: Literal["solitary-wave"] = "solitary-wave"
    height: Height = Field(description="height of the crest above still water [m]")
    x: Coordinate = Field(description="where the crest is [m]")

    def wave(self, tank: AnyTank) -> SteadyWave:
        """Return the wave, its crest where it is."""
        return replace(solitary_wave(self.height, depth=tank.depth, gravity=tank.gravity), crest=self.x)

    def at_ends(self, tank: SliceTank) -> motions.Array:
        """Return the elevation at both ends of a slice over the height, shape (2,)."""
        return np.asarray(self.wave(tank).elevation(np.array([0.0, tank.length])) / self.height, dtype=np.float64)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a tank without ends, a crest outside and a wave too high."""
        if isinstance(scene.tank, RingTank):
            yield Problem(("initial", "type"), self.type, "needs a slice (tank.type): its potential is not periodic")
        if not isinstance(scene.tank, BasinTank) and not 0 <= self.x <= scene.tank.length:
            yield Problem(("initial", "x"), self.x, f"must be inside the tank, 0 to {metres(scene.tank.length)} m")
        if self.height > HIGHEST_SOLITARY * scene.tank.depth:
            allowed = f"must be at most {HIGHEST_SOLITARY:g} depths, {HIGHEST_SOLITARY * scene.tank.depth:.4g} m"
            yield Problem(("initial", "height"), self.height, allowed)


Initial = Annotated[
    StillWater
    | StandingWave
    | StreamFunctionWave
    | SolitaryWave
    | IrregularSurface
    | FocusedSurface
    | FormulaSurface
    | FileSurface
    | RunState,
    Field(discriminator="type", description="the state at t = 0"),
]
