"""Maps of a basin's surface, seen from above: the highest crest, the highest elevation, the height of the waves."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.plots.basin_surface import Array, BasinSurface, Extremes, Indices, history
from wavetank.plots.gauge_marks import DARK, DEPTH, LIGHT, leave_out_overlaps, mark_places
from wavetank.plots.style import CM, DAMPED, FLAT, PADDLE, SATURATED, lay_out, picture

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
    came_to = history(surface)
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
            mark_places(axes, run.gauge_series(), rows=rows, ink=one.ink)
        figure.suptitle(run.title or "Surface elevation", fontsize=13, parse_math=False)
        lay_out(figure)  # where names are is known only now
        for axes in panels:
            leave_out_overlaps(axes)
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
