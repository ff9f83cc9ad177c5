"""A segmented paddle: waves that leave it at an angle, or meet from many directions.

Angles are in degrees from the wall's normal into the water, positive towards y, at either end of a basin.
"""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wavetank import motion as motions
from wavetank.case.tank import AnyTank, BasinTank, Context
from wavetank.case.waves import (
    MAX_COMPONENTS,
    MOTION_KEY,
    ComponentFile,
    FocusingWaves,
    GeneratingMotion,
    SpectralWaves,
    SurfaceFile,
)
from wavetank.mesh import MeshFile
from wavetank.motion.motion import widest_segment
from wavetank.values.case_model import Problem, one_of
from wavetank.values.quantities import Coordinate, Duration, Frequency, Height, Ramp
from wavetank.waves import airy
from wavetank.waves.focusing import Fan, FocusedGroup, ReflectedGroup
from wavetank.waves.plane_waves import PlaneWaves, waves_along
from wavetank.waves.spectra import irregular, random_directions, uniform
from wavetank.waves.wavemaker import Wavemaker

Spreading = Annotated[float, Field(ge=0, le=1000)]
Deviation = Annotated[float, Field(ge=0.1, le=90)]
PLACES = 101  # samples of a paddle without segments
NARROW = 1e-3  # of the energy of a file's waves: of so little the segments may be too wide
TERMS = 20_000_000  # of a motion's sum over components, directions and places, at most: 320 MB


def span(tank: AnyTank) -> tuple[float, float]:
    """Return the lowest and the highest y [m] of the paddle; infinite if only a mesh file has them."""
    if not isinstance(tank, BasinTank) or isinstance(tank.layout, MeshFile):
        return -np.inf, np.inf
    y_min = tank.layout.box[1]  # every recipe's paddle begins there
    return y_min, y_min + tank.layout.width


class SegmentedWaves(GeneratingMotion):
    """Waves that a segmented paddle generates, in any directions."""

    def build(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> motions.Motion:
        """Return the ramped motion; raises ``CaseError`` if a file cannot be read."""
        motion = motions.SnakeMotion(self.target(tank), wavemaker, self.power_period(tank, wavemaker))
        return motions.ramped(motion, self.ramp_in(tank))

    def power_period(self, tank: AnyTank, wavemaker: Wavemaker) -> float | None:
        """Return the period that halves the power of the paddle's velocity [s]; None: the sum of all waves decides."""
        return None

    def generation_in(self, tank: AnyTank, wavemaker: Wavemaker, physics: str) -> tuple[None, str]:
        """Return why the generation of segments is linear."""
        return None, "second-order generation is for paddles that move as a whole"

    def terms_per_component(self, context: Context) -> int:
        """Return the number of places of the paddle at which the motion is summed."""
        places = context.wall.places(context.tank)
        return PLACES if places is None else int(places.size)


class ObliqueWaveMotion(SegmentedWaves):
    """A regular wave that leaves the paddle at an angle; side walls reflect it."""

    type: Literal["oblique-wave"] = "oblique-wave"
    wave_amplitude: Height = Field(description="amplitude a of the wave [m]")
    period: Duration = Field(description="period T [s]")
    angle: float = Field(gt=-90, lt=90, description="direction theta from the wall's normal [deg], positive towards y")
    ramp: Ramp | None = Field(default=None, description="length of the ramp [s]; default two periods")

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the wave, with a crest at (0, 0) at t = 0."""
        f, a = np.array([1.0 / self.period]), np.array([self.wave_amplitude])
        angle = np.radians(self.angle)
        return waves_along(f, a, np.zeros(1), angles=angle, depth=tank.depth, gravity=tank.gravity)

    def default_ramp(self, tank: AnyTank) -> float:
        """Return two periods [s]."""
        return 2 * self.period

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] beyond which segments make spurious waves."""
        k = airy.wave_number(2.0 * np.pi / self.period, tank.depth, tank.gravity)
        return widest_segment(float(k), float(np.radians(self.angle)))


class _FanOfWaves(FocusingWaves, SegmentedWaves):
    """Waves from many directions that meet, by linear theory, in one crest at (focus_x, focus_y, focus_time)."""

    focus_y: Coordinate = Field(default=0.0, description="y of the focus [m]")
    largest_angle: float = Field(default=30.0, ge=0, lt=90, description="angle of the outermost directions [deg]")
    directions: int = Field(default=21, ge=1, le=1000, description="number of directions")
    spreading: float = Field(
        default=0.0, ge=0, le=1000, description="exponent s of the directional spreading cos^2s(theta/2); 0: uniform"
    )

    def directional(self, tank: AnyTank) -> FocusedGroup:
        """Return the group as in a sea without side walls."""
        fan = Fan(float(np.radians(self.largest_angle)), self.directions, self.spreading)
        return self.group(tank, fan=fan, focus_y=self.focus_y)

    def focused(self, tank: AnyTank) -> FocusedGroup | ReflectedGroup:
        """Return the group as it is to be generated."""
        return self.directional(tank)

    def power_period(self, tank: AnyTank, wavemaker: Wavemaker) -> float:
        """Return the period of the group in one direction [s]."""
        return motions.first_order_motion(self.group(tank).target, wavemaker).power_period

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] beyond which segments make spurious waves: the shortest and most oblique are first."""
        group = self.directional(tank)
        return widest_segment(float(group.k[-1]), float(group.fan.angles[-1]))

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield the problems of any focus, a focus outside the paddle's width, and too many waves to sum up."""
        low, high = span(context.tank)
        waves = self.components * self.directions * self.terms_per_component(context)
        if waves > TERMS:
            allowed = f"must be fewer: with the directions, at all places of the paddle, there are {waves:.2g}"
            yield self.problem("components", f"{allowed}, and at most {TERMS:.2g} are allowed")
            return
        yield from super().problems(context)
        if not low <= self.focus_y <= high:
            yield self.problem("focus_y", f"must be before the paddle, {low:g} to {high:g} m")


class DirectionalFocusMotion(_FanOfWaves):
    """The paddle sends each wave straight to the focus, as in a sea without side walls."""

    type: Literal["directional-focus"] = "directional-focus"

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield the problems of any focus, and directions that miss the paddle."""
        yield from super().problems(context)
        low, high = span(context.tank)
        first, last = self.directional(context.tank).sources
        if low <= self.focus_y <= high and (first < low or last > high):
            widest = np.degrees(np.arctan(min(self.focus_y - low, high - self.focus_y) / self.focus_x))
            allowed = (
                f"must be at most {widest:.4g} deg: waves from further aside would have to come from beyond the "
                "paddle's ends (type reflected-focus sends them by way of the side walls)"
            )
            yield self.problem("largest_angle", allowed)


class ReflectedFocusMotion(_FanOfWaves):
    """The paddle makes use of the side walls, which must go from its ends to the focus along x."""

    type: Literal["reflected-focus"] = "reflected-focus"

    def terms_per_component(self, context: Context) -> int:
        """Return at how many places, or in how many of the basin's own waves, its motion is summed up."""
        low, high = span(context.tank)
        modes = (high - low) / np.pi * float(self.group(context.tank).k[-1])
        return max(super().terms_per_component(context), int(min(modes, TERMS)))

    def focused(self, tank: AnyTank) -> ReflectedGroup:
        """Return the group between the side walls."""
        y_min, y_max = span(tank)
        return ReflectedGroup(group=self.directional(tank), y_min=y_min, y_max=y_max)


class DirectionalIrregularMotion(SpectralWaves, SegmentedWaves):
    """An irregular sea of many directions, the same of a seed on any machine; side walls reflect it."""

    highest_of_peak: ClassVar[float] = 3.0
    type: Literal["directional-irregular"] = "directional-irregular"
    significant_height: Height = Field(description="significant wave height Hm0 = 4 m0^(1/2) [m]")
    seed: int = Field(default=1, ge=0, le=2**53, description="seed of the random phases")
    spreading: Spreading | None = Field(
        default=None, description="exponent s of the directions' density cos^2s(theta/2); default: by deviation"
    )
    deviation: Deviation | None = Field(
        default=None, description="standard deviation of directions, of a normal density [deg]; default: by spreading"
    )
    largest_angle: float = Field(default=60.0, ge=0.1, lt=90, description="angle of the outermost directions [deg]")
    highest_frequency: Frequency | None = Field(default=None, description="last component [Hz]; default 3 fp")
    components: int = Field(
        default=1000, ge=2, le=MAX_COMPONENTS, description="number of components, each of one direction"
    )

    _one_spread = one_of("spreading", "deviation")

    def target(self, tank: AnyTank) -> PlaneWaves:
        """Return the waves, one direction for each frequency, with phases at (0, 0)."""
        f, spectrum = self.frequencies(tank), self.spectrum.build(tank)
        height, seed = self.significant_height, self.seed
        amplitudes, phases = irregular(spectrum, f, significant_height=height, seed=seed)
        random = uniform(self.seed, 3, f.size)[2]
        angles = random_directions(self._density, random, largest=float(np.radians(self.largest_angle)))
        return waves_along(f, amplitudes, phases, angles=angles, depth=tank.depth, gravity=tank.gravity)

    def _density(self, angle: motions.Array) -> motions.Array:
        if self.spreading is not None:
            return np.asarray(np.cos(angle / 2.0) ** (2.0 * self.spreading))
        return np.asarray(np.exp(-0.5 * (np.degrees(angle) / self.deviation) ** 2))

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] beyond which segments make spurious waves: the shortest and most oblique are first."""
        k = airy.wave_number(2.0 * np.pi * self.band(tank)[1], tank.depth, tank.gravity)
        return widest_segment(float(k), float(np.radians(self.largest_angle)))

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield the problems of any spectrum, and too many waves to sum up."""
        terms = self.components * self.terms_per_component(context)
        if terms > TERMS:
            allowed = f"must be fewer: at all places of the paddle they are {terms:.2g}, {TERMS:.2g} allowed"
            yield self.problem("components", allowed)
            return
        yield from super().problems(context)


class _WavesOfFile(SegmentedWaves):
    """Plane waves of a file, each in its own direction; side walls reflect them."""

    y: Coordinate = Field(default=0.0, description="y to which the phases refer [m]")

    def widest_segment(self, tank: AnyTank) -> float:
        """Return the width [m] beyond which segments make spurious waves, of all but a thousandth of the energy."""
        waves = self.target(tank)
        k, angles = np.hypot(waves.k_x, waves.k_y), np.arctan2(waves.k_y, waves.k_x)
        widest = np.array([widest_segment(*map(float, one)) for one in zip(k, angles, strict=True)])
        narrow_first = np.argsort(widest)
        energy = np.cumsum(np.abs(waves.amplitudes[narrow_first]) ** 2)
        return float(widest[narrow_first][np.searchsorted(energy, NARROW * energy[-1])])

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield too many waves to sum up."""
        terms = self.target(context.tank).omega.size * self.terms_per_component(context)
        if terms > TERMS:
            allowed = f"must have fewer waves: at all places of the paddle they are {terms:.2g}, {TERMS:.2g} allowed"
            yield Problem((*MOTION_KEY, "file"), None, allowed)


class DirectionalComponentsMotion(ComponentFile, _WavesOfFile):
    """Waves by their components in a file, each at an angle: sum a cos(omega (t - time) + phase) at (x, y)."""

    type: Literal["components"] = "components"


class DirectionalSurfaceMotion(SurfaceFile, _WavesOfFile):
    """Waves of one direction with a given elevation at a position, from a file."""

    type: Literal["surface"] = "surface"
    angle: float = Field(
        default=0.0,
        gt=-90,
        lt=90,
        description="direction of the waves from the wall's normal [deg], positive towards y",
    )

    @property
    def travel_distance(self) -> float:
        """Distance from the paddle to x along the waves' direction [m]."""
        return self.x / float(np.cos(np.radians(self.angle)))


SegmentedPaddleMotion = Annotated[
    ObliqueWaveMotion
    | DirectionalFocusMotion
    | ReflectedFocusMotion
    | DirectionalIrregularMotion
    | DirectionalComponentsMotion
    | DirectionalSurfaceMotion,
    Field(discriminator="type", description="motion of the paddle's segments"),
]
