"""Why a step could not be made: what the surface was like that it began with, and what the step was for it."""

from math import atan, degrees, isfinite

import numpy as np

from wavetank.arrays import Vector
from wavetank.hamiltonian.stage_solver import ITERATES
from wavetank.water.short_waves import ShortWaves
from wavetank.water.surface_flow import SurfaceFlow
from wavetank.water.waves import NonlinearWaves

NEARLY_STEEPEST = 0.5  # slope; the steepest progressive wave has 0.58
FLAT = 0.05  # slope, of waves that no theory calls steep
LEANING = 40.0  # degrees; beside paddles that lean more the surface may fold (docs/waves.md)
BESIDE = 2.0  # depths
STEP = 1e-3  # of the depth, over which a paddle's shape is looked at


def folds(waves: NonlinearWaves, q: Vector, p: Vector, t: float) -> str:
    """Return in words that the surface of a slice folds beside a paddle that leans far; empty if not; collective."""
    flow = waves.surface
    if not isinstance(flow, SurfaceFlow) or not waves.wall.leans:
        return ""
    flow.update(q, p, t)
    x, _, slope, _ = flow.profile
    steepest, z = float(x[np.argmax(np.abs(slope))]), STEP * waves.depth * np.array([-1.0, 0.0, 1.0])
    for paddle, stand in zip(waves.wall.paddles, waves.wall.stand(np.zeros((1, 2)))[:, 0], strict=True):
        below, here, above = stand * paddle.shape.at(z)
        lean = degrees(atan((above - below) / (z[2] - z[0])))
        place = float(paddle.side.point[0] + paddle.side.sign * here)
        if abs(lean) > LEANING and abs(steepest - place) < BESIDE * waves.depth:
            end, way = "far " if paddle.side.sign < 0 else "", "into" if lean > 0 else "out of"
            folded = f"slope {flow.largest_slope:.2g}, {abs(steepest - place):.2g} m from it"
            leans = f"the {end}paddle leans {abs(lean):.0f} degrees {way} the water"
            return f"{leans}, and the surface folds beside it ({folded}): it must lean less, or go more gently"
    return ""


def cause(waves: NonlinearWaves, q: Vector, p: Vector, t: float, *, dt: float, limit: float) -> str:
    """Return in words why a step dt [s] from a state failed; ``limit`` is the scheme's, of omega dt; collective."""
    if not isfinite(waves.plane.sum(q) + waves.plane.sum(p)):
        return (
            "the state that the step began with holds what is no number, such as an observer, a filter or a motion of "
            "one's own can make of it, or the step before, where it was too long or the waves too steep for the mesh"
        )
    flow = waves.surface
    flow.update(q, p, t)
    frequency, limit = ShortWaves(waves).largest_frequency(flow), min(limit, ITERATES)
    steep = f"the waves are too steep for the mesh, or break (largest slope of the surface {flow.largest_slope:.2g})"
    if flow.largest_slope < FLAT and dt * frequency <= limit:
        return (
            f"neither is the step long (dt omega_max = {dt * frequency:.3g}) nor are the waves steep (largest slope "
            f"{flow.largest_slope:.2g}): the solves do not get as exact as asked in water {waves.depth:.3g} m deep on "
            f"cells of {waves.plane.cell_size:.3g} m; a larger numerics.tolerance, or other cells, may do"
        )
    if not dt * frequency > limit:
        return steep
    long = (
        f"the step is too long: dt omega_max = {dt * waves.largest_frequency:.3g} on still water, "
        f"{dt * frequency:.3g} where the surface moves, at up to {flow.largest_velocity:.3g} m/s; "
        f"try {0.8 * limit / frequency:.2g} s"
    )
    return long if flow.largest_slope < NEARLY_STEEPEST else f"{steep}, or {long}"
