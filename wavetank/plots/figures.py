"""Figures of a run: surface, gauges, energy, breakdown, loads and probes."""

from collections.abc import Sequence
from dataclasses import replace
from importlib.util import find_spec
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter
from numpy.typing import NDArray

from wavetank.analysis.compare import MATCH, compare_gauge, matched
from wavetank.analysis.still_water import still_water
from wavetank.case.tank import Depth, FormulaSponge
from wavetank.errors import InputError
from wavetank.output.directory import BROKEN, BROKEN_PICTURE, GAUGES, LOADS, PROBES, SURFACE, RunDirectory
from wavetank.output.fields import Surface, index_file
from wavetank.output.tables import GaugeSeries
from wavetank.plots.style import (
    BLUE,
    CM,
    COMPUTED,
    DAMPED,
    DARK,
    FLAT,
    GREEN,
    INK,
    LOOK,
    MEASURED,
    ORANGE,
    PADDLE,
    PUBLISHED,
    SATURATED,
    VERMILION,
    WATER,
    lay_out,
    leave_out_overlaps,
    mark_along,
    picture,
)

KINETIC, POTENTIAL, TOTAL, WORK = VERMILION, GREEN, "#8cc5e8", INK
BEFORE, CREST, AFTER = ORANGE, "#0b2d5c", "#a0417f"
SKY, STILL, SAND = "#f4f9fd", "#a8d3ee", "#cdb990"
PIXELS = 1200, 540  # of the (x, t) plane
FOCUS = 4.0  # s shown on either side of the largest crest
SEEN = 1e-3  # of the largest energy; less dissipation is not drawn


# ---------------------------------------------------------------- the surface
def surface_figure(
    surface: Surface,
    path: Path,
    *,
    title: str = "",
    depth: float | Depth = np.inf,
    origin: str = "along the tank",
    gauges: Sequence[GaugeSeries] = (),
    sponge: tuple[float, float] | None = None,
) -> Path:
    """Draw the highest crest, with the wave just before and after it, above all snapshots in the (x, t) plane.

    Where a wall moves, its position stands beside the (x, t) plane. No water is drawn below the depth [m]; where that
    is a function d(x, y) the bed stands between the two. ``gauges`` are lines in the (x, t) plane; what a ``sponge``
    damps, from and to x [m], is hatched. ``origin`` says what x is the distance from, or along. Returns ``path``;
    there are two snapshots or more.
    """
    near, far = (bool(np.ptp(surface.x[:, node])) for node in (0, -1))
    varying = callable(depth)
    x = surface.x[_highest_crest(surface)[0]]
    d = depth(x, np.zeros_like(x)) if callable(depth) else np.full_like(x, depth)
    heights, widths = (1, 0.3, 1.5) if varying else (1, 1.5), (1, 11, 1)[1 - near : 2 + far]
    with picture(path, 11, 9.6 if varying else 8.6) as figure:
        grid = figure.add_gridspec(len(heights), len(widths), height_ratios=heights, width_ratios=widths)
        diagram = figure.add_subplot(grid[-1, int(near)])
        profile = figure.add_subplot(grid[0, int(near)], sharex=diagram)
        _draw_diagram(figure, diagram, surface)
        diagram.set_xlabel(f"distance {origin}, x [m]")
        mark_along(diagram, gauges, top=float(surface.t[-1]))
        if sponge is not None:
            _hatch_sponge(diagram, *sponge)
        _draw_profile(profile, surface, float(d.max()))
        if varying:
            _draw_bed(figure.add_subplot(grid[1, int(near)], sharex=diagram), x, d)
        if near:
            diagram.tick_params(labelleft=False)
            beside = figure.add_subplot(grid[-1, 0], sharey=diagram)
            beside.set_ylabel("time [s]")
            _draw_paddle(beside, diagram, surface)
        else:
            diagram.set_ylabel("time [s]")
        if far:
            beside = figure.add_subplot(grid[-1, -1], sharey=diagram)
            beside.tick_params(labelleft=False)
            _draw_paddle(beside, diagram, surface, far=True)
        figure.suptitle(title or "Surface elevation", fontsize=14, parse_math=False)
        lay_out(figure)  # the panel's size, its exaggeration, and where names are is known only now
        leave_out_overlaps(diagram)
        profile.set_title(f"vertical exaggeration {_exaggeration(profile):g}", loc="right", fontsize=9, color="#555555")
    return path


def _highest_crest(surface: Surface) -> tuple[int, int]:
    """Return (snapshot, point) of the largest elevation."""
    snapshot, point = np.unravel_index(np.argmax(surface.eta), surface.eta.shape)
    return int(snapshot), int(point)


def _half_period(surface: Surface) -> int:
    """Return half a wave period in snapshots, at least one: twice the time the highest crest takes to sink to 0."""
    snapshot, point = _highest_crest(surface)
    sunk = np.flatnonzero(surface.eta[snapshot:, point] < 0)
    return max(1, 2 * int(sunk[0]) - 1) if sunk.size else 1


def _draw_profile(axes: Axes, surface: Surface, depth: float) -> None:
    crest, top = _highest_crest(surface)
    x, eta = surface.x[crest], CM * surface.eta[crest]
    largest = max(float(np.abs(eta).max()), FLAT)
    limits = (max(-1.9 * largest, -CM * depth), 1.55 * largest)
    axes.set_facecolor(SKY)
    axes.grid(False)
    _fill_water(axes, x, eta, limits)
    step = _half_period(surface)
    for snapshot, colour, note in (
        (crest - step, BEFORE, ""),
        (crest, CREST, ", the highest crest of the snapshots"),
        (crest + step, AFTER, ""),
    ):
        if 0 <= snapshot < surface.t.size:
            label, width = f"t = {surface.t[snapshot]:.2f} s{note}", 2.2 if note else 1.3
            axes.plot(
                surface.x[snapshot], CM * surface.eta[snapshot], color=colour, lw=width, zorder=width, label=label
            )
    _name_crest(axes, float(x[top]), float(eta[top]), left=bool(x[top] > x.mean()))
    axes.set(ylim=limits, ylabel="elevation [cm]")
    axes.yaxis.label.set_in_layout(False)  # it hangs over the empty corner, and must not part paddle and diagram
    axes.tick_params(labelbottom=False)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)


def _fill_water(axes: Axes, x: NDArray[np.float64], eta: NDArray[np.float64], limits: tuple[float, float]) -> None:
    """Fill the water below eta [cm] with a colour that deepens downwards."""
    outline = axes.fill_between(x, eta, limits[0], color="none")
    extent = (float(x[0]), float(x[-1]), limits[0], float(eta.max()))
    shade = np.linspace(0.0, 1.0, 256)[:, None]
    water = axes.imshow(shade, extent=extent, cmap=WATER, origin="lower", aspect="auto", interpolation="bilinear")
    water.set_clip_path(outline.get_paths()[0], axes.transData)


def _hatch_sponge(axes: Axes, begin: float, end: float) -> None:
    """Hatch where there is a sponge, from ``begin`` to ``end`` [m], and say so."""
    axes.axvspan(begin, end, fill=False, hatch="//", ec=DARK, lw=0, alpha=0.6)
    place = 0.5 * (begin + end), 0.03
    axes.annotate("sponge", place, xycoords=axes.get_xaxis_transform(), ha="center", **LOOK)


def _draw_bed(axes: Axes, x: NDArray[np.float64], depth: NDArray[np.float64]) -> None:
    """Draw still water over its bed, depth [m] at x [m]."""
    lowest = 1.1 * float(depth.max())
    axes.fill_between(x, 0.0, -depth, color=STILL, lw=0)
    axes.fill_between(x, -depth, -lowest, color=SAND, lw=0)
    axes.set(ylim=(-lowest, 0.0), ylabel="bed [m]")
    axes.yaxis.label.set_in_layout(False)
    axes.tick_params(labelbottom=False)
    axes.grid(False)


def _name_crest(axes: Axes, x: float, eta: float, *, left: bool) -> None:
    """Write the crest's height [cm] and place [m] above it, on the side where there is room."""
    axes.annotate(
        f"{eta:.3g} cm at x = {x:.2f} m",
        (x, eta),
        xytext=(-14 if left else 14, 10),
        textcoords="offset points",
        ha="right" if left else "left",
        color=CREST,
        arrowprops={"arrowstyle": "-", "color": CREST, "lw": 0.8, "shrinkB": 3},
    )


def _exaggeration(axes: Axes) -> float:
    """Return how many times steeper than in the tank a slope is drawn, to two digits; x in m, y in cm."""
    box, (left, right), (low, high) = axes.get_window_extent(), axes.get_xlim(), axes.get_ylim()
    return float(f"{CM * (box.height / (high - low)) / (box.width / (right - left)):.2g}")


def _draw_diagram(figure: Figure, axes: Axes, surface: Surface) -> None:
    largest = max(CM * float(np.quantile(np.abs(surface.eta), SATURATED)), FLAT)
    extent = (float(surface.x.min()), float(surface.x.max()), float(surface.t[0]), float(surface.t[-1]))
    colours = axes.imshow(
        CM * _resampled(surface),
        extent=extent,
        cmap="RdBu_r",
        vmin=-largest,
        vmax=largest,
        origin="lower",
        aspect="auto",
    )
    axes.grid(False)
    crest, top = _highest_crest(surface)
    axes.axhline(surface.t[crest], color=CREST, lw=0.8, ls=(0, (6, 4)))
    axes.plot(surface.x[crest, top], surface.t[crest], "o", ms=9, mfc="none", mec=CREST, mew=1.3)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    bar = figure.colorbar(
        colours, ax=axes, orientation="horizontal", aspect=70, pad=0.02, extend="both", extendfrac=0.015
    )
    bar.set_label("elevation [cm]")


def _resampled(surface: Surface) -> NDArray[np.float64]:
    """Return eta [m] on a regular grid of about the picture's pixels, shape (times, places).

    The elevation is interpolated, not the colour: halfway between red and blue there is white, not purple.
    """
    x = np.linspace(surface.x.min(), surface.x.max(), PIXELS[0])
    t = np.linspace(surface.t[0], surface.t[-1], PIXELS[1])
    rows = np.array([np.interp(x, *snapshot) for snapshot in zip(surface.x, surface.eta, strict=True)])
    return _between_rows(surface.t, rows, t)


def _between_rows(t: NDArray[np.float64], rows: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cubic spline through rows at their times; SciPy's loads long."""
    h, slopes = np.diff(t), np.gradient(rows, t, axis=0, edge_order=2 if len(t) > 2 else 1)
    rises = 3.0 * np.diff(rows, axis=0) / h[:, None] ** 2
    slopes[1:-1] = rises[:-1] + rises[1:]
    below, middle = 1.0 / h, np.append(1.0, 2.0 / h[:-1] + 2.0 / h[1:])  # of a matrix of three diagonals
    above = np.append(0.0, below[1:])  # the ends' slopes are known
    for n in range(1, len(h)):
        part = below[n - 1] / middle[n - 1]
        middle[n] -= part * above[n - 1]
        slopes[n] -= part * slopes[n - 1]
    for n in range(len(h) - 1, 0, -1):
        slopes[n] = (slopes[n] - above[n] * slopes[n + 1]) / middle[n]
    first = np.clip(np.searchsorted(t, at, side="right") - 1, 0, len(h) - 1)
    step = h[first, None]
    s = (at - t[first])[:, None] / step
    turned = step * s * (1.0 - s) * ((1.0 - s) * slopes[first] - s * slopes[first + 1])
    return np.asarray(rows[first] + s**2 * (3.0 - 2.0 * s) * (rows[first + 1] - rows[first]) + turned)


def _draw_paddle(axes: Axes, diagram: Axes, surface: Surface, *, far: bool = False) -> None:
    """Draw a paddle's position where it is in the diagram, and enlarged beside it."""
    x = surface.x[:, -1 if far else 0]
    position = x - x[0] if far else x
    diagram.plot(x, surface.t, color=PADDLE, lw=1.5)
    diagram.fill_betweenx(surface.t, x.max() if far else x.min(), x, color="#dddddd", lw=0)
    axes.plot(CM * position, surface.t, color=PADDLE)
    reach = CM * float(np.abs(position).max())
    tick = float(f"{reach:.0e}")  # one digit: there is no room for more
    axes.set_xticks([-tick, 0.0, tick], [Formatter.fix_minus(f"{-tick:g}"), "0", f"{tick:g}"])
    axes.set(xlim=(-1.4 * reach, 1.4 * reach), xlabel=f"{'far wall' if far else 'paddle'}\n[cm]")


# ---------------------------------------------------------------- gauges
PANELS = 24  # of gauges in one picture


def gauges_overview(gauges: Sequence[GaugeSeries], path: Path, *, title: str = "") -> Path:
    """Draw the gauges' records, all on one scale, from the paddle outwards; return ``path``.

    Of more than ``PANELS`` gauges every second, third ... is drawn.

    Raises ``InputError`` if there is no gauge.
    """
    if not gauges:
        raise InputError(f"{path}: there is no gauge to draw.")
    shown = sorted(gauges, key=lambda gauge: gauge.x)[:: -(-len(gauges) // PANELS)]
    with picture(path, 10, 1.2 + 1.25 * len(shown)) as figure:
        panels = figure.subplots(len(shown), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for gauge, panel in zip(shown, panels, strict=True):
            panel.plot(gauge.t, CM * gauge.eta, color=COMPUTED)
            panel.axhline(0.0, color="#888888", lw=0.6, zorder=0)
            across = f", y = {gauge.y:g} m" if any(one.y for one in gauges) else ""
            panel.set_title(f"gauge {gauge.name}, x = {gauge.x:g} m{across}", pad=2, parse_math=False)
            panel.margins(x=0)
        largest = max(CM * float(np.abs(gauge.eta).max(initial=0.0)) for gauge in shown)
        if largest < FLAT:  # of what is that small no more is drawn than that it is
            panels[0].set_ylim(-FLAT, FLAT)
        panels[-1].set_xlabel("time [s]")
        figure.supylabel("elevation [cm]", fontsize=10)
        figure.suptitle(title or "Wave gauges", fontsize=13, parse_math=False)
    return path


def gauges_figure(
    measured: Sequence[GaugeSeries], computed: Sequence[GaugeSeries], published: Sequence[GaugeSeries], path: Path
) -> Path:
    """Draw measured, computed and published records of the same gauges, whole and around each largest crest.

    Every panel names gauge, place and the normalised rms misfit of each computation. Returns ``path``; raises
    ``InputError`` as ``compare`` does.
    """
    pairs = matched(computed, measured)
    with picture(path, 14, 1.1 + 1.6 * len(pairs)) as figure:
        axes = figure.subplots(len(pairs), 2, width_ratios=(2, 1), sharey="row", squeeze=False)
        for (one, reference), (whole, zoom) in zip(pairs, axes, strict=True):
            near = [other for other in published if abs(other.x - reference.x) < MATCH]
            _draw_gauge(whole, zoom, reference, [*near, one])
        for panel in axes[-1]:
            panel.set_xlabel("time [s]")
        figure.supylabel("elevation [cm]", fontsize=10)
        handles, labels = axes[0, 1].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), fontsize=11)
    return path


def _draw_gauge(whole: Axes, zoom: Axes, reference: GaugeSeries, computations: Sequence[GaugeSeries]) -> None:
    """Draw one gauge's records over the time of the last computation, which is this run's."""
    run = computations[-1]
    common = (reference.t >= run.t[0]) & (reference.t <= run.t[-1])
    shared = replace(reference, t=reference.t[common], eta=reference.eta[common])
    misfits = ", ".join(f"{one.source} {compare_gauge(one, shared).nrms:.3f}" for one in reversed(computations))
    focus = float(shared.t[int(np.argmax(shared.eta))])
    styles = [(MEASURED, "-", 2.0), *[(PUBLISHED, "--", 1.1)] * (len(computations) - 1), (COMPUTED, "-", 1.2)]
    for record, (colour, line, width) in zip([reference, *computations], styles, strict=True):
        there = (record.t >= shared.t[0]) & (record.t <= shared.t[-1])
        for panel, scale in ((whole, 0.6), (zoom, 1.0)):
            t, eta = record.t[there], CM * record.eta[there]
            panel.plot(t, eta, line, color=colour, lw=scale * width, label=record.source)
    whole.set_title(f"gauge {reference.name}, x = {reference.x:g} m;  nrms: {misfits}", pad=3, parse_math=False)
    whole.set_xlim(shared.t[0], shared.t[-1])
    zoom.set_title(f"around its largest crest, t = {focus:.2f} s", pad=3)
    zoom.set_xlim(max(focus - FOCUS, shared.t[0]), min(focus + FOCUS, shared.t[-1]))


# ---------------------------------------------------------------- energy
def energy_figure(energy: dict[str, NDArray[np.float64]], path: Path, *, title: str = "") -> Path:
    """Draw the energy budget and, on an axis of its own, what does not balance; return ``path``.

    ``energy`` has the columns of ``energy.csv`` by their names with units; raises ``InputError`` if one is missing or
    has no row.
    """
    columns = {name.partition(" [")[0]: values for name, values in energy.items()}
    basin = any("m^5" in name for name in energy)
    needed = ("t", "kinetic", "potential", "total", "paddle_work", "balance")
    if missing := [name for name in needed if not columns.get(name, np.zeros(0)).size]:
        raise InputError(f"{path}: the energy budget has no values of {', '.join(missing)}.")
    with picture(path, 10, 6.5) as figure:
        budget, rest = figure.subplots(2, 1, height_ratios=(2, 1), sharex=True)
        _draw_budget(budget, columns)
        budget.set_ylabel("energy per density\n[m⁵/s²]" if basin else "energy per density\nand width [m⁴/s²]")
        _draw_balance(rest, columns)
        figure.suptitle(title or "Energy budget", fontsize=13, parse_math=False)
        figure.align_ylabels()
    return path


def _draw_budget(axes: Axes, columns: dict[str, NDArray[np.float64]]) -> None:
    t, total = columns["t"], columns["total"]
    axes.plot(t, total, color=TOTAL, lw=4, label="total")
    supplied, dissipated = total[0] + columns["paddle_work"], columns.get("dissipated", np.zeros(t.size))
    axes.plot(t, supplied, "--", color=WORK, label="start + paddle work" if columns["paddle_work"].any() else "start")
    if dissipated[-1] > SEEN * np.abs(total).max():
        axes.plot(t, supplied - dissipated, ":", color=WORK, label="the same \N{MINUS SIGN} dissipated")
    if "absorbed" in columns:
        axes.plot(t, columns["absorbed"], "-.", color=WORK, label="paddle absorption")
    axes.plot(t, columns["kinetic"], color=KINETIC, label="kinetic")
    axes.plot(t, columns["potential"], color=POTENTIAL, label="potential")
    axes.legend(ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _draw_balance(axes: Axes, columns: dict[str, NDArray[np.float64]]) -> None:
    """Draw the balance over the most energy there was, what had gone by then included, as a run's verdict has it."""
    t, balance, nothing = columns["t"], columns["balance"], np.zeros(columns["t"].size)
    gone = columns.get("dissipated", nothing) + np.maximum(columns.get("absorbed", nothing), 0.0)
    largest = max(float(np.abs(columns["total"] + gone).max()), np.finfo(float).tiny)
    axes.plot(t, balance / largest, color=COMPUTED)
    axes.ticklabel_format(axis="y", scilimits=(-2, 2), useMathText=True)
    axes.set(xlabel="time [s]", ylabel="what does not balance,\nper largest energy", xlim=(t[0], t[-1]))


# ---------------------------------------------------------------- breakdown
Columns = dict[str, NDArray[np.float64]]
LABELS = {"elevation": "elevation [cm]", "slope": "slope [-]", "velocity": "velocity u [m/s]"}
ENLARGED, NEAR = 20.0, 0.1  # waves' heights, at most, and parts of the tank shown enlarged on either side of a place
PANEL = 3e4  # points² that cells of a basin fill
STEEPEST_SLOPE = 0.58  # slope of the steepest progressive wave


def broken_figure(run: RunDirectory) -> Path:
    """Draw the surface of a run that broke down, ``broken.png``; return its path.

    Of a slice or ring whole and around its steepest place, of a basin from above. Raises ``InputError`` where none is
    kept.
    """
    columns, told = run.broken(), run.manifest["broke_down"]
    path = run.path / BROKEN_PICTURE
    steepest, basin = told["steepest"], "y" in columns
    with picture(path, 11, 8.5) as figure:
        panels = figure.subplots(3, 2, sharex="col", width_ratios=(2, 1) if not basin else (1, 1), squeeze=False)
        for row, name in zip(panels, LABELS, strict=True):
            values = columns[name] * (CM if name == "elevation" else 1.0)
            (_draw_basin_breakdown if basin else _draw_breakdown)(row, columns, values, LABELS[name], steepest)
        if not basin:
            _mark(panels, told["crests"], steepest)
        what = f"{run.title}: " if run.title else ""
        where = f"x = {steepest['x']:.4g} m" + (f", y = {steepest['y']:.4g} m" if basin else "")
        figure.suptitle(
            f"{what}t = {told['t']:.5g} s, from where the run could not go on\n"
            f"steepest at {where}: slope {steepest['slope']:.2g}, u = {steepest['velocity']:.3g} m/s",
            fontsize=12,
            parse_math=False,
        )
    return path


def _draw_breakdown(
    row: NDArray[Any], columns: Columns, values: NDArray[np.float64], label: str, steepest: dict[str, float]
) -> None:
    whole, near = row
    x = columns["x"]
    half = min(ENLARGED * float(np.ptp(columns["elevation"])), NEAR * float(np.ptp(x)))
    there = np.abs(x - steepest["x"]) <= half
    for axes, part in ((whole, slice(None)), (near, there)):
        axes.plot(x[part], values[part], color=COMPUTED, lw=1.2, marker="." if part is there else "", ms=3)
        axes.axvline(steepest["x"], color=VERMILION, lw=0.8)
        axes.margins(x=0)
    if label == LABELS["slope"]:
        for axes in row:
            axes.axhline(STEEPEST_SLOPE, color=INK, lw=0.8, ls=":")
    whole.set_ylabel(label)


def _mark(panels: NDArray[Any], crests: list[dict[str, float]], steepest: dict[str, float]) -> None:
    """Write u/c at the steep crests, and what is what."""
    elevation: Axes = panels[0, 0]
    for crest in crests:
        for axes in panels[0]:
            axes.axvline(crest["x"], color=ORANGE, lw=0.8, ls="--")
        text, at = f"u/c = {crest['speed_ratio']:.2f}", ("data", "axes fraction")
        elevation.annotate(text, (crest["x"], 0.97), xycoords=at, color=ORANGE, fontsize=8, rotation=90, va="top")
    panels[0, 0].set_title("whole", fontsize=10)
    panels[0, 1].set_title("around the steepest place", fontsize=10, color=VERMILION)
    panels[1, 1].set_title("dotted: the steepest progressive wave", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("x [m]")


def _draw_basin_breakdown(
    row: NDArray[Any], columns: Columns, values: NDArray[np.float64], label: str, steepest: dict[str, float]
) -> None:
    """Draw the cells from above, and those around the steepest."""
    whole, near = row
    x, y = columns["x"], columns["y"]
    half = NEAR * max(float(np.ptp(x)), float(np.ptp(y)))
    there = (np.abs(x - steepest["x"]) <= half) & (np.abs(y - steepest["y"]) <= half)
    limits = {"vmin": float(values.min()), "vmax": float(values.max())}
    for axes, part in ((whole, np.ones_like(there)), (near, there)):
        size = PANEL / int(part.sum())
        shown = axes.scatter(x[part], y[part], c=values[part], s=size, marker="s", cmap="viridis", lw=0, **limits)
        axes.plot(steepest["x"], steepest["y"], "o", ms=12, mfc="none", mec=VERMILION)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(False)
    whole.figure.colorbar(shown, ax=list(row), label=label)
    whole.set_ylabel("y [m]")
    if label == LABELS["velocity"]:
        for axes in row:
            axes.set_xlabel("x [m]")


# ---------------------------------------------------------------- loads and probes
COLOURS = {"x": BLUE, "y": GREEN, "z": VERMILION}
MAX_PROBES = 8  # probes; of more every second, third ... is drawn
KILO = 1e3  # Pa, N, N m


def probes_figure(run: RunDirectory, path: Path) -> Path:
    """Draw a run's probes, gaps where they are dry; return ``path``. Raises ``InputError`` where there are none."""
    probes = run.probes
    shown = probes.isel(probe=slice(None, None, -(-probes.sizes["probe"] // MAX_PROBES)))
    rows, tank = shown.sizes["probe"], run.manifest.get("scene", {}).get("tank", {})
    weight = tank.get("density", 1000.0) * tank.get("gravity", 9.81)
    beyond = shown.pressure - weight * np.maximum(0.0, -shown.z)
    scale, kilo = _scale(beyond)
    with picture(path, 13, 1.1 + 1.6 * rows) as figure:
        axes = figure.subplots(rows, 3, sharex=True, sharey="col", squeeze=False)
        for n, (velocity, acceleration, pressure) in enumerate(axes):
            probe = shown.isel(probe=n)
            place = ", ".join(f"{axis} = {float(probe[axis]):g} m" for axis in "xyz" if axis != "y" or float(probe.y))
            velocity.set_title(f"probe {probe.probe.item()}, {place}", pad=2, parse_math=False)
            _draw_vector(velocity, probe, "velocity")
            _draw_vector(acceleration, probe, "acceleration")
            _draw(pressure, probe.time, beyond.isel(probe=n) / scale, color=BLUE)
        text = ("velocity [m/s]", "acceleration [m/s²]", f"pressure beyond still water's [{kilo}Pa]")
        for panel, what in zip(axes[0], text, strict=True):
            panel.set_title(what, loc="right", pad=2)
        _finish(figure, axes, f"{run.title}: probes".lstrip(": "))
    return path


def loads_figure(run: RunDirectory, path: Path) -> Path:
    """Draw forces and moments on a run's walls, less what they are at its start; return ``path``.

    Raises ``InputError`` where there are none.
    """
    loads = run.loads
    rows, beyond = loads.sizes["wall"], loads - loads.isel(time=0)
    scale, kilo = _scale(beyond[["force_x", "moment_y"]].to_array())
    units = {"force": loads.force_x.units, "moment": loads.moment_y.units}
    with picture(path, 11, 1.1 + 1.9 * rows) as figure:
        axes = figure.subplots(rows, 2, sharex=True, squeeze=False)
        for n, panels in enumerate(axes):
            for panel, name in zip(panels, units, strict=True):
                _draw_vector(panel, beyond.isel(wall=n) / scale, name)
            panels[0].set_title(str(loads.wall[n].item()), pad=2, parse_math=False)
        for panel, (name, unit) in zip(axes[0], units.items(), strict=True):
            panel.set_title(f"{name} beyond that at the start [{kilo}{unit}]", loc="right", pad=2)
        _finish(figure, axes, f"{run.title}: loads".lstrip(": "))
    return path


def _scale(values: Any) -> tuple[float, str]:
    """Return what values are shown over, and the prefix of their unit."""
    return (KILO, "k") if float(np.abs(values).max()) > KILO else (1.0, "")


def _draw_vector(panel: Axes, data: Any, name: str) -> None:
    """Draw the components of a vector that are there and are not all 0."""
    for axis, colour in COLOURS.items():
        if f"{name}_{axis}" in data and (values := data[f"{name}_{axis}"]).any():
            what = f"about {axis}" if name == "moment" else f"along {axis}"
            _draw(panel, data.time, values, label=what, color=colour)


def _draw(panel: Axes, t: Any, values: Any, **look: Any) -> None:
    panel.plot(t, values, **look)
    panel.axhline(0.0, color="#888888", lw=0.6, zorder=0)
    panel.margins(x=0)


def _finish(figure: Any, axes: Any, title: str) -> None:
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    each = (panel.get_legend_handles_labels() for panel in axes.flat)
    result = {label: handle for handles, labels in each for handle, label in zip(handles, labels, strict=True)}
    if result:
        figure.legend(result.values(), result.keys(), loc="outside upper right", ncols=len(result))
    figure.suptitle(title, fontsize=13, parse_math=False)


# ---------------------------------------------------------------- surface between columns of nodes
ENOUGH = 1200  # places along a tank: about the pixels of a picture


def within_cells(surface: Surface, order: int) -> Surface:
    """Return the surface at places between the nodes as well, by the polynomial of its order that each cell holds.

    Cells are alike, each between every ``order``-th node and the next; x is a polynomial in them, too. A surface of
    more places than a picture shows is returned as it is, and so is one whose cells cannot be told.
    """
    intervals = surface.x.shape[1] - 1
    if order == 1 or intervals < order or intervals % order or intervals >= ENOUGH:
        return surface
    cells = intervals // order
    nodes = order * np.arange(cells)[:, None] + np.arange(order + 1)
    last = surface.x[0, -order - 1 :]  # of the last cell, which no paddle moves
    shapes = _shapes((last - last[0]) / (last[-1] - last[0]), each=ceil(ENOUGH / cells))
    fields = (
        np.column_stack([(field[:, nodes] @ shapes).reshape(len(field), -1), field[:, -1]])
        for field in (surface.x, surface.eta, surface.psi)
    )
    return Surface(surface.t, *fields)


def _shapes(nodes: NDArray[np.float64], *, each: int) -> NDArray[np.float64]:
    """Return Lagrange's polynomials of nodes in [0, 1] at so many places from 0 on, shape (nodes, each)."""
    places = np.arange(each) / each
    others = [np.delete(nodes, j) for j in range(nodes.size)]
    return np.array([np.prod((places[:, None] - x) / (at - x), axis=1) for at, x in zip(nodes, others, strict=True)])


# ---------------------------------------------------------------- all figures of a run
def draw_run(run: RunDirectory) -> list[Path]:
    """Draw the standard pictures of a run into its directory; return the paths of those drawn.

    What a run that was killed early did not come to record is left out, and so are a basin's maps where pyvista, which
    reads its surface, is not installed. Raises ``InputError`` for missing files.
    """
    gauges, energy = run.gauge_series(), run.budget()
    pictures = [broken_figure(run)] if (run.path / BROKEN).exists() else []
    if _snapshots(run) > 1:
        pictures.append(draw_surface(run))
    if any(gauge.t.size > 1 for gauge in gauges):
        pictures.append(gauges_overview(gauges, run.path / "gauges.png", title=run.title))
    pictures += _in_the_water(run)
    if all(column.size > 1 for column in energy.values()) and energy:
        pictures.append(
            energy_figure(energy, run.path / "energy.png", title=f"{run.title}: energy budget".lstrip(": "))
        )
    return pictures


def _in_the_water(run: RunDirectory) -> list[Path]:
    """Draw probes and loads, where there are rows of them; return the paths."""
    pictures = list[Path]()
    if (run.path / PROBES).exists() and run.probes.sizes["time"] > 1:
        pictures.append(probes_figure(run, run.path / "probes.png"))
    if (run.path / LOADS).exists() and run.loads.sizes["time"] > 1:
        pictures.append(loads_figure(run, run.path / "loads.png"))
    return pictures


def _snapshots(run: RunDirectory) -> int:
    """Return how many snapshots of the surface can be drawn."""
    if (run.path / SURFACE).exists():
        return int(run.snapshots().t.size)
    return len(run.fields("surface")) if index_file(run.path, "surface").exists() and find_spec("pyvista") else 0


X_ORIGIN = "from the paddle's rest position"
ORIGINS = {"ring": "along the ring", "fixed": "from the wall", **dict.fromkeys(("piston", "flap", "profile"), X_ORIGIN)}


def draw_surface(run: RunDirectory) -> Path:
    """Draw the surface as the run's scene asks for, ``surface.png``: a basin's from above, else over x and t.

    Return the picture's path; raises ``InputError`` for less than two snapshots.
    """
    scene, path = run.manifest.get("scene", {}), run.path / "surface.png"
    tank, wall = scene.get("tank", {}), scene.get("wall", {})
    if not (run.path / SURFACE).exists():
        from wavetank.plots.basin import basin_figure

        return basin_figure(run, path)
    ring, surface = tank.get("type") == "ring", run.snapshots()
    if surface.t.size < 2:
        raise InputError(f"{path}: {surface.t.size} snapshots of the surface received; at least 2 are needed to draw.")
    origin = ORIGINS.get("ring" if ring else wall.get("type"), "along the tank")
    shown = _closed(surface, tank["length"]) if ring else surface
    numerics = (run.manifest.get("planned") or scene).get("numerics", {})
    shown = within_cells(shown, numerics.get("order", 1))
    depth = still_water(run) or tank.get("depth", np.inf)
    gauges, sponge = run.gauge_series() if (run.path / GAUGES).exists() else [], _sponge(scene, shown)
    return surface_figure(shown, path, title=run.title, depth=depth, origin=origin, gauges=gauges, sponge=sponge)


def _sponge(scene: dict[str, Any], surface: Surface) -> tuple[float, float] | None:
    """Return from where to where [m] a slice's sponge damps; None where there is none."""
    noun = scene.get("sponge")
    if noun is None:
        return None
    x = surface.x[0]
    if noun["type"] == "formula":
        rate = FormulaSponge.model_validate(noun).build()(x, 0 * x)
        inside = x[rate > DAMPED * rate.max(initial=0.0)]
        return (float(inside.min()), float(inside.max())) if inside.size else None
    return float(x[-1]) - noun["length"], float(x[-1])


def _closed(surface: Surface, length: float) -> Surface:
    """Return the surface of a ring [m] with its first point once more at the end."""
    x, eta, psi = (np.column_stack([field, field[:, 0]]) for field in (surface.x, surface.eta, surface.psi))
    x[:, -1] += length
    return Surface(surface.t, x, eta, psi)
