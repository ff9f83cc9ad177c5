"""The wall at x = 0."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from wavetank import motions
from wavetank.scene.noun import Noun, Problem
from wavetank.scene.paddles import PaddleMotion
from wavetank.scene.tanks import AnyTank, RingTank

if TYPE_CHECKING:
    from wavetank.scene.scene import Scene


class FixedWall(Noun):
    """A wall that stands still."""

    type: Literal["fixed"] = "fixed"

    def paddle(self, tank: AnyTank) -> motions.Motion:
        """Return the motion of a paddle at rest."""
        return motions.AtRest()

    def reach_in(self, tank: AnyTank) -> float:
        """Return inf: there is no mapping to die out."""
        return np.inf


class PistonWall(Noun):
    """A vertical wall that moves as a whole."""

    type: Literal["piston"] = "piston"
    motion: PaddleMotion
    reach: float | None = Field(
        default=None,
        gt=0,
        description="where the mapping x = X + s(X) X_p has died out [m]; default: the length, at most ten depths",
    )

    def paddle(self, tank: AnyTank) -> motions.Motion:
        """Return the paddle's motion; raises ``SceneError`` if its file cannot be had or read."""
        return self.motion.build(tank)

    def reach_in(self, tank: AnyTank) -> float:
        """Return the reach [m], default resolved."""
        return min(tank.length, 10 * tank.depth) if self.reach is None else self.reach

    def problems(self, scene: "Scene") -> Iterator[Problem]:
        """Yield a tank without walls, a reach beyond the tank, and what is wrong with the motion."""
        if isinstance(scene.tank, RingTank):
            yield Problem(("wall", "type"), self.type, "must be left out: a ring has no walls, hence no paddle")
            return
        if self.reach is not None and self.reach > scene.tank.length:
            yield Problem(("wall", "reach"), self.reach, f"must be at most the tank's length, {scene.tank.length:g} m")
        yield from self.motion.problems(scene)


Wall = Annotated[FixedWall | PistonWall, Field(discriminator="type", description="the wall at x = 0")]
