"""Causes of a breakdown: steep waves, short waves, time step and paddles near their limits.

It uses the shortest waves on the cells, and their frequency on a moving surface.

A current u shifts the frequency of a wave of wave number k by at most u k. Under a steep crest the shortest waves of
the cells oscillate faster than on still water; there a step first becomes too long for them. The same holds where a
paddle has narrowed cells, or leans.
"""

from math import atan, degrees, inf, isfinite
from typing import Any, NamedTuple

import numpy as np

from wavetank.base.arrays import Vector, largest
from wavetank.integrators.stages import ITERATES
from wavetank.motion.motion import frequency_shift
from wavetank.tank.surface_flow import SurfaceFlow, SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

FARTHEST = 0.8  # stable step at the largest displacement of a paddle, or under crests, relative to the stability limit
SAME_WIDTH = 1e-9  # relative difference of the wave numbers of cells of equal width
NEGLIGIBLE = 0.02  # negligible tangent of a lean, or displacement relative to the reach
HEIGHTS = np.linspace(-1.0, 0.0, 101, dtype=np.float64)  # heights at which a paddle is evaluated [depths]


class ShortWaves:
    """The shortest waves of each cell: k = pi p / l of its narrowest extent l, and the frequency on still water.

    The frequency is the largest of the mesh for the narrowest cell, and varies as k^(1/2).
    """

    def __init__(self, waves: NonlinearWaves):
        plane = waves.plane
        self._comm, self._frequency_shift = plane.comm, FrequencyShift(waves)
        self._k = np.pi * plane.order / _widths(waves)
        highest = largest(self._comm, float(self._k.max(initial=0.0)))
        self._alike = largest(self._comm, float((highest - self._k).max(initial=0.0))) <= SAME_WIDTH * highest
        self._still = waves.largest_frequency * np.sqrt(self._k / highest)
        self._highest = waves.largest_frequency, highest

    @property
    def frequency_shift(self) -> float:
        """Ratio of the frequencies for the current positions of the paddles to those at rest; collective."""
        return self._frequency_shift.by()

    def largest_frequency(self, flow: SurfaceVelocity, *, least: float = 0.0) -> float:
        """Return the largest frequency [rad/s] on the moving surface, at least ``least``; collective."""
        (still, k), faster = self._highest, self.frequency_shift
        most = faster * (still + k * flow.largest_velocity)
        if most <= least or self._alike:
            return max(least, most)
        shifted = float((self._still + self._k * flow.speeds).max(initial=0.0))
        return max(least, faster * largest(self._comm, shifted))


class FrequencyShift:
    """The largest ratio of frequencies of the shortest waves by the displacement of paddles.

    It corresponds to ``MovingWallModel.frequency_shift`` of a case.
    """

    def __init__(self, waves: NonlinearWaves):
        plane, depth = waves.plane, waves.depth
        self._wall, self._comm, self._paddles = waves.wall, plane.comm, list[tuple[float, tuple[float, float], float]]()
        self._places = plane.places[:1] if plane.mesh.topology.dim == 1 else plane.places  # uniform along a slice
        paddles: Any = waves.wall.paddles
        for paddle in paddles:
            mode_shape = paddle.shape.at(depth * HEIGHTS)
            slope = float(np.abs(np.diff(mode_shape)).max()) / (depth * (HEIGHTS[1] - HEIGHTS[0]))
            self._paddles.append((slope, (float(mode_shape.min()), float(mode_shape.max())), paddle.reach))

    def by(self) -> float:
        """Return the factor for the current positions of the paddles; collective."""
        faster = 1.0
        each = zip(self._paddles, self._wall.paddle_displacements(self._places), strict=True)
        for (slope, mode_shape, reach), x in each:
            ends = [sign * largest(self._comm, float((sign * x).max(initial=-np.inf))) for sign in (1.0, -1.0)]
            into = max(0.0, *(f * end for f in mode_shape for end in ends))
            lean = slope * max(map(abs, ends))
            if max(lean, into / reach) > NEGLIGIBLE:
                faster = max(faster, frequency_shift(lean, into / reach))
        return faster


def _widths(waves: NonlinearWaves) -> Vector:
    """Return the narrowest extent of each cell of this rank [m], shape (cells,); for a square cell, its side."""
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


NEARLY_STEEPEST = 0.5  # slope near that of the steepest progressive wave, 0.58
GENTLE = 0.3  # slope below which waves do not break
FLAT = 0.05  # slope below which waves are not steep
LEANING = 40.0  # lean of a paddle beyond which the surface may fold [degrees] (docs/waves.md)
LARGEST_TOLERANCE = 1e-4  # largest tolerance of a case
NARROW = 0.75  # relative width of a cell below which the message mentions the mapping
SQUEEZED = 0.5  # fraction of the stability limit above which a paddle may cause steep waves in its reach
FOLD_DISTANCE = 2.0  # distance from a paddle within which the surface folds [depths]
STEP = 1e-3  # step of the difference for the lean of a paddle [depths]


class _PaddlePose(NamedTuple):
    """Position and lean of a paddle of a slice.

    Attributes
    ----------
    called, key
        "paddle" or "far paddle", and its table in a case.
    place
        Position at still water, x [m].
    lean
        Angle from the vertical there, positive into the water [degrees].
    into
        Largest displacement into the water [m].
    reach
        Reach of its mapping [m].
    width
        Width of the narrowest cell, relative to its width at rest [-].
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
        """Description of its effect on the cells."""
        extent = f"the {self.called} is {self.into:.3g} m inside the water"
        return f"{extent}, and its mapping over {self.reach:.3g} m reduces cells to {self.width:.2g} of their width"


class Cause(NamedTuple):
    """The cause of a failed step.

    Attributes
    ----------
    words
        The cause and a possible remedy.
    cure
        Setting of the numerics that may help, ``KEY=VALUE``, or empty. Its time step equals that in ``words``.
    """

    words: str
    cure: str = ""


def _poses(waves: NonlinearWaves) -> list[_PaddlePose]:
    """Return the current position and lean of the paddles of a slice."""
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
    """Return a sentence if the surface of a slice folds beside a paddle with a large lean; otherwise empty; collective.

    Also if no wave is steep, so that no other cause remains.
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
        return f"{leans}, and {folded}: its lean or its velocity must be smaller"
    return ""


def _are_numbers(waves: NonlinearWaves, q: Vector, p: Vector) -> bool:
    """Return whether all values of a state are finite; collective."""
    return isfinite(waves.plane.sum(q) + waves.plane.sum(p))


def _steepest_place(surface: SurfaceFlow) -> float:
    """Return the position of the largest slope of the surface of a slice, x [m]."""
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
    """Return the cause of the failure of a step dt [s] from a state; collective.

    Parameters
    ----------
    waves, q, p, t
        The water, and the state at the beginning of the step.
    dt, limit
        The step [s], and the stability limit of omega dt of the scheme.
    tolerance
        Relative tolerance of the solves in the step.
    frequency_shift
        Ratio of the frequencies of the shortest waves at the largest displacement of paddles, for the proposed step.
    warned
        Step proposed by the stability watch [s], an upper bound of the proposed step.
    """
    if not _are_numbers(waves, q, p):
        return Cause(
            "the state at the beginning of the step is not finite, because of a user's observer, filter or "
            "motion, or of the previous step, if it was too long or the waves were too steep for the mesh"
        )
    flow: Any = waves.surface
    flow.update(q, p, t)
    narrow, limit = [one for one in _poses(waves) if one.width < NARROW], min(limit, ITERATES)
    short, still = ShortWaves(waves), waves.largest_frequency
    frequency, squeezed = short.largest_frequency(flow), still * short.frequency_shift
    squeezes = "".join(f", and {one.squeezes}" for one in narrow)
    longer = "".join(f", or a larger {one.key}.reach" for one in narrow)
    moves = f"{dt * frequency:.3g} on the moving surface, with velocities up to {flow.largest_velocity:.3g} m/s"
    stable_step = min(FARTHEST * limit / (still * frequency_shift), inf if warned is None else warned)
    if flow.largest_slope < GENTLE and dt * frequency <= limit:
        what = (
            f"the step is not long (dt omega_max = {dt * frequency:.3g}), the waves are not steep (largest slope "
            f"{flow.largest_slope:.2g})"
        )
        if flow.largest_slope < FLAT and not narrow:
            return Cause(
                f"{what}: the solves do not reach the tolerance in water {waves.depth:.3g} m deep on "
                f"cells of {waves.plane.cell_size:.3g} m; a larger numerics.tolerance, or other cells, may help",
                f"numerics.tolerance={min(10 * tolerance, LARGEST_TOLERANCE):g}",
            )
        step = _two_digits(min(stable_step, 0.5 * dt))
        grown = f"short waves of the mesh have grown; a step of {step} s, or finer cells{longer}, may help"
        return Cause(f"{what}{squeezes}: {grown}", f"numerics.dt={step}")
    step = _two_digits(min(stable_step, FARTHEST * limit / frequency))
    within_reach = narrow and any(abs(_steepest_place(flow) - one.place) < one.reach for one in narrow)
    if narrow and dt * squeezed > (SQUEEZED if within_reach else FARTHEST) * limit:
        shortest = f"dt omega_max = {dt * still:.3g} on still water with the paddle at rest, {dt * squeezed:.3g} there"
        long = f"the step is too long for the short waves there: {shortest}, {moves}"
        return Cause(f"{squeezes.removeprefix(', and ')}: {long}; try {step} s{longer}", f"numerics.dt={step}")
    steep = f"the waves are too steep for the mesh, or break (largest slope of the surface {flow.largest_slope:.2g})"
    if not dt * frequency > limit:
        return Cause(steep, f"numerics.dt={_two_digits(stable_step)}" if stable_step < dt else "")
    long = f"the step is too long: dt omega_max = {dt * still:.3g} on still water, {moves}"
    long = f"{long}{squeezes}; try {step} s{longer}"
    return Cause(long if flow.largest_slope < NEARLY_STEEPEST else f"{steep}, or {long}", f"numerics.dt={step}")
