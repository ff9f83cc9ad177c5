"""Surface, walls, bed and gauges of a run as meshes of PyVista."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from wavetank.analysis.still_water import still_water
from wavetank.case.tank import EndSponge, FormulaSponge, Sponge
from wavetank.case.wall import ShapedWall, Wall
from wavetank.errors import InputError
from wavetank.output.directory import GAUGES, RunDirectory
from wavetank.plots.basin import BasinSurface, Indices, MovingWall, history
from wavetank.plots.style import CM, FLAT, SATURATED

# ---------------------------------------------------------------- meshes of a scene
Array = NDArray[np.float64]

ELEVATION, HEIGHT, VEILED = "elevation [cm]", "z [m]", "sponge"
SLAB = 0.1  # thickness of the bed, over the depth
SAND, PAINT, GLASS, INK = "#cdb990", "#d9762b", "#9db4c4", "#1c2b3a"
DRY = {"ambient": 0.65, "diffuse": 0.5}
VEIL, COVER = (126, 87, 160), 150  # the colour of a sponge over the water, and how well it covers where it is strongest
SPONGE = "sponge: violet"
RAISED = 0.01  # of what is drawn over the surface, above it, over the height of the waves
TICK = 0.012  # length of a ruler's ticks, over the tank's size


@dataclass(frozen=True)
class Sight:
    """What moves, at one time: meshes in metres, z up from still water.

    Attributes
    ----------
    surface
        The free surface, with point data ``ELEVATION``.
    sides
        The water's sides, from the rim of the surface down to the bed, with point data ``HEIGHT``.
    paddle
        What moves of the walls; None where none does.
    contours
        Lines of equal still-water depth, drawn on the surface; None where there are none to be drawn.
    sponge
        The surface once more, with point data ``VEILED``: a colour that covers it where waves are absorbed; None where
        they are not.
    """

    surface: pv.PolyData
    sides: pv.PolyData
    paddle: pv.PolyData | None
    contours: pv.PolyData | None = None
    sponge: pv.PolyData | None = None


@dataclass(frozen=True)
class WaveSizes:
    """How large the waves of a run are.

    Attributes
    ----------
    low, high
        The extreme elevations [m].
    usual
        The largest elevation, single sharp crests left out [m].
    slope
        The largest slope of the surface, likewise [-].
    crest_time
        When the highest crest is there [s].
    """

    low: float
    high: float
    usual: float
    slope: float
    crest_time: float


@dataclass(frozen=True)
class Part:
    """What stands still: a mesh in metres, and how pyvista is to draw it."""

    name: str
    mesh: pv.PolyData
    look: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Labels:
    """Texts at places.

    Attributes
    ----------
    places
        In metres, shape (K, 3).
    texts
        One each.
    """

    places: Array
    texts: list[str]


@dataclass(frozen=True)
class Ruler:
    """A ruler beside the tank: its mesh in metres, heights at its ticks, the uppermost first, and their far ends."""

    mesh: pv.PolyData
    labels: Labels
    reach: Array


class TankView(Protocol):
    """A run as a picture needs it.

    Attributes
    ----------
    times
        Of the snapshots [s], shape (M,), increasing.
    depth
        Of still water, where it is deepest [m].
    waves
        How large they are.
    eye
        From where it is seen: degrees to the right of the view along y, and above.
    note
        What else must be said below the picture; empty if nothing.
    """

    times: Array
    depth: float
    waves: WaveSizes
    eye: tuple[float, float]
    note: str

    @property
    def extent(self) -> float:
        """The larger horizontal size of the water [m]."""

    def at(self, t: float) -> Sight:
        """Return what moves, at a time t [s] of the run."""

    def parts(self) -> Iterator[Part]:
        """Yield what stands still: first the slab whose top is the bed, then walls and what else is worth seeing."""

    def marks(self) -> Labels:
        """Return what is written along the tank."""

    def ruler(self) -> Ruler:
        """Return the vertical ruler, from the bed to the highest crest."""

    def gauges(self) -> Labels:
        """Return the gauges, and where they meet still water."""


def said(run: RunDirectory, key: str) -> Any:
    """Return what the manifest says of the tank; raise ``InputError`` if it says nothing."""
    try:
        return run.manifest["scene"]["tank"][key]
    except (KeyError, TypeError):
        raise InputError(f"{run.path}: its manifest does not say the tank's {key}.") from None


def ticks(low: float, high: float, *, most: int = 8) -> Array:
    """Return round numbers from low to high, for marks."""
    values = np.array(MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
    slack = 1e-9 * (high - low)
    return values[(values >= low - slack) & (values <= high + slack)]


# ---------------------------------------------------------------- meshes
def together(meshes: Sequence[pv.PolyData]) -> pv.PolyData | None:
    """Return one mesh of several; None of none."""
    return sum(meshes[1:], start=meshes[0]) if meshes else None


def sheet(rows: Array) -> pv.PolyData:
    """Return quadrilaterals between the points of rows [m], shape (R, N, 3)."""
    index = np.arange(rows[..., 0].size).reshape(rows.shape[:2])
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    return pv.PolyData.from_regular_faces(rows.reshape(-1, 3), np.stack(corners, axis=-1).reshape(-1, 4))


def upright(foot: Array, left: Array, *, depth: float, high: float, size: float) -> Ruler:
    """Return a ruler that stands at (x, y) = ``foot`` [m] from the bed to the highest crest, z from still water.

    Parameters
    ----------
    foot, left
        Where it is, and the direction to its left as it is seen, shape (2,).
    depth, high
        Of still water, and of the highest crest [m].
    size
        Of the tank [m].
    """
    z = ticks(-depth, max(high, 0.0), most=6)[::-1]

    def beside(ticks_away: float) -> Array:
        return np.column_stack([np.tile(foot + ticks_away * TICK * size * left, (z.size, 1)), z])

    inner, outer, text = beside(0.0), beside(1.0), beside(1.6)
    mesh = pv.line_segments_from_points(np.stack([inner, outer], axis=1).reshape(-1, 3))
    mesh += pv.Line((*foot, -depth), (*foot, max(high, z[0])))
    return Ruler(mesh, Labels(text, [f"z = {z[0]:g} m", *(f"{one:g}" for one in z[1:])]), beside(7.0))


def veiled(surface: pv.PolyData, damping: Array, height: float) -> pv.PolyData:
    """Return a surface a little raised, over waves of a height [m], in the colour of a sponge.

    ``damping`` at its points, shape (N,), over the largest there is: the colour covers where that is 1.
    """
    veil = pv.PolyData(surface.points + (0.0, 0.0, RAISED * height), surface.faces)
    colour = np.tile(np.array([*VEIL, 0], np.uint8), (veil.n_points, 1))
    colour[:, 3] = np.round(COVER * np.sqrt(damping))
    veil[VEILED] = colour
    return veil


def curtain(rim: Array, low: Array | float) -> pv.PolyData:
    """Return what hangs from a closed line [m], shape (N, 3), down to z = low [m], shape (N,) or one for all."""
    foot = rim.copy()
    foot[:, 2] = low
    return hung(np.array([foot, rim]))


def hung(rows: Array) -> pv.PolyData:
    """Return what hangs from the last of some closed lines [m], shape (R, N, 3), along the others."""
    hanging = sheet(np.concatenate([rows, rows[:, :1]], axis=1))
    hanging[HEIGHT] = hanging.points[:, 2]
    return hanging


# ---------------------------------------------------------------- gauges, sponge and walls of a case
POWER = 2  # of the distance into a sponge that its damping grows with


def gauge_places(run: RunDirectory) -> tuple[list[str], Array]:
    """Return the names of a run's gauges and their places (x, y) [m], shape (K, 2); none of a run without gauges."""
    if not (run.path / GAUGES).exists():
        return [], np.zeros((0, 2))
    gauges = run.gauges
    return gauges.gauge.values.tolist(), np.stack([gauges.x, gauges.y], axis=1)


def damping_along(run: RunDirectory, length: float) -> Callable[[Array], Array] | None:
    """Return the damping rate of a slice's sponge over its largest, a function of x [m]; None without a sponge.

    ``length`` [m] is the slice's.
    """
    try:
        sponge: Any = TypeAdapter(Sponge).validate_python(run.manifest["scene"]["sponge"])
    except (KeyError, ValidationError):
        return None
    if isinstance(sponge, EndSponge):
        width = sponge.length
        return lambda x: np.clip((x - length + width) / width, 0.0, 1.0) ** POWER
    return _shares(sponge, length) if isinstance(sponge, FormulaSponge) else None


def leaning(run: RunDirectory, depth: float, key: str = "wall") -> Callable[[Array], Array] | None:
    """Return the share f(z) of a wall by its key, at heights z [m], in which it leans; None of one that is vertical."""
    try:
        wall: Any = TypeAdapter(Wall).validate_python(run.manifest["scene"][key])
    except (KeyError, ValidationError):
        return None
    return (lambda z: wall.wavemaker.mode_shape(z, depth)) if isinstance(wall, ShapedWall) else None


def _shares(sponge: FormulaSponge, length: float) -> Callable[[Array], Array]:
    gamma, x = sponge.build(), np.linspace(0.0, length, 1000, dtype=np.float64)
    largest = max(float(gamma(x, 0 * x).max()), np.finfo(float).tiny)
    return lambda x: np.clip(gamma(np.clip(x, 0.0, length), 0 * x) / largest, 0.0, 1.0)


# ---------------------------------------------------------------- basins
BASIN_PLATE = 0.006  # thickness of the paddle, over the basin's size
CLEAR = 0.012  # of the rulers from the box around the basin, over the basin's size
CONCRETE, STONE = "#c3ccd2", "#a9b2b8"
ROUND = {"smooth_shading": True, "split_sharp_edges": True}


class BasinView:
    """A basin of any plan.

    Raises ``InputError`` if the run has no snapshot of the surface, or damaged ones; so do all methods that read one.
    """

    eye = (28.0, 36.0)

    def __init__(self, run: RunDirectory):
        self._surface, self._gauges = BasinSurface(run), gauge_places(run)
        came_to = history(self._surface)
        self.times, self.depth = self._surface.times, float(self._surface.depth.max())
        self.waves = WaveSizes(
            low=float(came_to.extremes.low.min()),
            high=float(came_to.extremes.high.max()),
            usual=came_to.usual,
            slope=came_to.slope,
            crest_time=came_to.crest_time,
        )
        sponge = SPONGE if self._surface.damping is not None else ""
        self.note = ", ".join(filter(None, (_said(self._surface.contours), sponge)))
        self._moving = self._surface.moving_walls(came_to.travel)
        farthest = np.linalg.norm(came_to.travel, axis=1).max()
        self._ground = self._surface.first * (1.0, 1.0, 0.0)
        for wall in self._moving:
            self._ground[wall.points, :2] += wall.outward * (farthest + BASIN_PLATE * self.extent)

    @property
    def extent(self) -> float:
        """The larger side of the box around the basin [m]."""
        return float(np.ptp(self._surface.first[:, :2], axis=0).max())

    def at(self, t: float) -> Sight:
        """Return what moves, at a time t [s] of the run."""
        points = self._surface.at(t)
        surface = pv.PolyData.from_regular_faces(points, self._surface.pieces)
        surface[ELEVATION] = CM * points[:, 2]
        depth = self._surface.depth
        sides = pv.merge([curtain(points[loop], -depth[loop]) for loop in self._surface.loops])
        paddles = [self._board(points, wall) for wall in self._moving]
        contours = self._contours(surface) if self._surface.contours.size else None
        return Sight(surface, sides, together(paddles), contours, self._sponge(surface))

    def parts(self) -> Iterator[Part]:
        """Yield the bed, the walls behind the water and what stands in it."""
        outer, *inner = self._surface.loops
        yield Part("bed", self.bed(), {"color": SAND, **DRY})
        yield Part("walls", self._wall(outer), {"color": CONCRETE, "culling": "front", **DRY})
        yield Part("rulers", self._rulers(), {"color": INK, "lighting": False})
        for number, loop in enumerate(inner):
            yield Part(f"island {number}", self._island(loop), {"color": STONE, **ROUND, **DRY})

    def bed(self) -> pv.PolyData:
        """Return a slab whose top is the bed, under the paddle's whole way too."""
        points = self._ground - np.outer(self._surface.depth, (0.0, 0.0, 1.0))
        top = pv.PolyData.from_regular_faces(points, self._surface.pieces)
        return pv.merge([top, *(curtain(points[loop], -(1 + SLAB) * self.depth) for loop in self._surface.loops)])

    def marks(self) -> Labels:
        """Return places beside the rulers, and their x or y."""
        x, y = (ticks(*ends) for ends in self._box)
        texts = [f"x = {x[0]:g} m", *(f"{one:g}" for one in (*x[1:], *y[:-1])), f"y = {y[-1]:g} m"]
        return Labels(np.concatenate([self._on_rulers(3.2 * CLEAR, 0), self._on_rulers(5.2 * CLEAR, 1)]), texts)

    def ruler(self) -> Ruler:
        """Return the vertical ruler, at the left of the box's front side, before the paddle."""
        foot = self._box[:, 0] - (2 * CLEAR * self.extent, 0.0)
        left = np.array([-1.0, 0.0])
        return upright(foot, left, depth=self.depth, high=self.waves.high, size=self.extent)

    def gauges(self) -> Labels:
        """Return the gauges."""
        names, places = self._gauges
        return Labels(np.pad(places, ((0, 0), (0, 1))), names)

    # ------------------------------------------------------------ meshes
    @property
    def _box(self) -> Array:
        """Least and largest x, least and largest y [m], shape (2, 2)."""
        plan = self._surface.first[:, :2]
        return np.stack([plan.min(axis=0), plan.max(axis=0)], axis=1)

    def _on_rulers(self, clear: float, axis: int) -> Array:
        """Return the places of an axis' ticks [m], shape (K, 3), so far, over the basin's size, outside the box."""
        (left, right), (low, _) = self._box
        along = ticks(*self._box[axis])
        beside = np.full_like(along, (low, right)[axis] + (-1, 1)[axis] * clear * self.extent)
        places = np.stack([along, beside] if axis == 0 else [beside, along], axis=1)
        return np.column_stack([places, np.full_like(along, -(1 + SLAB) * self.depth)])

    def _rulers(self) -> pv.PolyData:
        """Return a line with ticks along the box's front side, and one along its right side."""
        lines = pv.PolyData()
        for axis in (0, 1):
            inner, outer = self._on_rulers(CLEAR, axis), self._on_rulers(2 * CLEAR, axis)
            lines += pv.line_segments_from_points(np.stack([inner, outer], axis=1).reshape(-1, 3))
            lines += pv.Line(inner[0], inner[-1])
        return lines

    @property
    def _top(self) -> float:
        """The height of walls [m], which the highest crest does not reach."""
        return 1.3 * self.waves.high - 0.3 * self.waves.low

    def _contours(self, surface: pv.PolyData) -> pv.PolyData:
        surface["depth"] = self._surface.depth
        lines = surface.contour(self._surface.contours, scalars="depth")
        lines.points[:, 2] += RAISED * (self.waves.high - self.waves.low)
        return lines

    def _sponge(self, surface: pv.PolyData) -> pv.PolyData | None:
        damping = self._surface.damping
        if damping is None:
            return None
        return veiled(surface, damping / damping.max(), self.waves.high - self.waves.low)

    def _board(self, points: Array, wall: MovingWall) -> pv.PolyData:
        """Return the plate of a moving wall behind its line among the water's points [m], shape (N, 3)."""
        rows = np.array([points[wall.points], points[wall.points]])
        rows[..., 2] = -self._surface.depth[wall.points], np.full(wall.points.size, self._top)
        return sheet(rows).extrude((*(BASIN_PLATE * self.extent * wall.outward), 0.0), capping=True)

    def _wall(self, loop: Indices) -> pv.PolyData:
        """Return the wall along a line of the rim but for paddles; faces look at the water."""
        line = self._ground[loop] + (0.0, 0.0, self._top)
        wall, moving = curtain(line, -self._surface.depth[loop]), (np.isin(loop, one.points) for one in self._moving)
        within = sum((one & np.roll(one, -1) for one in moving), start=np.zeros(len(loop), dtype=bool))
        return wall.remove_cells(np.flatnonzero(within))

    def _island(self, loop: Indices) -> pv.PolyData:
        """Return what stands in the water within a line of the rim."""
        line = self._ground[loop] - (0.0, 0.0, self.depth)
        plan = pv.PolyData(line, faces=[len(line), *range(len(line))]).triangulate()
        return plan.extrude((0.0, 0.0, self.depth + self._top), capping=True)


def _said(contours: Array) -> str:
    """Return what lines of still-water depth [m] are; nothing of none."""
    depths = ", ".join(f"{depth:g}" for depth in contours)
    return f"lines of still-water depth {depths} m" if depths else ""


# ---------------------------------------------------------------- slices
FINE = 800  # places along a flume that a picture tells apart
LEANS, LEVELS = 5.0, 24  # depths from a paddle over which columns lean, and how many lines tell how
PLATE = 0.006  # thickness of paddle and walls, over the flume's length


# ---------------------------------------------------------------- a slice
class End(NamedTuple):
    """An end of a flume.

    Attributes
    ----------
    node
        Its place among the surface's: the first or the last.
    rest
        Where its wall stands at rest, x [m].
    out
        1 if it is the right one, -1 if it is the left one.
    lean
        The share f(z) in which its wall leans; None of one that is vertical.
    moves
        Whether that moves.
    """

    node: int
    rest: float
    out: int
    lean: Callable[[Array], Array] | None
    moves: bool

    def shift(self, x: Array, eta: Array) -> float:
        """Return how far along x [m] a wall that meets the surface there has moved where its motion is told."""
        f = 1.0 if self.lean is None else float(self.lean(eta[[self.node]])[0])
        return float(x[self.node] - self.rest) / f if f else 0.0


class FlumeView:
    """A slice: its section extruded across y.

    Raises ``InputError`` if the run has no snapshot of the surface, or damaged ones.
    """

    eye = (24.0, 27.0)
    _left: Array = np.array([-1.0, 0.0])  # of the picture, in the plan

    def __init__(self, run: RunDirectory):
        self.length, self._flat = (float(said(run, key)) for key in ("length", "depth"))
        self._bed, self._damping = still_water(run), damping_along(run, self.length)
        self._gauges, self.note = gauge_places(run), SPONGE if self._damping else ""
        self.depth = float(self._still_water(np.linspace(0.0, self.length, FINE, dtype=np.float64)).max())
        surface = run.snapshots()
        if not surface.time.size:
            raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
        self.times = surface.time.values
        self._x, self._eta = self._whole(surface.x.values, surface.elevation.values)
        if not (np.all(np.diff(self.times) > 0) and np.all(np.diff(self._x) > 0) and np.all(np.isfinite(self._eta))):
            raise InputError(f"{run.path}: its snapshots are damaged; times and places must increase.")
        self.waves = _sizes(self.times, self._x, self._eta)
        self._ends = [
            End(node, rest, out, leaning(run, self._flat, key), bool(np.ptp(self._x[:, node])))
            for key, node, rest, out in (("wall", 0, 0.0, -1), ("far_wall", -1, self.length, 1))
        ]

    @property
    def extent(self) -> float:
        """The flume's length [m]."""
        return self.length

    @property
    def width(self) -> float:
        """The flume's width [m], for the eye alone."""
        return 0.22 * self.length

    def at(self, t: float) -> Sight:
        """Return what moves, at a time t [s] of the run."""
        x, eta = self._profile(t)
        rows = self._rows(x, eta)
        surface = sheet(rows)
        surface[ELEVATION] = CM * np.tile(eta, len(rows))
        sides = hung(np.array([_rim(self._rows(*line)) for line in self._columns(x, eta)]))
        return Sight(surface, sides, self._paddles(x, eta), sponge=self._sponge(surface, x))

    def parts(self) -> Iterator[Part]:
        """Yield the bed and the walls that stand still."""
        yield Part("bed", self.bed(), {"color": SAND, **DRY})
        if (walls := self.walls()) is not None:
            yield Part("walls", walls, {"color": GLASS, "opacity": 0.22})

    def bed(self) -> pv.PolyData:
        """Return a slab whose top is the bed, under the paddle's whole way too."""
        x = np.linspace(*self._ground(), FINE, dtype=np.float64)
        rows = self._rows(x, -self._still_water(x))
        return sheet(rows) + curtain(_rim(rows), -(1 + SLAB) * self.depth)

    def walls(self) -> pv.PolyData | None:
        """Return the walls that stand still; None where none does."""
        clear = PLATE / 10 * self.length  # of the water: equal depths flicker
        return together([self._plate(end, end.rest + end.out * clear) for end in self._ends if not end.moves])

    def marks(self) -> Labels:
        """Return places along the flume, and their x."""
        x = ticks(0.0, self.length)
        clear = 0.55 * self.width  # of the bed's edge, which would hide half of them
        places = np.stack([*self._plan(x, -clear), np.full_like(x, -(1 + SLAB) * self.depth)], axis=1)
        return Labels(places, [f"{one:g} m" for one in x])

    def ruler(self) -> Ruler:
        """Return the vertical ruler, at the front's left."""
        foot = np.array([self._ground()[0] - TICK * self.extent, -self.width / 2])
        return upright(foot, self._left, depth=self.depth, high=self.waves.high, size=self.extent)

    def gauges(self) -> Labels:
        """Return the gauges, in the flume's middle."""
        names, places = self._gauges
        x = places[:, 0]
        return Labels(np.stack([*self._plan(x, 0.0), 0 * x], axis=1), names)

    # ------------------------------------------------------------ the section
    def _still_water(self, x: Array) -> Array:
        """Return the still-water depth [m], beyond the flume's ends as at them."""
        if self._bed is None:
            return np.full_like(x, self._flat)
        return self._bed(np.clip(x, 0.0, self.length), np.zeros_like(x))

    def _whole(self, x: Array, eta: Array) -> tuple[Array, Array]:
        """Return x and eta [m], shape (M, N), from end to end."""
        return x, eta

    def _plan(self, x: Array, y: float) -> tuple[Array, Array]:
        """Return where in the picture's plan (x, y) of the flume is [m]."""
        return x, np.full_like(x, y)

    def _ground(self) -> tuple[float, float]:
        """Return from where to where the bed is seen, x [m]: a little behind both walls."""
        margin = 2 * PLATE * self.length
        return float(self._x.min()) - margin, float(self._x.max()) + margin

    @cached_property
    def _section(self) -> BSpline:
        """The section's x and eta [m], shape (2, N), over time [s]: a film has more frames than a run has snapshots."""
        return make_interp_spline(self.times, np.stack([self._x, self._eta], 1), k=min(3, self.times.size - 1))

    def _profile(self, t: float) -> tuple[Array, Array]:
        """Return x and eta [m] at t [s], at more places than there are nodes if those are few."""
        x, eta = self._section(t)
        fine = np.linspace(x[0], x[-1], max(FINE, x.size))
        return fine, CubicSpline(x, eta)(fine)

    def _rows(self, x: Array, z: Array) -> Array:
        """Return the line (x, z) at the flume's near and far side, shape (2, N, 3)."""
        half = self.width / 2
        return np.array([np.stack([*self._plan(x, y), z], axis=1) for y in (-half, half)])

    def _columns(self, x: Array, eta: Array) -> Iterator[tuple[Array, Array]]:
        """Yield lines (x, z) through columns of the water from the bed to the surface; beside a paddle they lean."""
        foot, reach = -self._still_water(x), LEANS * self.depth
        leaning = [
            (end.lean, end.shift(x, eta) * np.clip(1.0 - np.abs(x - x[end.node]) / reach, 0.0, 1.0))
            for end in self._ends
            if end.lean is not None
        ]
        for part in np.linspace(0.0, 1.0, LEVELS if leaning else 2):
            z = foot + part * (eta - foot)
            yield x + sum((f(z) - f(eta)) * moved for f, moved in leaning), z

    def _sponge(self, surface: pv.PolyData, x: Array) -> pv.PolyData | None:
        if self._damping is None:
            return None
        return veiled(surface, np.tile(self._damping(x), 2), self.waves.high - self.waves.low)

    def _paddles(self, x: Array, eta: Array) -> pv.PolyData | None:
        """Return the walls that move, where they meet the surface; None where none does."""
        return together([self._paddle(end, x, eta) for end in self._ends if end.moves])

    def _paddle(self, end: End, x: Array, eta: Array) -> pv.PolyData:
        if end.lean is None:
            return self._plate(end, float(x[end.node]))
        z = np.linspace(-float(self._still_water(np.array([end.rest]))[0]), self._top, FINE, dtype=np.float64)
        line = self._rows(end.rest + end.shift(x, eta) * end.lean(z), z)
        return sheet(line).extrude((end.out * PLATE * self.length, 0.0, 0.0), capping=True)

    @property
    def _top(self) -> float:
        """The height of walls [m], which no crest overtops."""
        return 1.3 * self.waves.high - 0.3 * self.waves.low

    def _plate(self, end: End, x: float) -> pv.PolyData:
        """Return a plate across the flume from its bed, its side to the water at x [m]."""
        half, foot = self.width / 2, -float(self._still_water(np.array([x]))[0])
        return pv.Box((*sorted((x, x + end.out * PLATE * self.length)), -half, half, foot, self._top))


class RingView(FlumeView):
    """A ring: the flume bent to a circle, x = 0 in front, waves to +x running anticlockwise."""

    @property
    def extent(self) -> float:
        """The ring's outer diameter [m]."""
        return self.length / np.pi + self.width

    @property
    def width(self) -> float:
        """The ring's width [m], for the eye alone."""
        return 0.09 * self.length

    def walls(self) -> None:
        """Return None: a ring has no walls."""

    def _ground(self) -> tuple[float, float]:
        """Return from where to where the bed is seen, x [m]."""
        return 0.0, self.length

    def marks(self) -> Labels:
        """Return those in front: the water would stand before the others."""
        marks = super().marks()
        front = marks.places[:, 1] < -self.length / (4 * np.pi)
        return Labels(marks.places[front], [text for text, shown in zip(marks.texts, front, strict=True) if shown])

    def ruler(self) -> Ruler:
        """Return the vertical ruler, where the ring ends on the left as it is seen."""
        turn = np.radians(self.eye[0])
        left = -np.array([np.cos(turn), np.sin(turn)])
        foot = (self.extent / 2 + TICK * self.extent) * left
        return upright(foot, left, depth=self.depth, high=self.waves.high, size=self.extent)

    def _whole(self, x: Array, eta: Array) -> tuple[Array, Array]:
        """Return x and eta [m], shape (M, N + 1), closed."""
        return np.column_stack([x, x[:, 0] + self.length]), np.column_stack([eta, eta[:, 0]])

    def _plan(self, x: Array, y: float) -> tuple[Array, Array]:
        """Return where in the picture's plan (x, y) of the ring is [m]."""
        angle = 2 * np.pi * x / self.length - np.pi / 2
        radius = self.length / (2 * np.pi) - y
        return radius * np.cos(angle), radius * np.sin(angle)


TANK_VIEWS: dict[str, Callable[[RunDirectory], TankView]] = {"slice": FlumeView, "ring": RingView, "basin": BasinView}


def tank_view(run: RunDirectory) -> TankView:
    """Return how a run is shown.

    Raises ``InputError`` if its tank is not of a known type, or as that type's view does.
    """
    if (kind := said(run, "type")) not in TANK_VIEWS:
        raise InputError(f"{run.path}: its tank is of type {kind!r}; can be viewed: {', '.join(TANK_VIEWS)}.")
    return TANK_VIEWS[kind](run)


def _rim(rows: Array) -> Array:
    """Return the closed line around a sheet of two rows [m], shape (2, N, 3), without its end: shape (2 N, 3)."""
    return np.concatenate([rows[0], rows[1, ::-1]])


def _sizes(times: Array, x: Array, eta: Array) -> WaveSizes:
    """Return the sizes of waves of elevation eta [m] at x [m], shapes (M, N), and times [s], shape (M,)."""
    slope = np.abs(np.diff(eta) / np.diff(x))
    return WaveSizes(
        low=float(eta.min()),
        high=float(eta.max()),
        usual=max(float(np.quantile(np.abs(eta), SATURATED)), FLAT / CM),
        slope=float(np.quantile(slope, SATURATED)),
        crest_time=float(times[np.argmax(eta.max(axis=1))]),
    )
