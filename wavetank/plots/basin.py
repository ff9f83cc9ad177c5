"""The surface of a basin over time, and maps of its crest, wave heights and gauges."""

from collections.abc import Iterator
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyvista as pv
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation
from numpy.typing import NDArray
from scipy.interpolate import BarycentricInterpolator
from scipy.spatial import KDTree

from wavetank.errors import InputError
from wavetank.output.directory import REST_POSITION, RunDirectory
from wavetank.output.fields import piece_files
from wavetank.plots.style import (
    CM,
    DAMPED,
    DARK,
    DEPTH,
    FLAT,
    LIGHT,
    PADDLE,
    SATURATED,
    lay_out,
    mark_places,
    mark_sponge,
    picture,
    remove_overlaps,
)

# ---------------------------------------------------------------- surface
Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SAME = 1e-9  # of the basin's size: points as close are one, on the two sides of a border between ranks
SAME_AT_REST = 1e-6  # of the basin's size: rest positions are in single precision
AROUND = 4  # snapshots that the surface between two of them is interpolated from
CACHED = 8  # snapshots in memory
SLOPING = 1e-3  # of the depth: a bed that varies less is flat
MOVING = 1e-7  # of the basin's length: smaller displacements are no motion of a paddle
DAMPING = "damping rate"  # of the sponge, among a snapshot's point data
CORNERS = {pv.CellType.TRIANGLE: 3, pv.CellType.QUAD: 4}


class BasinSurface:
    """The surface of a run in a basin: the pieces of all ranks as one mesh.

    Points have the numbers of the first snapshot. The number of ranks may change where a run was resumed; points of
    later snapshots are then identified by their positions at rest.

    Attributes
    ----------
    times
        Of the snapshots [s], shape (M,), increasing.
    first
        The points (x, y, eta) [m] of the first snapshot, shape (N, 3).
    depth
        Still-water depth d at the points [m], shape (N,).
    damping
        Damping rate of the sponge at the points [1/s], shape (N,); None where there is none.
    pieces
        Corners of the triangles or quadrilaterals between the points, anticlockwise, shape (F, 3) or (F, 4).

    Raises ``InputError`` if the run has no snapshot, or damaged ones; so do all methods that read one.
    """

    def __init__(self, run: RunDirectory):
        snapshots = run.fields("surface")
        if not snapshots:
            raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
        times, self._files = zip(*snapshots, strict=True)
        self.times = np.array(times)
        if not np.all(np.diff(self.times) > 0):
            raise InputError(f"{run.path}: its snapshots are damaged; times must increase.")
        self._merge()
        self.snapshot = lru_cache(CACHED)(self._snapshot)

    def _merge(self) -> None:
        """Join the pieces of the ranks."""
        parts = _read(self._files[0])
        flat = parts.copy()
        flat.points = parts.points * (1.0, 1.0, 0.0)
        # in x and y: points on a border are computed by the ranks on both sides, equal to solver tolerance
        merged = flat.clean(tolerance=SAME * parts.length, produce_merge_map=True)
        self._chosen: Indices
        _, self._chosen = np.unique(merged.field_data["PointMergeMap"], return_index=True)
        self._stored, self._rest, self._size = parts.n_points, _rest_positions(parts), float(parts.length)
        kinds = [kind for kind in CORNERS if kind in merged.cells_dict]
        if len(kinds) != 1 or "depth" not in parts.point_data:
            raise InputError(f"{self._files[0]}: is no surface of triangles or quadrilaterals with their depth.")
        self.pieces: Indices = merged.cells_dict[kinds[0]].astype(np.int64)
        self.depth: Array = np.asarray(parts["depth"][self._chosen], float)
        damping = np.asarray(parts[DAMPING][self._chosen], float) if DAMPING in parts.point_data else np.zeros(1)
        self.damping: Array | None = damping if damping.any() else None
        self.first: Array = np.asarray(parts.points[self._chosen], float)

    def _snapshot(self, number: int) -> Array:
        """Return the points (x, y, eta) [m] of a snapshot by its number, shape (N, 3)."""
        parts = _read(self._files[number])
        return np.asarray(parts.points[self._numbers(parts, self._files[number])], float)

    def _numbers(self, parts: pv.UnstructuredGrid, file: Path) -> Indices:
        """Return the numbers that the points have in a snapshot, shape (N,)."""
        rest = _rest_positions(parts)
        if np.array_equal(rest, self._rest) and parts.n_points == self._stored:
            return self._chosen
        if not (len(rest) and len(self._rest)):
            raise InputError(f"{file}: {parts.n_points} points; the first snapshot has {self._stored}.")
        distances, numbers = KDTree(rest).query(self._rest[self._chosen])
        if distances.max() > SAME_AT_REST * self._size:
            raise InputError(f"{file}: its cells differ from those of the first snapshot; they must be the same.")
        return np.asarray(numbers, np.int64)

    def snapshots(self) -> Iterator[tuple[float, Array]]:
        """Yield times [s] and points (x, y, eta) [m], shape (N, 3), one after the other."""
        for number, t in enumerate(self.times):
            yield float(t), self._snapshot(number)

    def at(self, t: float) -> Array:
        """Return the points (x, y, eta) [m] at t [s], shape (N, 3), interpolated between the snapshots around."""
        begin = int(np.searchsorted(self.times, t)) - AROUND // 2
        begin = int(np.clip(begin, 0, max(0, self.times.size - AROUND)))
        around = range(begin, min(begin + AROUND, self.times.size))
        values = np.array([self.snapshot(number) for number in around])
        return np.asarray(BarycentricInterpolator(self.times[around.start : around.stop], values)(t))

    @property
    def contours(self) -> Array:
        """The still-water depths [m] that lines of the bed are drawn at; none over a flat bed."""
        low, high = float(self.depth.min()), float(self.depth.max())
        least = SLOPING * high
        levels = np.array(MaxNLocator(8, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        return levels[(levels > low + least) & (levels < high - least)]

    @property
    def edges(self) -> Indices:
        """Start and end of each piece's sides among the points, shape (E, 2)."""
        return np.stack([self.pieces, np.roll(self.pieces, -1, axis=1)], axis=-1).reshape(-1, 2)

    @cached_property
    def loops(self) -> list[Indices]:
        """The points of each closed line of the rim, the water on its left; the outermost first."""
        edges = self.edges
        low, high = edges.min(axis=1), edges.max(axis=1)
        _, first, count = np.unique(low * len(self.first) + high, return_index=True, return_counts=True)
        after = dict(edges[first[count == 1]].tolist())
        loops = []
        while after:
            start, point = after.popitem()
            loop = [start]
            while point != start:
                loop.append(point)
                point = after.pop(point)
            loops.append(np.array(loop))
        return sorted(loops, key=lambda loop: -_area(self.first[loop]))

    def moving_walls(self, displacement: Array) -> list["MovingWall"]:
        """Return the walls that move across themselves: the paddle, and the far wall if it moves.

        ``displacement`` [m], shape (N, 2), is the largest horizontal one of each point. The mapping moves points of the
        side walls, too, but along these walls.
        """
        rim = self.loops[0]
        edges = np.diff(self.first[np.append(rim, rim[0]), :2], axis=0)
        outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1, keepdims=True)
        mean = (displacement[rim] + displacement[np.roll(rim, -1)]) / 2
        across = np.abs(np.sum(mean * outward, axis=1))
        moving = across > np.maximum(MOVING * np.ptp(self.first[:, :2]), np.linalg.norm(mean, axis=1) / np.sqrt(2))
        if not np.any(moving):
            return []
        opposite = outward @ outward[np.argmax(moving)] < 0
        return [self._moving_wall(moving & end, outward) for end in (~opposite, opposite) if np.any(moving & end)]

    def _moving_wall(self, edges: NDArray[np.bool_], outward: Array) -> "MovingWall":
        """Return the wall of some edges of the rim."""
        rim, normal = self.loops[0], outward[edges].mean(axis=0)
        normal /= np.linalg.norm(normal)
        points = rim[edges | np.roll(edges, 1)]
        return MovingWall(points[np.argsort(self.first[points, :2] @ (-normal[1], normal[0]))], normal)


class MovingWall(NamedTuple):
    """A moving wall: its points of the surface, from one end to the other, and its unit normal out of the water."""

    points: Indices
    outward: Array


def _area(line: Array) -> float:
    """Return the area within a closed line (x, y, ...) [m], positive if it runs anticlockwise."""
    x, y = line[:, 0], line[:, 1]
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def _rest_positions(parts: pv.UnstructuredGrid) -> Array:
    """Return (x, y) [m] at rest of a snapshot's points, shape (N, 2); shape (0, 2) if it does not contain them."""
    return np.asarray(parts.point_data.get(REST_POSITION, np.zeros((0, 2))), float)


def _read(file: Path) -> pv.UnstructuredGrid:
    for one in (file, *(piece_files(file) if file.is_file() else [])):
        if not one.is_file():
            raise InputError(f"{one}: is missing; the run directory names it.")
    return pv.read(file)


# ---------------------------------------------------------------- sizes of waves over all snapshots
Snapshot = tuple[float, Array]


class WaveSizes(NamedTuple):
    """Sizes of the waves of a run.

    Attributes
    ----------
    low, high
        The extreme elevations [m].
    usual, slope
        The largest elevation [m] and slope [-], single sharp crests left out.
    crest_time
        Time of the highest crest [s].
    """

    low: float
    high: float
    usual: float
    slope: float
    crest_time: float


def wave_sizes(times: Array, x: Array, eta: Array) -> WaveSizes:
    """Return the sizes of waves of elevation eta [m] at x [m], shapes (M, N), and times [s], shape (M,)."""
    usual = max(float(np.quantile(np.abs(eta), SATURATED)), FLAT / CM)
    slope = float(np.quantile(np.abs(np.diff(eta) / np.diff(x)), SATURATED))
    crest_time = float(times[np.argmax(eta.max(axis=1))])
    return WaveSizes(float(eta.min()), float(eta.max()), usual, slope, crest_time)


class Extremes:
    """The highest and the lowest elevation at each point, between snapshots too.

    Where a snapshot is higher than those before and after it, the crest is that of the parabola through the three: of
    a cosine at nine snapshots a period it misses 0.5 % where the highest snapshot may miss 6 %.

    Attributes
    ----------
    high, low
        The extremes so far [m], shape (N,).
    """

    def __init__(self, points: int):
        self.high, self.low = np.full(points, -np.inf), np.full(points, np.inf)
        self._before: list[Snapshot] = []

    def add(self, t: float, eta: Array) -> None:
        """Include the elevation [m] at t [s], shape (N,), later than those before."""
        three = [*self._before, (t, eta)]
        self.high, self.low = np.maximum(self.high, eta), np.minimum(self.low, eta)
        if len(three) == 3:
            self.high = np.maximum(self.high, _crest(*three))
            self.low = np.minimum(self.low, -_crest(*((when, -one) for when, one in three)))
        self._before = three[-2:]


def _crest(first: Snapshot, second: Snapshot, third: Snapshot) -> Array:
    """Return the tops of the parabolas through three snapshots where the second is highest; elsewhere the second."""
    (t, a), (u, b), (v, c) = first, second, third
    rise, fall = (b - a) / (u - t), (c - b) / (v - u)
    bend = (fall - rise) / (v - t)
    slope = rise + bend * (u - t)
    higher = (b >= a) & (b >= c) & (bend < 0)
    return np.asarray(b - np.where(higher, slope**2 / np.where(higher, 4 * bend, 1.0), 0.0))


class History(NamedTuple):
    """The waves of a run over all snapshots.

    Attributes
    ----------
    waves
        Their sizes.
    high
        The highest elevation at each point [m], shape (N,).
    crest
        The points (x, y, eta) [m] at the time of the highest crest, shape (N, 3).
    displacement
        The largest horizontal displacement (x, y) of each point [m], shape (N, 2).
    """

    waves: WaveSizes
    high: Array
    crest: Array
    displacement: Array


def history(surface: BasinSurface) -> History:
    """Return the waves over all snapshots, which are read once, one at a time."""
    extremes = Extremes(len(surface.first))
    largest: Array = np.zeros((len(surface.first), 2))
    crest_time, crest, usual, slope = float(surface.times[0]), surface.first, FLAT / CM, 0.0
    start, end = np.unique(np.sort(surface.edges, axis=1), axis=0).T
    for t, points in surface.snapshots():
        extremes.add(t, points[:, 2])
        displacement = (points - surface.first)[:, :2]
        larger = np.linalg.norm(displacement, axis=1) > np.linalg.norm(largest, axis=1)
        largest = np.where(larger[:, None], displacement, largest)
        if points[:, 2].max() > crest[:, 2].max():
            crest_time, crest = t, points
        step = points[end] - points[start]
        slopes = np.abs(step[:, 2]) / np.hypot(step[:, 0], step[:, 1])
        usual = max(usual, float(np.quantile(np.abs(points[:, 2]), SATURATED)))
        slope = max(slope, float(np.quantile(slopes, SATURATED)))
    waves = WaveSizes(float(extremes.low.min()), float(extremes.high.max()), usual, slope, crest_time)
    return History(waves, extremes.high, crest, largest)


# ---------------------------------------------------------------- maps
LEVELS = 64  # of colours
WIDTH, WIDE = 5.2, 9.5  # of a map [inch], the maps in a row or in a column
ELONGATED = 0.4  # width over length of a basin up to which maps are in a column
PERIODS, SNAPSHOTS = 3, 6  # wave heights are those of the last periods, if there are so many snapshots in each
RIM = "#444444"


class Map(NamedTuple):
    """A map of the basin.

    Attributes
    ----------
    title, label
        Its title, and that of its colours.
    points
        Places of the values, (x, y, ...) [m], shape (N, 3).
    values
        Shape (N,) [m].
    limits
        The values at which the colours end [m].
    colours, ink
        The name of matplotlib's colour map, and the colour of marks upon it.
    """

    title: str
    label: str
    points: Array
    values: Array
    limits: tuple[float, float]
    colours: str = "viridis"
    ink: str = LIGHT


def basin_figure(run: RunDirectory, path: Path) -> Path:
    """Draw the elevation at the time of the highest crest, the highest elevation, and the height of regular waves.

    Over contours of the bed, with paddle and gauges; heights are crest minus trough over the last periods of a paddle
    that has one. Returns ``path``; raises ``InputError`` for less than two snapshots.
    """
    surface = BasinSurface(run)
    if surface.times.size < 2:
        raise InputError(f"{path}: {surface.times.size} snapshots of the surface received; at least 2 are needed.")
    extremes, gauges = history(surface), run.gauges
    usual, crest, high = extremes.waves.usual, extremes.crest, extremes.high
    title = f"at the highest crest of the snapshots, t = {extremes.waves.crest_time:.2f} s"
    maps = [
        Map(title, "elevation [cm]", crest, crest[:, 2], (-usual, usual), "RdBu_r", DARK),
        Map("the highest elevation of the snapshots", "elevation [cm]", surface.first, high, _limits(high)),
        *_wave_heights(run, surface),
    ]
    rows = {row["name"] for row in run.manifest.get("scene", {}).get("gauge_lines", ())}
    length, width = np.ptp(surface.first[:, :2], axis=0)
    shape, number = float(width / length), len(maps)
    size = (WIDTH * number, float(np.clip(1.8 + 0.94 * WIDTH * shape, 3.5, 14.0)))
    if shape < ELONGATED:
        size = (WIDE, 0.5 + number * (0.8 + 0.95 * WIDE * shape))
    with picture(path, *size, title=run.title or "Surface elevation") as figure:
        grid, bar = ((number, 1), "right") if shape < ELONGATED else ((1, number), "bottom")
        panels = figure.subplots(*grid, squeeze=False, sharex=True, sharey=True).ravel()
        for axes, one in zip(panels, maps, strict=True):
            _draw_map(figure, axes, surface, one, bar)
            for wall in surface.moving_walls(extremes.displacement):
                axes.plot(*one.points[wall.points, :2].T, color=PADDLE, lw=3.5, solid_capstyle="butt")
            mark_places(axes, gauges, rows=rows, ink=one.ink)
        lay_out(figure)  # the places of names are final only now
        for axes in panels:
            remove_overlaps(axes)
    return path


def _limits(values: Array) -> tuple[float, float]:
    """Return the values [m] at which colours begin and end, single sharp crests left out."""
    low, high = np.quantile(values, [1 - SATURATED, SATURATED])
    return float(low), max(float(high), float(low) + FLAT / CM)


def _wave_heights(run: RunDirectory, surface: BasinSurface) -> list[Map]:
    """Return the map of crest minus trough over the last periods; none without a period, or of too few snapshots."""
    motion = run.manifest.get("scene", {}).get("wall", {}).get("motion") or {}
    period, end = motion.get("period"), surface.times[-1]
    if period is None or end - surface.times[0] < 2 * PERIODS * period:  # the waves have not come yet
        return []
    last = np.flatnonzero(surface.times >= end - PERIODS * period)
    if last.size < PERIODS * SNAPSHOTS:
        return []
    extremes = Extremes(len(surface.first))
    for number in last:
        extremes.add(surface.times[number], surface.snapshot(int(number))[:, 2])
    heights = extremes.high - extremes.low
    title = f"wave height from t = {surface.times[last[0]]:.2f} to {end:.2f} s"
    return [Map(title, "crest minus trough [cm]", surface.first, heights, _limits(heights))]


def _draw_map(figure: Figure, axes: Axes, surface: BasinSurface, one: Map, bar: Any) -> None:
    """Draw a map with the side of its colour bar, lines of the bed, sponge and rim."""
    plan = Triangulation(one.points[:, 0], one.points[:, 1], _triangles(surface.pieces))
    levels = CM * np.linspace(*one.limits, LEVELS)
    filled = axes.tricontourf(plan, CM * one.values, levels, cmap=one.colours, extend="both")
    colours = figure.colorbar(filled, ax=axes, location=bar, shrink=0.85, aspect=35, pad=0.02, label=one.label)
    colours.set_ticks(MaxNLocator(7).tick_values(levels[0], levels[-1])[1:-1])
    if surface.contours.size:
        lines = axes.tricontour(plan, surface.depth, surface.contours, colors=one.ink, linewidths=0.6)
        for text in axes.clabel(lines, fmt=lambda depth: f"{depth:g} m", fontsize=7):
            text.set_gid(DEPTH)
    if surface.damping is not None:
        damping = surface.damping / surface.damping.max()
        axes.tricontourf(plan, damping, [DAMPED, 1.0], colors="none", hatches=["//"], extend="max")
        inside = damping > DAMPED
        mark_sponge(axes, (float(plan.x[inside].mean()), float(plan.y[inside].mean())), va="center")
    rim = [one.points[np.append(loop, loop[0]), :2] for loop in surface.loops]
    axes.add_collection(LineCollection(rim, colors=RIM, linewidths=0.8))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=one.title)
    axes.label_outer()
    axes.grid(False)


def _triangles(pieces: Indices) -> Indices:
    """Return triangles instead of triangles or quadrilaterals, shape (F, 3)."""
    fans = [pieces[:, [0, corner, corner + 1]] for corner in range(1, pieces.shape[1] - 1)]
    return np.concatenate(fans)
