"""Walls of a case: fixed walls and paddles, each built for its water and its side."""

from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.base.case_model import CaseError, Problem, renamed
from wavetank.base.mpi import raise_on_all_ranks
from wavetank.case import (
    Case,
    EndWall,
)
from wavetank.case.paddle import SIZES
from wavetank.case.wall import MovingWallModel, ShapedWall
from wavetank.fem.plane import Plane
from wavetank.motion import Motion
from wavetank.motion.feedback import FeedbackMotion
from wavetank.motion.motion import STEEPEST
from wavetank.tank.energy import Part
from wavetank.tank.footprint import Basin, Ring, Slice
from wavetank.tank.walls import BothEnds, LinearPaddle, Paddle, Polynomial, Side, Wall
from wavetank.tank.walls.paddle import DESCRIPTIONS
from wavetank.tank.walls.shape import UPRIGHT

Footprint = Slice | Ring | Basin


MISSED = 0.1  # largest error of the polynomial of a shape, relative to the largest part


FLAT = 1e-9  # relative tolerance for a flat bed


def build_wall(case: Case, footprint: Footprint, plane: Plane) -> Wall:
    """Return the walls of the case, for its type of water; collective.

    Raises ``InputError`` if the reach of a paddle is too small for its motion.
    """
    paddles = [_built(end, footprint, plane) for end in case.paddles]
    if len(paddles) < 2 or case.physics == "linear":
        return Wall(*paddles)
    first, second = paddles
    if first.reach + second.reach > case.tank.length * (1 + 1e-9):
        what = f"reaches {second.reach:.4g} m on this mesh, the wall {first.reach:.4g} m: must not overlap"
        raise CaseError([Problem(("far_wall", "reach"), case.ends[1].reach, what)])
    return BothEnds(first, second)


def wall_descriptions(case: Case) -> list[tuple[Part, str]]:
    """Return the part of the Hamiltonian and the mapping for the case's paddles, or for a fixed wall."""
    kinds = ["leaning" if isinstance(end.wall, ShapedWall) else "upright" for end in case.paddles] or ["fixed"]
    return [DESCRIPTIONS["linear" if case.paddles and case.physics == "linear" else kind] for kind in kinds]


def _built(end: EndWall, footprint: Any, plane: Plane) -> Any:
    """Return the paddle at an end of the tank; collective."""
    model: Any = end.wall
    with renamed("wall", end.key):
        side = footprint.side(end.side)
        shape = _shape(end, model, plane) if isinstance(model, ShapedWall) else UPRIGHT
        if end.case.physics == "linear":
            return LinearPaddle(motion_of(end), side=side, shape=shape)
        reach = _reach(end, model, footprint, side)
        paddle = Paddle(motion_of(end), plane=plane, reach=reach, side=side, shape=shape)
        if isinstance(model, ShapedWall):
            _check_flat(end, model, paddle, plane)
        _check_stroke(end, model, paddle)
        return paddle


def motion_of(end: EndWall) -> Motion:
    """Return the motion of a wall; an absorbing paddle has a new feedback motion."""
    return end.motion() if end.wall.absorb is None else FeedbackMotion(end.motion())


def _shape(end: EndWall, model: ShapedWall, plane: Plane) -> Polynomial:
    """Return the polynomial of a paddle's shape; raises ``CaseError`` for a shape that no polynomial approximates."""
    wavemaker, depth = model.wavemaker, end.tank.depth
    shape = Polynomial.fit(lambda z: wavemaker.mode_shape(z, depth), depth, plane.mesh, kinks=wavemaker.kinks(depth))
    z = np.linspace(-depth, 0.0, 1001, dtype=np.float64)
    wanted = wavemaker.mode_shape(z, depth)
    missed = float(np.abs(shape.at(z) - wanted).max() / np.abs(wanted).max())
    if missed > MISSED:
        allowed = f"bends the paddle too sharply: the nearest polynomial has an error of {100 * missed:.0f} %"
        raise CaseError([Problem(("wall", model.shaped_by), getattr(model, model.shaped_by), allowed)])
    return shape


def _check_flat(end: EndWall, model: ShapedWall, paddle: Paddle, plane: Plane) -> None:
    """Raise ``CaseError`` for a bed that varies within the reach of a flap; collective."""
    depth, distances = end.case.depths(), paddle.side.distances(plane.places)
    if not callable(depth):
        return
    result = raise_on_all_ranks(plane.comm, lambda: np.asarray(depth(*plane.places.T)))
    uneven = np.abs(result - end.tank.depth) > FLAT * end.tank.depth
    nearest = plane.comm.allreduce(float(distances[uneven].min(initial=np.inf)), op=MPI.MIN)
    if nearest < paddle.reach:
        needed = STEEPEST * model.max_mode_shape(end.tank) * end.max_displacement
        bounds = f"must be at most {nearest:.4g} m, and more than {needed:.4g} m for this motion"
        flat = f"must be of the tank's depth, to {FLAT:g} of it, within the reach of a flap"
        if model.reach is not None and nearest > needed:
            raise CaseError([Problem(("wall", "reach"), model.reach, f"{bounds}: the bed {flat}")])
        cure = f"its reach {bounds}"
        if nearest <= needed:
            cure = f"this motion needs more than {needed:.4g} m of such a bed; a piston does not need it"
        here = f"here {paddle.reach:.4g} m{'' if model.reach else ' by default'}; the bed is flat for {nearest:.4g} m"
        raise CaseError([Problem(("tank", "bed"), None, f"{flat}, {here}: {cure}")])


def _check_stroke(end: EndWall, model: MovingWallModel, paddle: Paddle) -> None:
    """Raise ``CaseError`` if the largest displacement exceeds that of the mapping."""
    excursion, allowed = model.max_mode_shape(end.tank) * end.max_displacement, paddle.largest_stroke
    if excursion >= allowed:
        limit = (
            f"moves the paddle {excursion:.4g} m from rest; must stay below {allowed:.4g} m, 3/4 of its reach, "
            f"which is {paddle.reach:.4g} m on this mesh, up to the first fixed wall"
        )
        raise CaseError([model.motion.problem("wall", SIZES, limit)])


def _reach(end: EndWall, model: MovingWallModel, footprint: Slice | Basin, side: Side) -> float:
    """Return the length of the wall's mapping [m], limited by the nearest wall that must not move; collective."""
    free, requested = footprint.free_reach(side), end.reach
    if model.reach is not None and requested > free * (1 + 1e-9):
        what = "the distance of a wall that is not parallel to the paddle's motion"
        raise CaseError([Problem(("wall", "reach"), requested, f"must be at most {free:.4g} m, {what}")])
    return min(free, requested)
