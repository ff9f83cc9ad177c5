"""The picture of an ensemble: every run, the mean with its confidence, and quantiles, over a key or over the seeds."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from wavetank.plots.style import BLUE, PALE_GREY, VERMILION, entry, picture
from wavetank.studies.ensemble import Ensemble
from wavetank.studies.look import OPEN, legend_below, remarks
from wavetank.studies.response_drawing import TICKS, label_of, numeric, panels_of, places_of
from wavetank.studies.sweep import Axis
from wavetank.studies.table import Row

RUN, MEAN, QUANTILE = PALE_GREY, BLUE, VERMILION


def draw_ensembles(
    rows: Sequence[Row], found: Sequence[Ensemble], axes: Sequence[Axis], path: Path, *, title: str = ""
) -> Path:
    """Draw each response over the first key that is no seed, or over the runs, and return ``path``.

    Of more such keys each further setting is a point beside the others.
    """
    along = next((axis for axis in axes if not axis.seeds and axis.physical), None)
    label = label_of(rows, along) if along else "run [-]"
    names = list(dict.fromkeys(one.response for one in found))
    with picture(path, *panels_of(names)[1]) as figure:
        panels = figure.subplots(*panels_of(names)[0], squeeze=False).flat
        for name, panel in zip(names, panels, strict=False):
            some = [one for one in found if one.response == name]
            if along:
                _draw_over(panel, some, along)
            else:
                _draw_runs(panel, some[0])
            panel.set(xlabel=label, ylabel=name)
        for empty in list(panels):
            empty.set_axis_off()
        handles = [
            entry("a run", color=RUN, marker=".", ls=""),
            entry("mean, with its 95 % confidence", color=MEAN, marker="o"),
            entry("5, 50 and 95 % quantiles", color=QUANTILE, ls="--"),
            *remarks(rows),
        ]
        legend_below(figure, handles)
        figure.suptitle(title, fontsize=12, parse_math=False)
    return path


def _draw_over(panel: Axes, found: Sequence[Ensemble], along: Axis) -> None:
    places = places_of(along)
    ordered = sorted(found, key=lambda one: places[one.settings[along.name]])
    x = np.array([places[one.settings[along.name]] for one in ordered])
    for at, one in zip(x, ordered, strict=True):
        _draw_values(panel, np.full(one.values.size, at), one)
    sure = np.nan_to_num([one.sure for one in ordered])
    panel.errorbar(x, [one.mean for one in ordered], sure, color=MEAN, marker="o", ms=5, capsize=4, ls="", zorder=3)
    for quantile in np.array([one.quantiles for one in ordered]).T:
        panel.plot(x, quantile, "--", marker="_", color=QUANTILE, lw=0.8, zorder=2)
    if numeric(along):
        panel.locator_params(axis="x", nbins=TICKS)
    else:
        panel.set_xticks(range(len(along.values)), along.values)


def _draw_values(panel: Axes, x: NDArray[Any], one: Ensemble) -> None:
    """Draw the runs' values at x of shape (runs,), those that have warnings as open circles."""
    some = list(one.warned)
    panel.plot(np.delete(x, some), np.delete(one.values, some), ".", color=RUN, zorder=1)
    panel.plot(x[some], one.values[some], "o", color=RUN, ms=4, zorder=1, **OPEN)


def _draw_runs(panel: Axes, one: Ensemble) -> None:
    runs = 1 + np.arange(one.values.size)
    _draw_values(panel, runs, one)
    panel.axhline(one.mean, color=MEAN)
    if np.isfinite(one.sure):
        panel.axhspan(one.mean - one.sure, one.mean + one.sure, color=MEAN, alpha=0.15, lw=0)
    for quantile in one.quantiles:
        panel.axhline(quantile, color=QUANTILE, ls="--", lw=0.8)
