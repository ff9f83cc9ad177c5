"""Figures of comparisons: harmonics at gauges, and wave heights along sections."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from wavetank.analysis.compare import (
    ComputedHeights,
    HarmonicComparison,
    SectionComparison,
    SectionProfile,
    line,
)
from wavetank.analysis.still_water import still_water
from wavetank.data import HeightSeries
from wavetank.output.directory import RunDirectory
from wavetank.plots.style import BLUE, COMPUTED, GREEN, VERMILION, picture


# ---------------------------------------------------------------- harmonics
def harmonics_figure(path: Path, found: Sequence[HarmonicComparison]) -> None:
    """Draw the amplitudes along the tank, or gauge by gauge where not all places are known."""
    places = {one.gauge: one.x for one in found}
    known = bool(np.isfinite([*places.values()]).all())
    at = places if known else {gauge: float(n) for n, gauge in enumerate(places)}
    with picture(path, 9, 4.6) as figure:
        axes = figure.add_subplot()
        for harmonic, colour in enumerate((BLUE, VERMILION, GREEN), start=1):
            ones = sorted((one for one in found if one.harmonic == harmonic), key=lambda one: at[one.gauge])
            x = [at[one.gauge] for one in ones]
            theirs, ours = [1e3 * one.reference for one in ones], [1e3 * one.computed for one in ones]
            axes.plot(x, theirs, "o", ms=8, mfc="none", color=colour, label=f"reference, harmonic {harmonic}")
            axes.plot(x, ours, ".-", color=colour, label=f"computed, harmonic {harmonic}")
        axes.set(xlabel="x [m]" if known else "gauge", ylabel="amplitude [mm]", ylim=(0, None))
        if not known:
            axes.set_xticks([*at.values()], [*at])
        figure.legend(ncols=3, loc="outside lower center")


# ---------------------------------------------------------------- wave heights along sections
MARKS = (("o", "#222222"), ("^", "#d55e00"), ("s", "#009e73"))  # one an origin of measurements
ROW = 3  # panels
HEADROOM = 1.06
CONTOURS = 14
POINTS = 241  # of a bed, in each direction


class Bathymetry(NamedTuple):
    """A bed to draw: x [m] of shape (N,), y [m] of shape (M,), still-water depth [m] of shape (M, N)."""

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    depth: NDArray[np.float64]


def bathymetry(run: RunDirectory) -> Bathymetry | None:
    """Return the bed between the outermost gauges of a run; None where it is flat.

    Raises ``InputError`` if the bed is in a file that cannot be had or used.
    """
    depth = still_water(run)
    if depth is None:
        return None
    places = np.array([(gauge.x, gauge.y) for gauge in run.gauge_series()])
    x, y = np.linspace(places.min(axis=0), places.max(axis=0), POINTS, dtype=np.float64).T
    grid = [axis.ravel() for axis in np.meshgrid(x, y)]
    return Bathymetry(x, y, depth(*grid).reshape(POINTS, POINTS))


def sections_figure(
    computed: ComputedHeights,
    measured: Sequence[HeightSeries],
    comparisons: Sequence[SectionComparison],
    path: Path,
    *,
    incident: float,
    bed: Bathymetry | None = None,
    title: str = "",
) -> Path:
    """Draw H / H0 along each section, and the sections over the bed, if one is given; return ``path``.

    The panels' titles tell the misfits, of ``compare_heights``; ``incident`` is H0 [m].
    """
    panels = len(computed.profiles) + (bed is not None)
    rows, columns = -(-panels // ROW), min(ROW, panels)
    with picture(path, 1 + 4.3 * columns, 1.0 + 2.9 * rows) as figure:
        grid = figure.add_gridspec(rows, columns)
        places = [grid[divmod(n, columns)] for n in range(panels)]
        highest = HEADROOM * max(_highest(computed, incident), *(series.ratios.max() for series in measured))
        for place, profile in zip(places, computed.profiles, strict=False):
            axes = figure.add_subplot(place)
            _draw_section(axes, profile, measured, comparisons, incident=incident)
            axes.set_ylim(0.0, highest)
        figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=11)
        if bed is not None:
            _draw_layout(figure, figure.add_subplot(places[-1]), computed, bed)
        figure.suptitle(title or "Wave heights", fontsize=13, parse_math=False)
    return path


def _highest(computed: ComputedHeights, incident: float) -> float:
    return max(float(profile.heights.max()) for profile in computed.profiles) / incident


def _draw_section(
    axes: Axes,
    profile: SectionProfile,
    measured: Sequence[HeightSeries],
    comparisons: Sequence[SectionComparison],
    *,
    incident: float,
) -> None:
    section = profile.section
    fine = np.linspace(profile.places[0], profile.places[-1], 8 * profile.places.size)
    axes.axhline(1.0, color="#888888", lw=0.6, zorder=0)
    axes.plot(fine, profile.at(fine) / incident, color=COMPUTED, lw=1.6, label="computed")
    for source, (mark, colour) in zip(dict.fromkeys(series.source for series in measured), MARKS, strict=False):
        theirs = [one for one in measured if one.source == source and one.section.name == section.name]
        points = np.array([[one.places, one.ratios] for one in theirs]).reshape(2, -1)  # also none: for the legend
        axes.plot(*points, mark, ms=4, mfc="none", mec=colour, mew=1.0, label=source)
    nrms = " / ".join(f"{one.nrms:.3f}" for one in comparisons if one.section == section.name)
    axes.set_title(f"section {section.name}, {line(section)};  nrms {nrms}", pad=4)
    axes.set(xlabel=f"{section.along} [m]", ylabel="wave height $H/H_0$ [-]", xlim=section.reach)


def _draw_layout(figure: Figure, axes: Axes, computed: ComputedHeights, bed: Bathymetry) -> None:
    """Draw the bed's contours and the sections on it."""
    filled = axes.contourf(bed.x, bed.y, bed.depth, CONTOURS, cmap="Blues")
    axes.contour(bed.x, bed.y, bed.depth, filled.levels, colors="#0b2d5c", linewidths=0.4)
    figure.colorbar(filled, ax=axes, shrink=0.7, label="still-water depth d [m]")
    for section in (profile.section for profile in computed.profiles):
        ends = {section.along: section.reach, section.across: (section.at, section.at)}
        axes.plot(ends["x"], ends["y"], color="#d55e00", lw=1.0)
        last = (ends["x"][1], ends["y"][1])
        axes.annotate(
            section.name, last, xytext=(-2, -2), textcoords="offset points", va="top", ha="right", color="#a03c00"
        )
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="bed and sections; waves from the left")
    axes.grid(False)
