"""The walls at the ends of the tank, fixed or moving, and how paddles absorb waves."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wavetank import motion as motions
from wavetank.base.case_model import CaseModel, Check, HeightFormulaText, HeightHelpers, Problem
from wavetank.base.errors import InputError
from wavetank.base.formula import Formula
from wavetank.base.quantities import Acceleration, Coordinate, Duration, Length, PerWidth, Speed, metres
from wavetank.case import paddle as paddles
from wavetank.case.tank import AnyTank, BasinTank, Context, RingTank, SliceTank
from wavetank.motion import Array
from wavetank.motion.motion import TOP, Extent, joints
from wavetank.waves.absorption import PassiveFilter, face, radiation, sudden_mass
from wavetank.waves.airy import angular_frequency
from wavetank.waves.wavemaker import PISTON, Flap, ProfileShape, Wavemaker

# ---------------------------------------------------------------- absorption
BAND = (0.5, 3.0)  # default k d of the longest and the shortest waves
POSSIBLE_BAND = (0.02, 10.0)  # possible k d of the longest and the shortest waves
MIN_BAND_RATIO = 1.05  # least ratio of the longest and the shortest period


def _periods(tank: AnyTank, band: tuple[float, float]) -> tuple[float, float]:
    """Return the shortest and the longest period [s] of a band of k d, given the lowest first."""
    low, high = (float(2 * np.pi / angular_frequency(kd / tank.depth, tank.depth, tank.gravity)) for kd in band)
    return high, low


def _is_possible(key: str, period: float | None, tank: AnyTank) -> Check:
    """Return the check that waves of a period [s] are possible in the tank."""
    least, most = _periods(tank, POSSIBLE_BAND)
    allowed = f"must be from {least:.4g} to {most:.4g} s, k d = {POSSIBLE_BAND[1]:g} to {POSSIBLE_BAND[0]:g}"
    return key, period is None or least <= period <= most, allowed


class ActiveAbsorption(CaseModel):
    """The paddle generates and absorbs simultaneously, by the elevation at its face."""

    type: Literal["active"] = "active"
    shortest: Duration | None = Field(
        default=None,
        description="shortest period of the filter [s], half that of the waves behind a bar; "
        "default: that of k d = 3, or of a paddle",
    )
    longest: Duration | None = Field(
        default=None, description="longest period of the filter [s]; default: that of k d = 1/2, or of a paddle"
    )

    def band(self, end: Context) -> tuple[float, float]:
        """Return shortest and longest period [s], defaults resolved."""
        paddles = np.clip(end.case.paddle_periods, *_periods(end.tank, POSSIBLE_BAND))
        periods = [*_periods(end.tank, BAND), *map(float, paddles)]
        shortest, longest = min(periods), max(periods)
        shortest = self.shortest or min(shortest, (self.longest or longest) / MIN_BAND_RATIO)
        return shortest, self.longest or max(longest, shortest * MIN_BAND_RATIO)

    def build(self, end: Context) -> PassiveFilter:
        """Return the filter of the absorbing paddle."""
        shortest, longest = self.band(end)
        return PassiveFilter.fitted(
            end.wall.wavemaker, depth=end.tank.depth, gravity=end.tank.gravity, shortest=shortest, longest=longest
        )

    def reflection(self, omega: Array, end: Context) -> Array:
        """Return the reflection coefficient of small waves of angular frequencies [rad/s], shape (N,)."""
        at_face = face(end.wall.wavemaker, omega, end.tank.depth, end.tank.gravity)
        return np.abs(self.build(end).reflection(at_face, omega))

    def description(self, end: Context) -> str:
        """Return a description of the absorption."""
        shortest, longest = self.band(end)
        most = self.reflection(np.asarray(2 * np.pi / np.geomspace(shortest, longest, 50)), end).max()
        band = f"small waves from {shortest:.3g} to {longest:.3g} s"
        return f"it absorbs what comes to it, all but {100 * most:.2g} % of {band} at short steps"

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the periods are a band."""
        yield _is_possible("shortest", self.shortest, end.tank)
        yield _is_possible("longest", self.longest, end.tank)
        least = MIN_BAND_RATIO * (self.shortest or 0.0)
        allowed = f"must be at least {least:.4g} s, {MIN_BAND_RATIO:g} times the shortest"
        yield "longest", self.longest is None or self.longest >= least, allowed


class SpringDamper(CaseModel):
    """A paddle without a drive, as a mass on a spring and a damper (for a flap, at its stroke height)."""

    type: Literal["spring-damper"] = "spring-damper"
    period: Duration | None = Field(
        default=None, description="period of the tuning [s]; default: that of the opposite paddle, or of k d = 1"
    )
    mass: PerWidth = Field(default=0.0, description="mass [kg/m], per metre of width")
    stiffness: PerWidth | None = Field(
        default=None,
        description="stiffness of the spring [N/m²], per metre of width; default: no reflection at the period",
    )
    damping: PerWidth | None = Field(
        default=None, description="damping [N s/m²], per metre of width; default: no reflection at the period"
    )

    @property
    def _given(self) -> bool:
        """Whether no default depends on the period."""
        return self.stiffness is not None and self.damping is not None

    def tuned(self, end: Context) -> float:
        """Return the period [s] of the tuning, default resolved."""
        usual = next(iter(end.case.paddle_periods), _periods(end.tank, (1.0, 1.0))[0])
        return self.period or float(np.clip(usual, *_periods(end.tank, POSSIBLE_BAND)))

    def resolved(self, end: Context) -> tuple[float, float, float]:
        """Return mass [m²], stiffness [m²/s²] and damping [m²/s] over the density, defaults resolved."""
        omega, density = np.array([2 * np.pi / self.tuned(end)]), end.tank.density
        (damping,), (added,) = radiation(end.wall.wavemaker, omega, end.tank.depth, end.tank.gravity)
        mass = self.mass / density
        stiffness = float(omega[0] ** 2 * (mass + added)) if self.stiffness is None else self.stiffness / density
        return mass, stiffness, float(damping) if self.damping is None else self.damping / density

    def reflection(self, omega: Array, end: Context) -> Array:
        """Return the reflection coefficient of small waves of angular frequencies [rad/s], shape (N,)."""
        mass, stiffness, damping = self.resolved(end)
        r, added = radiation(end.wall.wavemaker, omega, end.tank.depth, end.tank.gravity)
        out_of_tune = 1j * (omega * (mass + added) - stiffness / omega)
        return np.abs((damping - r + out_of_tune) / (damping + r + out_of_tune))

    def description(self, end: Context) -> str:
        """Return a description of the absorption."""
        mass, stiffness, damping = (end.tank.density * part for part in self.resolved(end))
        parts = f"{mass:.4g} kg/m on a spring of {stiffness:.4g} N/m² and a damper of {damping:.4g} N s/m²"
        return f"it absorbs{'' if self._given else f', tuned to {self.tuned(end):.3g} s'}, a mass of {parts}"

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that waves of the period are possible, and that a default depends on it."""
        yield _is_possible("period", self.period, end.tank)
        yield "period", not (self.period and self._given), "must be left out: stiffness and damping are given"


Absorption = Annotated[
    ActiveAbsorption | SpringDamper,
    Field(discriminator="type", description="absorption of waves that return to a paddle"),
]


# ---------------------------------------------------------------- moving walls
class Limits(CaseModel):
    """Limits of the paddle's drive: a motion beyond them is refused before the run."""

    stroke: Length | None = Field(default=None, description="largest minus smallest position [m]; default: any")
    speed: Speed | None = Field(default=None, description="largest speed [m/s]; default: any")
    acceleration: Acceleration | None = Field(default=None, description="largest acceleration [m/s^2]; default: any")

    def exceeded(self, extent: Extent, *key: str) -> Iterator[Problem]:
        """Yield each limit, at a key of the case, that the extent of a motion exceeds."""
        for name, unit in (("stroke", "m"), ("speed", "m/s"), ("acceleration", "m/s^2")):
            limit, needed = getattr(self, name), getattr(extent, name)
            if limit is not None and needed > limit:
                yield Problem((*key, name), limit, f"is too little: this motion needs {needed:.4g} {unit}")


class BaseWall(CaseModel):
    """A wall at an end of the tank, by default vertical."""

    moves: ClassVar[bool] = False

    @property
    def wavemaker(self) -> Wavemaker:
        """The mode shape f(z) of the wall's motion, by which it generates waves."""
        return PISTON

    def places(self, tank: AnyTank) -> Array | None:
        """Return positions y along the paddle [m], shape (N,), at which its motion is sampled; None if uniform."""
        return None

    def added_mass(self, tank: AnyTank) -> float:
        """Return the added mass of a sudden motion [m²], over the density."""
        return sudden_mass(self.wavemaker, tank.depth)

    def max_mode_shape(self, tank: AnyTank) -> float:
        """Return the largest absolute value of the mode shape f(z)."""
        return float(np.abs(self.mode_shape(tank)).max())

    def mode_shape(self, tank: AnyTank) -> Array:
        """Return f(z) at 1001 heights from the bed up, shape (N,): the displacement over that of the motion."""
        return np.asarray(self.wavemaker.mode_shape(tank.depth * np.linspace(-1.0, TOP, 1001), tank.depth))


class MovingWallModel(BaseWall):
    """A moving wall, vertical or of another shape."""

    if TYPE_CHECKING:
        type: str
        motion: paddles.MotionModel  # its types depend on the wall

    moves: ClassVar[bool] = True
    reach: Length | None = Field(
        default=None,
        description="length over which the mapping x = X + s(X) X_p decays to zero [m]; default: the length "
        "(half of it, or the remainder, if both walls move), at most ten depths",
    )

    limits: Limits | None = Field(default=None, description="limits of the paddle's drive; default: none")

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion of the paddle in the water; raises ``CaseError`` if its file cannot be read."""
        return self.motion.build(tank, self.wavemaker, physics)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the wall can move, inside the tank and without collision with a moving opposite wall."""
        tank, length = end.tank, end.tank.length
        if end.far:
            can_move = isinstance(tank, SliceTank) or (isinstance(tank, BasinTank) and tank.layout.type == "rectangle")
            kind = "basin that is no rectangle" if isinstance(tank, BasinTank) else tank.type
            yield "type", can_move, f"must be fixed or left out: in a {kind} no far wall moves"
            sponge = end.case.sponge is not None and end.case.sponge.type in ("end", "group")
            yield "type", not sponge, "must be fixed or left out: there is a sponge before it (sponge.type)"
        yield "type", not isinstance(tank, RingTank), "must be left out: a ring has no walls, hence no paddle"
        within = self.reach is None or self.reach <= length
        yield "reach", within, f"must be at most the tank's length, {length:g} m"
        if end.far and end.opposite.moves:
            own, other = (one.reach for one in end.case.ends)
            clear = own + other <= length * (1 + 1e-9) or max(own, other) > length
            allowed = f"must be at most {metres(length - own)} m, not to overlap with wall.reach = {metres(own)} m"
            yield (("far_wall", "reach"), other), clear, f"{allowed} in a tank of {metres(length)} m"
            for key, reach, rest in (("wall", own, other), ("far_wall", other, own)):
                yield (
                    ((key, "reach"), reach),
                    reach != length or rest > 0,
                    "must leave some of the tank to the other wall",
                )


class ShapedWall(MovingWallModel):
    """A wall whose displacement depends on height."""

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
        """The mode shape that generates waves."""
        return Flap(self.hinge, self.stroke_height)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that still water and stroke height are above the hinge, and the conditions of any paddle."""
        depth, height = end.tank.depth, self.stroke_height
        yield "hinge", self.hinge < depth, f"must be below still water, less than {metres(depth)} m"
        above = f"must be above the hinge, more than {metres(self.hinge)} m"
        yield "stroke_height", height is None or height > self.hinge, above
        yield from super().checks(end)


# ---------------------------------------------------------------- segmented paddles
MAX_SEGMENTS = 1000


class SegmentedWall(MovingWallModel):
    """A wall of many paddles in a row, with separate motions."""

    absorb: ClassVar[None] = None
    motion: paddles.SegmentedPaddleMotion
    segment: Length | None = Field(
        default=None, description="largest width of a segment [m]; default: no segments, continuous in y"
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion of the segments of the paddle, hinged to each other."""
        motion = super().paddle(tank, physics)
        return motion if self.segment is None else motions.hinged(motion, self.places(tank))

    def places(self, tank: AnyTank) -> motions.Array:
        """Return positions y along the paddle [m], shape (N,), at which its motion is sampled: its joints, if any."""
        low, high = paddles.span(tank)
        return joints(low, high, segment=(high - low) / (paddles.SAMPLES - 1) if self.segment is None else self.segment)

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield a width of the paddle, nonlinear water, the conditions of any paddle, and the number of segments."""
        low, high = paddles.span(end.tank)
        recipe = "needs a basin (tank.type) whose layout says how wide it is: a recipe, not a file"
        yield "type", bool(np.isfinite(low)), recipe
        yield "type", end.physics != "linear", "needs nonlinear water (water.type), or must be a piston"
        yield from super().checks(end)
        least = (high - low) / MAX_SEGMENTS
        wide = self.segment is None or self.segment >= least
        yield "segment", wide, f"must be at least {least:.4g} m, for {MAX_SEGMENTS} segments", True


class SegmentedPistonWall(SegmentedWall):
    """A vertical wall of many pistons in a row, with separate motions."""

    type: Literal["segmented-piston"] = "segmented-piston"


class SegmentedFlapWall(HingedWall, SegmentedWall):
    """Many flaps in a row, hinged at one height, with separate motions."""

    type: Literal["segmented-flap"] = "segmented-flap"


# ---------------------------------------------------------------- fixed walls and paddles that move as a whole
class FixedWall(BaseWall):
    """A fixed wall."""

    motion: ClassVar[paddles.MotionModel] = paddles.AtRestMotion()
    absorb: ClassVar[None] = None
    reach: ClassVar[None] = None
    limits: ClassVar[None] = None
    type: Literal["fixed"] = "fixed"

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return X = 0."""
        return motions.AT_REST


class PaddleWall(MovingWallModel):
    """A moving wall without segments."""

    motion: paddles.PaddleMotion
    absorb: Absorption | None = Field(
        default=None, description="absorption of waves that return to the paddle, in a slice; default: none"
    )

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of any moving wall, and that it can absorb."""
        yield from super().checks(end)
        can_absorb = self.absorb is None or isinstance(end.tank, SliceTank)
        yield "absorb", can_absorb, f"must be left out: in a {end.tank.type} no paddle absorbs"
        driven = isinstance(self.absorb, SpringDamper) and self.motion.type != "at-rest"
        key = (end.key, "motion", "type"), self.motion.type
        yield key, not driven, "must be at-rest: a paddle that absorbs on a spring is not driven"


class PistonWall(PaddleWall):
    """A vertical wall with one motion."""

    type: Literal["piston"] = "piston"


class FlapWall(HingedWall, PaddleWall):
    """A rigid flap that rotates about a hinge; below a hinge above the bed the wall is fixed."""

    type: Literal["flap"] = "flap"
    motion_as: Literal["stroke", "angle"] = Field(
        default="stroke",
        description="meaning of values of a sinusoid, a formula, a function or a record: the horizontal position at "
        "stroke_height in metres, or the angle from the vertical in radians, positive into the water; a record with "
        "the column names of paddle.csv has positions in both cases",
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion at the stroke height; raises ``CaseError`` if its file cannot be read."""
        motion = super().paddle(tank, physics)
        if self.motion_as == "stroke" or (isinstance(self.motion, paddles.RecordedMotion) and self.motion.in_metres):
            return motion
        return motions.flap_motion(motion, self.wavemaker.arm(tank.depth))

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield the conditions of a hinged wall, and that an angle is given only for motions that allow it."""
        yield from super().checks(end)
        allowed = f"must be left out: a motion of type {self.motion.type} follows from its waves"
        generates = isinstance(self.motion, paddles.GeneratingMotion | paddles.SolitaryWaveMotion)
        yield "motion_as", self.motion_as == "stroke" or not generates, allowed


class ProfileWall(ShapedWall, PaddleWall):
    """A wall of any shape, x = f(z) X(t)."""

    shaped_by: ClassVar[str] = "shape"
    type: Literal["profile"] = "profile"
    where: HeightHelpers = Field(
        default={}, description="helpers of the formula by name, numbers or formulae; default: none"
    )
    shape: HeightFormulaText = Field(description="f(z), z the height above still water [m]")

    @property
    def wavemaker(self) -> ProfileShape:
        """The mode shape that generates waves."""
        formula = Formula(self.shape, where=self.where, variables=("z",))
        return ProfileShape(formula, lambda z: formula.derivatives(z)[1])

    def checks(self, end: Context) -> Iterator[Check]:
        """Yield that the shape is finite and displaces water, and the conditions of any paddle."""
        try:
            largest, error = self.max_mode_shape(end.tank), ""
        except InputError as refused:
            largest, error = 0.0, str(refused).removesuffix(".")
        yield "shape", largest > 0.0, error or "must not be 0 at all heights"
        yield from super().checks(end)


AnyWall = FixedWall | PistonWall | FlapWall | ProfileWall | SegmentedPistonWall | SegmentedFlapWall
Wall = Annotated[AnyWall, Field(discriminator="type", description="the wall at x = 0")]
FarWall = Annotated[
    AnyWall,
    Field(
        discriminator="type",
        description="the wall at x = length, of a slice or a rectangle; its motion and the x of its waves are positive "
        "from the wall into the water, angles are from its normal into the water, positive towards y",
    ),
]
