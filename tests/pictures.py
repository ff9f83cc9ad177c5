"""What makes a picture hard to read, found in the figure itself."""

from collections.abc import Iterator
from itertools import chain, combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

GREYS = {"#555555", "#666666", "#777777", "#888888", "#9a9a9a", "#222222", "#000000"}  # stand for no quantity
FEWEST = 2  # numbers an axis needs to be one


def faults(figure: Figure) -> list[str]:
    """Return what is wrong with a figure, a sentence each.

    Axes with fewer than two numbers, axes without a unit, colours that no legend of the panel or of the figure names,
    legends and texts on curves, texts on texts, legends that are wider than the figure.
    """
    figure.draw_without_rendering()
    panels = [axes for axes in figure.axes if axes.lines]
    found = [fault for axes in panels for fault in chain(_numbers(axes), _colours(axes), _covered(axes), _texts(axes))]
    wide = [one for one in figure.legends if one.get_window_extent().width > figure.bbox.width]
    return [*found, *("a legend is wider than the figure" for _ in wide)]


def _numbers(axes: Axes) -> Iterator[str]:
    for axis, (low, high), side in (
        (axes.xaxis, axes.get_xlim(), "labelbottom"),
        (axes.yaxis, axes.get_ylim(), "labelleft"),
    ):
        low, high = sorted((low, high))
        if not axis.get_tick_params().get(side, True):
            continue
        ticks = _ticks(axis)
        shown = [x for x, text in ticks if text and low * (1 - 1e-9) <= x <= high * (1 + 1e-9)]
        if len(shown) < FEWEST:
            yield f"{_named(axes)}: {len(shown)} numbers at {axis.label.get_text()!r}"
        if "[" not in axis.label.get_text() and any(letter.isdigit() for _, text in ticks for letter in text):
            yield f"{_named(axes)}: no unit at {axis.label.get_text()!r}"


def _ticks(axis: Axis) -> list[tuple[float, str]]:
    """Return places and texts."""
    major, minor = axis.get_majorticklocs(), axis.get_minorticklocs()
    texts = (*axis.get_major_formatter().format_ticks(major), *axis.get_minor_formatter().format_ticks(minor))
    return list(zip([*major, *minor], texts, strict=True))


def _colours(axes: Axes) -> Iterator[str]:
    legends = [*filter(None, [axes.get_legend()]), *axes.figure.legends]
    named = {look for legend in legends for handle in legend.legend_handles for look in _looks(handle)}
    drawn = {look for line in _curves(axes) for look in _looks(line)}
    if len(drawn - GREYS) > 1:
        yield from (f"{_named(axes)}: no legend says what {colour} is" for colour in sorted(drawn - GREYS - named))


def _looks(handle: Any) -> set[str]:
    """Return the colours that a line or a legend's entry is seen in."""
    if not isinstance(handle, Line2D):
        return set()
    line = {to_hex(handle.get_color())} if handle.get_linestyle() not in ("None", "") else set()
    marked = handle.get_marker() not in ("None", "", None)
    return line | ({to_hex(handle.get_markeredgecolor())} if marked else set())


def _curves(axes: Axes) -> list[Line2D]:
    """Return the lines that are data, not rules across the panel."""
    return [line for line in axes.lines if line.get_transform() == axes.transData and len(line.get_xdata())]


def _covered(axes: Axes) -> Iterator[str]:
    legend = axes.get_legend()
    boxes = {"the legend": legend.get_window_extent()} if legend else {}
    boxes |= {repr(one.get_text()): Text.get_window_extent(one) for one in axes.texts if one.get_text()}
    for what, box in boxes.items():
        if any(box.count_contains(_places(axes, line)) for line in _curves(axes)):
            yield f"{_named(axes)}: {what} lies on a curve"


def _places(axes: Axes, line: Line2D) -> NDArray[np.float64]:
    """Return where a line is seen [pixels], shape (N, 2): its marks, and many places between."""
    corners = axes.transData.transform(np.column_stack([line.get_xdata(), line.get_ydata()]))
    drawn = np.linspace(corners[:-1], corners[1:], 50).reshape(-1, 2)
    return drawn if line.get_linestyle() not in ("None", "") else corners


def _texts(axes: Axes) -> Iterator[str]:
    texts = [one for one in [*axes.texts, *_legend_texts(axes.get_legend())] if one.get_visible() and one.get_text()]
    ticks = [[one for one in axis.get_ticklabels() if one.get_text()] for axis in (axes.xaxis, axes.yaxis)]
    for group in (texts, *ticks):
        boxes = [(one.get_text(), Text.get_window_extent(one)) for one in group]
        for (text, box), (other, under) in combinations(boxes, 2):
            if box.overlaps(under):
                yield f"{_named(axes)}: {text!r} lies on {other!r}"


def _legend_texts(legend: Legend | None) -> list[Text]:
    return legend.get_texts() if legend else []


def _named(axes: Axes) -> str:
    return axes.get_title("left") or axes.get_title() or axes.get_ylabel() or "a panel"
