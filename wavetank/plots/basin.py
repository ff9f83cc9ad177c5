"""The surface of a basin over time, and maps of its crest, wave heights and gauges."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import NamedTuple

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
    picture,
    remove_overlaps,
)

# ---------------------------------------------------------------- surface
Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SAME = 1e-9  # of the basin's size: points as close are one, on the two sides of a border between ranks
SAME_AT_REST = 1e-6  # of the basin's size: rest positions are in single precision
AROUND = 4  # snapshots that the surface between two of them is interpolated from
KEPT = 8  # snapshots in memory
SLOPING = 1e-3  # of the depth: a bed that varies less is flat
MOVED = 1e-7  # of the basin's length: less is no paddle's motion
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
        self.snapshot = lru_cache(KEPT)(self._snapshot)

    def _merge(self) -> None:
        """Join the pieces of the ranks."""
        parts = _read(self._files[0])
        flat = parts.copy()
        flat.points = parts.points * (1.0, 1.0, 0.0)
        # in x and y: what stands on both sides of a border is computed by both, to solver tolerance the same
        whole = flat.clean(tolerance=SAME * parts.length, produce_merge_map=True)
        self._chosen: Indices
        _, self._chosen = np.unique(whole.field_data["PointMergeMap"], return_index=True)
        self._stored, self._rest, self._size = parts.n_points, _rest_positions(parts), float(parts.length)
        kinds = [kind for kind in CORNERS if kind in whole.cells_dict]
        if len(kinds) != 1 or "depth" not in parts.point_data:
            raise InputError(f"{self._files[0]}: is no surface of triangles or quadrilaterals with their depth.")
        self.pieces: Indices = whole.cells_dict[kinds[0]].astype(np.int64)
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
        near = range(begin, min(begin + AROUND, self.times.size))
        values = np.array([self.snapshot(number) for number in near])
        return np.asarray(BarycentricInterpolator(self.times[near.start : near.stop], values)(t))

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

    def moving_walls(self, travel: Array) -> list["MovingWall"]:
        """Return the walls that move across themselves: the paddle, and the far wall if it moves.

        ``travel`` [m], shape (N, 2), is the largest horizontal displacement of each point. The mapping moves points of
        the side walls, too, but along these walls.
        """
        rim = self.loops[0]
        edges = np.diff(self.first[np.append(rim, rim[0]), :2], axis=0)
        outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1, keepdims=True)
        mean = (travel[rim] + travel[np.roll(rim, -1)]) / 2
        across = np.abs(np.sum(mean * outward, axis=1))
        moving = across > np.maximum(MOVED * np.ptp(self.first[:, :2]), np.linalg.norm(mean, axis=1) / np.sqrt(2))
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
    """A wall that moves.

    Attributes
    ----------
    points
        Of the surface, from one end of the wall to the other.
    outward
        Unit normal (x, y) out of the water.
    """

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


# ---------------------------------------------------------------- what comes of all snapshots
Snapshot = tuple[float, Array]


class Extremes:
    """The highest and the lowest elevation at each point, between snapshots too.

    Where a snapshot is higher than those before and after it, the crest is that of the parabola through the three: of
    a cosine at nine snapshots a period it misses 0.5 % where the highest snapshot may miss 6 %.

    Attributes
    ----------
    high, low
        What was reached so far [m], shape (N,).
    """

    def __init__(self, points: int):
        self.high, self.low = np.full(points, -np.inf), np.full(points, np.inf)
        self._before: list[Snapshot] = []

    def add(self, t: float, eta: Array) -> None:
        """Take in the elevation [m] at t [s], shape (N,), later than those before."""
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


@dataclass(frozen=True, eq=False)
class History:
    """What the waves of a run came to.

    Attributes
    ----------
    extremes
        The highest and the lowest elevation at each point.
    crest_time, crest
        When the highest crest is there [s], and the points (x, y, eta) [m] then, shape (N, 3).
    travel
        The largest horizontal displacement (x, y) of each point [m], shape (N, 2).
    usual, slope
        The largest elevation [m] and slope [-], single sharp crests left out.
    """

    extremes: Extremes
    crest_time: float
    crest: Array
    travel: Array
    usual: float
    slope: float


def history(surface: BasinSurface) -> History:
    """Return what the waves came to; reads all snapshots once, one at a time."""
    extremes = Extremes(len(surface.first))
    travel: Array = np.zeros((len(surface.first), 2))
    crest_time, crest, usual, slope = float(surface.times[0]), surface.first, FLAT / CM, 0.0
    start, end = np.unique(np.sort(surface.edges, axis=1), axis=0).T
    for t, points in surface.snapshots():
        extremes.add(t, points[:, 2])
        displacement = (points - surface.first)[:, :2]
        farther = np.linalg.norm(displacement, axis=1) > np.linalg.norm(travel, axis=1)
        travel = np.where(farther[:, None], displacement, travel)
        if points[:, 2].max() > crest[:, 2].max():
            crest_time, crest = t, points
        step = points[end] - points[start]
        slopes = np.abs(step[:, 2]) / np.hypot(step[:, 0], step[:, 1])
        usual = max(usual, float(np.quantile(np.abs(points[:, 2]), SATURATED)))
        slope = max(slope, float(np.quantile(slopes, SATURATED)))
    return History(extremes, crest_time, crest, travel, usual, slope)


# ---------------------------------------------------------------- maps
LEVELS = 64  # of colours
BESIDE, BELOW = 5.2, 9.5  # width of a map [inch], the maps beside or below each other
LONG = 0.4  # width over length of a basin up to which they are below each other
PERIODS, SNAPSHOTS = 3, 6  # wave heights are those of the last periods, if there are so many snapshots in each
RIM = "#444444"


@dataclass(frozen=True, eq=False)
class Map:
    """What one map shows.

    Attributes
    ----------
    title, label
        What is said above it, and of its colours.
    points
        Where its values are, (x, y, ...) [m], shape (N, 3).
    values
        Shape (N,) [m].
    limits
        The values at which the colours end [m].
    colours, ink
        The name of matplotlib's colour map, and the colour of what is drawn upon it.
    """

    title: str
    label: str
    points: Array
    values: Array
    limits: tuple[float, float]
    colours: str
    ink: str


def basin_figure(run: RunDirectory, path: Path) -> Path:
    """Draw the elevation when the highest crest is there, the highest elevation, and the height of regular waves.

    Over contours of the bed, with paddle and gauges; heights are crest minus trough over the last periods of a paddle
    that has one. Returns ``path``; raises ``InputError`` for less than two snapshots.
    """
    surface = BasinSurface(run)
    if surface.times.size < 2:
        raise InputError(f"{path}: {surface.times.size} snapshots of the surface received; at least 2 are needed.")
    came_to, gauges = history(surface), run.gauges
    rows = {row["name"] for row in run.manifest.get("scene", {}).get("gauge_lines", ())}
    walls, high = surface.moving_walls(came_to.travel), came_to.extremes.high
    title, both = (
        f"at the highest crest of the snapshots, t = {came_to.crest_time:.2f} s",
        (-came_to.usual, came_to.usual),
    )
    maps = [
        Map(title, "elevation [cm]", came_to.crest, came_to.crest[:, 2], both, "RdBu_r", DARK),
        Map(
            "the highest elevation of the snapshots",
            "elevation [cm]",
            surface.first,
            high,
            _limits(high),
            "viridis",
            LIGHT,
        ),
        *_wave_heights(run, surface),
    ]
    with picture(path, *_size(surface, len(maps))) as figure:
        panels = _panels(figure, surface, len(maps))
        for axes, one in zip(panels, maps, strict=True):
            _draw_map(figure, axes, surface, one)
            for wall in walls:
                axes.plot(*one.points[wall.points, :2].T, color=PADDLE, lw=3.5, solid_capstyle="butt")
            mark_places(axes, gauges, rows=rows, ink=one.ink)
        figure.suptitle(run.title or "Surface elevation", fontsize=13, parse_math=False)
        lay_out(figure)  # where names are is known only now
        for axes in panels:
            remove_overlaps(axes)
    return path


def _limits(values: Array) -> tuple[float, float]:
    """Return where the colours of values [m] begin and end, single sharp crests left out."""
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
    return [Map(title, "crest minus trough [cm]", surface.first, heights, _limits(heights), "viridis", LIGHT)]


# ---------------------------------------------------------------- the picture
def _shape(surface: BasinSurface) -> float:
    """Return width over length of the box around the basin."""
    length, width = np.ptp(surface.first[:, :2], axis=0)
    return float(width / length)


def _size(surface: BasinSurface, maps: int) -> tuple[float, float]:
    """Return the figure's width and height [inch]."""
    shape = _shape(surface)
    if shape < LONG:
        return BELOW, 0.5 + maps * (0.8 + 0.95 * BELOW * shape)
    return BESIDE * maps, float(np.clip(1.8 + 0.94 * BESIDE * shape, 3.5, 14.0))


def _panels(figure: Figure, surface: BasinSurface, maps: int) -> list[Axes]:
    grid = (maps, 1) if _shape(surface) < LONG else (1, maps)
    return list(figure.subplots(*grid, squeeze=False, sharex=True, sharey=True).ravel())


def _draw_map(figure: Figure, axes: Axes, surface: BasinSurface, one: Map) -> None:
    x, y = one.points[:, 0], one.points[:, 1]
    plan = Triangulation(x, y, _triangles(surface.pieces))
    levels = CM * np.linspace(*one.limits, LEVELS)
    filled = axes.tricontourf(plan, CM * one.values, levels, cmap=one.colours, extend="both")
    bar = figure.colorbar(
        filled, ax=axes, location="right" if _shape(surface) < LONG else "bottom", shrink=0.85, aspect=35, pad=0.02
    )
    bar.set_ticks(MaxNLocator(7).tick_values(levels[0], levels[-1])[1:-1])
    bar.set_label(one.label)
    if surface.contours.size:
        lines = axes.tricontour(plan, surface.depth, surface.contours, colors=one.ink, linewidths=0.6)
        for text in axes.clabel(lines, fmt=lambda depth: f"{depth:g} m", fontsize=7):
            text.set_gid(DEPTH)
    if surface.damping is not None:
        _hatch_sponge(axes, plan, surface.damping / surface.damping.max())
    rim = [one.points[np.append(loop, loop[0]), :2] for loop in surface.loops]
    axes.add_collection(LineCollection(rim, colors=RIM, linewidths=0.8))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=one.title)
    axes.label_outer()
    axes.grid(False)


def _hatch_sponge(axes: Axes, plan: Triangulation, damping: Array) -> None:
    """Hatch where there is damping, of 1 at most, and say so in the middle of it."""
    axes.tricontourf(plan, damping, [DAMPED, 1.0], colors="none", hatches=["//"], extend="max")
    inside = damping > DAMPED
    place = float(plan.x[inside].mean()), float(plan.y[inside].mean())
    axes.annotate("sponge", place, ha="center", va="center", fontsize=8, bbox={"facecolor": LIGHT, "lw": 0, "pad": 1})


def _triangles(pieces: Indices) -> Indices:
    """Return triangles instead of triangles or quadrilaterals, shape (F, 3)."""
    fans = [pieces[:, [0, corner, corner + 1]] for corner in range(1, pieces.shape[1] - 1)]
    return np.concatenate(fans)
