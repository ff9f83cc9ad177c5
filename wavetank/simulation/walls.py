"""Walls of a case: still ones and paddles, each built for its water and its side."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.case import (
    Case,
    EndWall,
    Physics,
    PistonWall,
)
from wavetank.case.wall import MovingWallModel, ShapedWall
from wavetank.fem.plane import Plane
from wavetank.motion import Motion
from wavetank.motion.feedback import FeedbackMotion
from wavetank.motion.motion import STEEPEST
from wavetank.mpi import raise_on_all_ranks
from wavetank.tank.footprint import Basin, Ring, Slice
from wavetank.tank.walls import BothEnds, LinearEnds, LinearPaddle, Piston, Placed, Polynomial, Shaped, Side, StillWall
from wavetank.values.case_model import CaseError, CaseModel, Problem, entry, renamed

Footprint = Slice | Ring | Basin


MISSED = 0.1  # of the largest share: a polynomial farther from a shape is another


FLAT = 1e-9  # of the depth


class Kind(NamedTuple):
    """A kind of wall.

    Attributes
    ----------
    wall
        Its class, which says in words what it adds and how it maps.
    build
        Returns the wall at an end of the tank, by its table, on a footprint with its plane; collective.
    """

    wall: type[Placed]
    build: Callable[[EndWall, Any, Any, Plane], Any]


def build_wall(scene: Case, footprint: Footprint, plane: Plane) -> Any:
    """Return what moves of the scene's walls, for its water; collective.

    Raises ``InputError`` where one cannot move as far.
    """
    walls = [_built(end, footprint, plane) for end in scene.paddles]
    if len(walls) < 2:
        return walls[0] if walls else StillWall()
    return LinearEnds(*walls) if scene.physics == "linear" else _both(scene, *walls, plane=plane)


def wall_classes(scene: Case) -> list[type[Placed]]:
    """Return the classes of what moves of the scene's walls, or that of one that stands still."""
    return [_kind(end).wall for end in scene.paddles] or [StillWall]


def _kind(end: EndWall) -> Kind:
    return entry(WALLS[end.case.physics], end.wall, f"WALLS of {__file__}")


def _built(end: EndWall, footprint: Footprint, plane: Plane) -> Any:
    """Return the wall at an end of the tank; collective."""
    with renamed("wall", end.key):
        return _kind(end).build(end, end.wall, footprint, plane)


def _both(scene: Case, first: Piston, second: Piston, *, plane: Plane) -> BothEnds:
    """Return both walls; raises ``CaseError`` where their reaches meet on a mesh of few cells."""
    if first.reach + second.reach > scene.tank.length * (1 + 1e-9):
        what = f"reaches {second.reach:.4g} m on this mesh, the wall {first.reach:.4g} m: must not overlap"
        raise CaseError([Problem(("far_wall", "reach"), scene.ends[1].reach, what)])
    return BothEnds(first, second, plane=plane)


def motion_of(end: EndWall) -> Motion:
    """Return what moves the wall: of a paddle that absorbs a motion of this run's own."""
    return end.motion() if getattr(end.wall, "absorb", None) is None else FeedbackMotion(end.motion())


def _linear_piston(end: EndWall, noun: PistonWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    return LinearPaddle(motion_of(end), plane=plane, side=footprint.side(end.side))


def _linear_shaped(end: EndWall, noun: ShapedWall, footprint: Slice | Basin, plane: Plane) -> LinearPaddle:
    side, shape = footprint.side(end.side), _shape(end, noun, plane)
    return LinearPaddle(motion_of(end), plane=plane, side=side, shape=shape)


def _shape(end: EndWall, noun: ShapedWall, plane: Plane) -> Polynomial:
    """Return the polynomial of a paddle's shape; raises ``CaseError`` for one that it would not show."""
    wavemaker, depth = noun.wavemaker, end.tank.depth
    shape = Polynomial.fit(lambda z: wavemaker.mode_shape(z, depth), depth, plane.mesh, kinks=wavemaker.kinks(depth))
    z = np.linspace(-depth, 0.0, 1001, dtype=np.float64)
    wanted = wavemaker.mode_shape(z, depth)
    missed = float(np.abs(shape.at(z) - wanted).max() / np.abs(wanted).max())
    if missed > MISSED:
        allowed = f"bends the paddle too sharply: the nearest polynomial misses {100 * missed:.0f} % of its stroke"
        raise CaseError([Problem(("wall", noun.shaped_by), getattr(noun, noun.shaped_by), allowed)])
    return shape


def _shaped(end: EndWall, noun: ShapedWall, footprint: Slice | Basin, plane: Plane) -> Piston:
    side, shape = footprint.side(end.side), _shape(end, noun, plane)
    wall = Shaped(motion_of(end), plane=plane, reach=_reach(end, noun, footprint, side), side=side, shape=shape)
    _check_flat(end, noun, wall, plane)
    return _checked(end, noun, wall)


def _check_flat(end: EndWall, noun: ShapedWall, wall: Piston, plane: Plane) -> None:
    """Raise ``CaseError`` for a bed that varies within the reach of a paddle that leans; collective."""
    depth, distances = end.case.depths(), wall.distances(plane)
    if not callable(depth):
        return
    result = raise_on_all_ranks(plane.comm, lambda: np.asarray(depth(*plane.places.T)))
    uneven = np.abs(result - end.tank.depth) > FLAT * end.tank.depth
    nearest = plane.comm.allreduce(float(distances[uneven].min(initial=np.inf)), op=MPI.MIN)
    if nearest < wall.reach:
        needed = STEEPEST * noun.max_mode_shape(end.tank) * end.max_displacement
        bounds = f"must be at most {nearest:.4g} m, and more than {needed:.4g} m for this motion"
        flat = f"must be of the tank's depth, to {FLAT:g} of it, within the reach of a paddle that leans"
        if noun.reach is not None and nearest > needed:
            raise CaseError([Problem(("wall", "reach"), noun.reach, f"{bounds}: the bed {flat}")])
        cure = f"its reach {bounds}"
        if nearest <= needed:
            cure = f"this motion needs more than {needed:.4g} m of such a bed; a piston needs none"
        here = f"here {wall.reach:.4g} m{'' if noun.reach else ' by default'}, and is so for {nearest:.4g} m"
        raise CaseError([Problem(("tank", "bed"), None, f"{flat}, {here}: {cure}")])


def _piston(end: EndWall, noun: MovingWallModel, footprint: Slice | Basin, plane: Plane) -> Piston:
    side = footprint.side(end.side)
    wall = Piston(motion_of(end), plane=plane, reach=_reach(end, noun, footprint, side), side=side)
    return _checked(end, noun, wall)


def _checked(end: EndWall, noun: MovingWallModel, wall: Piston) -> Piston:
    """Return the wall; raises ``CaseError`` where it goes farther than its mapping can."""
    excursion, allowed = noun.max_mode_shape(end.tank) * end.max_displacement, wall.largest_stroke
    if excursion >= allowed:
        limit = (
            f"goes {excursion:.4g} m from rest; must stay below {allowed:.4g} m, 3/4 of the reach in which its mapping "
            f"dies out, which is {wall.reach:.4g} m on this mesh and before any wall that stands still"
        )
        raise CaseError([Problem(("wall", "motion"), None, limit)])
    return wall


def _reach(end: EndWall, noun: MovingWallModel, footprint: Slice | Basin, side: Side) -> float:
    """Return where the wall's mapping has died out [m], before any wall that must not move; collective."""
    free, requested = footprint.free_reach(side), end.reach
    if noun.reach is not None and requested > free * (1 + 1e-9):
        what = "where a wall stands that does not run along the paddle's motion"
        raise CaseError([Problem(("wall", "reach"), requested, f"must be at most {free:.4g} m, {what}")])
    return min(free, requested)


WALLS: dict[Physics, dict[type[CaseModel], Kind]] = {  # by the nearest base class of a wall's table
    "nonlinear": {MovingWallModel: Kind(Piston, _piston), ShapedWall: Kind(Shaped, _shaped)},
    "linear": {MovingWallModel: Kind(LinearPaddle, _linear_piston), ShapedWall: Kind(LinearPaddle, _linear_shaped)},
}
