"""From a scene's wall to what the water asks of it: a row in a table for each noun, in each kind of water."""

from collections.abc import Callable
from typing import Any, NamedTuple

from wavetank.case import FixedWall, Physics, PistonWall, Scene, SegmentedPistonWall
from wavetank.case.moving_wall import MovingWall
from wavetank.fe.plane import Plane
from wavetank.runs.footprints import Footprint
from wavetank.values.noun import Noun, Problem, SceneError
from wavetank.water.footprint import Basin, Slice
from wavetank.water.walls import LinearPaddle, Piston, Placed, Side, StillWall


class Kind(NamedTuple):
    """A kind of wall.

    Attributes
    ----------
    wall
        Its class, which says in words what it adds and how it maps.
    build
        Returns the wall of a scene, by its noun, on a footprint with its plane; collective.
    """

    wall: type[Placed]
    build: Callable[[Scene, Any, Any, Plane], Any]


def build_wall(scene: Scene, footprint: Footprint, plane: Plane) -> Any:
    """Return the scene's wall, for its water; collective. Raises ``InputError`` where it cannot move as far."""
    return kind_of(scene).build(scene, scene.wall, footprint, plane)


def kind_of(scene: Scene) -> Kind:
    """Return the kind of the scene's wall."""
    return WALLS[scene.physics][type(scene.wall)]


def _still(scene: Scene, noun: FixedWall, footprint: Footprint, plane: Plane) -> StillWall:
    return StillWall()


def _linear_piston(scene: Scene, noun: PistonWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    return LinearPaddle(scene.motion(), plane=plane, side=footprint.side())


def _piston(scene: Scene, noun: MovingWall, footprint: Slice | Basin, plane: Plane) -> Piston:
    motion, side = scene.motion(), footprint.side()
    wall = Piston(motion, plane=plane, reach=_reach(scene, noun, footprint, side), side=side)
    excursion, allowed = scene.excursion(motion), wall.largest_stroke
    if excursion >= allowed:
        limit = (
            f"goes {excursion:.4g} m from rest; must stay below {allowed:.4g} m, 3/4 of the reach in which its mapping "
            f"dies out, which is {wall.reach:.4g} m on this mesh and before any wall that stands still"
        )
        raise SceneError([Problem(("wall", "motion"), None, limit)])
    return wall


def _reach(scene: Scene, noun: MovingWall, footprint: Slice | Basin, side: Side) -> float:
    """Return where the wall's mapping has died out [m], before any wall that must not move; collective."""
    free, asked = footprint.free_reach(side), scene.reach
    if noun.reach is not None and asked > free * (1 + 1e-9):
        what = "where a wall stands that does not run along the paddle's motion"
        raise SceneError([Problem(("wall", "reach"), asked, f"must be at most {free:.4g} m, {what}")])
    return min(free, asked)


WALLS: dict[Physics, dict[type[Noun], Kind]] = {
    "nonlinear": {
        FixedWall: Kind(StillWall, _still),
        PistonWall: Kind(Piston, _piston),
        SegmentedPistonWall: Kind(Piston, _piston),
    },
    "linear": {
        FixedWall: Kind(StillWall, _still),
        PistonWall: Kind(LinearPaddle, _linear_piston),
    },
}
