"""From a scene's walls to what the water asks of them: a row in a table for each noun, in each kind of water."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import (
    FlapWall,
    Physics,
    PistonWall,
    ProfileWall,
    Scene,
    SegmentedFlapWall,
    SegmentedPistonWall,
)
from wavetank.case.wall import MovingWall, ShapedWall
from wavetank.fem.agreed import agreed
from wavetank.fem.plane import Plane
from wavetank.motion import Motion
from wavetank.motion.feedback import FeedbackMotion
from wavetank.motion.motion import STEEPEST
from wavetank.simulation.footprints import Footprint
from wavetank.tank.footprint import Basin, Slice
from wavetank.tank.walls import BothEnds, LinearEnds, LinearPaddle, Piston, Placed, Polynomial, Shaped, Side, StillWall
from wavetank.values.noun import Noun, Problem, SceneError, renamed

MISSED = 0.1  # of the largest share: a polynomial farther from a shape is another
FLAT = 1e-9  # of the depth


class Kind(NamedTuple):
    """A kind of wall.

    Attributes
    ----------
    wall
        Its class, which says in words what it adds and how it maps.
    build
        Returns the wall of a scene that moves, by its noun, on a footprint with its plane; collective.
    """

    wall: type[Placed]
    build: Callable[[Scene, Any, Any, Plane], Any]


def build_wall(scene: Scene, footprint: Footprint, plane: Plane) -> Any:
    """Return what moves of the scene's walls, for its water; collective.

    Raises ``InputError`` where one cannot move as far.
    """
    walls = [_built(seen, footprint, plane) for seen in scene.paddles]
    if len(walls) < 2:
        return walls[0] if walls else StillWall()
    return LinearEnds(*walls) if scene.physics == "linear" else _both(scene, *walls, plane=plane)


def kinds_of(scene: Scene) -> list[type[Placed]]:
    """Return the classes of what moves of the scene's walls, or that of one that stands still."""
    return [WALLS[scene.physics][type(seen.wall)].wall for seen in scene.paddles] or [StillWall]


def _built(seen: Scene, footprint: Footprint, plane: Plane) -> Any:
    """Return the wall of a scene as seen from it; collective."""
    with renamed("wall", seen.key):
        return WALLS[seen.physics][type(seen.wall)].build(seen, seen.wall, footprint, plane)


def _both(scene: Scene, near: Piston, far: Piston, *, plane: Plane) -> BothEnds:
    """Return both walls; raises ``SceneError`` where their reaches meet on a mesh of few cells."""
    if near.reach + far.reach > scene.tank.length * (1 + 1e-9):
        what = f"reaches {far.reach:.4g} m on this mesh, the wall {near.reach:.4g} m: must not overlap"
        raise SceneError([Problem(("far_wall", "reach"), scene.mirrored.reach, what)])
    return BothEnds(near, far, plane=plane)


def motion_of(scene: Scene) -> Motion:
    """Return what moves the wall: of a paddle that absorbs a motion of this run's own."""
    return scene.motion() if getattr(scene.wall, "absorb", None) is None else FeedbackMotion(scene.motion())


def _linear_piston(scene: Scene, noun: PistonWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    return LinearPaddle(motion_of(scene), plane=plane, side=footprint.side(scene.end))


def _linear_shaped(scene: Scene, noun: ShapedWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    side, shape = footprint.side(scene.end), _shape(scene, noun, plane)
    return LinearPaddle(motion_of(scene), plane=plane, side=side, shape=shape)


def _shape(scene: Scene, noun: ShapedWall, plane: Plane) -> Polynomial:
    """Return the polynomial of a paddle's shape; raises ``SceneError`` for one that it would not show."""
    maker, depth = noun.maker, scene.tank.depth
    shape = Polynomial.near(lambda z: maker.share(z, depth), depth, plane.mesh, kinks=maker.kinks(depth))
    z = np.linspace(-depth, 0.0, 1001, dtype=np.float64)
    wanted = maker.share(z, depth)
    missed = float(np.abs(shape.at(z) - wanted).max() / np.abs(wanted).max())
    if missed > MISSED:
        allowed = f"bends the paddle too sharply: the nearest polynomial misses {100 * missed:.0f} % of its stroke"
        raise SceneError([Problem(("wall", noun.shaped_by), getattr(noun, noun.shaped_by), allowed)])
    return shape


def _shaped(scene: Scene, noun: ShapedWall, footprint: Slice | Basin, plane: Plane) -> Piston:
    side, shape = footprint.side(scene.end), _shape(scene, noun, plane)
    wall = Shaped(motion_of(scene), plane=plane, reach=_reach(scene, noun, footprint, side), side=side, shape=shape)
    _check_flat(scene, noun, wall, plane)
    return _checked(scene, noun, wall)


def _check_flat(scene: Scene, noun: ShapedWall, wall: Piston, plane: Plane) -> None:
    """Raise ``SceneError`` for a bed that varies within the reach of a paddle that leans; collective."""
    depth, distances = scene.depths(), wall.distances(plane)
    if not callable(depth):
        return
    found = agreed(plane.comm, lambda: np.asarray(depth(*plane.places.T)))
    uneven = np.abs(found - scene.tank.depth) > FLAT * scene.tank.depth
    nearest = plane.comm.allreduce(float(distances[uneven].min(initial=np.inf)), op=MPI.MIN)
    if nearest < wall.reach:
        needed = STEEPEST * noun.max_mode_shape(scene.tank) * scene.excursion(scene.motion())
        bounds = f"must be at most {nearest:.4g} m, and more than {needed:.4g} m for this motion"
        flat = f"must be of the tank's depth, to {FLAT:g} of it, within the reach of a paddle that leans"
        if noun.reach is not None and nearest > needed:
            raise SceneError([Problem(("wall", "reach"), noun.reach, f"{bounds}: the bed {flat}")])
        cure = f"its reach {bounds}"
        if nearest <= needed:
            cure = f"this motion needs more than {needed:.4g} m of such a bed; a piston needs none"
        here = f"here {wall.reach:.4g} m{'' if noun.reach else ' by default'}, and is so for {nearest:.4g} m"
        raise SceneError([Problem(("tank", "bed"), None, f"{flat}, {here}: {cure}")])


def _piston(scene: Scene, noun: MovingWall, footprint: Slice | Basin, plane: Plane) -> Piston:
    side = footprint.side(scene.end)
    wall = Piston(motion_of(scene), plane=plane, reach=_reach(scene, noun, footprint, side), side=side)
    return _checked(scene, noun, wall)


def _checked(scene: Scene, noun: MovingWall, wall: Piston) -> Piston:
    """Return the wall; raises ``SceneError`` where it goes farther than its mapping can."""
    excursion, allowed = noun.max_mode_shape(scene.tank) * scene.excursion(scene.motion()), wall.largest_stroke
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
        PistonWall: Kind(Piston, _piston),
        FlapWall: Kind(Shaped, _shaped),
        ProfileWall: Kind(Shaped, _shaped),
        SegmentedPistonWall: Kind(Piston, _piston),
        SegmentedFlapWall: Kind(Shaped, _shaped),
    },
    "linear": {
        PistonWall: Kind(LinearPaddle, _linear_piston),
        FlapWall: Kind(LinearPaddle, _linear_shaped),
        ProfileWall: Kind(LinearPaddle, _linear_shaped),
    },
}
