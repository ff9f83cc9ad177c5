"""The walls at the ends of the tank, fixed or moving, and how paddles absorb waves."""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wavetank import motion as motions
from wavetank.case.paddle import PLACES, MotionModel, PaddleMotion, SegmentedPaddleMotion, span
from wavetank.case.tank import AnyTank, Context, RingTank, SliceTank
from wavetank.errors import InputError
from wavetank.motion import Array
from wavetank.motion.motion import ANGLES, STEEPEST, TOP, UPSET, Extent, frequency_shift, joints, largest_stroke
from wavetank.values.case_model import CaseModel, HeightFormulaText, HeightHelpers, Problem
from wavetank.values.formula import Formula
from wavetank.values.quantities import (
    Acceleration,
    Coordinate,
    Damping,
    Duration,
    Length,
    Mass,
    Speed,
    Stiffness,
    metres,
)
from wavetank.waves.absorption import PassiveFilter, face, radiation, sudden_mass
from wavetank.waves.airy import angular_frequency
from wavetank.waves.wavemaker import PISTON, Flap, ProfileShape, Wavemaker

# ---------------------------------------------------------------- absorption
BAND = (0.5, 3.0)  # k d of the longest and the shortest waves, by default
POSSIBLE = (0.02, 10.0)  # the same, at most
NARROWEST = 1.05  # the longest period over the shortest


class ActiveAbsorption(CaseModel):
    """The paddle generates and absorbs at the same time, by the elevation at its face."""

    location: ClassVar[tuple[str, ...]] = ("wall", "absorb")
    type: Literal["active"] = "active"
    shortest: Duration | None = Field(
        default=None,
        description="shortest period that it is made for [s], half the waves' behind a bar; "
        "default: that of k d = 3, or a paddle's",
    )
    longest: Duration | None = Field(
        default=None, description="longest period that it is made for [s]; default: that of k d = 1/2, or a paddle's"
    )

    def band(self, tank: AnyTank, *, paddles: Iterable[float] = ()) -> tuple[float, float]:
        """Return shortest and longest period [s], defaults resolved; ``paddles`` have these periods [s]."""
        possible = _periods(tank, POSSIBLE)
        periods = [*_periods(tank, BAND), *(float(np.clip(one, *possible)) for one in paddles)]
        shortest, longest = min(periods), max(periods)
        shortest = self.shortest or min(shortest, (self.longest or longest) / NARROWEST)
        return shortest, self.longest or max(longest, shortest * NARROWEST)

    def build(self, tank: AnyTank, wavemaker: Wavemaker, *, paddles: Iterable[float] = ()) -> PassiveFilter:
        """Return the filter by which a paddle of a mode shape absorbs; arguments as of ``band``."""
        shortest, longest = self.band(tank, paddles=paddles)
        return PassiveFilter.fitted(
            wavemaker, depth=tank.depth, gravity=tank.gravity, shortest=shortest, longest=longest
        )

    def reflection(
        self, periods: Array, tank: AnyTank, wavemaker: Wavemaker, *, paddles: Iterable[float] = ()
    ) -> Array:
        """Return the reflection coefficient of small waves of periods [s], shape (N,); arguments as of ``band``."""
        omega = np.asarray(2 * np.pi / periods)
        at_face = face(wavemaker, omega, tank.depth, tank.gravity)
        return np.abs(self.build(tank, wavemaker, paddles=paddles).reflection(at_face, omega))

    def description(self, tank: AnyTank, wavemaker: Wavemaker, *, paddles: Iterable[float] = ()) -> str:
        """Return a description of the absorption; arguments as of ``band``."""
        shortest, longest = self.band(tank, paddles=paddles)
        periods = np.geomspace(shortest, longest, 50, dtype=np.float64)
        most = self.reflection(periods, tank, wavemaker, paddles=paddles).max()
        band = f"small waves from {shortest:.3g} to {longest:.3g} s"
        return f"it absorbs what comes to it, all but {100 * most:.2g} % of {band} at short steps"

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a band that is none."""
        least, most = _periods(context.tank, POSSIBLE)
        for name in ("shortest", "longest"):
            period = getattr(self, name)
            if period is not None and not least <= period <= most:
                allowed = f"must be from {least:.4g} to {most:.4g} s, k d = {POSSIBLE[1]:g} to {POSSIBLE[0]:g}"
                yield Problem(("wall", "absorb", name), period, allowed)
        if self.shortest is not None and self.longest is not None and self.longest < NARROWEST * self.shortest:
            allowed = f"must be at least {NARROWEST * self.shortest:.4g} s, {NARROWEST:g} times the shortest"
            yield self.problem("longest", allowed)


class SpringDamper(CaseModel):
    """The paddle, which is not driven, is a mass on a spring and a damper (of a flap: at its stroke height)."""

    location: ClassVar[tuple[str, ...]] = ("wall", "absorb")
    type: Literal["spring-damper"] = "spring-damper"
    period: Duration | None = Field(
        default=None, description="period that it is tuned to [s]; default: that of the paddle opposite, or of k d = 1"
    )
    mass: Mass = Field(default=0.0, description="mass [kg/m], for a metre's width")
    stiffness: Stiffness | None = Field(
        default=None, description="of the spring [N/m²], for a metre's width; default: none of the period comes back"
    )
    damping: Damping | None = Field(
        default=None, description="of the damper [N s/m²], for a metre's width; default: none of the period comes back"
    )

    def tuned(self, tank: AnyTank, *, paddles: Iterable[float] = ()) -> float:
        """Return the period that it is tuned to [s], default resolved; ``paddles`` have these periods [s]."""
        (usual, _), possible = _periods(tank, (1.0, 1.0)), _periods(tank, POSSIBLE)
        return self.period or float(np.clip(next(iter(paddles), usual), *possible))

    def resolved(
        self, tank: AnyTank, wavemaker: Wavemaker, *, paddles: Iterable[float] = ()
    ) -> tuple[float, float, float]:
        """Return mass [m²], stiffness [m²/s²] and damping [m²/s] over the density, defaults resolved; as ``tuned``."""
        omega = np.array([2 * np.pi / self.tuned(tank, paddles=paddles)])
        (damping,), (added,) = radiation(wavemaker, omega, tank.depth, tank.gravity)
        mass = self.mass / tank.density
        stiffness = float(omega[0] ** 2 * (mass + added))
        return (
            mass,
            stiffness if self.stiffness is None else self.stiffness / tank.density,
            float(damping) if self.damping is None else self.damping / tank.density,
        )

    def band(self, tank: AnyTank, *, paddles: Iterable[float] = ()) -> tuple[float, float]:
        """Return the period that it is tuned to [s], as shortest and longest."""
        return (self.tuned(tank, paddles=paddles),) * 2

    def reflection(
        self, periods: Array, tank: AnyTank, wavemaker: Wavemaker, *, paddles: Iterable[float] = ()
    ) -> Array:
        """Return the reflection coefficient of small waves of periods [s], shape (N,); arguments as of ``tuned``."""
        omega = np.asarray(2 * np.pi / periods)
        mass, stiffness, damping = self.resolved(tank, wavemaker, paddles=paddles)
        r, added = radiation(wavemaker, omega, tank.depth, tank.gravity)
        out_of_tune = 1j * (omega * (mass + added) - stiffness / omega)
        return np.abs((damping - r + out_of_tune) / (damping + r + out_of_tune))

    def description(self, tank: AnyTank, wavemaker: Wavemaker, *, paddles: Iterable[float] = ()) -> str:
        """Return a description of the absorption; arguments as of ``tuned``."""
        tuned, resolved = self.tuned(tank, paddles=paddles), self.resolved(tank, wavemaker, paddles=paddles)
        mass, stiffness, damping = (tank.density * part for part in resolved)
        parts = f"{mass:.4g} kg/m on a spring of {stiffness:.4g} N/m² and a damper of {damping:.4g} N s/m²"
        given = self.stiffness is not None and self.damping is not None
        return f"it absorbs{'' if given else f', tuned to {tuned:.3g} s'}, a mass of {parts}"

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a period that is none of the tank's waves, or that nothing follows from."""
        least, most = _periods(context.tank, POSSIBLE)
        if self.period is not None and not least <= self.period <= most:
            allowed = f"must be from {least:.4g} to {most:.4g} s, k d = {POSSIBLE[1]:g} to {POSSIBLE[0]:g}"
            yield self.problem("period", allowed)
        elif self.period is not None and self.stiffness is not None and self.damping is not None:
            yield self.problem("period", "must be left out: stiffness and damping are given")


Absorption = Annotated[
    ActiveAbsorption | SpringDamper,
    Field(discriminator="type", description="how a paddle absorbs the waves that come back to it"),
]


def _periods(tank: AnyTank, band: tuple[float, float]) -> tuple[float, float]:
    """Return the shortest and the longest period [s] of a band of k d from the least on."""
    low, high = (float(2 * np.pi / angular_frequency(kd / tank.depth, tank.depth, tank.gravity)) for kd in band)
    return high, low


# ---------------------------------------------------------------- moving walls
SIZES = (  # keys that set the size of a motion
    *("paddle_amplitude", "wave_amplitude", "linear_crest", "significant_height", "height", "heights"),
    *("position", "velocity", "file"),
)


class Limits(CaseModel):
    """Limits of the paddle's drive: a motion beyond them is refused before the run."""

    stroke: Length | None = Field(default=None, description="largest minus smallest position [m]; default: any")
    speed: Speed | None = Field(default=None, description="largest speed [m/s]; default: any")
    acceleration: Acceleration | None = Field(default=None, description="largest acceleration [m/s^2]; default: any")

    def exceeded(self, extent: Extent) -> Iterator[Problem]:
        """Yield each limit that the extent of a motion exceeds."""
        for name, unit in (("stroke", "m"), ("speed", "m/s"), ("acceleration", "m/s^2")):
            limit, needed = getattr(self, name), getattr(extent, name)
            if limit is not None and needed > limit:
                yield Problem(("wall", "limits", name), limit, f"is too little: this motion needs {needed:.4g} {unit}")


class BaseWall(CaseModel):
    """A wall at an end of the tank: by itself a vertical one at rest."""

    location: ClassVar[tuple[str, ...]] = ("wall",)
    moves: ClassVar[bool] = False

    @property
    def wavemaker(self) -> Wavemaker:
        """The mode shape f(z) of the wall's motion, by which it generates waves."""
        return PISTON

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return its motion; raises ``CaseError`` if its file cannot be read. By default it is at rest."""
        return motions.AT_REST

    def places(self, tank: AnyTank) -> Array | None:
        """Return positions y along the paddle [m], shape (N,), at which its motion is sampled; None if uniform."""
        return None


class MovingWallModel(BaseWall):
    """A wall that moves, vertical or of another shape."""

    if TYPE_CHECKING:
        motion: MotionModel  # of other types at other walls

    moves: ClassVar[bool] = True
    reach: Length | None = Field(
        default=None,
        description="length over which the mapping x = X + s(X) X_p decays to zero [m]; default: the length "
        "(half of it, or the remainder, if both walls move), at most ten depths",
    )

    limits: Limits | None = Field(default=None, description="limits of the paddle's drive; default: all")

    def mode_shape(self, tank: AnyTank) -> Array:
        """Return f(z) at 1001 heights from the bed up, shape (N,): the displacement over that of the motion."""
        return np.asarray(self.wavemaker.mode_shape(tank.depth * np.linspace(-1.0, TOP, 1001), tank.depth))

    def added_mass(self, tank: AnyTank) -> float:
        """Return the added mass of a sudden motion [m²], over the density."""
        return sudden_mass(self.wavemaker, tank.depth)

    def max_mode_shape(self, tank: AnyTank) -> float:
        """Return the largest absolute value of the mode shape f(z)."""
        return float(np.abs(self.mode_shape(tank)).max())

    def frequency_shift(self, tank: AnyTank, reach: float, displacement: float) -> float:
        """Return the largest factor on the frequency of the mesh's shortest waves, of the wall's lean and the mapping.

        Given are the mapping's reach and the paddle's largest displacement [m].
        """
        z = tank.depth * np.linspace(-1.0, 0.0, 1001)
        mode_shape = self.wavemaker.mode_shape(z, tank.depth)
        slope = float(np.abs(np.diff(mode_shape) / np.diff(z)).max()) * displacement
        return frequency_shift(slope, float(np.abs(mode_shape).max()) * displacement / reach)

    def amplitude(self, tank: AnyTank) -> float:
        """Return the amplitude of a sinusoid's displacement after its ramp [m]; 0 for other motions."""
        return float(getattr(self.motion, "paddle_amplitude", 0.0))

    def reach_in(self, tank: AnyTank, available: float) -> float:
        """Return the reach [m]; by default ten depths, at most what is available [m]."""
        return min(available, 10 * tank.depth) if self.reach is None else self.reach

    def reach_problems(self, tank: AnyTank, available: float, displacement: float) -> Iterator[Problem]:
        """Yield a displacement [m], in the run or a longer one, that exceeds what the mapping's reach allows."""
        motion, reach = self.motion, self.reach_in(tank, available)
        farthest = self.max_mode_shape(tank) * max(displacement, self.amplitude(tank))
        needed = STEEPEST * farthest
        if needed < reach:
            return
        if self.reach is not None and needed < available:
            allowed = f"must be more than {needed:.4g} m, 4/3 of the paddle's largest distance from rest"
            yield self.problem("reach", allowed)
            return
        size = next((key for key in SIZES if getattr(motion, key, None) is not None), None)
        least = f"{reach:.4g} m{'' if self.reach else ' by default'}, at most the tank's length"
        allowed = f"must stay below {largest_stroke(reach):.4g} m, 3/4 of its reach, which is {least}"
        where, received = (("wall", "motion", size), getattr(motion, size)) if size else (("wall", "motion"), None)
        yield Problem(where, received, f"takes the paddle {farthest:.4g} m from rest; it {allowed}")

    @property
    def reads_file(self) -> bool:
        """Whether its motion is checked when its file is read, and not before."""
        return self.motion.reads_file

    def motion_problems(self, context: Context) -> Iterator[Problem]:
        """Yield problems of the motion; of one that reads a file they are checked when it is built."""
        yield from self.motion.problems(context)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a reach beyond the tank."""
        if self.reach is not None and self.reach > context.tank.length:
            yield Problem(
                ("wall", "reach"), self.reach, f"must be at most the tank's length, {context.tank.length:g} m"
            )


class ShapedWall(MovingWallModel):
    """A wall that moves at some heights farther than at others."""

    shaped_by: ClassVar[str] = "type"  # the key of its shape


class HingedWall(ShapedWall):
    """A wall that rotates about a hinge; below a hinge above the bed it is fixed."""

    shaped_by: ClassVar[str] = "hinge"
    hinge: Coordinate = Field(default=0.0, description="height of the hinge above the bed [m], negative below it")
    stroke_height: Coordinate | None = Field(
        default=None, description="height above the bed at which the motion is given [m]; default: still water"
    )

    @property
    def wavemaker(self) -> Flap:
        """Its shape, by which it makes waves."""
        return Flap(self.hinge, self.stroke_height)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a hinge above still water, a stroke height not above the hinge, and problems of any paddle."""
        depth, height = context.tank.depth, self.stroke_height
        if self.hinge >= depth:
            yield self.problem("hinge", f"must be below still water, less than {metres(depth)} m")
        elif height is not None and height <= self.hinge:
            allowed = f"must be above the hinge, more than {metres(self.hinge)} m"
            yield Problem(("wall", "stroke_height"), height, allowed)
        else:
            yield from super().problems(context)


# ---------------------------------------------------------------- segmented paddles
SEGMENTS = 1000  # at most


class SegmentedWall(MovingWallModel):
    """A wall of many paddles in a row, with separate motions."""

    motion: SegmentedPaddleMotion
    segment: Length | None = Field(
        default=None, description="largest width of a segment [m]; default: no segments, continuous in y"
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion of the paddle's segments, hinged to each other."""
        motion = self.motion.build(tank, self.wavemaker, physics)
        return motion if self.segment is None else motions.hinged(motion, self.places(tank))

    def places(self, tank: AnyTank) -> motions.Array:
        """Return positions y along the paddle [m], shape (N,), at which its motion is sampled: its joints, if any."""
        low, high = span(tank)
        return joints(low, high, segment=(high - low) / (PLACES - 1) if self.segment is None else self.segment)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a tank without a paddle of given width, too many segments, and problems of reach and motion."""
        kind = getattr(self, "type", None)
        if not np.isfinite(span(context.tank)).all():
            allowed = "needs a basin (tank.type) whose layout says how wide it is: a recipe, not a file"
            yield Problem(("wall", "type"), kind, allowed)
            return
        if context.physics == "linear":
            yield Problem(("wall", "type"), kind, "needs nonlinear water (water.type), or must be a piston")
        yield from super().problems(context)
        low, high = span(context.tank)
        if self.segment is not None and high - low > SEGMENTS * self.segment:
            least = (high - low) / SEGMENTS
            yield self.problem("segment", f"must be at least {least:.4g} m, for {SEGMENTS} segments")
            return
        yield from () if self.reads_file else self.motion_problems(context)

    def motion_problems(self, context: Context) -> Iterator[Problem]:
        """Yield segments too wide for the waves, and problems of the motion."""
        widest = self.motion.widest_segment(context.tank)
        if self.segment is not None and self.segment > widest:
            allowed = (
                f"must be at most {widest:.4g} m, the shortest wave's length over 1 + sin of its angle: wider segments "
                "make spurious waves in other directions"
            )
            yield self.problem("segment", allowed)
        yield from super().motion_problems(context)


class SegmentedPistonWall(SegmentedWall):
    """A vertical wall of many pistons in a row, with separate motions."""

    type: Literal["segmented-piston"] = "segmented-piston"


class SegmentedFlapWall(HingedWall, SegmentedWall):
    """Many flaps in a row, hinged at one height, with separate motions."""

    type: Literal["segmented-flap"] = "segmented-flap"


# ---------------------------------------------------------------- fixed walls and paddles that move as a whole
class FixedWall(BaseWall):
    """A fixed wall."""

    type: Literal["fixed"] = "fixed"

    def reach_in(self, tank: AnyTank, available: float) -> float:
        """Return inf: there is no mapping to die out."""
        return np.inf


class PaddleWall(MovingWallModel):
    """A wall that moves as a whole."""

    motion: PaddleMotion
    absorb: Absorption | None = Field(
        default=None, description="how it absorbs the waves that come back to it, in a slice; default: not at all"
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the paddle's motion in the water; raises ``CaseError`` if its file cannot be read."""
        return self.motion.build(tank, self.wavemaker, physics)

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a tank without walls, a reach beyond the tank, and problems of the motion."""
        if isinstance(context.tank, RingTank):
            kind = getattr(self, "type", None)
            yield Problem(("wall", "type"), kind, "must be left out: a ring has no walls, hence no paddle")
            return
        yield from super().problems(context)
        if self.absorb is not None and not isinstance(context.tank, SliceTank):
            yield Problem(("wall", "absorb"), None, f"must be left out: in a {context.tank.type} no paddle absorbs")
        elif self.absorb is not None:
            yield from self.absorb.problems(context)
            if isinstance(self.absorb, SpringDamper) and self.motion.type != "at-rest":
                allowed = "must be at-rest: a paddle that absorbs on a spring is not driven"
                yield Problem(("wall", "motion", "type"), self.motion.type, allowed)
        yield from () if self.reads_file else self.motion_problems(context)


class PistonWall(PaddleWall):
    """A vertical wall with one motion."""

    type: Literal["piston"] = "piston"


class FlapWall(HingedWall, PaddleWall):
    """A rigid flap that rotates about a hinge; below a hinge above the bed the wall is fixed."""

    type: Literal["flap"] = "flap"
    motion_as: Literal["stroke", "angle"] = Field(
        default="stroke",
        description="what the numbers of a sinusoid, a formula, a function or a record are: the horizontal position at "
        "stroke_height in metres, or the angle from upright in radians, positive into the water; a record whose "
        "columns are named as in paddle.csv is of positions either way",
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion at the stroke's height; raises ``CaseError`` if its file cannot be read."""
        motion = super().paddle(tank, physics)
        if self.motion_as == "stroke" or self.motion.in_metres:
            return motion
        return motions.flap_motion(motion, self.wavemaker.arm(tank.depth))

    def amplitude(self, tank: AnyTank) -> float:
        """Return the amplitude of a sinusoid's displacement after its ramp [m]; 0 for other motions."""
        value = super().amplitude(tank)
        return value if self.motion_as == "stroke" else self.wavemaker.arm(tank.depth) * float(np.tan(value))

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield problems of any hinged wall, and an angle given for a motion that cannot have one."""
        problems = list(super().problems(context))
        if problems or self.motion_as == "stroke":
            yield from problems
        elif self.motion.generates:
            allowed = f"must be left out: a motion of type {self.motion.type} is found for its waves, not told"
            yield self.problem("motion_as", allowed)
        elif (angle := super().amplitude(context.tank)) >= UPSET:
            yield Problem(("wall", "motion", "paddle_amplitude"), angle, ANGLES)


class ProfileWall(ShapedWall, PaddleWall):
    """A wall of any shape, x = f(z) X(t)."""

    shaped_by: ClassVar[str] = "shape"
    type: Literal["profile"] = "profile"
    where: HeightHelpers = Field(default={}, description="parts of it by name, numbers or formulae; default: none")
    shape: HeightFormulaText = Field(description="f(z), z the height above still water [m]")

    @property
    def wavemaker(self) -> ProfileShape:
        """Its shape, by which it makes waves."""
        formula = Formula(self.shape, where=self.where, variables=("z",))
        return ProfileShape(formula, lambda z: formula.derivatives(z)[1])

    def problems(self, context: Context) -> Iterator[Problem]:
        """Yield a shape that is not finite, or displaces no water, and problems of any paddle."""
        z = context.tank.depth * np.linspace(-1.0, TOP, 1001)
        try:
            values = self.wavemaker.mode_shape(z, context.tank.depth)
        except InputError as error:
            yield self.problem("shape", str(error).removesuffix("."))
            return
        if not np.abs(values).max() > 0.0:
            yield self.problem("shape", "must not be 0 at all heights")
            return
        yield from super().problems(context)


AnyWall = FixedWall | PistonWall | FlapWall | ProfileWall | SegmentedPistonWall | SegmentedFlapWall
Wall = Annotated[AnyWall, Field(discriminator="type", description="the wall at x = 0")]
FarWall = Annotated[
    AnyWall,
    Field(
        discriminator="type",
        description="the wall at x = length, of a slice or a rectangle; its motion is positive into the water, all "
        "x of its waves count from it, into the water, and angles are from its normal into the water, positive "
        "towards y",
    ),
]
