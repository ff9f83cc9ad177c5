"""The wall at x = 0."""

from collections.abc import Iterator
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from wavetank import motions
from wavetank.case.directional import SegmentedPistonWall
from wavetank.case.moving_wall import MovingWall
from wavetank.case.paddles import PaddleMotion
from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank, RingTank
from wavetank.theory.wavemaker import PISTON, Wavemaker
from wavetank.values.noun import Noun, Problem


class FixedWall(Noun):
    """A wall that stands still."""

    moves: ClassVar[bool] = False
    maker: ClassVar[Wavemaker] = PISTON  # one at rest
    type: Literal["fixed"] = "fixed"

    def paddle(self, tank: AnyTank) -> motions.Motion:
        """Return the motion of a paddle at rest."""
        return motions.AtRest()

    def reach_in(self, tank: AnyTank) -> float:
        """Return inf: there is no mapping to die out."""
        return np.inf

    def places(self, tank: AnyTank) -> None:
        """Return None: it is the same all along the wall."""

    def doubts(self, tank: AnyTank) -> Iterator[str]:
        """Yield nothing."""
        yield from ()


class PistonWall(MovingWall):
    """A vertical wall that moves as a whole."""

    type: Literal["piston"] = "piston"
    motion: PaddleMotion

    def paddle(self, tank: AnyTank) -> motions.Motion:
        """Return the paddle's motion; raises ``SceneError`` if its file cannot be had or read."""
        return self.motion.build(tank, self.maker)

    def doubts(self, tank: AnyTank) -> Iterator[str]:
        """Yield what is doubtful of the motion."""
        yield from self.motion.doubts(tank, self.maker)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a tank without walls, a reach beyond the tank, and what is wrong with the motion."""
        if isinstance(scene.tank, RingTank):
            yield Problem(("wall", "type"), self.type, "must be left out: a ring has no walls, hence no paddle")
            return
        yield from super().problems(scene)
        yield from () if self.reads_file else self.motion_problems(scene)

    @property
    def reads_file(self) -> bool:
        """Whether what fits its motion is known only when a file has been read."""
        return self.motion.reads_file

    def motion_problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield what is wrong with the motion."""
        yield from self.motion.problems(scene)


Wall = Annotated[
    FixedWall | PistonWall | SegmentedPistonWall, Field(discriminator="type", description="the wall at x = 0")
]
