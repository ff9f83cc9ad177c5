"""What walls that move have in common: the reach of their mapping."""

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank
from wavetank.motions import Array
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Length


class MovingWall(Noun):
    """A vertical wall that moves."""

    moves: ClassVar[bool] = True
    reach: Length | None = Field(
        default=None,
        description="where the mapping x = X + s(X) X_p has died out [m]; default: the length, at most ten depths",
    )

    def reach_in(self, tank: AnyTank) -> float:
        """Return the reach [m], default resolved."""
        return min(tank.length, 10 * tank.depth) if self.reach is None else self.reach

    def places(self, tank: AnyTank) -> Array | None:
        """Return places y along the paddle [m], shape (N,), among which it goes farthest; None where all go as far."""
        return None

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a reach beyond the tank."""
        if self.reach is not None and self.reach > scene.tank.length:
            yield Problem(("wall", "reach"), self.reach, f"must be at most the tank's length, {scene.tank.length:g} m")
