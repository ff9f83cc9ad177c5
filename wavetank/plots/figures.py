"""Figures of a run: surface, gauges, energy, breakdown, loads and probes."""

from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset, concat

from wavetank.analysis.compare import MATCH, compare_gauge, matched
from wavetank.analysis.still_water import sponge_rate, still_water
from wavetank.case.tank import Depth
from wavetank.errors import InputError
from wavetank.output.directory import BROKEN, BROKEN_PICTURE, ENERGY, GAUGES, LOADS, PROBES, SURFACE, RunDirectory
from wavetank.output.fields import index_file
from wavetank.plots.style import (
    BLUE,
    CM,
    COMPUTED,
    DAMPED,
    DARK,
    FLAT,
    GREEN,
    INK,
    MEASURED,
    ORANGE,
    PADDLE,
    PUBLISHED,
    SATURATED,
    VERMILION,
    WATER,
    common_legend,
    lay_out,
    mark_along,
    mark_sponge,
    picture,
    remove_overlaps,
    titled,
    zero_line,
)

Array = NDArray[np.float64]

# ---------------------------------------------------------------- the surface
BEFORE, CREST, AFTER = ORANGE, "#0b2d5c", "#a0417f"
SKY, STILL, SAND = "#f4f9fd", "#a8d3ee", "#cdb990"
PIXELS = 1200, 540  # of the (x, t) plane


def surface_figure(
    surface: Dataset,
    path: Path,
    *,
    title: str = "",
    depth: float | Depth = np.inf,
    origin: str = "along the tank",
    gauges: DataArray | None = None,
    sponge: tuple[float, float] | None = None,
) -> Path:
    """Draw the highest crest, with the wave just before and after it, above all snapshots in the (x, t) plane.

    ``surface`` is ``RunDirectory.snapshots()``, of two snapshots or more. Where a wall moves, its position is drawn at
    that side of the (x, t) plane. No water is drawn below the depth [m]; where that is a function d(x, y) the bed is
    drawn between the two panels. ``gauges`` are lines in the (x, t) plane; what a ``sponge`` damps, from and to x [m],
    is hatched. ``origin`` says what x is the distance from, or along. Returns ``path``.
    """
    t, x, eta = surface.time.values, surface.x.values, surface.elevation.values
    crest = int(eta.max(axis=1).argmax())
    paddle, far = (bool(np.ptp(x[:, node])) for node in (0, -1))
    d = depth(x[crest], 0 * x[crest]) if callable(depth) else np.full_like(x[crest], depth)
    heights, widths = (1, 0.3, 1.5) if callable(depth) else (1, 1.5), (1, 11, 1)[1 - paddle : 2 + far]
    with picture(path, 11, 9.6 if callable(depth) else 8.6, title=title or "Surface elevation") as figure:
        grid = figure.add_gridspec(len(heights), len(widths), height_ratios=heights, width_ratios=widths)
        diagram = figure.add_subplot(grid[-1, int(paddle)], xlabel=f"distance {origin}, x [m]", ylabel="time [s]")
        profile = figure.add_subplot(grid[0, int(paddle)], sharex=diagram)
        _draw_diagram(figure, diagram, t, x, eta)
        if gauges is not None:
            mark_along(diagram, gauges, top=float(t[-1]))
        if sponge is not None:
            diagram.axvspan(*sponge, fill=False, hatch="//", ec=DARK, lw=0, alpha=0.6)
            mark_sponge(diagram, (sum(sponge) / 2, 0.03), xycoords=diagram.get_xaxis_transform())
        _draw_profile(profile, t, x, eta, float(d.max()))
        if callable(depth):
            _draw_bed(figure.add_subplot(grid[1, int(paddle)], sharex=diagram), x[crest], d)
        if paddle:
            diagram.tick_params(labelleft=False)
            diagram.set_ylabel("")
            _draw_wall(figure.add_subplot(grid[-1, 0], sharey=diagram, ylabel="time [s]"), diagram, t, x[:, 0], 0.0)
        if far:
            panel = figure.add_subplot(grid[-1, -1], sharey=diagram)
            panel.tick_params(labelleft=False)
            _draw_wall(panel, diagram, t, x[:, -1], float(x[0, -1]), far=True)
        lay_out(figure)  # the panel's size, its exaggeration, and the places of names are final only now
        remove_overlaps(diagram)
        profile.set_title(f"vertical exaggeration {_exaggeration(profile):g}", loc="right", fontsize=9, color="#555555")
    return path


def _draw_profile(axes: Axes, t: Array, x: Array, eta: Array, depth: float) -> None:
    """Draw the highest crest over the water, and the surface half a period before and after it."""
    crest, top = (int(n) for n in np.unravel_index(np.argmax(eta), eta.shape))
    place, height, largest = float(x[crest, top]), CM * float(eta[crest, top]), CM * float(np.abs(eta[crest]).max())
    limits = (max(-1.9 * max(largest, FLAT), -CM * depth), 1.55 * max(largest, FLAT))
    axes.set_facecolor(SKY)
    axes.grid(False)
    _fill_water(axes, x[crest], CM * eta[crest], limits)
    below = np.flatnonzero(eta[crest:, top] < 0)
    step = max(1, 2 * int(below[0]) - 1) if below.size else 1  # half a period: twice the time that it takes to sink
    for snapshot, colour, note in (
        (crest - step, BEFORE, ""),
        (crest, CREST, ", the highest crest of the snapshots"),
        (crest + step, AFTER, ""),
    ):
        if 0 <= snapshot < t.size:
            label, width = f"t = {t[snapshot]:.2f} s{note}", 2.2 if note else 1.3
            axes.plot(x[snapshot], CM * eta[snapshot], color=colour, lw=width, zorder=width, label=label)
    side, offset = ("right", -14) if place > x[crest].mean() else ("left", 14)
    axes.annotate(
        f"{height:.3g} cm at x = {place:.2f} m",
        (place, height),
        xytext=(offset, 10),
        textcoords="offset points",
        ha=side,
        color=CREST,
        arrowprops={"arrowstyle": "-", "color": CREST, "lw": 0.8, "shrinkB": 3},
    )
    axes.set(ylim=limits, ylabel="elevation [cm]")
    axes.yaxis.label.set_in_layout(False)  # it hangs over the empty corner, and must not part paddle and diagram
    axes.tick_params(labelbottom=False)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)


def _fill_water(axes: Axes, x: Array, eta: Array, limits: tuple[float, float]) -> None:
    """Fill the water below eta [cm] with a colour that deepens downwards."""
    outline = axes.fill_between(x, eta, limits[0], color="none")
    extent = (float(x[0]), float(x[-1]), limits[0], float(eta.max()))
    shade = np.linspace(0.0, 1.0, 256)[:, None]
    water = axes.imshow(shade, extent=extent, cmap=WATER, origin="lower", aspect="auto", interpolation="bilinear")
    water.set_clip_path(outline.get_paths()[0], axes.transData)


def _draw_bed(axes: Axes, x: Array, depth: Array) -> None:
    """Draw still water over its bed, depth [m] at x [m]."""
    lowest = 1.1 * float(depth.max())
    axes.fill_between(x, 0.0, -depth, color=STILL, lw=0)
    axes.fill_between(x, -depth, -lowest, color=SAND, lw=0)
    axes.set(ylim=(-lowest, 0.0), ylabel="bed [m]")
    axes.yaxis.label.set_in_layout(False)
    axes.tick_params(labelbottom=False)
    axes.grid(False)


def _exaggeration(axes: Axes) -> float:
    """Return how many times steeper than in the tank a slope is drawn, to two digits; x in m, y in cm."""
    box, (first, last), (low, high) = axes.get_window_extent(), axes.get_xlim(), axes.get_ylim()
    return float(f"{CM * (box.height / (high - low)) / (box.width / (last - first)):.2g}")


def _draw_diagram(figure: Figure, axes: Axes, t: Array, x: Array, eta: Array) -> None:
    """Draw the elevation over x and t as colours, with the highest crest marked."""
    largest = max(CM * float(np.quantile(np.abs(eta), SATURATED)), FLAT)
    limits: dict[str, Any] = {"vmin": -largest, "vmax": largest}
    extent = (float(x.min()), float(x.max()), float(t[0]), float(t[-1]))
    values = CM * _resampled(t, x, eta)
    colours = axes.imshow(values, extent=extent, cmap="RdBu_r", origin="lower", aspect="auto", **limits)
    axes.grid(False)
    crest, top = np.unravel_index(np.argmax(eta), eta.shape)
    axes.axhline(t[crest], color=CREST, lw=0.8, ls=(0, (6, 4)))
    axes.plot(x[crest, top], t[crest], "o", ms=9, mfc="none", mec=CREST, mew=1.3)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    bar: dict[str, Any] = {"orientation": "horizontal", "aspect": 70, "pad": 0.02, "extend": "both"}
    figure.colorbar(colours, ax=axes, extendfrac=0.015, label="elevation [cm]", **bar)


def _resampled(t: Array, x: Array, eta: Array) -> Array:
    """Return eta [m] on a regular grid of about the picture's pixels, shape (times, places).

    The elevation is interpolated, not the colour: halfway between red and blue there is white, not purple.
    """
    columns, times = np.linspace(x.min(), x.max(), PIXELS[0]), np.linspace(t[0], t[-1], PIXELS[1])
    rows = np.array([np.interp(columns, *snapshot) for snapshot in zip(x, eta, strict=True)])
    return np.asarray(CubicSpline(t, rows)(times))


def _draw_wall(axes: Axes, diagram: Axes, t: Array, x: Array, rest: float, *, far: bool = False) -> None:
    """Draw the position x [m] of a moving wall where it is in the diagram, and enlarged in a panel of its own."""
    diagram.plot(x, t, color=PADDLE, lw=1.5)
    diagram.fill_betweenx(t, x.max() if far else x.min(), x, color="#dddddd", lw=0)
    axes.plot(CM * (x - rest), t, color=PADDLE)
    reach = CM * float(np.abs(x - rest).max())
    tick = float(f"{reach:.0e}")  # one digit: the panel is narrow
    axes.set_xticks([-tick, 0.0, tick], [Formatter.fix_minus(f"{-tick:g}"), "0", f"{tick:g}"])
    axes.set(xlim=(-1.4 * reach, 1.4 * reach), xlabel=f"{'far wall' if far else 'paddle'}\n[cm]")


# ---------------------------------------------------------------- gauges
PANELS = 24  # of gauges in one picture
COLUMN = 8  # panels one below the other; of more there are two columns
FOCUS = 4.0  # s shown on either side of the largest crest


def gauges_overview(gauges: DataArray, path: Path, *, title: str = "") -> Path:
    """Draw the gauges' records, all on one scale, from the paddle outwards; return ``path``.

    Of more than ``PANELS`` gauges every second, third ... is drawn. Raises ``InputError`` if there is no gauge.
    """
    if not gauges.sizes["gauge"]:
        raise InputError(f"{path}: there is no gauge to draw.")
    shown = gauges.sortby("x")[:: -(-gauges.sizes["gauge"] // PANELS)]
    columns = 1 if len(shown) <= COLUMN else 2
    rows = -(-len(shown) // columns)
    with picture(path, 10 if columns == 1 else 14, 1.2 + 1.25 * rows, title=title or "Wave gauges") as figure:
        panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel(order="F")
        for gauge, panel in zip(shown, panels, strict=False):
            panel.plot(gauge.time, CM * gauge, color=COMPUTED)
            zero_line(panel)
            across = f", y = {float(gauge.y):g} m" if gauges.y.any() else ""
            panel.set_title(f"gauge {gauge.gauge.item()}, x = {float(gauge.x):g} m{across}", pad=2, parse_math=False)
            panel.margins(x=0)
        for panel in panels[len(shown) :]:
            panel.set_axis_off()
        if CM * float(np.abs(shown).max()) < FLAT:  # smaller waves are drawn as still water
            panels[0].set_ylim(-FLAT, FLAT)
        for panel in panels[rows - 1 : len(shown) : rows] if columns > 1 else panels[-1:]:
            panel.set_xlabel("time [s]")
        figure.supylabel("elevation [cm]", fontsize=10)
    return path


def gauges_figure(measured: DataArray, computed: DataArray, published: Sequence[DataArray], path: Path) -> Path:
    """Draw measured, computed and published records of the same gauges, in full and around each largest crest.

    Every panel names gauge, place and the normalised rms misfit of each computation. Returns ``path``; raises
    ``InputError`` as ``compare`` does.
    """
    pairs = matched(computed, measured)
    computations = [one for records in published for one in records]
    with picture(path, 14, 1.1 + 1.6 * len(pairs)) as figure:
        axes = figure.subplots(len(pairs), 2, width_ratios=(2, 1), sharey="row", squeeze=False)
        for (one, reference), (full, zoom) in zip(pairs, axes, strict=True):
            same_place = [other.dropna("time") for other in computations if abs(other.x - reference.x) < MATCH]
            _draw_gauge(full, zoom, reference, [*same_place, one])
        for panel in axes[-1]:
            panel.set_xlabel("time [s]")
        figure.supylabel("elevation [cm]", fontsize=10)
        common_legend(figure, "outside upper center", ncols=2 + len(published))
    return path


def _draw_gauge(full: Axes, zoom: Axes, reference: DataArray, computations: Sequence[DataArray]) -> None:
    """Draw one gauge's records over the time of the last computation, which is this run's."""
    run = computations[-1]
    shared = reference.sel(time=slice(run.time[0], run.time[-1]))
    misfits = ", ".join(f"{one.source} {compare_gauge(one, shared)['nrms']:.3f}" for one in reversed(computations))
    focus, (first, last) = float(shared.idxmax("time")), shared.time.values[[0, -1]]
    styles = [(MEASURED, "-", 2.0), *[(PUBLISHED, "--", 1.1)] * (len(computations) - 1), (COMPUTED, "-", 1.2)]
    for record, (colour, line, width) in zip([reference, *computations], styles, strict=True):
        part = record.sel(time=slice(first, last))
        for panel, scale in ((full, 0.6), (zoom, 1.0)):
            panel.plot(part.time, CM * part, line, color=colour, lw=scale * width, label=record.source)
    name = f"gauge {reference.gauge.item()}, x = {float(reference.x):g} m"
    full.set_title(f"{name};  nrms: {misfits}", pad=3, parse_math=False)
    full.set_xlim(first, last)
    zoom.set_title(f"around its largest crest, t = {focus:.2f} s", pad=3)
    zoom.set_xlim(max(focus - FOCUS, first), min(focus + FOCUS, last))


# ---------------------------------------------------------------- energy
KINETIC, POTENTIAL, TOTAL, WORK = VERMILION, GREEN, "#8cc5e8", INK
NEGLIGIBLE = 1e-3  # of the largest energy; less dissipation is not drawn


def energy_figure(energy: Dataset, path: Path, *, title: str = "") -> Path:
    """Draw the energy budget and, on an axis of its own, the error of the energy balance; return ``path``.

    ``energy`` is ``RunDirectory.energy``; raises ``InputError`` if a quantity is missing or has no value.
    """
    needed = ("kinetic", "potential", "total", "paddle_work", "balance")
    if missing := [name for name in needed if name not in energy or not energy.time.size]:
        raise InputError(f"{path}: the energy budget has no values of {', '.join(missing)}.")
    basin = "m^5" in energy.total.units
    with picture(path, 10, 6.5, title=titled(title, "energy budget")) as figure:
        budget, error = figure.subplots(2, 1, height_ratios=(2, 1), sharex=True)
        _draw_budget(budget, energy)
        budget.set_ylabel("energy per density\n[m⁵/s²]" if basin else "energy per density\nand width [m⁴/s²]")
        _draw_balance(error, energy)
        figure.align_ylabels()
    return path


def _draw_budget(axes: Axes, energy: Dataset) -> None:
    t, total, work = energy.time, energy.total, energy.paddle_work
    axes.plot(t, total, color=TOTAL, lw=4, label="total")
    supplied = total[0] + work
    axes.plot(t, supplied, "--", color=WORK, label="start + paddle work" if work.any() else "start")
    if "dissipated" in energy and energy.dissipated[-1] > NEGLIGIBLE * np.abs(total).max():
        remainder = supplied - energy.dissipated
        axes.plot(t, remainder, ":", color=WORK, label="the same \N{MINUS SIGN} dissipated")
    if "absorbed" in energy:
        axes.plot(t, energy.absorbed, "-.", color=WORK, label="paddle absorption")
    axes.plot(t, energy.kinetic, color=KINETIC, label="kinetic")
    axes.plot(t, energy.potential, color=POTENTIAL, label="potential")
    axes.legend(ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0))


def _draw_balance(axes: Axes, energy: Dataset) -> None:
    """Draw the balance over the largest sum of energy, dissipation and absorption, as the run's warning has it."""
    nothing = 0 * energy.total
    removed = energy.get("dissipated", nothing) + np.maximum(energy.get("absorbed", nothing), 0.0)
    largest = max(float(np.abs(energy.total + removed).max()), np.finfo(float).tiny)
    axes.plot(energy.time, energy.balance / largest, color=COMPUTED)
    axes.ticklabel_format(axis="y", scilimits=(-2, 2), useMathText=True)
    limits = float(energy.time[0]), float(energy.time[-1])
    axes.set(xlabel="time [s]", ylabel="energy error over\nlargest energy [-]", xlim=limits)


# ---------------------------------------------------------------- breakdown
LABELS = {"elevation": "elevation [cm]", "slope": "slope [-]", "velocity": "velocity u [m/s]"}
ENLARGED, AROUND = 20.0, 0.1  # wave heights, at most, and parts of the tank shown enlarged on either side of a place
PANEL = 3e4  # points² that cells of a basin fill
STEEPEST_SLOPE = 0.58  # slope of the steepest progressive wave


def broken_figure(run: RunDirectory) -> Path:
    """Draw the surface of a run that broke down, ``broken.png``; return its path.

    In full and around its steepest place, of a basin in plan view. Raises ``InputError`` where none was recorded.
    """
    surface, breakdown = run.broken(), run.manifest["broke_down"]
    path, steepest, basin = run.path / BROKEN_PICTURE, breakdown["steepest"], "y" in surface
    surface["elevation"] = CM * surface.elevation
    where = f"x = {steepest['x']:.4g} m" + (f", y = {steepest['y']:.4g} m" if basin else "")
    title = (
        f"{f'{run.title}: ' if run.title else ''}t = {breakdown['t']:.5g} s, from where the run could not go on\n"
        f"steepest at {where}: slope {steepest['slope']:.2g}, u = {steepest['velocity']:.3g} m/s"
    )
    with picture(path, 11, 8.5, title=title) as figure:
        panels = figure.subplots(3, 2, sharex="col", width_ratios=(2, 1) if not basin else (1, 1), squeeze=False)
        if basin:
            _draw_broken_basin(panels, surface, steepest)
        else:
            _draw_broken_slice(panels, surface, steepest, breakdown["crests"])
        for panel in panels[-1]:
            panel.set_xlabel("x [m]")
    return path


def _draw_broken_slice(
    panels: NDArray[Any], surface: Dataset, steepest: dict[str, float], crests: list[dict[str, float]]
) -> None:
    """Draw each quantity over x, in full and around the steepest place, with u/c at the steep crests."""
    half = min(ENLARGED * float(np.ptp(surface.elevation.values)) / CM, AROUND * float(np.ptp(surface.x.values)))
    zoom = surface.where(np.abs(surface.x - steepest["x"]) <= half, drop=True)
    for row, (name, label) in zip(panels, LABELS.items(), strict=True):
        for axes, part, marker in zip(row, (surface, zoom), ("", "."), strict=True):
            axes.plot(part.x, part[name], color=COMPUTED, lw=1.2, marker=marker, ms=3)
            axes.axvline(steepest["x"], color=VERMILION, lw=0.8)
            axes.margins(x=0)
        row[0].set_ylabel(label)
    for axes in panels[1]:
        axes.axhline(STEEPEST_SLOPE, color=INK, lw=0.8, ls=":")
    for crest in crests:
        for axes in panels[0]:
            axes.axvline(crest["x"], color=ORANGE, lw=0.8, ls="--")
        text, at = f"u/c = {crest['speed_ratio']:.2f}", ("data", "axes fraction")
        style = {"color": ORANGE, "fontsize": 8, "rotation": 90, "va": "top"}
        panels[0, 0].annotate(text, (crest["x"], 0.97), xycoords=at, **style)
    panels[0, 0].set_title("in full", fontsize=10)
    panels[0, 1].set_title("around the steepest place", fontsize=10, color=VERMILION)
    panels[1, 1].set_title("dotted: the steepest progressive wave", fontsize=8)


def _draw_broken_basin(panels: NDArray[Any], surface: Dataset, steepest: dict[str, float]) -> None:
    """Draw the cells in plan view, all of them and those around the steepest."""
    half = AROUND * max(float(np.ptp(surface.x.values)), float(np.ptp(surface.y.values)))
    inside = (np.abs(surface.x - steepest["x"]) <= half) & (np.abs(surface.y - steepest["y"]) <= half)
    zoom = surface.where(inside, drop=True)
    for row, (name, label) in zip(panels, LABELS.items(), strict=True):
        limits = {"vmin": float(surface[name].min()), "vmax": float(surface[name].max())}
        for axes, part in zip(row, (surface, zoom), strict=True):
            style = {"s": PANEL / part.sizes["point"], "marker": "s", "cmap": "viridis", "lw": 0}
            colours = axes.scatter(part.x, part.y, c=part[name], **style, **limits)
            axes.plot(steepest["x"], steepest["y"], "o", ms=12, mfc="none", mec=VERMILION)
            axes.set_aspect("equal", adjustable="datalim")
            axes.grid(False)
        row[0].figure.colorbar(colours, ax=list(row), label=label)
        row[0].set_ylabel("y [m]")


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
    with picture(path, 13, 1.1 + 1.6 * rows, title=titled(run.title, "probes")) as figure:
        axes = figure.subplots(rows, 3, sharex=True, sharey="col", squeeze=False)
        for n, (velocity, acceleration, pressure) in enumerate(axes):
            probe = shown.isel(probe=n)
            place = ", ".join(f"{axis} = {float(probe[axis]):g} m" for axis in "xyz" if axis != "y" or float(probe.y))
            velocity.set_title(f"probe {probe.probe.item()}, {place}", pad=2, parse_math=False)
            _draw_vector(velocity, probe, "velocity")
            _draw_vector(acceleration, probe, "acceleration")
            _draw(pressure, probe.time, beyond.isel(probe=n) / scale, color=BLUE)
        text = ("velocity [m/s]", "acceleration [m/s²]", f"pressure beyond still water's [{kilo}Pa]")
        _finish(figure, axes, text)
    return path


def loads_figure(run: RunDirectory, path: Path) -> Path:
    """Draw forces and moments on a run's walls, less those at its start; return ``path``.

    Raises ``InputError`` where there are none.
    """
    loads = run.loads
    rows, beyond = loads.sizes["wall"], loads - loads.isel(time=0)
    scale, kilo = _scale(beyond[["force_x", "moment_y"]].to_array())
    units = {"force": loads.force_x.units, "moment": loads.moment_y.units}
    with picture(path, 11, 1.1 + 1.9 * rows, title=titled(run.title, "loads")) as figure:
        axes = figure.subplots(rows, 2, sharex=True, squeeze=False)
        for n, panels in enumerate(axes):
            for panel, name in zip(panels, units, strict=True):
                _draw_vector(panel, beyond.isel(wall=n) / scale, name)
            panels[0].set_title(str(loads.wall[n].item()), pad=2, parse_math=False)
        _finish(figure, axes, [f"{name} beyond that at the start [{kilo}{unit}]" for name, unit in units.items()])
    return path


def _scale(values: Any) -> tuple[float, str]:
    """Return the divisor of values that are shown, and the prefix of their unit."""
    return (KILO, "k") if float(np.abs(values).max()) > KILO else (1.0, "")


def _draw_vector(panel: Axes, data: Any, name: str) -> None:
    """Draw the components of a vector that exist and are not all 0."""
    for axis, colour in COLOURS.items():
        if f"{name}_{axis}" in data and (values := data[f"{name}_{axis}"]).any():
            label = f"about {axis}" if name == "moment" else f"along {axis}"
            _draw(panel, data.time, values, label=label, color=colour)


def _draw(panel: Axes, t: Any, values: Any, **properties: Any) -> None:
    panel.plot(t, values, **properties)
    zero_line(panel)
    panel.margins(x=0)


def _finish(figure: Figure, axes: NDArray[Any], titles: Sequence[str]) -> None:
    """Write the quantities above the columns, the time below them, and the legend."""
    for panel, text in zip(axes[0], titles, strict=True):
        panel.set_title(text, loc="right", pad=2)
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    common_legend(figure, "outside upper right", ncols=5)


# ---------------------------------------------------------------- all figures of a run
def draw_run(run: RunDirectory) -> list[Path]:
    """Draw the standard pictures of a run into its directory; return the paths of those drawn.

    Those without records, as of a run that was killed early, are left out, and so are a basin's maps where pyvista,
    which reads its surface, is not installed. Raises ``InputError`` for missing files.
    """
    gauges, energy = run.gauges, run.energy
    pictures = [broken_figure(run)] if (run.path / BROKEN).exists() else []
    if _snapshots(run) > 1:
        pictures.append(draw_surface(run))
    if gauges.sizes["gauge"] and gauges.time.size > 1:
        pictures.append(gauges_overview(gauges, run.path / "gauges.png", title=run.title))
    for file, draw in ((PROBES, probes_figure), (LOADS, loads_figure)):
        if (run.path / file).exists() and getattr(run, Path(file).stem).sizes["time"] > 1:
            pictures.append(draw(run, run.path / Path(file).with_suffix(".png").name))
    if energy.time.size > 1:
        pictures.append(energy_figure(energy, run.path / Path(ENERGY).with_suffix(".png"), title=run.title))
    return pictures


def _snapshots(run: RunDirectory) -> int:
    """Return how many snapshots of the surface can be drawn."""
    if (run.path / SURFACE).exists():
        return int(run.snapshots().time.size)
    return len(run.fields("surface")) if index_file(run.path, "surface").exists() and find_spec("pyvista") else 0


X_ORIGIN = "from the paddle's rest position"
ORIGINS = {"ring": "along the ring", "fixed": "from the wall"}  # of others ``X_ORIGIN``


def draw_surface(run: RunDirectory) -> Path:
    """Draw the surface of a run, ``surface.png``: of a basin maps, else a diagram over x and t.

    Return the picture's path; raises ``InputError`` for less than two snapshots.
    """
    scene, path = run.manifest.get("scene", {}), run.path / "surface.png"
    tank, wall = scene.get("tank", {}), scene.get("wall", {})
    if not (run.path / SURFACE).exists():
        from wavetank.plots.basin import basin_figure

        return basin_figure(run, path)
    ring, surface = tank.get("type") == "ring", run.snapshots()
    if surface.time.size < 2:
        number = surface.time.size
        raise InputError(f"{path}: {number} snapshots of the surface received; at least 2 are needed to draw.")
    shown = _closed(surface, tank["length"]) if ring else surface
    return surface_figure(
        shown,
        path,
        title=run.title,
        depth=still_water(run) or tank.get("depth", np.inf),
        origin=ORIGINS.get("ring" if ring else wall.get("type"), X_ORIGIN),
        gauges=run.gauges if (run.path / GAUGES).exists() else None,
        sponge=_sponge(scene, shown.x.values[0]),
    )


def _sponge(scene: dict[str, Any], x: Array) -> tuple[float, float] | None:
    """Return from where to where [m] a slice's sponge damps, x [m] the surface's points; None where there is none."""
    if (rate := sponge_rate(scene, x)) is None:
        return None
    inside = x[rate > DAMPED * rate.max(initial=0.0)]
    return (float(inside.min()), float(inside.max())) if inside.size else None


def _closed(surface: Dataset, length: float) -> Dataset:
    """Return the surface of a ring [m] with its first point once more at the end."""
    first = surface.isel(point=[0])
    both = [surface[["elevation"]], first[["elevation"]].assign_coords(x=first.x + length)]
    return concat(both, "point", data_vars="minimal", coords="minimal", compat="override")
