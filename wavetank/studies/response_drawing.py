"""The picture of a study over what is modelled: what the water does, over that key.

Errors of different waves have no common front, so none is drawn.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from wavetank.plots.style import GREY, number_logarithms, picture
from wavetank.studies.look import CROSS, Look, legend_below, remarks
from wavetank.studies.measures import CREST as CREST_ERROR
from wavetank.studies.responses import CREST_TIME, responded
from wavetank.studies.sweep import Axis, unit
from wavetank.studies.table import Row, measured

TICKS = 5  # numbers at an axis, at most about so many
WIDEST = 3  # panels side by side
MAPPED = 3  # values, at least, of each of two keys that make a map
WRITTEN = 64  # cells of a map, at most, in which its numbers are written


def draw_responses(rows: Sequence[Row], axes: Sequence[Axis], path: Path, *, title: str = "") -> Path:
    """Draw each response but the crest's time over the first physical axis, a panel each, and return ``path``.

    Over two axes of numbers, three of each at least, they are maps. Where numerics are swept beside it errors are
    drawn, too; the other axes are colours and markers. Values that are no numbers stand side by side; where a run has
    not finished there is a cross on the axis. Raises ``StopIteration`` if no axis is physical.
    """
    names = [name for name in responded(row.responses for row in rows) if name != CREST_TIME]
    if len(axes) == 2 and all(axis.physical and numeric(axis) and len(axis.values) >= MAPPED for axis in axes):
        return _draw_maps(rows, axes, names, path, title=title)
    along = next(axis for axis in axes if axis.physical)
    look, numerics = Look(axes, along), any(not axis.physical for axis in axes)
    names += [name for name in measured(rows) if numerics and name != CREST_ERROR]
    (down, across), size = panels_of(names)
    with picture(path, *size) as figure:
        panels = figure.subplots(down, across, squeeze=False).flat
        for name, panel in zip(names, panels, strict=False):
            _draw_panel(panel, rows, name, along, look)
            panel.set(xlabel=label_of(rows, along), ylabel=name)
        for empty in list(panels):
            empty.set_axis_off()
        legend_below(figure, [*look.legend(rows), *remarks(rows, **CROSS)])
        figure.suptitle(title, fontsize=12, parse_math=False)
    return path


def panels_of(names: Sequence[str]) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return how many panels go down and across for some responses, and the picture's width and height [inch]."""
    across, down = min(len(names), WIDEST), -(-len(names) // WIDEST)
    return (down, across), (1.0 + 4.2 * across, 0.8 + 3.8 * down)


def label_of(rows: Sequence[Row], axis: Axis) -> str:
    """Return a key with the unit of its numbers, as a run that tells something has it."""
    scene = next(row.scene for row in rows if row.found)
    return f"{axis.name} [{unit(scene, axis.key) or '-'}]" if numeric(axis) else axis.name


def _draw_maps(rows: Sequence[Row], axes: Sequence[Axis], names: Sequence[str], path: Path, *, title: str) -> Path:
    """Draw each response as a map over two axes of numbers, a cross where a run has not finished.

    In those of runs that have warnings stands a white mark, with the number where numbers are written.
    """
    across, up = ([float(value) for value in sorted(axis.values, key=float)] for axis in axes)
    (down, wide), size = panels_of(names)
    with picture(path, *size) as figure:
        panels = figure.subplots(down, wide, squeeze=False).flat
        for name, panel in zip(names, panels, strict=False):
            values = np.full((len(up), len(across)), np.nan)
            doubtful = np.zeros(values.shape, dtype=bool)
            for row in rows:
                x, y = (float(row.combination.values.get(axis.name, "nan")) for axis in axes)
                if x not in across or y not in up:
                    continue
                if name in row.responses:
                    at = up.index(y), across.index(x)
                    values[at], doubtful[at] = row.responses[name], bool(row.warnings)
                elif row.outcome.status != "finished":
                    panel.plot(x, y, **CROSS)
            cells = panel.pcolormesh(across, up, values, shading="nearest", cmap="viridis")
            figure.colorbar(cells, ax=panel).set_label(name)
            panel.grid(False)
            _write(panel, across, up, values, doubtful)
            panel.set(xlabel=label_of(rows, axes[0]), ylabel=label_of(rows, axes[1]), xticks=across, yticks=up)
        for empty in list(panels):
            empty.set_axis_off()
        legend_below(figure, remarks(rows, **CROSS))
        figure.suptitle(title, fontsize=12, parse_math=False)
    return path


def _write(
    panel: Axes, across: Sequence[float], up: Sequence[float], values: NDArray[np.float64], doubtful: NDArray[np.bool_]
) -> None:
    """Write the numbers into the cells of a map of few, dark on bright ones, and on white marks where doubtful."""
    bright = np.nanmin(values) + 0.6 * np.ptp(values[np.isfinite(values)])
    few = values.size <= WRITTEN
    for (n, m), value in np.ndenumerate(values):
        if np.isfinite(value) and (few or doubtful[n, m]):
            colour = "black" if value > bright or doubtful[n, m] else "white"
            mark = {"boxstyle": "round", "fc": "white", "ec": GREY} if doubtful[n, m] else None
            text = f"{value:.3g}" if few else " "
            panel.text(across[m], up[n], text, ha="center", va="center", fontsize=8, color=colour, bbox=mark)


def _draw_panel(panel: Axes, rows: Sequence[Row], name: str, along: Axis, look: Look) -> None:
    """Draw a response, or an error on a logarithmic axis, a line for each of the other settings."""
    places = places_of(along)
    rows = [row for row in rows if row.combination.values.get(along.name) in places]
    shown = [row for row in rows if _value(row, name) is not None]
    look.draw(panel, shown, lambda row: (places[row.combination.values[along.name]], _value(row, name) or 0.0))
    for row in rows:
        if row.outcome.status != "finished":
            place, on_axis = places[row.combination.values[along.name]], panel.get_xaxis_transform()
            panel.plot(place, 0.0, **CROSS, transform=on_axis, clip_on=False)
    if name in measured(rows):
        panel.set_yscale("log")
        number_logarithms(panel.yaxis)
    if numeric(along):
        panel.locator_params(axis="x", nbins=TICKS)
    else:
        panel.set_xticks(range(len(along.values)), along.values)


def _value(row: Row, name: str) -> float | None:
    """Return a response, or the size of an error."""
    error = row.errors.get(name)
    return row.responses.get(name) if error is None else abs(error)


def numeric(axis: Axis) -> bool:
    """Return whether all values of an axis are finite numbers."""
    try:
        return bool(np.isfinite([float(value) for value in axis.values]).all())
    except ValueError:
        return False


def places_of(axis: Axis) -> dict[str, float]:
    """Return where each value stands: at itself, or, if they are no numbers, side by side."""
    numbers = numeric(axis)
    return {value: float(value) if numbers else float(n) for n, value in enumerate(axis.values)}
