"""The walls at the ends of the tank."""

from collections.abc import Iterator
from functools import partial
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wavetank import motion as motions
from wavetank.case.absorption import Absorption, SpringDamper
from wavetank.case.directional import SegmentedFlapWall, SegmentedPistonWall
from wavetank.case.formulae import HeightFormulaText, HeightHelpers
from wavetank.case.moving_wall import HingedWall, MovingWall, ShapedWall
from wavetank.case.paddles import PaddleMotion
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank, RingTank, SliceTank
from wavetank.errors import InputError
from wavetank.motion.mapping import TOP
from wavetank.motion.turned import ANGLES, UPSET
from wavetank.values.formula import Formula
from wavetank.values.noun import Noun, Problem
from wavetank.waves.wavemaker import PISTON, Profile, Wavemaker


class FixedWall(Noun):
    """A wall that stands still."""

    moves: ClassVar[bool] = False
    maker: ClassVar[Wavemaker] = PISTON  # one at rest
    type: Literal["fixed"] = "fixed"

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion of a paddle at rest."""
        return motions.AtRest()

    def reach_in(self, tank: AnyTank, room: float) -> float:
        """Return inf: there is no mapping to die out."""
        return np.inf

    def generation(self, tank: AnyTank, physics: str) -> None:
        """Return None: it makes no waves."""

    def generation_reason(self, tank: AnyTank, physics: str) -> str:
        """Return nothing."""
        return ""

    def places(self, tank: AnyTank) -> None:
        """Return None: it is the same all along the wall."""

    def doubts(self, tank: AnyTank) -> Iterator[str]:
        """Yield nothing."""
        yield from ()


class PaddleWall(MovingWall):
    """A wall that moves as a whole."""

    motion: PaddleMotion
    absorb: Absorption | None = Field(
        default=None, description="how it absorbs the waves that come back to it, in a slice; default: not at all"
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the paddle's motion in the water; raises ``SceneError`` if its file cannot be had or read."""
        return self.motion.resolved(tank, self.maker, physics).build(tank, self.maker)

    def generation(self, tank: AnyTank, physics: str) -> str | None:
        """Return the resolved ``generation`` of its waves; None of a motion that is not found for waves."""
        return getattr(self.motion.resolved(tank, self.maker, physics), "generation", None)

    def generation_reason(self, tank: AnyTank, physics: str) -> str:
        """Return why its generation is linear by default in nonlinear water; empty where it is not."""
        return self.motion.generation_reason(tank, self.maker, physics)

    def doubts(self, tank: AnyTank) -> Iterator[str]:
        """Yield what is doubtful of the motion."""
        yield from self.motion.doubts(tank, self.maker)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a tank without walls, a reach beyond the tank, and what is wrong with the motion."""
        if isinstance(scene.tank, RingTank):
            kind = getattr(self, "type", None)
            yield Problem(("wall", "type"), kind, "must be left out: a ring has no walls, hence no paddle")
            return
        yield from super().problems(scene)
        if self.absorb is not None and not isinstance(scene.tank, SliceTank):
            yield Problem(("wall", "absorb"), None, f"must be left out: in a {scene.tank.type} no paddle absorbs")
        elif self.absorb is not None:
            yield from self.absorb.problems(scene)
            if isinstance(self.absorb, SpringDamper) and self.motion.type != "at-rest":
                allowed = "must be at-rest: a paddle that absorbs on a spring is not driven"
                yield Problem(("wall", "motion", "type"), self.motion.type, allowed)
        yield from () if self.reads_file else self.motion_problems(scene)


class PistonWall(PaddleWall):
    """A vertical wall that moves as a whole."""

    type: Literal["piston"] = "piston"


class FlapWall(HingedWall, PaddleWall):
    """A rigid flap that turns about a hinge; below a hinge above the bed the wall stands still."""

    type: Literal["flap"] = "flap"
    motion_as: Literal["stroke", "angle"] = Field(
        default="stroke",
        description="what the numbers of a sinusoid, a formula, a function or a record are: the horizontal position at "
        "stroke_height in metres, or the angle from upright in radians, positive into the water; a record whose "
        "columns are named as in paddle.csv is of positions either way",
    )

    def paddle(self, tank: AnyTank, physics: str) -> motions.Motion:
        """Return the motion at the stroke's height; raises ``SceneError`` if its file cannot be had or read."""
        motion = super().paddle(tank, physics)
        if self.motion_as == "stroke" or self.motion.says_metres:
            return motion
        return motions.Turned(motion, self.maker.arm(tank.depth))

    def amplitude(self, tank: AnyTank) -> float:
        """Return how far it goes from rest once a ramp is over, where the case tells it, otherwise 0 [m]."""
        told = super().amplitude(tank)
        return told if self.motion_as == "stroke" else self.maker.arm(tank.depth) * float(np.tan(told))

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield what is wrong with any hinged wall, or an angle that is told of a motion that cannot be."""
        found = list(super().problems(scene))
        if found or self.motion_as == "stroke":
            yield from found
        elif self.motion.by_waves:
            allowed = f"must be left out: a motion of type {self.motion.type} is found for its waves, not told"
            yield Problem(("wall", "motion_as"), self.motion_as, allowed)
        elif (angle := super().amplitude(scene.tank)) >= UPSET:
            yield Problem(("wall", "motion", "paddle_amplitude"), angle, ANGLES)


class ProfileWall(ShapedWall, PaddleWall):
    """A wall of any shape, x = f(z) X(t)."""

    shaped_by: ClassVar[str] = "shape"
    type: Literal["profile"] = "profile"
    where: HeightHelpers = Field(default={}, description="parts of it by name, numbers or formulae; default: none")
    shape: HeightFormulaText = Field(description="f(z), z the height above still water [m]")

    @property
    def maker(self) -> Profile:
        """Its shape, by which it makes waves."""
        formula = Formula(self.shape, where=self.where, variables=("z",))
        return Profile(partial(formula.derivative, 0), partial(formula.derivative, 1))

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a shape that is not finite, or moves no water, and what is wrong with any paddle."""
        z = scene.tank.depth * np.linspace(-1.0, TOP, 1001)
        try:
            values = self.maker.share(z, scene.tank.depth)
        except InputError as error:
            yield Problem(("wall", "shape"), self.shape, str(error).removesuffix("."))
            return
        if not np.abs(values).max() > 0.0:
            yield Problem(("wall", "shape"), self.shape, "must not be 0 at all heights")
            return
        yield from super().problems(scene)


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
