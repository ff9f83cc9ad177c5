"""The picture of a study over what is modelled: what the water does, over that key.

Errors of different waves have no common front, so none is drawn.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from wavetank.postprocess.style import number_logarithms, picture
from wavetank.study.look import EDGE, MARK, Look
from wavetank.study.measures import CREST as CREST_ERROR
from wavetank.study.responses import CREST, CREST_PLACE, TROUGH
from wavetank.study.sweep import Axis, unit
from wavetank.study.table import Row, measured

DRAWN = (CREST, TROUGH, CREST_PLACE)
WIDEST = 3  # panels side by side


def draw_responses(rows: Sequence[Row], axes: Sequence[Axis], path: Path, *, title: str = "") -> Path:
    """Draw crest, trough and the crest's place over the first physical axis, a panel each, and return ``path``.

    Where numerics are swept beside it errors are drawn, too; the other axes are colours and markers. Values that are no
    numbers stand side by side. Raises ``StopIteration`` if no axis is physical.
    """
    along = next(axis for axis in axes if axis.physical)
    look, numerics = Look(axes, along), any(not axis.physical for axis in axes)
    names = [*DRAWN, *(name for name in measured(rows) if numerics and name != CREST_ERROR)]
    down = -(-len(names) // WIDEST)
    with picture(path, 1.0 + 4.2 * min(len(names), WIDEST), 0.8 + 3.8 * down) as figure:
        panels = figure.subplots(down, min(len(names), WIDEST), squeeze=False).flat
        one = f" [{unit(rows[0].combination.scene, along.key) or '-'}]" if _numeric(along) else ""
        for panel, name in zip(panels, names, strict=False):
            _draw_panel(panel, rows, name, along, look)
            panel.set(xlabel=f"{along.name}{one}", ylabel=name)
        for empty in list(panels):
            empty.set_axis_off()
        if handles := look.legend(rows):
            figure.legend(handles=handles, loc="outside lower center", ncols=4)
        figure.suptitle(title, fontsize=12, parse_math=False)
    return path


def _draw_panel(panel: Axes, rows: Sequence[Row], name: str, along: Axis, look: Look) -> None:
    """Draw a response, or an error on a logarithmic axis, a line for each of the other settings."""
    places = _places(along)
    shown = [row for row in rows if _value(row, name) is not None and row.combination.values.get(along.name) in places]
    for line in dict.fromkeys(look.line(row) for row in shown if not row.mark):
        some = [row for row in shown if look.line(row) == line and not row.mark]
        points = sorted((places[row.combination.values[along.name]], _value(row, name) or 0.0) for row in some)
        panel.plot(
            *zip(*points, strict=True), color=look.colour(some[0]), marker=look.marker(some[0]), ms=6, alpha=0.85
        )
    for row in shown:
        if row.mark:
            place = places[row.combination.values[along.name]]
            panel.plot(place, _value(row, name) or 0.0, "*", color=MARK, ms=15, mec=EDGE, zorder=6)
    if name not in DRAWN:
        panel.set_yscale("log")
        number_logarithms(panel.yaxis)
    if not _numeric(along):
        panel.set_xticks(range(len(along.values)), along.values)


def _value(row: Row, name: str) -> float | None:
    """Return a response, or the size of an error."""
    error = row.errors.get(name)
    return row.responses.get(name) if error is None else abs(error)


def _numeric(axis: Axis) -> bool:
    try:
        return bool(np.isfinite([float(value) for value in axis.values]).all())
    except ValueError:
        return False


def _places(axis: Axis) -> dict[str, float]:
    """Return where each value stands: at itself, or, if they are no numbers, side by side."""
    numeric = _numeric(axis)
    return {value: float(value) if numeric else float(n) for n, value in enumerate(axis.values)}
