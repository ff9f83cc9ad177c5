"""What a picture needs of a tank: the water, the bed, walls and paddle as meshes in metres, at any time of the run."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import pyvista as pv
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory

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
