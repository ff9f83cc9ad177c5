"""Causes of a breakdown: steep waves, short waves, steps and paddles near their limits.

The shortest waves that the cells carry, and how fast they oscillate where the surface moves.

A current u shifts the frequency of a wave of wave number k by u k at most: under a steep crest the shortest waves of
the cells there oscillate faster than on still water, and it is there that a step gets too long for them. So they do
where a paddle has narrowed cells, or leans.
"""

from math import atan, degrees, inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from wavetank.base.arrays import Vector, largest
from wavetank.integrators.stages import ITERATES
from wavetank.motion.motion import frequency_shift
from wavetank.tank.surface_flow import SurfaceFlow, SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

FARTHEST = 0.8  # of the stability limit: a stable step at the largest displacement of a paddle, or under crests
ALIKE = 1e-9  # relative: so much do wave numbers differ of cells that are as wide as each other
LITTLE = 0.02  # of a lean's tangent, or of the reach: negligible
HEIGHTS = np.linspace(-1.0, 0.0, 101, dtype=np.float64)  # depths, at which the position of a paddle is evaluated


class ShortWaves:
    """The shortest waves of each cell: k = pi p / l of its narrowest extent l, and the frequency of still water.

    The latter is the largest of the mesh for the narrowest of all cells, and falls as k^(1/2).
    """

    def __init__(self, waves: NonlinearWaves):
        plane = waves.plane
        self._comm, self._frequency_shift = plane.comm, FrequencyShift(waves)
        self._k = np.pi * plane.order / _widths(waves)
        highest = largest(self._comm, float(self._k.max(initial=0.0)))
        self._alike = largest(self._comm, float((highest - self._k).max(initial=0.0))) <= ALIKE * highest
        self._still = waves.largest_frequency * np.sqrt(self._k / highest)
        self._highest = waves.largest_frequency, highest

    @property
    def frequency_shift(self) -> float:
        """Ratio of their frequencies to those with paddles at rest, for the positions of paddles now; collective."""
        return self._frequency_shift.by()

    def largest_frequency(self, flow: SurfaceVelocity, *, least: float = 0.0) -> float:
        """Return the largest frequency [rad/s] on the surface as it moves, ``least`` if that is more; collective."""
        (still, k), faster = self._highest, self.frequency_shift
        most = faster * (still + k * flow.largest_velocity)
        if most <= least or self._alike:
            return max(least, most)
        shifted = float((self._still + self._k * flow.speeds).max(initial=0.0))
        return max(least, faster * largest(self._comm, shifted))


class FrequencyShift:
    """The largest frequency ratio of the mesh's shortest waves by the displacement of paddles.

    As ``MovingWallModel.frequency_shift`` of a case.
    """

    def __init__(self, waves: NonlinearWaves):
        plane, depth = waves.plane, waves.depth
        self._wall, self._comm, self._paddles = waves.wall, plane.comm, list[tuple[float, tuple[float, float], float]]()
        self._places = (
            plane.places[:1] if plane.mesh.topology.dim == 1 else plane.places
        )  # at all of a slice it is the same
        paddles: Any = waves.wall.paddles
        for paddle in paddles:
            mode_shape = paddle.shape.at(depth * HEIGHTS)
            slope = float(np.abs(np.diff(mode_shape)).max()) / (depth * (HEIGHTS[1] - HEIGHTS[0]))
            self._paddles.append((slope, (float(mode_shape.min()), float(mode_shape.max())), paddle.reach))

    def by(self) -> float:
        """Return the factor, for the present positions of paddles; collective."""
        faster = 1.0
        each = zip(self._paddles, self._wall.paddle_displacements(self._places), strict=True)
        for (slope, mode_shape, reach), x in each:
            ends = [sign * largest(self._comm, float((sign * x).max(initial=-np.inf))) for sign in (1.0, -1.0)]
            into = max(0.0, *(f * end for f in mode_shape for end in ends))
            lean = slope * max(map(abs, ends))
            if max(lean, into / reach) > LITTLE:
                faster = max(faster, frequency_shift(lean, into / reach))
        return faster


def _widths(waves: NonlinearWaves) -> Vector:
    """Return the narrowest extent of each cell of this rank [m], shape (cells,): of a square one its side."""
    horizontal = waves.plane.mesh
    dim = horizontal.topology.dim
    horizontal.topology.create_connectivity(dim, dim)
    cells = np.arange(horizontal.topology.index_map(dim).size_local, dtype=np.int32)
    longest = horizontal.h(dim, cells)
    if dim == 1:
        return np.asarray(longest)
    corners = horizontal.geometry.x[horizontal.geometry.dofmap[: cells.size]][:, :, :2]
    return np.asarray(np.sqrt(2) * _areas(corners) / longest)


def _areas(corners: Vector) -> Vector:
    """Return the areas of triangles, or of quadrilaterals in dolfinx's order of vertices, shape (cells, 3 or 4, 2)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    if corners.shape[1] == 4:
        first, second = corners[:, 3] - corners[:, 0], corners[:, 2] - corners[:, 1]
    return np.asarray(0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]))


NEARLY_STEEPEST = 0.5  # slope; the steepest progressive wave has 0.58
GENTLE = 0.3  # slope, of waves that break nowhere by themselves
FLAT = 0.05  # slope, of waves that no theory calls steep
LEANING = 40.0  # degrees; beside paddles that lean more the surface may fold (docs/waves.md)
LOOSEST = 1e-4  # tolerance that a case may have
NARROW = 0.75  # of a cell's width: what a mapping leaves less of is said
SQUEEZED = 0.5  # of the stability limit: above it a paddle may be to blame for what is steep in its reach
FOLD_DISTANCE = 2.0  # depths
STEP = 1e-3  # of the depth, over which the lean of a paddle is a difference


class _PaddlePose(NamedTuple):
    """Position and lean of a paddle of a slice.

    Attributes
    ----------
    called, key
        "paddle" or "far paddle", and its table of a case.
    place
        Where it is at still water, x [m].
    lean
        Its angle from upright there, positive into the water [degrees].
    into
        How far it has gone into the water where it has gone farthest [m].
    reach
        That of its mapping [m].
    width
        What that has left of the narrowest cell's width [-].
    """

    called: str
    key: str
    place: float
    lean: float
    into: float
    reach: float
    width: float

    @property
    def squeezes(self) -> str:
        """What it does to the cells, in words."""
        extent = f"the {self.called} stands {self.into:.3g} m in the water"
        return f"{extent}, and its mapping over {self.reach:.3g} m leaves cells {self.width:.2g} of their width"


class Cause(NamedTuple):
    """Why a step failed.

    Attributes
    ----------
    words
        What was so, and what may do.
    cure
        The setting of the numerics that may help, ``KEY=VALUE``; empty if there is none. It has the
        only step that the words name.
    """

    words: str
    cure: str = ""


def _poses(waves: NonlinearWaves) -> list[_PaddlePose]:
    """Return position and lean of the paddles of a slice now."""
    result, d, wall = list[_PaddlePose](), waves.depth, waves.wall
    if not isinstance(waves.surface, SurfaceFlow):
        return result
    paddles: Any = wall.paddles
    for paddle, displacements in zip(paddles, wall.paddle_displacements(np.zeros((1, 2)))[:, 0], strict=True):
        below, here, above = displacements * paddle.shape.at(STEP * d * np.array([-1.0, 0.0, 1.0]))
        names = ("paddle", "wall") if paddle.side.sign > 0 else ("far paddle", "far_wall")
        place = float(paddle.side.point[0] + paddle.side.sign * here)
        lean = degrees(atan((above - below) / (2.0 * STEP * d)))
        into = max(0.0, float((displacements * paddle.shape.at(d * HEIGHTS)).max()))
        result.append(_PaddlePose(*names, place, lean, into, paddle.reach, 1.0 - into / paddle.largest_stroke))
    return result


def folds(waves: NonlinearWaves, q: Vector, p: Vector, t: float) -> str:
    """Return in words that the surface of a slice folds beside a paddle that leans far; empty if not; collective.

    Or that nothing else can be to blame than that it does: no wave is steep.
    """
    flow, far = waves.surface, [one for one in _poses(waves) if abs(one.lean) > LEANING]
    if not isinstance(flow, SurfaceFlow) or not far or not _are_numbers(waves, q, p):
        return ""
    flow.update(q, p, t)
    for one in far:
        away, direction = abs(_steepest_place(flow) - one.place), "into" if one.lean > 0 else "out of"
        leans = f"the {one.called} leans {abs(one.lean):.0f} degrees {direction} the water"
        if away < FOLD_DISTANCE * waves.depth:
            folded = f"the surface folds beside it (slope {flow.largest_slope:.2g}, {away:.2g} m from it)"
        elif flow.largest_slope < GENTLE:
            folded = f"no wave is steep (largest slope {flow.largest_slope:.2g})"
        else:
            continue
        return f"{leans}, and {folded}: it must lean less, or go more gently"
    return ""


def _are_numbers(waves: NonlinearWaves, q: Vector, p: Vector) -> bool:
    """Return whether a state has nothing in it that is no number; collective."""
    return isfinite(waves.plane.sum(q) + waves.plane.sum(p))


def _steepest_place(surface: SurfaceFlow) -> float:
    """Return where the surface of a slice is steepest, x [m]."""
    x, _, slope, _ = surface.profile
    return float(x[np.argmax(np.abs(slope))])


def _two_digits(step: float) -> str:
    """Return a step [s] to two digits."""
    return f"{float(f'{step:.2g}'):g}"


def cause(
    waves: NonlinearWaves,
    q: Vector,
    p: Vector,
    t: float,
    *,
    dt: float,
    limit: float,
    tolerance: float,
    frequency_shift: float = 1.0,
    warned: float | None = None,
) -> Cause:
    """Return why a step dt [s] from a state failed; collective.

    Parameters
    ----------
    waves, q, p, t
        The water, and the state that the step began with.
    dt, limit
        The step [s], and the scheme's limit of omega dt.
    tolerance
        Of the step's solves, relative.
    frequency_shift
        The frequency ratio of the shortest waves of still water at the largest displacement of paddles, which the step
        named allows for.
    warned
        The step that the watch on it has named [s]: none is named that is longer.
    """
    if not _are_numbers(waves, q, p):
        return Cause(
            "the state that the step began with holds what is no number, such as an observer, a filter or a motion of "
            "one's own can make of it, or the step before, where it was too long or the waves too steep for the mesh"
        )
    flow: Any = waves.surface
    flow.update(q, p, t)
    narrow, limit = [one for one in _poses(waves) if one.width < NARROW], min(limit, ITERATES)
    short, still = ShortWaves(waves), waves.largest_frequency
    frequency, squeezed = short.largest_frequency(flow), still * short.frequency_shift
    squeezes = "".join(f", and {one.squeezes}" for one in narrow)
    longer = "".join(f", or more of {one.key}.reach" for one in narrow)
    moves = f"{dt * frequency:.3g} where the surface moves, at up to {flow.largest_velocity:.3g} m/s"
    stable_step = min(FARTHEST * limit / (still * frequency_shift), inf if warned is None else warned)
    if flow.largest_slope < GENTLE and dt * frequency <= limit:
        what = (
            f"neither is the step long (dt omega_max = {dt * frequency:.3g}) nor are the waves steep (largest slope "
            f"{flow.largest_slope:.2g})"
        )
        if flow.largest_slope < FLAT and not narrow:
            return Cause(
                f"{what}: the solves do not get as exact as asked in water {waves.depth:.3g} m deep on "
                f"cells of {waves.plane.cell_size:.3g} m; a larger numerics.tolerance, or other cells, may do",
                f"numerics.tolerance={min(10 * tolerance, LOOSEST):g}",
            )
        step = _two_digits(min(stable_step, 0.5 * dt))
        grown = f"short waves that the mesh carries have grown; a step of {step} s, or finer cells{longer}, may do"
        return Cause(f"{what}{squeezes}: {grown}", f"numerics.dt={step}")
    step = _two_digits(min(stable_step, FARTHEST * limit / frequency))
    within_reach = narrow and any(abs(_steepest_place(flow) - one.place) < one.reach for one in narrow)
    if narrow and dt * squeezed > (SQUEEZED if within_reach else FARTHEST) * limit:
        shortest = f"dt omega_max = {dt * still:.3g} on still water with the paddle at rest, {dt * squeezed:.3g} there"
        long = f"the step is too long for waves as short as these: {shortest}, {moves}"
        return Cause(f"{squeezes.removeprefix(', and ')}: {long}; try {step} s{longer}", f"numerics.dt={step}")
    steep = f"the waves are too steep for the mesh, or break (largest slope of the surface {flow.largest_slope:.2g})"
    if not dt * frequency > limit:
        return Cause(steep, f"numerics.dt={_two_digits(stable_step)}" if stable_step < dt else "")
    long = f"the step is too long: dt omega_max = {dt * still:.3g} on still water, {moves}"
    long = f"{long}{squeezes}; try {step} s{longer}"
    return Cause(long if flow.largest_slope < NEARLY_STEEPEST else f"{steep}, or {long}", f"numerics.dt={step}")
