"""The surface of a run as moving polygons over the still-water depth, and the sizes of its waves."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial import KDTree

from wavetank.analysis.still_water import closed, sponge_rate, still_water
from wavetank.base.errors import InputError
from wavetank.output.directory import REST_POSITION, RunDirectory
from wavetank.output.fields import piece_files
from wavetank.plots.style import CM, FLAT, SATURATED

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

POINT_TOLERANCE = 1e-9  # distance over the basin's size below which points of two ranks are the same
REST_TOLERANCE = 1e-6  # the same for rest positions, which are in single precision
INTERPOLATED = 4  # number of snapshots of an interpolation
CACHED = 8  # snapshots in memory
MIN_BED_VARIATION = 1e-3  # least variation of the depth, relative to it, of a bed that is drawn as varying
MIN_DISPLACEMENT = 1e-7  # least displacement of a paddle that is drawn, over the tank's length
DAMPING = "damping rate"  # name of the sponge's damping rate in the point data of a snapshot
CORNERS = {pv.CellType.TRIANGLE: 3, pv.CellType.QUAD: 4}
FINE, WIDTH = 800, 0.22  # number of points along a slice or ring, and its drawn width over its length


@dataclass(frozen=True, eq=False)
class TankSurface:
    """The surface of a run over time.

    Attributes
    ----------
    times
        Times of the snapshots [s], shape (M,), increasing.
    snapshot
        Returns the points (x, y, eta) [m] of a snapshot by its number, shape (N, 3); raises ``InputError`` if it is
        damaged.
    depth
        Still-water depth d at the points [m], shape (N,).
    damping
        Damping rate of the sponge at the points [1/s], shape (N,); None if there is none.
    pieces
        Corners of the triangles or quadrilaterals between the points, anticlockwise, shape (F, 3) or (F, 4).
    basin
        Whether the tank is a basin.
    """

    times: Array
    snapshot: Callable[[int], Array]
    depth: Array
    damping: Array | None
    pieces: Indices
    basin: bool

    @cached_property
    def first(self) -> Array:
        """The points (x, y, eta) [m] of the first snapshot, shape (N, 3)."""
        return self.snapshot(0)

    def at(self, t: float) -> Array:
        """Return the points (x, y, eta) [m] at t [s], shape (N, 3), interpolated between snapshots."""
        if self.times.size == 1:
            return self.first
        begin = int(np.searchsorted(self.times, t)) - INTERPOLATED // 2
        begin = int(np.clip(begin, 0, max(0, self.times.size - INTERPOLATED)))
        around = range(begin, min(begin + INTERPOLATED, self.times.size))
        values = [self.snapshot(number) for number in around]
        return np.asarray(CubicSpline(self.times[around.start : around.stop], values)(t))

    @property
    def contours(self) -> Array:
        """The still-water depths [m] of contours of the bed; empty for a flat bed."""
        low, high = float(self.depth.min()), float(self.depth.max())
        least = MIN_BED_VARIATION * high
        levels = np.array(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        return levels[(levels > low + least) & (levels < high - least)]

    @cached_property
    def edges(self) -> Indices:
        """Start and end points of the sides of the pieces, shape (E, 2)."""
        return np.stack([self.pieces, np.roll(self.pieces, -1, axis=1)], axis=-1).reshape(-1, 2)

    @cached_property
    def rim(self) -> Indices:
        """Start and end points of sides that belong to one piece only, with the water on their left, shape (R, 2)."""
        _, first, count = np.unique(np.sort(self.edges, axis=1), axis=0, return_index=True, return_counts=True)
        return np.asarray(self.edges[first[count == 1]])

    def moving(self, displacement: Array) -> NDArray[np.bool_]:
        """Return which sides of the rim are on walls that move in their normal direction, shape (R,).

        ``displacement`` [m], shape (N, 2), is the largest horizontal displacement of each point. The mapping also moves
        points of the side walls, but along these walls.
        """
        along = np.diff(self.first[self.rim, :2], axis=1)[:, 0]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
        mean = displacement[self.rim].mean(axis=1)
        across = np.abs(np.sum(mean * outward, axis=1))
        least = np.maximum(MIN_DISPLACEMENT * np.ptp(self.first[:, :2]), np.linalg.norm(mean, axis=1) / np.sqrt(2))
        return np.asarray(across > least)


def tank_surface(run: RunDirectory) -> TankSurface:
    """Return the surface of a run.

    Raises ``InputError`` for a type of tank that cannot be viewed, and for no snapshots or damaged ones.
    """
    kinds = {"slice": flume_surface, "ring": flume_surface, "basin": basin_surface}
    kind = run.manifest.get("case", {}).get("tank", {}).get("type")
    if kind not in kinds:
        raise InputError(f"{run.path}: its tank is of type {kind!r}; can be viewed: {', '.join(kinds)}.")
    return kinds[kind](run)


def flume_surface(run: RunDirectory) -> TankSurface:
    """Return the surface of a slice or an unrolled ring, with a width."""
    case = run.manifest.get("case", {})
    tank, surface = case.get("tank", {}), run.snapshots()
    if missing := [key for key in ("length", "depth") if tank.get(key) is None]:
        raise InputError(f"{run.path}: its manifest does not say the tank's {missing[0]}.")
    times, length = surface.time.values, tank["length"]
    if not times.size:
        raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
    surface = closed(surface, length) if tank["type"] == "ring" else surface
    nodes, eta = surface.x.values, surface.elevation.values
    if not (np.all(np.diff(times) > 0) and np.all(np.diff(nodes) > 0) and np.all(np.isfinite(eta))):
        raise InputError(f"{run.path}: its snapshots are damaged; times and places must increase.")

    @lru_cache(CACHED)
    def snapshot(number: int) -> Array:
        x = np.linspace(nodes[number, 0], nodes[number, -1], FINE)
        z = CubicSpline(nodes[number], eta[number])(x)
        return np.concatenate(
            [np.column_stack([x, np.full_like(x, y), z]) for y in WIDTH / 2 * length * np.array([-1, 1])]
        )

    start, x = np.arange(FINE - 1), np.clip(snapshot(0)[:, 0], 0.0, length)
    pieces, bed = np.column_stack([start, start + 1, start + 1 + FINE, start + FINE]), still_water(run)
    depth = np.full_like(x, tank["depth"]) if bed is None else bed(x, 0 * x)
    return TankSurface(times, snapshot, depth, sponge_rate(case, x), pieces, basin=False)


def basin_surface(run: RunDirectory) -> TankSurface:
    """Return the surface of a run in a basin: the pieces of all ranks as one mesh.

    Points have the numbers of the first snapshot. A resumed run may have another number of ranks; points of later
    snapshots are then identified by their rest positions.
    """
    if not (snapshots := run.fields("surface")):
        raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
    times, files = zip(*snapshots, strict=True)
    if not np.all(np.diff(times) > 0):
        raise InputError(f"{run.path}: its snapshots are damaged; times must increase.")
    first = _read(files[0])
    flat, at_rest = first.copy(), _rest_positions(first)
    flat.points = first.points * (1.0, 1.0, 0.0)
    # in x and y: points on a border are computed by the ranks on both sides, equal to solver tolerance
    merged = flat.clean(tolerance=POINT_TOLERANCE * first.length, produce_merge_map=True)
    _, chosen = np.unique(merged.field_data["PointMergeMap"], return_index=True)
    kinds = [kind for kind in CORNERS if kind in merged.cells_dict]
    if len(kinds) != 1 or "depth" not in first.point_data:
        raise InputError(f"{files[0]}: is no surface of triangles or quadrilaterals with their depth.")

    @lru_cache(CACHED)
    def snapshot(number: int) -> Array:
        parts = _read(files[number])
        rest = _rest_positions(parts)
        if np.array_equal(rest, at_rest) and parts.n_points == first.n_points:
            return np.asarray(parts.points[chosen], float)
        if not (len(rest) and len(at_rest)):
            raise InputError(f"{files[number]}: {parts.n_points} points; the first snapshot has {first.n_points}.")
        distances, numbers = KDTree(rest).query(at_rest[chosen])
        if distances.max() > REST_TOLERANCE * first.length:
            raise InputError(
                f"{files[number]}: its cells differ from those of the first snapshot; they must be the same."
            )
        return np.asarray(parts.points[numbers], float)

    damping = np.asarray(first[DAMPING][chosen], float) if DAMPING in first.point_data else np.zeros(1)
    return TankSurface(
        np.array(times),
        snapshot,
        np.asarray(first["depth"][chosen], float),
        damping if damping.any() else None,
        merged.cells_dict[kinds[0]].astype(np.int64),
        basin=True,
    )


def _rest_positions(parts: pv.UnstructuredGrid) -> Array:
    """Return the rest positions (x, y) [m] of a snapshot's points, shape (N, 2); shape (0, 2) if it has none."""
    return np.asarray(parts.point_data.get(REST_POSITION, np.zeros((0, 2))), float)


def _read(file: Path) -> pv.UnstructuredGrid:
    for one in (file, *(piece_files(file) if file.is_file() else [])):
        if not one.is_file():
            raise InputError(f"{one}: is missing; the run directory names it.")
    return pv.read(file)


# ---------------------------------------------------------------- sizes of waves over all snapshots
Snapshot = tuple[float, Array]


class Extremes:
    """The highest and the lowest elevation at each point, also between snapshots.

    If a snapshot is higher than those before and after it, the crest is that of the parabola through the three. Its
    error for a cosine at nine snapshots per period is 0.5 %, that of the highest snapshot up to 6 %.

    Attributes
    ----------
    high, low
        Extremes so far [m], shape (N,).
    """

    def __init__(self, points: int):
        self.high, self.low = np.full(points, -np.inf), np.full(points, np.inf)
        self._before: list[Snapshot] = []

    def add(self, t: float, eta: Array) -> None:
        """Include the elevation [m] at t [s], shape (N,), later than the earlier ones."""
        three = [*self._before, (t, eta)]
        self.high, self.low = np.maximum(self.high, eta), np.minimum(self.low, eta)
        if len(three) == 3:
            self.high = np.maximum(self.high, _crest(*three))
            self.low = np.minimum(self.low, -_crest(*((when, -one) for when, one in three)))
        self._before = three[-2:]


def _crest(first: Snapshot, second: Snapshot, third: Snapshot) -> Array:
    """Return the maxima of the parabolas through three snapshots if the second is highest; else the second."""
    (t, a), (u, b), (v, c) = first, second, third
    rise, fall = (b - a) / (u - t), (c - b) / (v - u)
    bend = (fall - rise) / (v - t)
    slope = rise + bend * (u - t)
    higher = (b >= a) & (b >= c) & (bend < 0)
    return np.asarray(b - np.where(higher, slope**2 / np.where(higher, 4 * bend, 1.0), 0.0))


class WaveHistory(NamedTuple):
    """The waves of a run over all snapshots.

    Attributes
    ----------
    low, high
        Extreme elevations at each point [m], shape (N,).
    usual, slope
        Largest elevation [m] and slope [-], without single sharp crests.
    crest_time, crest
        Time of the highest crest [s], and the points (x, y, eta) [m] at that time, shape (N, 3).
    displacement
        Largest horizontal displacement (x, y) of each point [m], shape (N, 2).
    """

    low: Array
    high: Array
    usual: float
    slope: float
    crest_time: float
    crest: Array
    displacement: Array


def wave_history(surface: TankSurface) -> WaveHistory:
    """Return the waves over all snapshots, which are read once, one at a time."""
    extremes = Extremes(len(surface.first))
    largest: Array = np.zeros((len(surface.first), 2))
    crest_time, crest, usual, slope = float(surface.times[0]), surface.first, FLAT / CM, 0.0
    start, end = surface.edges.T
    for number, t in enumerate(surface.times):
        points = surface.snapshot(number)
        extremes.add(float(t), points[:, 2])
        displacement = (points - surface.first)[:, :2]
        larger = np.linalg.norm(displacement, axis=1) > np.linalg.norm(largest, axis=1)
        largest = np.where(larger[:, None], displacement, largest)
        if points[:, 2].max() > crest[:, 2].max():
            crest_time, crest = float(t), points
        step = points[end] - points[start]
        slopes = np.abs(step[:, 2]) / np.hypot(step[:, 0], step[:, 1])
        usual = max(usual, float(np.quantile(np.abs(points[:, 2]), SATURATED)))
        slope = max(slope, float(np.quantile(slopes, SATURATED)))
    return WaveHistory(extremes.low, extremes.high, usual, slope, crest_time, crest, largest)
