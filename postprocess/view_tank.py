"""What is seen of a run: the water, the bed and the paddle as meshes in metres, at any time of the run.

A picture (``view.py``) knows a ``TankView`` alone. A slice is shown as a flume, its section extruded across y; a ring
is the same flume bent to a circle. Other plan views join ``TANK_VIEWS``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicSpline, make_interp_spline

from postprocess.figures import CM, FLAT, SATURATED
from wavetank.errors import InputError
from wavetank.rundir import RunDirectory

Array = NDArray[np.float64]

ELEVATION, HEIGHT = "elevation [cm]", "z [m]"
FINE = 800  # places along a flume that a picture tells apart
PLATE = 0.006  # thickness of paddle and walls, over the flume's length
SLAB = 0.1  # thickness of the bed, over the depth


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
        The paddle; None where no wall moves.
    """

    surface: pv.PolyData
    sides: pv.PolyData
    paddle: pv.PolyData | None


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
    """

    times: Array
    depth: float
    waves: WaveSizes

    @property
    def extent(self) -> float:
        """The larger horizontal size of the water [m]."""

    def at(self, t: float) -> Sight:
        """Return what moves, at a time t [s] of the run."""

    def bed(self) -> pv.PolyData:
        """Return a slab whose top is the bed."""

    def walls(self) -> pv.PolyData | None:
        """Return the walls that stand still, as far as they are worth seeing."""

    def marks(self) -> tuple[Array, list[str]]:
        """Return places [m], shape (K, 3), and what is written there."""


# ---------------------------------------------------------------- a slice
class Flume:
    """A slice: its section extruded across y.

    Raises ``InputError`` if the run has no snapshot of the surface, or damaged ones.
    """

    def __init__(self, run: RunDirectory):
        self.length, self.depth = (float(_said(run, key)) for key in ("length", "depth"))
        surface = run.surface()
        if not surface.t.size:
            raise InputError(f"{run.path}: has no snapshot of the surface; at least 1 is needed to view it.")
        self.times, self._x, self._eta = surface.t, *self._whole(surface.x, surface.eta)
        if not (np.all(np.diff(self.times) > 0) and np.all(np.diff(self._x) > 0) and np.all(np.isfinite(self._eta))):
            raise InputError(f"{run.path}: its snapshots are damaged; times and places must increase.")
        self.waves = _sizes(self.times, self._x, self._eta)

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
        surface = _sheet(rows)
        surface[ELEVATION] = CM * np.tile(eta, len(rows))
        return Sight(surface, _curtain(rows, -self.depth), self._paddle(x[0]))

    def bed(self) -> pv.PolyData:
        """Return a slab whose top is the bed, under the paddle's whole way too."""
        x = np.linspace(*self._ground(), FINE, dtype=np.float64)
        rows = self._rows(x, np.full_like(x, -self.depth))
        return _sheet(rows) + _curtain(rows, -(1 + SLAB) * self.depth)

    def walls(self) -> pv.PolyData | None:
        """Return the far wall, and that at x = 0 where it stands still."""
        far = self._plate((1 + PLATE / 10) * self.length)  # clear of the water: equal depths flicker
        return far if self._moving else far + self._plate(-1.1 * PLATE * self.length)

    def marks(self) -> tuple[Array, list[str]]:
        """Return places along the flume [m], shape (K, 3), and their x."""
        x = np.array(MaxNLocator(nbins=8, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, self.length))
        x = x[(x >= 0) & (x <= self.length * (1 + 1e-9))]
        clear = 0.55 * self.width  # of the bed's edge, which would hide half of them
        places = np.stack([*self._plan(x, -clear), np.full_like(x, -(1 + SLAB) * self.depth)], axis=1)
        return places, [f"{one:g} m" for one in x]

    # ------------------------------------------------------------ the section
    def _whole(self, x: Array, eta: Array) -> tuple[Array, Array]:
        """Return x and eta [m], shape (M, N), from end to end."""
        return x, eta

    def _plan(self, x: Array, y: float) -> tuple[Array, Array]:
        """Return where in the picture's plan (x, y) of the flume is [m]."""
        return x, np.full_like(x, y)

    def _ground(self) -> tuple[float, float]:
        """Return from where to where the bed is seen, x [m]: a little behind paddle and wall."""
        margin = 2 * PLATE * self.length
        return float(self._x.min()) - margin, self.length + margin

    @property
    def _moving(self) -> bool:
        return bool(np.ptp(self._x[:, 0]))

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

    def _paddle(self, x: float) -> pv.PolyData | None:
        return self._plate(x - PLATE * self.length) if self._moving else None

    def _plate(self, x: float) -> pv.PolyData:
        """Return a plate across the flume whose left side is at x [m], and which the highest crest does not reach."""
        half, top = self.width / 2, 1.3 * self.waves.high - 0.3 * self.waves.low
        return pv.Box((x, x + PLATE * self.length, -half, half, -self.depth, top))


class Ring(Flume):
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

    def marks(self) -> tuple[Array, list[str]]:
        """Return those in front [m], shape (K, 3): the water would stand before the others."""
        places, texts = super().marks()
        front = places[:, 1] < -self.length / (4 * np.pi)
        return places[front], [text for text, shown in zip(texts, front, strict=True) if shown]

    def _whole(self, x: Array, eta: Array) -> tuple[Array, Array]:
        """Return x and eta [m], shape (M, N + 1), closed."""
        return np.column_stack([x, x[:, 0] + self.length]), np.column_stack([eta, eta[:, 0]])

    def _plan(self, x: Array, y: float) -> tuple[Array, Array]:
        """Return where in the picture's plan (x, y) of the ring is [m]."""
        angle = 2 * np.pi * x / self.length - np.pi / 2
        radius = self.length / (2 * np.pi) - y
        return radius * np.cos(angle), radius * np.sin(angle)


TANK_VIEWS: dict[str, Callable[[RunDirectory], TankView]] = {"slice": Flume, "ring": Ring}


def tank_view(run: RunDirectory) -> TankView:
    """Return how a run is shown.

    Raises ``InputError`` if its tank is not of a known type, or as that type's view does.
    """
    if (kind := _said(run, "type")) not in TANK_VIEWS:
        raise InputError(f"{run.path}: its tank is of type {kind!r}; can be viewed: {', '.join(TANK_VIEWS)}.")
    return TANK_VIEWS[kind](run)


def _said(run: RunDirectory, key: str) -> Any:
    """Return what the manifest says of the tank; raise ``InputError`` if it says nothing."""
    try:
        return run.manifest["scene"]["tank"][key]
    except (KeyError, TypeError):
        raise InputError(f"{run.path}: its manifest does not say the tank's {key}.") from None


# ---------------------------------------------------------------- meshes and sizes
def _sheet(rows: Array) -> pv.PolyData:
    """Return quadrilaterals between the points of rows [m], shape (R, N, 3)."""
    index = np.arange(rows[..., 0].size).reshape(rows.shape[:2])
    corners = (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1])
    return pv.PolyData.from_regular_faces(rows.reshape(-1, 3), np.stack(corners, axis=-1).reshape(-1, 4))


def _curtain(rows: Array, low: float) -> pv.PolyData:
    """Return what hangs from the rim of a sheet of two rows [m] down to z = low [m]."""
    rim = np.concatenate([rows[0], rows[1, ::-1], rows[0, :1]])
    foot = rim * (1.0, 1.0, 0.0) + (0.0, 0.0, low)
    curtain = _sheet(np.array([foot, rim]))
    curtain[HEIGHT] = curtain.points[:, 2]
    return curtain


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
