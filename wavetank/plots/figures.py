"""Figures of a run: surface, gauges, energy, breakdown, loads and probes."""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank.analysis.compare import GAUGE_TOLERANCE, compare_gauge, matched
from wavetank.analysis.still_water import closed, sponge_rate, still_water
from wavetank.base.errors import InputError
from wavetank.case.tank import Depth
from wavetank.output.directory import (
    BROKEN,
    BROKEN_PICTURE,
    CERTIFICATE,
    ENERGY,
    GAUGES,
    LOADS,
    PROBES,
    SURFACE,
    RunDirectory,
)
from wavetank.output.fields import index_file
from wavetank.plots import style

Array = NDArray[np.float64]

# ---------------------------------------------------------------- the surface
BEFORE, CREST, AFTER = style.ORANGE, "#0b2d5c", "#a0417f"
SKY, STILL, SAND = "#f4f9fd", "#a8d3ee", "#cdb990"
PIXELS = 1200, 540  # pixels of the (x, t) plane


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

    ``surface`` is ``RunDirectory.snapshots()`` with at least two snapshots. The position of a moving wall is drawn at
    its side of the (x, t) plane. No water is drawn below the depth [m]; the bed of a function d(x, y) is drawn between
    the two panels. ``gauges`` are lines in the (x, t) plane; the range x [m] of a ``sponge`` is hatched. ``origin`` is
    the label of the x axis. Returns ``path``.
    """
    t, x, eta = surface.time.values, surface.x.values, surface.elevation.values
    walls = {name: end for name, end in (("paddle", 0), ("far wall", -1)) if np.ptp(x[:, end])}
    columns = [name for name in ("paddle", "diagram", "far wall") if name in walls or name == "diagram"]
    heights = {"profile": 1.0, **({"bed": 0.3} if callable(depth) else {})}
    mosaic: Any = [*[[name if column == "diagram" else "." for column in columns] for name in heights], columns]
    ratios: dict[str, Any] = {"width_ratios": [11 if column == "diagram" else 1 for column in columns]}
    ratios["height_ratios"] = [*heights.values(), 1.5]
    with style.picture(path, 11, 9.6 if callable(depth) else 8.6, title=title or "Surface elevation") as figure:
        axes = figure.subplot_mosaic(mosaic, **ratios)
        diagram, profile = axes["diagram"], axes["profile"]
        for name in heights:
            axes[name].sharex(diagram)
            axes[name].tick_params(labelbottom=False)
            axes[name].grid(False)
        _draw_diagram(figure, diagram, t, x, eta)
        diagram.set_xlabel(f"distance {origin}, x [m]")
        if gauges is not None:
            style.mark_along(diagram, gauges, top=float(t[-1]))
        if sponge is not None:
            diagram.axvspan(*sponge, fill=False, hatch="//", ec=style.DARK, lw=0, alpha=0.6)
            style.mark_sponge(diagram, (sum(sponge) / 2, 0.03), xycoords=diagram.get_xaxis_transform())
        d = depth(x[0], 0 * x[0]) if callable(depth) else np.full_like(x[0], depth)
        _draw_profile(profile, t, x, eta, float(d.max()))
        if "bed" in axes:
            _draw_bed(axes["bed"], x[0], d)
        for name, end in walls.items():
            axes[name].sharey(diagram)
            _draw_wall(axes[name], diagram, t, x[:, end], name)
        for name in columns[1:]:
            axes[name].tick_params(labelleft=False)
        axes[columns[0]].set_ylabel("time [s]")
        style.lay_out(figure)  # now the size and exaggeration of the panel and the positions of labels are final
        style.remove_overlaps(diagram)
        box, (first, last), (low, high) = profile.get_window_extent(), profile.get_xlim(), profile.get_ylim()
        times = style.CM * (box.height / (high - low)) / (box.width / (last - first))
        profile.set_title(f"vertical exaggeration {float(f'{times:.2g}'):g}", loc="right", fontsize=9, color="#555555")
    return path


def _draw_profile(axes: Axes, t: Array, x: Array, eta: Array, depth: float) -> None:
    """Draw the water with the highest crest, and the surface half a period before and after."""
    crest, top = (int(n) for n in np.unravel_index(np.argmax(eta), eta.shape))
    place, height = float(x[crest, top]), style.CM * float(eta[crest, top])
    largest = style.CM * float(np.abs(eta[crest]).max())
    limits = (max(-1.9 * max(largest, style.FLAT), -style.CM * depth), 1.55 * max(largest, style.FLAT))
    axes.set_facecolor(SKY)
    _fill_water(axes, x[crest], style.CM * eta[crest], limits)
    below = np.flatnonzero(eta[crest:, top] < 0)
    step = max(1, 2 * int(below[0]) - 1) if below.size else 1  # half a period: twice the time in which the crest sinks
    for snapshot, colour, note in (
        (crest - step, BEFORE, ""),
        (crest, CREST, ", the highest crest of the snapshots"),
        (crest + step, AFTER, ""),
    ):
        if 0 <= snapshot < t.size:
            label, width = f"t = {t[snapshot]:.2f} s{note}", 2.2 if note else 1.3
            axes.plot(x[snapshot], style.CM * eta[snapshot], color=colour, lw=width, zorder=width, label=label)
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
    axes.yaxis.label.set_in_layout(False)  # the label is over the empty corner, not between paddle and diagram
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2)


def _fill_water(axes: Axes, x: Array, eta: Array, limits: tuple[float, float]) -> None:
    """Fill the water below eta [cm] with a colour that deepens downwards."""
    outline = axes.fill_between(x, eta, limits[0], color="none")
    extent = (float(x[0]), float(x[-1]), limits[0], float(eta.max()))
    shade = np.linspace(0.0, 1.0, 256)[:, None]
    water = axes.imshow(shade, extent=extent, cmap=style.WATER, origin="lower", aspect="auto", interpolation="bilinear")
    water.set_clip_path(outline.get_paths()[0], axes.transData)


def _draw_bed(axes: Axes, x: Array, depth: Array) -> None:
    """Draw still water over the bed, depth [m] at x [m]."""
    lowest = 1.1 * float(depth.max())
    axes.fill_between(x, 0.0, -depth, color=STILL, lw=0)
    axes.fill_between(x, -depth, -lowest, color=SAND, lw=0)
    axes.set(ylim=(-lowest, 0.0), ylabel="bed [m]")
    axes.yaxis.label.set_in_layout(False)


def _draw_diagram(figure: Figure, axes: Axes, t: Array, x: Array, eta: Array) -> None:
    """Draw the elevation over x and t as colours, with the highest crest marked.

    The elevation is interpolated to about the pixels of the picture, not the colour: the colour between red and blue is
    white, not purple.
    """
    columns, times = np.linspace(x.min(), x.max(), PIXELS[0]), np.linspace(t[0], t[-1], PIXELS[1])
    rows = np.array([np.interp(columns, *snapshot) for snapshot in zip(x, eta, strict=True)])
    largest = max(style.CM * float(np.quantile(np.abs(eta), style.SATURATED)), style.FLAT)
    values: dict[str, Any] = {"vmin": -largest, "vmax": largest, "cmap": "RdBu_r"}
    values["extent"] = (columns[0], columns[-1], t[0], t[-1])
    colours = axes.imshow(style.CM * CubicSpline(t, rows)(times), origin="lower", aspect="auto", **values)
    crest, top = np.unravel_index(np.argmax(eta), eta.shape)
    axes.axhline(t[crest], color=CREST, lw=0.8, ls=(0, (6, 4)))
    axes.plot(x[crest, top], t[crest], "o", ms=9, mfc="none", mec=CREST, mew=1.3)
    axes.set(xlim=(columns[0], columns[-1]), ylim=(t[0], t[-1]))
    axes.grid(False)
    bar: dict[str, Any] = {"orientation": "horizontal", "aspect": 70, "pad": 0.02, "extend": "both"}
    figure.colorbar(colours, ax=axes, extendfrac=0.015, label="elevation [cm]", **bar)


def _draw_wall(axes: Axes, diagram: Axes, t: Array, x: Array, name: str) -> None:
    """Draw the position x [m] of a moving wall in the diagram, and enlarged in a separate panel."""
    far = name != "paddle"
    diagram.plot(x, t, color=style.PADDLE, lw=1.5)
    diagram.fill_betweenx(t, x.max() if far else x.min(), x, color="#dddddd", lw=0)
    displacement = style.CM * (x - x[0] if far else x)
    axes.plot(displacement, t, color=style.PADDLE)
    reach = float(np.abs(displacement).max())
    tick = float(f"{reach:.0e}")  # one digit, since the panel is narrow
    axes.set_xticks([-tick, 0.0, tick], [Formatter.fix_minus(f"{-tick:g}"), "0", f"{tick:g}"])
    axes.set(xlim=(-1.4 * reach, 1.4 * reach), xlabel=f"{name}\n[cm]")


# ---------------------------------------------------------------- gauges
VISIBLE = 0.03  # height of the band of an uncertainty over that of the record
MAGNIFICATIONS = [factor * 10**n for n in range(5) for factor in (1, 2, 5)]
MAX_PANELS = 24  # largest number of gauges in a picture
COLUMN = 8  # largest number of panels in one column
FOCUS = 4.0  # time shown before and after the largest crest [s]


def gauges_overview(gauges: DataArray, path: Path, *, title: str = "", uncertainty: DataArray | None = None) -> Path:
    """Draw the records of gauges to the same scale, ordered by distance from the paddle; return ``path``.

    Their ``uncertainty`` is a band. It is magnified if it is invisible, as the title of the gauge says.

    If there are more than ``MAX_PANELS`` gauges, every second, third ... is drawn. Raises ``InputError`` if there is
    none.
    """
    if not gauges.sizes["gauge"]:
        raise InputError(f"{path}: there is no gauge to draw.")
    shown = gauges.sortby("x")[:: -(-gauges.sizes["gauge"] // MAX_PANELS)]
    columns = 1 if len(shown) <= COLUMN else 2
    rows = -(-len(shown) // columns)
    size = (10 if columns == 1 else 14, 1.2 + 1.25 * rows)
    with style.panels(path, rows, columns, size=size, title=title or "Wave gauges", sharey=True) as axes:
        order = axes.ravel(order="F")
        for gauge, panel in zip(shown, order, strict=False):
            across = f", y = {float(gauge.y):g} m" if gauges.y.any() else ""
            style.draw_series(panel, gauge.time, style.CM * gauge, color=style.COMPUTED)
            name = f"gauge {gauge.gauge.item()}, x = {float(gauge.x):g} m{across}"
            if uncertainty is not None:
                name += _draw_band(panel, gauge, uncertainty.sel(gauge=gauge.gauge), height=float(np.ptp(shown.values)))
            panel.set_title(name, pad=2, parse_math=False)
        for panel in order[len(shown) :]:
            panel.set_axis_off()
        if style.CM * float(np.abs(shown).max()) < style.FLAT:  # lower waves are drawn as still water
            axes[0, 0].set_ylim(-style.FLAT, style.FLAT)
        axes[0, 0].figure.supylabel("elevation [cm]", fontsize=10)
    return path


def _draw_band(panel: Axes, gauge: DataArray, uncertainty: DataArray, *, height: float) -> str:
    """Draw a record plus and minus its uncertainty, magnified to be visible in panels of a height [m].

    Returns a description.
    """
    largest = float(uncertainty.max())
    wanted = VISIBLE * height / max(largest, 1e-300)
    factor = next((one for one in MAGNIFICATIONS if one >= wanted), MAGNIFICATIONS[-1])
    low, high = (style.CM * (gauge + sign * factor * uncertainty) for sign in (-1, 1))
    panel.fill_between(gauge.time.values, low.values, high.values, color=style.COMPUTED, alpha=0.25, lw=0)
    magnified = f", band {factor} times" if factor > 1 else ""
    return f", numerical uncertainty up to {1e3 * largest:.2g} mm (95 %){magnified}"


def gauges_figure(
    measured: DataArray,
    computed: DataArray,
    published: Sequence[DataArray],
    path: Path,
    bands: Mapping[str, DataArray] = MappingProxyType({}),
) -> Path:
    """Draw measured, computed and published records of the same gauges, complete and around each largest crest.

    Panels are labelled with gauge, position and the normalised rms misfit of each computation. ``bands`` are the
    uncertainties U_V [m] over time, by gauge; with them a third panel has the error. Returns ``path``; raises
    ``InputError`` as ``compare`` does.
    """
    pairs = matched(computed, measured)
    computations = [one for records in published for one in records]
    ratios = (2, 1, 1) if bands else (2, 1)
    layout: dict[str, Any] = {"width_ratios": ratios, "sharex": False}
    size = (4.7 * sum(ratios), 1.1 + 1.6 * len(pairs))
    with style.panels(path, len(pairs), len(ratios), size=size, legend="outside upper center", **layout) as axes:
        for (one, reference), (full, zoom, *errors) in zip(pairs, axes, strict=True):
            zoom.sharey(full)
            zoom.tick_params(labelleft=False)
            same_place = [
                other.dropna("time") for other in computations if abs(other.x - reference.x) < GAUGE_TOLERANCE
            ]
            _draw_gauge(full, zoom, reference, [*same_place, one])
            for panel in errors:
                _draw_error(panel, (full, zoom), one, reference, bands[reference.gauge.item()])
        axes[0, 0].figure.supylabel("elevation [cm]", fontsize=10)
    return path


def _draw_error(
    panel: Axes, records: Sequence[Axes], computed: DataArray, measured: DataArray, uncertainty: DataArray
) -> None:
    """Draw U_V [m] as a band around a measured record in its panels, and around 0 with the error in another one."""
    shared, (first, last) = measured.sel(time=uncertainty.time), records[-1].get_xlim()
    part = shared.sel(time=slice(first, last))
    error = part - CubicSpline(computed.time.values, computed.values)(part.time.values)
    panel.plot(part.time, style.CM * error, color=style.INK, lw=1.0, label="measured \N{MINUS SIGN} computed")
    panel.set_title("measured \N{MINUS SIGN} computed", pad=3)
    panel.set_xlim(first, last)
    band: dict[str, Any] = {"color": style.ORANGE, "alpha": 0.35, "lw": 0, "zorder": 0}
    for axes, middle in (*((axes, shared) for axes in records), (panel, 0 * part)):
        low, high = (style.CM * (middle + sign * uncertainty.sel(time=middle.time)).values for sign in (-1, 1))
        axes.fill_between(middle.time.values, low, high, label="\N{PLUS-MINUS SIGN} U_V (95 %)", **band)


def _draw_gauge(full: Axes, zoom: Axes, reference: DataArray, computations: Sequence[DataArray]) -> None:
    """Draw the records of one gauge over the time of the last computation, which is this run's."""
    run = computations[-1]
    shared = reference.sel(time=slice(run.time[0], run.time[-1]))
    misfits = ", ".join(f"{one.source} {compare_gauge(one, shared)['nrms']:.3f}" for one in reversed(computations))
    focus, (first, last) = float(shared.idxmax("time")), shared.time.values[[0, -1]]
    styles = [
        (style.MEASURED, "-", 2.0),
        *[(style.PUBLISHED, "--", 1.1)] * (len(computations) - 1),
        (style.COMPUTED, "-", 1.2),
    ]
    for record, (colour, line, width) in zip([reference, *computations], styles, strict=True):
        part = record.sel(time=slice(first, last))
        for panel, scale in ((full, 0.6), (zoom, 1.0)):
            panel.plot(part.time, style.CM * part, line, color=colour, lw=scale * width, label=record.source)
    name = f"gauge {reference.gauge.item()}, x = {float(reference.x):g} m"
    full.set_title(f"{name};  nrms: {misfits}", pad=3, parse_math=False)
    full.set_xlim(first, last)
    zoom.set_title(f"around its largest crest, t = {focus:.2f} s", pad=3)
    zoom.set_xlim(max(focus - FOCUS, first), min(focus + FOCUS, last))


# ---------------------------------------------------------------- energy
KINETIC, POTENTIAL, TOTAL, WORK = style.VERMILION, style.GREEN, "#8cc5e8", style.INK
MIN_DISSIPATION = 1e-3  # least dissipation that is drawn, over the largest energy


def energy_figure(energy: Dataset, path: Path, *, title: str = "") -> Path:
    """Draw the energy budget and, on a separate axis, the error of the energy balance; return ``path``.

    The error is relative to the largest sum of energy, dissipation and absorption. ``energy`` is
    ``RunDirectory.energy``; raises ``InputError`` if a quantity is missing or has no value.
    """
    needed = ("kinetic", "potential", "total", "paddle_work", "balance")
    if missing := [name for name in needed if name not in energy or not energy.time.size]:
        raise InputError(f"{path}: the energy budget has no values of {', '.join(missing)}.")
    t, total, work = energy.time, energy.total, energy.paddle_work
    dissipated, absorbed = (energy.get(name, 0 * total) for name in ("dissipated", "absorbed"))
    supplied, largest = total[0] + work, float(np.abs(total + dissipated + np.maximum(absorbed, 0.0)).max())
    unit = "[m⁵/s²]" if "m^5" in total.units else "and width [m⁴/s²]"
    title = style.titled(title, "energy budget")
    with style.panels(path, 2, size=(10, 6.5), title=title, height_ratios=(2, 1)) as axes:
        budget, error = axes[:, 0]
        budget.plot(t, total, color=TOTAL, lw=4, label="total")
        budget.plot(t, supplied, "--", color=WORK, label="start + paddle work" if work.any() else "start")
        if dissipated[-1] > MIN_DISSIPATION * np.abs(total).max():
            budget.plot(t, supplied - dissipated, ":", color=WORK, label="the same \N{MINUS SIGN} dissipated")
        if "absorbed" in energy:
            budget.plot(t, absorbed, "-.", color=WORK, label="paddle absorption")
        budget.plot(t, energy.kinetic, color=KINETIC, label="kinetic")
        budget.plot(t, energy.potential, color=POTENTIAL, label="potential")
        budget.set_ylabel(f"energy per density\n{unit}")
        error.plot(t, energy.balance / max(largest, np.finfo(float).tiny), color=style.COMPUTED)
        error.ticklabel_format(axis="y", scilimits=(-2, 2), useMathText=True)
        error.set(ylabel="energy error over\nlargest energy [-]", xlim=(t[0], t[-1]))
        budget.figure.align_ylabels()
    return path


# ---------------------------------------------------------------- breakdown
LABELS = {"elevation": "elevation [cm]", "slope": "slope [-]", "velocity": "velocity u [m/s]"}
ENLARGED, AROUND = 20.0, 0.1  # half width of an enlargement: largest number of wave heights, and part of the tank
PANEL = 3e4  # points² that cells of a basin fill


def broken_figure(run: RunDirectory) -> Path:
    """Draw the last surface of a run that broke down, ``broken.png``; return its path.

    The complete surface and an enlargement around its steepest point, in plan view for a basin; for a slice with u/c at
    the steep crests. Raises ``InputError`` without a record.
    """
    surface, breakdown = run.broken(), run.manifest["broke_down"]
    path, steepest, basin = run.path / BROKEN_PICTURE, breakdown["steepest"], "y" in surface
    extent = max(float(np.ptp(surface[axis].values)) for axis in ("x", "y") if axis in surface)
    half = AROUND * extent if basin else min(ENLARGED * float(np.ptp(surface.elevation.values)), AROUND * extent)
    inside = np.abs(surface.x - steepest["x"]) <= half
    if basin:
        inside &= np.abs(surface.y - steepest["y"]) <= half
    surface["elevation"] = style.CM * surface.elevation
    parts = surface, surface.where(inside, drop=True)
    where = f"x = {steepest['x']:.4g} m" + (f", y = {steepest['y']:.4g} m" if basin else "")
    title = (
        f"{f'{run.title}: ' if run.title else ''}t = {breakdown['t']:.5g} s, from where the run could not go on\n"
        f"steepest at {where}: slope {steepest['slope']:.2g}, u = {steepest['velocity']:.3g} m/s"
    )
    layout: dict[str, Any] = {"sharex": "col", "width_ratios": (1, 1) if basin else (2, 1)}
    with style.panels(path, 3, 2, size=(11, 8.5), title=title, xlabel="x [m]", **layout) as axes:
        for row, (name, label) in zip(axes, LABELS.items(), strict=True):
            row[0].set_ylabel("y [m]" if basin else label)
            for panel, part, marker in zip(row, parts, ("", "."), strict=True):
                if basin:
                    limits = {"vmin": float(surface[name].min()), "vmax": float(surface[name].max())}
                    marks = {"s": PANEL / part.sizes["point"], "marker": "s", "cmap": "viridis", "lw": 0, **limits}
                    colours = panel.scatter(part.x, part.y, c=part[name], **marks)
                    panel.plot(steepest["x"], steepest["y"], "o", ms=12, mfc="none", mec=style.VERMILION)
                    panel.set_aspect("equal", adjustable="datalim")
                    panel.grid(False)
                else:
                    panel.plot(part.x, part[name], color=style.COMPUTED, lw=1.2, marker=marker, ms=3)
                    panel.axvline(steepest["x"], color=style.VERMILION, lw=0.8)
                    panel.margins(x=0)
            if basin:
                row[0].figure.colorbar(colours, ax=list(row), label=label)
        axes[0, 0].set_title("in full", fontsize=10)
        axes[0, 1].set_title("around the steepest place", fontsize=10, color=style.VERMILION)
        for crest in () if basin else breakdown["crests"]:
            for panel in axes[0]:
                panel.axvline(crest["x"], color=style.ORANGE, lw=0.8, ls="--")
            text, at = f"u/c = {crest['speed_ratio']:.2f}", ("data", "axes fraction")
            text_style = {"color": style.ORANGE, "fontsize": 8, "rotation": 90, "va": "top"}
            axes[0, 0].annotate(text, (crest["x"], 0.97), xycoords=at, **text_style)
    return path


# ---------------------------------------------------------------- loads and probes
COLOURS = {"x": style.BLUE, "y": style.GREEN, "z": style.VERMILION}
MAX_PROBES = 8  # largest number of probes; of more, every second, third ... is drawn
KILO = 1e3  # Pa, N, N m


def probes_figure(run: RunDirectory, path: Path) -> Path:
    """Draw the probes of a run, with gaps while they are dry; return ``path``. Raises ``InputError`` without probes."""
    probes = run.probes
    shown = probes.isel(probe=slice(None, None, -(-probes.sizes["probe"] // MAX_PROBES)))
    rows, tank = shown.sizes["probe"], run.manifest.get("case", {}).get("tank", {})
    weight = tank.get("density", 1000.0) * tank.get("gravity", 9.81)
    pressure = shown.pressure - weight * np.maximum(0.0, -shown.z)
    scale, kilo = _scale(pressure)
    titles = ("velocity [m/s]", "acceleration [m/s²]", f"pressure beyond still water's [{kilo}Pa]")
    size, title = (13, 1.1 + 1.6 * rows), style.titled(run.title, "probes")
    with style.panels(path, rows, 3, size=size, title=title, legend="outside upper right", sharey="col") as axes:
        for n, row in enumerate(axes):
            probe = shown.isel(probe=n)
            place = ", ".join(f"{axis} = {float(probe[axis]):g} m" for axis in "xyz" if axis != "y" or float(probe.y))
            row[0].set_title(f"probe {probe.probe.item()}, {place}", pad=2, parse_math=False)
            _draw_vector(row[0], probe, "velocity")
            _draw_vector(row[1], probe, "acceleration")
            style.draw_series(row[2], probe.time, pressure.isel(probe=n) / scale, color=style.BLUE)
        for panel, text in zip(axes[0], titles, strict=True):
            panel.set_title(text, loc="right", pad=2)
    return path


def loads_figure(run: RunDirectory, path: Path) -> Path:
    """Draw the changes of forces and moments on the walls of a run since its start; return ``path``.

    Raises ``InputError`` without loads.
    """
    loads = run.loads
    rows, beyond = loads.sizes["wall"], loads - loads.isel(time=0)
    scale, kilo = _scale(beyond[["force_x", "moment_y"]].to_array())
    units = {"force": loads.force_x.units, "moment": loads.moment_y.units}
    size, title = (11, 1.1 + 1.9 * rows), style.titled(run.title, "loads")
    with style.panels(path, rows, 2, size=size, title=title, legend="outside upper right") as axes:
        for n, row in enumerate(axes):
            for panel, name in zip(row, units, strict=True):
                _draw_vector(panel, beyond.isel(wall=n) / scale, name)
            row[0].set_title(str(loads.wall[n].item()), pad=2, parse_math=False)
        for panel, (name, unit) in zip(axes[0], units.items(), strict=True):
            panel.set_title(f"{name} beyond that at the start [{kilo}{unit}]", loc="right", pad=2)
    return path


def _scale(values: DataArray) -> tuple[float, str]:
    """Return the divisor of plotted values, and the prefix of their unit."""
    return (KILO, "k") if float(np.abs(values).max()) > KILO else (1.0, "")


def _draw_vector(panel: Axes, data: Dataset, name: str) -> None:
    """Draw the components of a vector that exist and are not all 0."""
    for axis, colour in COLOURS.items():
        if f"{name}_{axis}" in data and (values := data[f"{name}_{axis}"]).any():
            label = f"about {axis}" if name == "moment" else f"along {axis}"
            style.draw_series(panel, data.time, values, label=label, color=colour)


# ---------------------------------------------------------------- all figures of a run
def draw_run(run: RunDirectory) -> list[Path]:
    """Draw the standard pictures of a run into its directory; return their paths.

    Pictures without records, as in a run that was killed early, are omitted, as are the maps of a basin if pyvista,
    which reads its surface, is not installed. Raises ``InputError`` for missing files.
    """
    gauges, energy = run.gauges, run.energy
    pictures = [broken_figure(run)] if (run.path / BROKEN).exists() else []
    if _snapshots(run) > 1:
        pictures.append(draw_surface(run))
    if gauges.sizes["gauge"] and gauges.time.size > 1:
        band = run.certificate.elevation_uncertainty if (run.path / CERTIFICATE).exists() else None
        pictures.append(gauges_overview(gauges, run.path / "gauges.png", title=run.title, uncertainty=band))
    for file, draw in ((PROBES, probes_figure), (LOADS, loads_figure)):
        if (run.path / file).exists() and getattr(run, Path(file).stem).sizes["time"] > 1:
            pictures.append(draw(run, run.path / Path(file).with_suffix(".png").name))
    if energy.time.size > 1:
        pictures.append(energy_figure(energy, run.path / Path(ENERGY).with_suffix(".png"), title=run.title))
    return pictures


def _snapshots(run: RunDirectory) -> int:
    """Return the number of snapshots of the surface that can be drawn."""
    if (run.path / SURFACE).exists():
        return int(run.snapshots().time.size)
    return len(run.fields("surface")) if index_file(run.path, "surface").exists() and find_spec("pyvista") else 0


X_ORIGIN = "from the paddle's rest position"
ORIGINS = {"ring": "along the ring", "fixed": "from the wall"}  # of others ``X_ORIGIN``


def draw_surface(run: RunDirectory) -> Path:
    """Draw the surface of a run, ``surface.png``: maps for a basin, else a diagram over x and t.

    Returns the path of the picture; raises ``InputError`` for fewer than two snapshots.
    """
    case, path = run.manifest.get("case", {}), run.path / "surface.png"
    tank, wall = case.get("tank", {}), case.get("wall", {})
    if not (run.path / SURFACE).exists():
        from wavetank.plots.basin import basin_figure

        return basin_figure(run, path)
    ring, surface = tank.get("type") == "ring", run.snapshots()
    if surface.time.size < 2:
        number = surface.time.size
        raise InputError(f"{path}: {number} snapshots of the surface received; at least 2 are needed to draw.")
    shown = closed(surface, tank["length"]) if ring else surface
    return surface_figure(
        shown,
        path,
        title=run.title,
        depth=still_water(run) or tank.get("depth", np.inf),
        origin=ORIGINS.get("ring" if ring else wall.get("type"), X_ORIGIN),
        gauges=run.gauges if (run.path / GAUGES).exists() else None,
        sponge=_sponge(case, shown.x.values[0]),
    )


def _sponge(case: dict[str, Any], x: Array) -> tuple[float, float] | None:
    """Return the range x [m] of the sponge of a slice, given the points x [m] of the surface; None without a sponge."""
    if (rate := sponge_rate(case, x)) is None:
        return None
    inside = x[rate > style.DAMPED * rate.max(initial=0.0)]
    return (float(inside.min()), float(inside.max())) if inside.size else None
