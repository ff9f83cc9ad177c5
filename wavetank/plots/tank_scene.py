"""Surface, walls, bed and gauges of a run as meshes of PyVista, in metres, z upwards from still water."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

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
from wavetank.plots.basin import BasinSurface, Indices, MovingWall, WaveSizes, history, wave_sizes
from wavetank.plots.style import CM

Array = NDArray[np.float64]
Meshes = dict[str, pv.PolyData]

ELEVATION, HEIGHT, COVER = "elevation [cm]", "z [m]", "sponge"  # names of point data
SPONGE_COLOUR, OPACITY = (126, 87, 160), 150  # over the water where the sponge is strongest; of 255
SLAB = 0.1  # thickness of the bed, over the depth
PLATE = 0.006  # thickness of walls, over the tank's size
RAISED = 0.01  # height of contours and sponge above the surface, over the height of the waves
TICK = 0.012  # length of a ruler's ticks, over the tank's size


# ---------------------------------------------------------------- meshes
def ticks(low: float, high: float, *, most: int = 8) -> Array:
    """Return round numbers from low to high."""
    values = np.array(MaxNLocator(nbins=most, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
    slack = 1e-9 * (high - low)
    return values[(values >= low - slack) & (values <= high + slack)]


def sheet(rows: Array) -> pv.PolyData:
    """Return quadrilaterals between the points of rows [m], shape (R, N, 3)."""
    index = np.arange(rows[..., 0].size).reshape(rows.shape[:2])
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    return pv.PolyData.from_regular_faces(rows.reshape(-1, 3), np.stack(corners, axis=-1).reshape(-1, 4))


def closed_sheet(rows: Array) -> pv.PolyData:
    """Return the sheet between closed lines [m], shape (R, N, 3), with z as point data ``HEIGHT``."""
    mesh = sheet(np.concatenate([rows, rows[:, :1]], axis=1))
    mesh[HEIGHT] = mesh.points[:, 2]
    return mesh


def curtain(rim: Array, low: Array | float) -> pv.PolyData:
    """Return the vertical sheet from a closed line [m], shape (N, 3), down to z = low [m], a number or shape (N,)."""
    foot = rim.copy()
    foot[:, 2] = low
    return closed_sheet(np.array([foot, rim]))


def present(meshes: dict[str, pv.PolyData | Sequence[pv.PolyData] | None]) -> Meshes:
    """Return meshes by name, one for several of a name; without names that have none."""
    result = {}
    for name, mesh in meshes.items():
        if isinstance(mesh, pv.PolyData):
            result[name] = mesh
        elif mesh:
            result[name] = sum(mesh[1:], start=mesh[0])
    return result


# ---------------------------------------------------------------- views
class Labels(NamedTuple):
    """Texts at places [m], shape (K, 3)."""

    places: Array
    texts: list[str]


class Ruler(NamedTuple):
    """A vertical ruler: its mesh, heights at its ticks, the uppermost first, and the outer ends [m] of these texts."""

    mesh: pv.PolyData
    labels: Labels
    reach: Array


class TankView(ABC):
    """The meshes of a run.

    Attributes
    ----------
    times
        Of the snapshots [s], shape (M,), increasing.
    depth
        Largest still-water depth [m].
    extent
        The larger horizontal size of the water [m].
    waves
        Their sizes.
    note
        Further text below the picture; empty if there is none.
    eye
        Direction of view: degrees to the right of the y axis, and above the horizontal.

    Raises ``InputError`` if the run has no snapshot of the surface, or damaged ones; so do methods that read one.
    """

    eye = (24.0, 27.0)
    times: Array
    depth: float
    extent: float
    waves: WaveSizes
    note: str

    @abstractmethod
    def at(self, t: float) -> Meshes:
        """Return what moves, at a time t [s] of the run.

        ``surface`` with point data ``ELEVATION``; ``sides`` of the water down to the bed, with point data ``HEIGHT``;
        where there are any ``paddle``, the moving walls, ``contours`` of the still-water depth upon the surface, and
        ``sponge``, the surface with colours as point data ``COVER``.
        """

    @abstractmethod
    def fixed(self) -> Meshes:
        """Return what does not move: first the slab ``bed``, then walls, rulers and islands."""

    @abstractmethod
    def marks(self) -> Labels:
        """Return the numbers along the tank."""

    @abstractmethod
    def ruler(self) -> Ruler:
        """Return the vertical ruler, from the bed to the highest crest."""

    @abstractmethod
    def gauges(self) -> Labels:
        """Return the gauges' names and places on still water."""

    @property
    def top(self) -> float:
        """The height of walls [m], which no crest reaches."""
        return 1.3 * self.waves.high - 0.3 * self.waves.low

    @property
    def raised(self) -> float:
        """The height [m] of contours and sponge above the surface."""
        return RAISED * (self.waves.high - self.waves.low)

    def _upright_ruler(self, foot: Array, side: Array) -> Ruler:
        """Return a ruler at (x, y) = ``foot`` [m] whose texts are on a side, a unit vector of shape (2,)."""
        z = ticks(-self.depth, max(self.waves.high, 0.0), most=6)[::-1]

        def at_distance(lengths: float) -> Array:
            return np.column_stack([np.tile(foot + lengths * TICK * self.extent * side, (z.size, 1)), z])

        mesh = pv.line_segments_from_points(np.stack([at_distance(0.0), at_distance(1.0)], axis=1).reshape(-1, 3))
        mesh += pv.Line((*foot, -self.depth), (*foot, max(self.waves.high, z[0])))
        texts = [f"z = {z[0]:g} m", *(f"{one:g}" for one in z[1:])]
        return Ruler(mesh, Labels(at_distance(1.6), texts), at_distance(7.0))

    def _sponge(self, surface: pv.PolyData, damping: Array | None) -> pv.PolyData | None:
        """Return the surface in the colour of a sponge, which covers it where ``damping``, shape (N,), is 1."""
        if damping is None:
            return None
        cover = pv.PolyData(surface.points + (0.0, 0.0, self.raised), surface.faces)
        colour = np.tile(np.array([*SPONGE_COLOUR, 0], np.uint8), (cover.n_points, 1))
        colour[:, 3] = np.round(OPACITY * np.sqrt(damping))
        cover[COVER] = colour
        return cover


def tank_value(run: RunDirectory, key: str) -> Any:
    """Return a value of the tank in a run's manifest; raise ``InputError`` if there is none."""
    try:
        return run.manifest["scene"]["tank"][key]
    except (KeyError, TypeError):
        raise InputError(f"{run.path}: its manifest does not say the tank's {key}.") from None


def gauge_places(run: RunDirectory) -> tuple[list[str], Array]:
    """Return the names of a run's gauges and their places (x, y) [m], shape (K, 2); none of a run without gauges."""
    if not (run.path / GAUGES).exists():
        return [], np.zeros((0, 2))
    gauges = run.gauges
    return gauges.gauge.values.tolist(), np.stack([gauges.x, gauges.y], axis=1)


# ---------------------------------------------------------------- basins
CLEAR = 0.012  # of the rulers from the box around the basin, over the basin's size


class BasinView(TankView):
    """A basin of any plan."""

    eye = (28.0, 36.0)

    def __init__(self, run: RunDirectory):
        self._surface, self._gauges = BasinSurface(run), gauge_places(run)
        extremes = history(self._surface)
        first = self._surface.first
        self.times, self.depth = self._surface.times, float(self._surface.depth.max())
        self.waves, self.extent = extremes.waves, float(np.ptp(first[:, :2], axis=0).max())
        depths = ", ".join(f"{depth:g}" for depth in self._surface.contours)
        notes = (f"lines of still-water depth {depths} m" * bool(depths), self._surface.damping is not None)
        self.note = ", ".join(filter(None, (notes[0], "sponge: violet" * notes[1])))
        self._moving = self._surface.moving_walls(extremes.displacement)
        farthest = np.linalg.norm(extremes.displacement, axis=1).max()
        self._ground = first * (1.0, 1.0, 0.0)  # the plan, behind the paddles at their outermost positions
        for wall in self._moving:
            self._ground[wall.points, :2] += wall.outward * (farthest + PLATE * self.extent)
        self._box = np.stack([first[:, :2].min(axis=0), first[:, :2].max(axis=0)], axis=1)  # x and y, least and largest

    def at(self, t: float) -> Meshes:
        """Return what moves, at a time t [s] of the run."""
        points, depth, damping = self._surface.at(t), self._surface.depth, self._surface.damping
        surface = pv.PolyData.from_regular_faces(points, self._surface.pieces)
        surface[ELEVATION] = CM * points[:, 2]
        return present(
            {
                "surface": surface,
                "sides": pv.merge([curtain(points[loop], -depth[loop]) for loop in self._surface.loops]),
                "paddle": [self._board(points, wall) for wall in self._moving],
                "contours": self._contours(surface) if self._surface.contours.size else None,
                "sponge": self._sponge(surface, None if damping is None else damping / damping.max()),
            }
        )

    def fixed(self) -> Meshes:
        """Return the bed, the walls behind the water, rulers along x and y, and islands."""
        outer, *inner = self._surface.loops
        bed = pv.PolyData.from_regular_faces(
            self._ground - np.outer(self._surface.depth, (0.0, 0.0, 1.0)), self._surface.pieces
        )
        sides = [curtain(bed.points[loop], -(1 + SLAB) * self.depth) for loop in self._surface.loops]
        islands = [self._island(loop) for loop in inner]
        return present({"bed": pv.merge([bed, *sides]), "walls": self._wall(outer), "rulers": self._rulers()}) | {
            f"island {number}": mesh for number, mesh in enumerate(islands)
        }

    def marks(self) -> Labels:
        """Return the x and y of the rulers' ticks."""
        x, y = (ticks(*ends) for ends in self._box)
        texts = [f"x = {x[0]:g} m", *(f"{one:g}" for one in (*x[1:], *y[:-1])), f"y = {y[-1]:g} m"]
        return Labels(np.concatenate([self._on_ruler(3.2 * CLEAR, 0), self._on_ruler(5.2 * CLEAR, 1)]), texts)

    def ruler(self) -> Ruler:
        """Return the vertical ruler, outside the front corner at the least x and y."""
        return self._upright_ruler(self._box[:, 0] - (2 * CLEAR * self.extent, 0.0), np.array([-1.0, 0.0]))

    def gauges(self) -> Labels:
        """Return the gauges' names and places."""
        names, places = self._gauges
        return Labels(np.pad(places, ((0, 0), (0, 1))), names)

    def _on_ruler(self, clear: float, axis: int) -> Array:
        """Return the places of an axis' ticks [m], shape (K, 3), so far, over the basin's size, outside the box."""
        values = ticks(*self._box[axis])
        places = np.full((values.size, 3), -(1 + SLAB) * self.depth)
        places[:, axis] = values
        places[:, 1 - axis] = (self._box[1, 0], self._box[0, 1])[axis] + (-1, 1)[axis] * clear * self.extent
        return places

    def _rulers(self) -> pv.PolyData:
        """Return a line with ticks along the front side of the box, and one along the side of the largest x."""
        lines = pv.PolyData()
        for axis in (0, 1):
            inner, outer = self._on_ruler(CLEAR, axis), self._on_ruler(2 * CLEAR, axis)
            lines += pv.line_segments_from_points(np.stack([inner, outer], axis=1).reshape(-1, 3))
            lines += pv.Line(inner[0], inner[-1])
        return lines

    def _contours(self, surface: pv.PolyData) -> pv.PolyData:
        surface["depth"] = self._surface.depth
        lines = surface.contour(self._surface.contours, scalars="depth")
        lines.points[:, 2] += self.raised
        return lines

    def _board(self, points: Array, wall: MovingWall) -> pv.PolyData:
        """Return the plate of a moving wall behind its line among the water's points [m], shape (N, 3)."""
        rows = np.array([points[wall.points], points[wall.points]])
        rows[..., 2] = -self._surface.depth[wall.points], np.full(wall.points.size, self.top)
        return sheet(rows).extrude((*(PLATE * self.extent * wall.outward), 0.0), capping=True)

    def _wall(self, loop: Indices) -> pv.PolyData:
        """Return the wall along a line of the rim but for paddles."""
        wall = curtain(self._ground[loop] + (0.0, 0.0, self.top), -self._surface.depth[loop])
        moving = np.zeros(len(loop), dtype=bool)
        for one in self._moving:
            on_wall = np.isin(loop, one.points)
            moving |= on_wall & np.roll(on_wall, -1)
        return wall.remove_cells(np.flatnonzero(moving))

    def _island(self, loop: Indices) -> pv.PolyData:
        """Return the island within a line of the rim."""
        line = self._ground[loop] - (0.0, 0.0, self.depth)
        plan = pv.PolyData(line, faces=[len(line), *range(len(line))]).triangulate()
        return plan.extrude((0.0, 0.0, self.depth + self.top), capping=True)


# ---------------------------------------------------------------- slices and rings
FINE = 800  # places along a flume that a picture can resolve
REACH, LEVELS = 5.0, 24  # depths from a leaning paddle over which columns lean, and number of lines through columns
POWER = 2  # of the distance into a sponge, by which its damping grows


def sponge_damping(run: RunDirectory, length: float) -> Callable[[Array], Array] | None:
    """Return the damping rate over its maximum, a function of x [m], of a slice's sponge; None without a sponge.

    ``length`` [m] is the slice's.
    """
    try:
        sponge: Any = TypeAdapter(Sponge).validate_python(run.manifest["scene"]["sponge"])
    except (KeyError, ValidationError):
        return None
    if isinstance(sponge, EndSponge):
        return lambda x: np.clip(1.0 + (x - length) / sponge.length, 0.0, 1.0) ** POWER
    if not isinstance(sponge, FormulaSponge):
        return None
    gamma, x = sponge.build(), np.linspace(0.0, length, 1000, dtype=np.float64)
    largest = max(float(gamma(x, 0 * x).max()), np.finfo(float).tiny)
    return lambda x: np.clip(gamma(np.clip(x, 0.0, length), 0 * x) / largest, 0.0, 1.0)


def wall_shape(run: RunDirectory, depth: float, key: str) -> Callable[[Array], Array] | None:
    """Return the mode shape f(z) of a wall by its key, z in m; None of a vertical wall."""
    try:
        wall: Any = TypeAdapter(Wall).validate_python(run.manifest["scene"][key])
    except (KeyError, ValidationError):
        return None
    return (lambda z: wall.wavemaker.mode_shape(z, depth)) if isinstance(wall, ShapedWall) else None


class End(NamedTuple):
    """An end of a flume.

    Attributes
    ----------
    node
        Index of its point of the surface: 0 or -1.
    rest
        Position of its wall at rest, x [m].
    outward
        1 if it is the far one, -1 if it is that at x = 0.
    shape
        The mode shape f(z) of its wall; None of a vertical one.
    moves
        Whether that moves.
    """

    node: int
    rest: float
    outward: int
    shape: Callable[[Array], Array] | None
    moves: bool

    def displacement(self, x: Array, eta: Array) -> float:
        """Return the displacement [m] of the wall where f = 1, if it meets the surface at x and eta [m]."""
        f = 1.0 if self.shape is None else float(self.shape(eta[[self.node]])[0])
        return float(x[self.node] - self.rest) / f if f else 0.0


class FlumeView(TankView):
    """A slice: its section extruded across y."""

    width_over_length = 0.22  # a slice has no width; this one is for the picture

    def __init__(self, run: RunDirectory):
        self.length, self._flat = (float(tank_value(run, key)) for key in ("length", "depth"))
        self._bed, self._damping = still_water(run), sponge_damping(run, self.length)
        self._gauges, self.note = gauge_places(run), "sponge: violet" if self._damping else ""
        self.width = self.width_over_length * self.length
        self.extent = self.length
        self.depth = float(self._still_water(np.linspace(0.0, self.length, FINE, dtype=np.float64)).max())
        surface = run.snapshots()
        if not surface.time.size:
            raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
        x, eta = self._end_to_end(surface.x.values, surface.elevation.values)
        self.times = surface.time.values
        if not (np.all(np.diff(self.times) > 0) and np.all(np.diff(x) > 0) and np.all(np.isfinite(eta))):
            raise InputError(f"{run.path}: its snapshots are damaged; times and places must increase.")
        self.waves = wave_sizes(self.times, x, eta)
        margin = 2 * PLATE * self.length  # of the bed beyond the walls
        self._ground = float(x.min()) - margin, float(x.max()) + margin
        self._ends = [
            End(node, rest, outward, wall_shape(run, self._flat, key), bool(np.ptp(x[:, node])))
            for key, node, rest, outward in (("wall", 0, 0.0, -1), ("far_wall", -1, self.length, 1))
        ]
        self._points = np.stack([x, eta], axis=1)  # shape (M, 2, N)

    def at(self, t: float) -> Meshes:
        """Return what moves, at a time t [s] of the run."""
        x, eta = self._profile(t)
        rows = self._rows(x, eta)
        surface = sheet(rows)
        surface[ELEVATION] = CM * np.tile(eta, len(rows))
        return present(
            {
                "surface": surface,
                "sides": closed_sheet(np.array([_rim(self._rows(*line)) for line in self._columns(x, eta)])),
                "paddle": [self._paddle(end, x, eta) for end in self._ends if end.moves],
                "sponge": self._sponge(surface, None if self._damping is None else np.tile(self._damping(x), 2)),
            }
        )

    def fixed(self) -> Meshes:
        """Return the bed, under all positions of the paddle, and the walls that do not move."""
        x = np.linspace(*self._ground, FINE, dtype=np.float64)
        rows = self._rows(x, -self._still_water(x))
        clear = PLATE / 10 * self.length  # from the water: equal depths flicker
        glass = [self._plate(end, end.rest + end.outward * clear) for end in self._ends if not end.moves]
        return present({"bed": sheet(rows) + curtain(_rim(rows), -(1 + SLAB) * self.depth), "glass": glass})

    def marks(self) -> Labels:
        """Return places along the flume, and their x."""
        x = ticks(0.0, self.length)
        clear = 0.55 * self.width  # from the bed's edge, which would hide half of them
        places = np.stack([*self._plan(x, -clear), np.full_like(x, -(1 + SLAB) * self.depth)], axis=1)
        return Labels(places, [f"{one:g} m" for one in x])

    def ruler(self) -> Ruler:
        """Return the vertical ruler, in front at the least x."""
        foot = np.array([self._ground[0] - TICK * self.extent, -self.width / 2])
        return self._upright_ruler(foot, np.array([-1.0, 0.0]))

    def gauges(self) -> Labels:
        """Return the gauges, in the flume's middle."""
        names, places = self._gauges
        x = places[:, 0]
        return Labels(np.stack([*self._plan(x, 0.0), 0 * x], axis=1), names)

    def _still_water(self, x: Array) -> Array:
        """Return the still-water depth [m], beyond the flume's ends as at them."""
        if self._bed is None:
            return np.full_like(x, self._flat)
        return self._bed(np.clip(x, 0.0, self.length), np.zeros_like(x))

    def _end_to_end(self, x: Array, eta: Array) -> tuple[Array, Array]:
        """Return x and eta [m], shape (M, N), from end to end."""
        return x, eta

    def _plan(self, x: Array, y: float) -> tuple[Array, Array]:
        """Return (x, y) [m] in the picture of places in the flume."""
        return x, np.full_like(x, y)

    @cached_property
    def _section(self) -> BSpline:
        """The section's x and eta [m], shape (2, N), over time [s]: a film has more frames than a run has snapshots."""
        return make_interp_spline(self.times, self._points, k=min(3, self.times.size - 1))

    def _profile(self, t: float) -> tuple[Array, Array]:
        """Return x and eta [m] at t [s], at more places than there are nodes if those are few."""
        x, eta = self._section(t)
        fine = np.linspace(x[0], x[-1], max(FINE, x.size))
        return fine, CubicSpline(x, eta)(fine)

    def _rows(self, x: Array, z: Array) -> Array:
        """Return the line (x, z) at the flume's front and rear side, shape (2, N, 3)."""
        half = self.width / 2
        return np.array([np.stack([*self._plan(x, y), z], axis=1) for y in (-half, half)])

    def _columns(self, x: Array, eta: Array) -> Iterator[tuple[Array, Array]]:
        """Yield lines (x, z) through columns of the water from the bed to the surface, which lean with the paddles."""
        foot, reach = -self._still_water(x), REACH * self.depth
        leaning = [
            (end.shape, end.displacement(x, eta) * np.clip(1.0 - np.abs(x - x[end.node]) / reach, 0.0, 1.0))
            for end in self._ends
            if end.shape is not None
        ]
        for part in np.linspace(0.0, 1.0, LEVELS if leaning else 2):
            z = foot + part * (eta - foot)
            yield x + sum((f(z) - f(eta)) * shift for f, shift in leaning), z

    def _paddle(self, end: End, x: Array, eta: Array) -> pv.PolyData:
        """Return a moving wall where it meets the surface."""
        if end.shape is None:
            return self._plate(end, float(x[end.node]))
        z = np.linspace(-float(self._still_water(np.array([end.rest]))[0]), self.top, FINE, dtype=np.float64)
        line = self._rows(end.rest + end.displacement(x, eta) * end.shape(z), z)
        return sheet(line).extrude((end.outward * PLATE * self.length, 0.0, 0.0), capping=True)

    def _plate(self, end: End, x: float) -> pv.PolyData:
        """Return a plate across the flume from its bed, its side to the water at x [m]."""
        half, foot = self.width / 2, -float(self._still_water(np.array([x]))[0])
        return pv.Box((*sorted((x, x + end.outward * PLATE * self.length)), -half, half, foot, self.top))


class RingView(FlumeView):
    """A ring: the flume bent to a circle, x = 0 in front, waves to +x running anticlockwise."""

    width_over_length = 0.09

    def __init__(self, run: RunDirectory):
        super().__init__(run)
        self.extent = self.length / np.pi + self.width  # the outer diameter
        self._ground, self._ends = (0.0, self.length), []

    def marks(self) -> Labels:
        """Return those in front: the water would hide the others."""
        places, texts = super().marks()
        front = places[:, 1] < -self.length / (4 * np.pi)
        return Labels(places[front], [text for text, shown in zip(texts, front, strict=True) if shown])

    def ruler(self) -> Ruler:
        """Return the vertical ruler, outside the ring in the direction of the picture's left side."""
        turn = np.radians(self.eye[0])
        side = -np.array([np.cos(turn), np.sin(turn)])
        return self._upright_ruler((self.extent / 2 + TICK * self.extent) * side, side)

    def _end_to_end(self, x: Array, eta: Array) -> tuple[Array, Array]:
        """Return x and eta [m], shape (M, N + 1), closed."""
        return np.column_stack([x, x[:, 0] + self.length]), np.column_stack([eta, eta[:, 0]])

    def _plan(self, x: Array, y: float) -> tuple[Array, Array]:
        """Return (x, y) [m] in the picture of places in the ring."""
        angle = 2 * np.pi * x / self.length - np.pi / 2
        radius = self.length / (2 * np.pi) - y
        return radius * np.cos(angle), radius * np.sin(angle)


TANK_VIEWS: dict[str, Callable[[RunDirectory], TankView]] = {"slice": FlumeView, "ring": RingView, "basin": BasinView}


def tank_view(run: RunDirectory) -> TankView:
    """Return the meshes of a run.

    Raises ``InputError`` if its tank is not of a known type, or as that type's view does.
    """
    if (kind := tank_value(run, "type")) not in TANK_VIEWS:
        raise InputError(f"{run.path}: its tank is of type {kind!r}; can be viewed: {', '.join(TANK_VIEWS)}.")
    return TANK_VIEWS[kind](run)


def _rim(rows: Array) -> Array:
    """Return the closed line around a sheet of two rows [m], shape (2, N, 3), without its end: shape (2 N, 3)."""
    return np.concatenate([rows[0], rows[1, ::-1]])
