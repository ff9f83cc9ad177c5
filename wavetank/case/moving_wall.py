"""What walls that move have in common: the reach of their mapping, and a shape."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from pydantic import Field

from wavetank.case.surroundings import Surroundings
from wavetank.case.tanks import AnyTank
from wavetank.motion import Array
from wavetank.motion.extent import Extent
from wavetank.motion.mapping import STEEPEST, TOP, largest_stroke, quickened
from wavetank.values.noun import Noun, Problem
from wavetank.values.quantities import Acceleration, Coordinate, Length, Speed, metres
from wavetank.waves.absorption import sudden_mass
from wavetank.waves.wavemaker import PISTON, Flap, Wavemaker

SIZES = (  # of a motion: keys by which the paddle goes far
    *("paddle_amplitude", "wave_amplitude", "linear_crest", "significant_height", "height", "heights"),
    *("position", "velocity", "file"),
)


class Limits(Noun):
    """What the paddle's drive can do: a run that asks for more is refused before it begins."""

    stroke: Length | None = Field(default=None, description="from one end of its way to the other [m]; default: any")
    speed: Speed | None = Field(default=None, description="largest speed [m/s]; default: any")
    acceleration: Acceleration | None = Field(default=None, description="largest acceleration [m/s^2]; default: any")

    def exceeded(self, asked: Extent) -> Iterator[Problem]:
        """Yield each limit that a motion is beyond."""
        for name, unit in (("stroke", "m"), ("speed", "m/s"), ("acceleration", "m/s^2")):
            limit, needed = getattr(self, name), getattr(asked, name)
            if limit is not None and needed > limit:
                yield Problem(("wall", "limits", name), limit, f"is too little: this motion needs {needed:.4g} {unit}")


class MovingWall(Noun):
    """A wall that moves, vertical or of another shape."""

    if TYPE_CHECKING:
        motion: Any  # a noun, of other types at other walls

    moves: ClassVar[bool] = True
    reach: Length | None = Field(
        default=None,
        description="where the mapping x = X + s(X) X_p has died out [m]; default: the length, where both walls move "
        "half of it or what the other leaves, at most ten depths",
    )

    limits: Limits | None = Field(default=None, description="what the paddle's drive can do; default: all")

    @property
    def maker(self) -> Wavemaker:
        """Its shape, by which it makes waves."""
        return PISTON

    def shares(self, tank: AnyTank) -> Array:
        """Return how far it goes at heights from the bed up, over how far it goes where that is told, shape (N,)."""
        return np.asarray(self.maker.share(tank.depth * np.linspace(-1.0, TOP, 1001), tank.depth))

    def added_mass(self, tank: AnyTank) -> float:
        """Return the added mass of a sudden motion [m²], over the density."""
        return sudden_mass(self.maker, tank.depth)

    def farther(self, tank: AnyTank) -> float:
        """Return how far it goes at the height where it goes farthest, over how far it goes where that is told."""
        return float(np.abs(self.shares(tank)).max())

    def quickened(self, tank: AnyTank, reach: float, excursion: float) -> float:
        """Return how much faster the mesh's shortest waves get, at most, where it leans or its mapping narrows cells.

        Given are the mapping's reach and the paddle's largest distance from rest [m].
        """
        z = tank.depth * np.linspace(-1.0, 0.0, 1001)
        shares = self.maker.share(z, tank.depth)
        lean = float(np.abs(np.diff(shares) / np.diff(z)).max()) * excursion
        return quickened(lean, float(np.abs(shares).max()) * excursion / reach)

    def amplitude(self, tank: AnyTank) -> float:
        """Return how far it goes from rest once a ramp is over, where the case tells it, otherwise 0 [m]."""
        return float(getattr(self.motion, "paddle_amplitude", 0.0))

    def reach_in(self, tank: AnyTank, room: float) -> float:
        """Return the reach [m], default resolved in the room [m] that there is."""
        return min(room, 10 * tank.depth) if self.reach is None else self.reach

    def places(self, tank: AnyTank) -> Array | None:
        """Return places y along the paddle [m], shape (N,), among which it goes farthest; None where all go as far."""
        return None

    def generation(self, tank: AnyTank, physics: str) -> str | None:
        """Return the resolved ``generation`` of its waves; by itself, None."""
        return None

    def generation_reason(self, tank: AnyTank, physics: str) -> str:
        """Return why its generation is linear by default in nonlinear water; empty where it is not."""
        return ""

    def doubts(self, tank: AnyTank) -> Iterator[str]:
        """Yield what is doubtful of it before a run, a sentence each; by itself, nothing."""
        yield from ()

    def reach_problems(self, tank: AnyTank, room: float, excursion: float) -> Iterator[Problem]:
        """Yield a paddle that goes farther from rest [m] in the run, or in a longer one, than its mapping reaches."""
        motion, reach = self.motion, self.reach_in(tank, room)
        farthest = self.farther(tank) * max(excursion, self.amplitude(tank))
        needed = STEEPEST * farthest
        if needed < reach:
            return
        if self.reach is not None and needed < room:
            allowed = f"must be more than {needed:.4g} m, 4/3 of the paddle's largest distance from rest"
            yield Problem(("wall", "reach"), self.reach, allowed)
            return
        size = next((key for key in SIZES if getattr(motion, key, None) is not None), None)
        least = f"{reach:.4g} m{'' if self.reach else ' by default'}, at most the tank's length"
        allowed = f"must stay below {largest_stroke(reach):.4g} m, 3/4 of its reach, which is {least}"
        where, received = (("wall", "motion", size), getattr(motion, size)) if size else (("wall", "motion"), None)
        yield Problem(where, received, f"takes the paddle {farthest:.4g} m from rest; it {allowed}")

    @property
    def reads_file(self) -> bool:
        """Whether what fits its motion is known only when a file has been read."""
        return bool(self.motion.reads_file)

    def motion_problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield what is wrong with the motion; asked when a motion that reads a file is built, of others before."""
        yield from self.motion.problems(scene)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a reach beyond the tank."""
        if self.reach is not None and self.reach > scene.tank.length:
            yield Problem(("wall", "reach"), self.reach, f"must be at most the tank's length, {scene.tank.length:g} m")


class ShapedWall(MovingWall):
    """A wall that moves at some heights farther than at others."""

    shaped_by: ClassVar[str]  # the key that says its shape


class HingedWall(ShapedWall):
    """A wall that turns about a hinge; below a hinge above the bed it stands still."""

    shaped_by: ClassVar[str] = "hinge"
    hinge: Coordinate = Field(default=0.0, description="height of the hinge above the bed [m], negative below it")
    stroke_height: Coordinate | None = Field(
        default=None, description="height above the bed at which its motion is told [m]; default: still water"
    )

    @property
    def maker(self) -> Flap:
        """Its shape, by which it makes waves."""
        return Flap(self.hinge, self.stroke_height)

    def problems(self, scene: Surroundings) -> Iterator[Problem]:
        """Yield a hinge above the water, a stroke's height that is not above it, and what is wrong with any paddle."""
        depth, height = scene.tank.depth, self.stroke_height
        if self.hinge >= depth:
            yield Problem(("wall", "hinge"), self.hinge, f"must be below still water, less than {metres(depth)} m")
        elif height is not None and height <= self.hinge:
            allowed = f"must be above the hinge, more than {metres(self.hinge)} m"
            yield Problem(("wall", "stroke_height"), height, allowed)
        else:
            yield from super().problems(scene)
