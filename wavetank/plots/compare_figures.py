"""Figures of comparisons: harmonics at gauges, and wave heights along sections."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from pandas import DataFrame
from xarray import DataArray, Dataset

from wavetank.analysis.compare import ComputedHeights, interpolated, line
from wavetank.analysis.still_water import still_water
from wavetank.data import HeightSeries, Section
from wavetank.output.directory import RunDirectory
from wavetank.plots.style import BLUE, COMPUTED, GREEN, VERMILION, common_legend, panels, picture


# ---------------------------------------------------------------- harmonics
def harmonics_figure(path: Path, compared: Dataset) -> None:
    """Draw the amplitudes along the tank, or by gauge if positions are missing."""
    placed = bool(np.isfinite(compared.x).all())
    ordered = compared.sortby("x") if placed else compared
    x = ordered.x.values if placed else np.arange(ordered.gauge.size)
    with panels(path, size=(9, 4.6), xlabel="x [m]" if placed else "gauge") as ((axes,),):
        for n, colour in zip(ordered.harmonic.values, (BLUE, VERMILION, GREEN), strict=True):
            one = 1e3 * ordered.sel(harmonic=n)
            axes.plot(x, one.reference, "o", ms=8, mfc="none", color=colour, label=f"reference, harmonic {n}")
            axes.plot(x, one.computed, ".-", color=colour, label=f"computed, harmonic {n}")
        axes.set(ylabel="amplitude [mm]", ylim=(0, None))
        if not placed:
            axes.set_xticks(x, ordered.gauge.values)


def amplitudes_figure(path: Path, rows: DataFrame) -> None:
    """Draw measured and computed amplitudes, relative to the measured ones, by name."""
    with panels(path, size=(9, 1.4 + 0.3 * len(rows)), xlabel="amplitude over the measured one") as ((axes,),):
        y = np.arange(len(rows))
        axes.plot(np.ones(len(rows)), y, "o", ms=8, mfc="none", color=BLUE, label="measured")
        axes.plot(rows.computed / rows.measured, y, "o", color=VERMILION, label="computed")
        axes.set(ylim=(len(rows) - 0.5, -0.5))
        axes.set_xlim(0, max(1.5, *axes.get_xlim()))
        axes.set_yticks(y, [f"{row.gauge}: {row.measured:.3g}" for _, row in rows.iterrows()])


# ---------------------------------------------------------------- wave heights along sections
MARKS = (("o", "#222222"), ("^", "#d55e00"), ("s", "#009e73"))  # one for each origin of measurements
ROW = 3  # panels
HEADROOM = 1.06
CONTOURS = 14
POINTS = 241  # number of points of a bed in each direction


def bathymetry(run: RunDirectory, gauges: DataArray) -> DataArray | None:
    """Return the still-water depth [m] over y and x [m] between the outermost gauges of a run; None for a flat bed.

    Raises ``InputError`` if the file of the bed cannot be read.
    """
    depth = still_water(run)
    if depth is None:
        return None
    x, y = (np.linspace(float(at.min()), float(at.max()), POINTS, dtype=np.float64) for at in (gauges.x, gauges.y))
    grid = [axis.ravel() for axis in np.meshgrid(x, y)]
    return DataArray(depth(*grid).reshape(POINTS, POINTS), {"y": y, "x": x}, ("y", "x"))


def sections_figure(
    computed: ComputedHeights,
    measured: Sequence[HeightSeries],
    compared: Sequence[Mapping[str, Any]],
    path: Path,
    *,
    incident: float,
    bed: DataArray | None = None,
    title: str = "",
) -> Path:
    """Draw H / H0 along each section, and the sections over the bed, if one is given; return ``path``.

    The titles of panels contain the misfits of the rows ``compared``; ``incident`` is H0 [m].
    """
    panels = len(computed.profiles) + (bed is not None)
    rows, columns = -(-panels // ROW), min(ROW, panels)
    highest = max(float(heights.max()) / incident for _, heights in computed.profiles)
    highest = HEADROOM * max(highest, *(series.ratios.max() for series in measured))
    with picture(path, 1 + 4.3 * columns, 1.0 + 2.9 * rows, title=title or "Wave heights") as figure:
        grid = figure.add_gridspec(rows, columns)
        for n, (section, heights) in enumerate(computed.profiles):
            axes = figure.add_subplot(grid[divmod(n, columns)], ylim=(0.0, highest))
            _draw_section(axes, section, heights / incident, measured)
            nrms = " / ".join(f"{row['nrms']:.3f}" for row in compared if row["section"] == section.name)
            axes.set_title(f"section {section.name}, {line(section)};  nrms {nrms}", pad=4)
        common_legend(figure)
        if bed is not None:
            _draw_layout(figure, figure.add_subplot(grid[divmod(panels - 1, columns)]), computed, bed)
    return path


def _draw_section(axes: Axes, section: Section, computed: DataArray, measured: Sequence[HeightSeries]) -> None:
    """Draw computed and measured H / H0 along a section."""
    first, last = computed.place.values[[0, -1]]
    fine = np.linspace(first, last, 8 * computed.size)
    axes.axhline(1.0, color="#888888", lw=0.6, zorder=0)
    axes.plot(fine, interpolated(computed, fine), color=COMPUTED, lw=1.6, label="computed")
    for source, (mark, colour) in zip(dict.fromkeys(series.source for series in measured), MARKS, strict=False):
        for one in measured:
            if one.source == source and one.section.name == section.name:
                axes.plot(one.places, one.ratios, mark, ms=4, mfc="none", mec=colour, mew=1.0, label=source)
    axes.set(xlabel=f"{section.along} [m]", ylabel="wave height $H/H_0$ [-]", xlim=section.reach)


def _draw_layout(figure: Figure, axes: Axes, computed: ComputedHeights, bed: DataArray) -> None:
    """Draw the contours of the bed and the sections on it."""
    filled = axes.contourf(bed.x, bed.y, bed, CONTOURS, cmap="Blues")
    axes.contour(bed.x, bed.y, bed, filled.levels, colors="#0b2d5c", linewidths=0.4)
    figure.colorbar(filled, ax=axes, shrink=0.7, label="still-water depth d [m]")
    for section, _ in computed.profiles:
        ends = {section.along: section.reach, section.across: (section.at, section.at)}
        axes.plot(ends["x"], ends["y"], color="#d55e00", lw=1.0)
        last = (ends["x"][1], ends["y"][1])
        axes.annotate(
            section.name, last, xytext=(-2, -2), textcoords="offset points", va="top", ha="right", color="#a03c00"
        )
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="bed and sections; waves from the left")
    axes.grid(False)
