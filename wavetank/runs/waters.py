"""From a scene to the tank with its water."""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from wavetank import case as nouns
from wavetank.runs.footprints import Footprint, build_footprint
from wavetank.fe.plane import Plane
from wavetank.values.noun import Problem, SceneError, about
from wavetank.case import Physics, Scene
from wavetank.case.moving_wall import MovingWall
from wavetank.water.bed import Depth
from wavetank.water.linear_waves import LinearPiston, LinearWaves
from wavetank.water.footprint import Basin, Ring, Slice
from wavetank.water.walls import StillWall, Side, Piston, Wall
from wavetank.water.waves import NonlinearWaves, Tolerances

AnyWaves = NonlinearWaves | LinearWaves


def build_waves(scene: Scene, comm: MPI.Comm) -> AnyWaves:
    """Return the tank with its water; collective."""
    return fill(scene, build_footprint(scene, comm))


def fill(scene: Scene, footprint: Footprint) -> AnyWaves:
    """Return a footprint with the scene's water in it; collective."""
    with about("tank", "bed"):
        return WATERS[scene.physics](scene, footprint, Plane(footprint.mesh, scene.numerics.order, footprint.chart))


def _depth(scene: Scene) -> float | Depth:
    return scene.tank.depth if scene.tank.bed is None else scene.tank.bed.build()


def told_of_bed(scene: Scene, waves: AnyWaves) -> str:
    """Return how much of the tank the bed's minimum depth touches, or nothing if it has none; collective."""
    minimum = None if scene.tank.bed is None else scene.tank.bed.minimum_depth
    if minimum is None:
        return ""
    touched = np.asarray(waves.bed.still == minimum, dtype=np.float64)
    wet, whole = (waves.plane.sum(waves.mass.apply(part)) for part in (touched, np.ones_like(touched)))
    return f"tank.bed.minimum_depth = {minimum:g} m holds for {100 * wet / whole:.3g} % of the tank"


def _driven(scene: Scene, footprint: Footprint) -> Slice | Basin | None:
    """Return the footprint if one of its walls moves."""
    return None if isinstance(footprint, Ring) or isinstance(scene.wall, nouns.FixedWall) else footprint


def _reach(scene: Scene, footprint: Slice | Basin, side: Side) -> float:
    """Return where the wall's mapping has died out [m], before any wall that must not move; collective."""
    free, asked = footprint.free_reach(side), scene.reach
    if isinstance(scene.wall, MovingWall) and scene.wall.reach is not None and asked > free * (1 + 1e-9):
        what = "where a wall stands that does not run along the paddle's motion"
        raise SceneError([Problem(("wall", "reach"), asked, f"must be at most {free:.4g} m, {what}")])
    return min(free, asked)


def _piston(scene: Scene, footprint: Slice | Basin, plane: Plane) -> Piston:
    """Return the wall that moves; collective. Raises ``InputError`` where it goes too far for its mapping's reach."""
    motion, side = scene.motion(), footprint.side()
    wall = Piston(motion, plane=plane, reach=_reach(scene, footprint, side), side=side)
    stroke, allowed = scene.stroke(motion), wall.largest_stroke
    if stroke >= allowed:
        limit = (
            f"goes {stroke:.4g} m from rest; must stay below {allowed:.4g} m, 3/4 of the reach in which its mapping "
            f"dies out, which is {wall.reach:.4g} m on this mesh and before any wall that stands still"
        )
        raise SceneError([Problem(("wall", "motion"), None, limit)])
    return wall


def _nonlinear(scene: Scene, footprint: Footprint, plane: Plane) -> NonlinearWaves:
    numerics = scene.numerics
    wall: Wall = StillWall()
    if driven := _driven(scene, footprint):
        wall = _piston(scene, driven, plane)
    return NonlinearWaves(
        plane,
        depth=_depth(scene),
        gravity=scene.tank.gravity,
        wall=wall,
        vertical_order=numerics.vertical_order,
        tolerances=Tolerances(stage=numerics.tolerance, interior=0.1 * numerics.tolerance),
    )


def _linear(scene: Scene, footprint: Footprint, plane: Plane) -> LinearWaves:
    wall, motion = StillWall(), scene.motion()
    if driven := _driven(scene, footprint):
        wall = LinearPiston(motion, plane=plane, side=driven.side())
    return LinearWaves(
        plane,
        depth=_depth(scene),
        gravity=scene.tank.gravity,
        wall=wall,
        vertical_order=scene.numerics.vertical_order,
        tolerance=scene.numerics.tolerance,
    )


WATERS: dict[Physics, Callable[[Scene, Footprint, Plane], AnyWaves]] = {"nonlinear": _nonlinear, "linear": _linear}
