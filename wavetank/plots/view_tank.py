"""What is seen of a run, by the type of its tank.

A slice is shown as a flume, its section extruded across y; a ring is the same flume bent to a circle; a basin as it is
(``view_basin.py``). Other footprints join ``TANK_VIEWS``.
"""

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pyvista as pv
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from wavetank.analysis.still_water import still_water
from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.plots.fittings import damping_along, gauges_of, leaning
from wavetank.plots.style import CM, FLAT, SATURATED
from wavetank.plots.view_basin import BasinView
from wavetank.plots.view_sight import (
    DRY,
    ELEVATION,
    GLASS,
    SAND,
    SLAB,
    SPONGE,
    TICK,
    Array,
    Labels,
    Part,
    Ruler,
    Sight,
    TankView,
    WaveSizes,
    curtain,
    hung,
    said,
    sheet,
    ticks,
    together,
    upright,
    veiled,
)

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
        self._gauges, self.note = gauges_of(run), SPONGE if self._damping else ""
        self.depth = float(self._still_water(np.linspace(0.0, self.length, FINE, dtype=np.float64)).max())
        surface = run.snapshots()
        if not surface.t.size:
            raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
        self.times, self._x, self._eta = surface.t, *self._whole(surface.x, surface.eta)
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
        x = np.array([one.x for one in self._gauges])
        return Labels(np.stack([*self._plan(x, 0.0), 0 * x], axis=1), [one.name for one in self._gauges])

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
