"""Maps of a basin: its highest crest, wave heights and gauges."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from wavetank.base.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.plots import style
from wavetank.plots.surfaces import Array, Extremes, Indices, TankSurface, basin_surface, wave_history

LEVELS = 64  # number of colours
WIDTH, WIDE = 5.2, 9.5  # width of maps [inch] in a row, and in a column
ELONGATED = 0.4  # width over length of a basin up to which maps are in a column
PERIODS, SNAPSHOTS = 3, 6  # number of last periods for wave heights, and least number of snapshots in each
RIM = "#444444"


class Map(NamedTuple):
    """A map of the basin.

    Attributes
    ----------
    title, label
        Title, and label of the colour bar.
    points
        Positions of the values, (x, y, ...) [m], shape (N, 3).
    values
        Values [m], shape (N,).
    limits
        Limits of the colours [m].
    colours, ink
        Name of matplotlib's colour map, and colour of marks on it.
    """

    title: str
    label: str
    points: Array
    values: Array
    limits: tuple[float, float]
    colours: str = "viridis"
    ink: str = style.LIGHT


def basin_figure(run: RunDirectory, path: Path) -> Path:
    """Draw the elevation at the time of the highest crest, the highest elevation, and the height of regular waves.

    Maps have contours of the bed, paddle and gauges. Heights are crest minus trough over the last periods of a periodic
    paddle. Returns ``path``; raises ``InputError`` for fewer than two snapshots.
    """
    surface = basin_surface(run)
    if surface.times.size < 2:
        raise InputError(f"{path}: {surface.times.size} snapshots of the surface received; at least 2 are needed.")
    past, gauges = wave_history(surface), run.gauges
    usual, crest, high = past.usual, past.crest, past.high
    title = f"at the highest crest of the snapshots, t = {past.crest_time:.2f} s"
    maps = [
        Map(title, "elevation [cm]", crest, crest[:, 2], (-usual, usual), "RdBu_r", style.DARK),
        Map("the highest elevation of the snapshots", "elevation [cm]", surface.first, high, _limits(high)),
        *_wave_heights(run, surface),
    ]
    rows = {row["name"] for row in run.manifest.get("case", {}).get("gauge_lines", ())}
    length, width = np.ptp(surface.first[:, :2], axis=0)
    shape, number = float(width / length), len(maps)
    size = (WIDTH * number, float(np.clip(1.8 + 0.94 * WIDTH * shape, 3.5, 14.0)))
    if shape < ELONGATED:
        size = (WIDE, 0.5 + number * (0.8 + 0.95 * WIDE * shape))
    with style.picture(path, *size, title=run.title or "Surface elevation") as figure:
        grid, bar = ((number, 1), "right") if shape < ELONGATED else ((1, number), "bottom")
        panels = figure.subplots(*grid, squeeze=False, sharex=True, sharey=True).ravel()
        for axes, one in zip(panels, maps, strict=True):
            _draw_map(figure, axes, surface, one, bar)
            paddles = one.points[surface.rim[surface.moving(past.displacement)], :2]
            axes.add_collection(LineCollection([*paddles], colors=style.PADDLE, linewidths=3.5))
            style.mark_places(axes, gauges, rows=rows, ink=one.ink)
        style.lay_out(figure)  # now the positions of labels are final
        for axes in panels:
            style.remove_overlaps(axes)
    return path


def _limits(values: Array) -> tuple[float, float]:
    """Return the limits of the colours [m], without single sharp crests."""
    low, high = np.quantile(values, [1 - style.SATURATED, style.SATURATED])
    return float(low), max(float(high), float(low) + style.FLAT / style.CM)


def _wave_heights(run: RunDirectory, surface: TankSurface) -> list[Map]:
    """Return the map of crest minus trough over the last periods; None without a period or enough snapshots."""
    motion = run.manifest.get("case", {}).get("wall", {}).get("motion") or {}
    period, end = motion.get("period"), surface.times[-1]
    if period is None or end - surface.times[0] < 2 * PERIODS * period:  # the waves have not arrived
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


def _draw_map(figure: Figure, axes: Axes, surface: TankSurface, one: Map, bar: Any) -> None:
    """Draw a map with the side of its colour bar, contours of the bed, sponge and rim."""
    plan = Triangulation(one.points[:, 0], one.points[:, 1], _triangles(surface.pieces))
    levels = style.CM * np.linspace(*one.limits, LEVELS)
    filled = axes.tricontourf(plan, style.CM * one.values, levels, cmap=one.colours, extend="both")
    colours = figure.colorbar(filled, ax=axes, location=bar, shrink=0.85, aspect=35, pad=0.02, label=one.label)
    colours.set_ticks(MaxNLocator(7).tick_values(levels[0], levels[-1])[1:-1])
    if surface.contours.size:
        lines = axes.tricontour(plan, surface.depth, surface.contours, colors=one.ink, linewidths=0.6)
        for text in axes.clabel(lines, fmt=lambda depth: f"{depth:g} m", fontsize=7):
            text.set_gid(style.DEPTH)
    if surface.damping is not None:
        damping = surface.damping / surface.damping.max()
        axes.tricontourf(plan, damping, [style.DAMPED, 1.0], colors="none", hatches=["//"], extend="max")
        inside = damping > style.DAMPED
        style.mark_sponge(axes, (float(plan.x[inside].mean()), float(plan.y[inside].mean())), va="center")
    axes.add_collection(LineCollection([*one.points[surface.rim, :2]], colors=RIM, linewidths=0.8))
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=one.title)
    axes.label_outer()
    axes.grid(False)


def _triangles(pieces: Indices) -> Indices:
    """Return triangles, shape (F, 3), of triangles or quadrilaterals."""
    fans = [pieces[:, [0, corner, corner + 1]] for corner in range(1, pieces.shape[1] - 1)]
    return np.concatenate(fans)
