"""Style of all figures: colours, sizes, axes, legends, and labels of gauges."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text
from matplotlib.ticker import LogLocator, NullFormatter
from matplotlib.transforms import Bbox
from numpy.typing import NDArray
from xarray import DataArray

from wavetank.output.files import atomic_file

# colours for colour-blind readers (Okabe and Ito), and greys
BLUE, VERMILION, GREEN, ORANGE, PURPLE, LIGHT_BLUE = "#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9"
INK, GREY, PALE_GREY = "#222222", "#555555", "#9a9a9a"
MEASURED, COMPUTED, PUBLISHED, PADDLE = PALE_GREY, BLUE, VERMILION, INK
WATER = LinearSegmentedColormap.from_list("water", ["#0b2d5c", "#2f7ab9", "#a8d3ee"])

CM = 100.0  # elevations are drawn in centimetres
FLAT = 1e-3  # largest elevation that is drawn as still water [cm]
DAMPED = 1e-3  # damping rate over the largest one at which a sponge begins
SATURATED = 0.995  # quantile of the elevation at which colours end, so that one sharp crest does not hide other waves

LEGEND_COLUMNS = 5  # largest number of columns
COMPRESSION = 3  # level of zlib: files are 10 % larger than at the default 6 and are written in half the time

STYLE: Any = {  # matplotlib 3.11 has a type for the keys, earlier versions accept any
    "font.size": 10,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "lines.linewidth": 1.2,
    "hatch.linewidth": 0.5,
    "figure.dpi": 130,
    "figure.autolayout": False,
    "savefig.dpi": "figure",
}


@contextmanager
def picture(path: Path, width: float, height: float, *, title: str = "") -> Iterator[Figure]:
    """Yield an empty figure of a size [inch] with a title, saved to ``path`` at the end; needs no display."""
    with rc_context(STYLE):
        figure = Figure(figsize=(width, height), layout="constrained")
        if title:
            figure.suptitle(title, fontsize=13, parse_math=False)
        yield figure
        lay_out(figure)
        fast: dict[str, Any] = {"pil_kwargs": {"compress_level": COMPRESSION}} if path.suffix == ".png" else {}
        with atomic_file(path) as file:  # not through an existing link
            figure.savefig(file, format=path.suffix.removeprefix("."), **fast)


def titled(run_title: str, kind: str) -> str:
    """Return the title of a figure: that of the run or the data, if any, and the subject of the figure."""
    return f"{run_title}: {kind}" if run_title else kind.capitalize()


def draw_series(axes: Axes, t: Any, values: Any, **properties: Any) -> None:
    """Draw values over their times, with a thin line at 0."""
    axes.axhline(0.0, color="#888888", lw=0.6, zorder=0)
    axes.plot(t, values, **properties)
    axes.margins(x=0)


@contextmanager
def panels(
    path: Path,
    rows: int = 1,
    columns: int = 1,
    *,
    size: tuple[float, float],
    title: str = "",
    xlabel: str = "time [s]",
    legend: str = "outside lower center",
    **layout: Any,
) -> Iterator[NDArray[Any]]:
    """Yield the axes, shape (rows, columns), of a picture of a size [inch] with a common x axis and one legend.

    ``layout`` are options of matplotlib's ``subplots``, such as ``height_ratios``.
    """
    with picture(path, *size, title=title) as figure:
        axes = figure.subplots(rows, columns, squeeze=False, **({"sharex": True} | layout))
        yield axes
        for panel in axes[-1]:
            panel.set_xlabel(panel.get_xlabel() or xlabel)
        common_legend(figure, legend)


def common_legend(figure: Figure, loc: Any = "outside lower center", handles: Sequence[Line2D] = ()) -> None:
    """Draw one legend below or above all panels, with each label once, in at most five columns.

    Its entries are handles, by default all labelled curves.
    """
    entries: dict[str, Any] = {str(handle.get_label()): handle for handle in handles}
    for axes in () if handles else figure.axes:
        entries |= {label: handle for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    for columns in range(min(LEGEND_COLUMNS, len(entries)), 0, -1):
        legend = figure.legend([*entries.values()], [*entries], loc=loc, ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def lay_out(figure: Figure) -> None:
    """Compute the layout of axes and texts once; drawing and saving do not repeat it, which would be slow."""
    if layout := figure.get_layout_engine():
        layout.execute(figure)
        figure.set_layout_engine(None)


def entry(label: str, **properties: Any) -> Line2D:
    """Return a legend entry for properties of a line: colour, marker (with ``ls=""``) or dash; grey by default."""
    return Line2D([], [], label=label, **{"color": GREY, **properties})


FEW_DECADES = 1e3  # an axis of fewer decades has labels at 1, 2 and 5


def number_logarithms(axis: Axis) -> None:
    """Label a logarithmic axis with final limits at powers of ten; over few decades also at 2 and 5."""
    low, high = sorted(axis.get_view_interval())
    if high < FEW_DECADES * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_formatter(NullFormatter())
        axis.set_major_formatter("{x:g}")


# ---------------------------------------------------------------- marks of gauges
NAMED = 12  # largest number of labelled gauges; each row of gauges has one label
GAUGE, DEPTH = "gauge", "depth"  # identifiers of texts: labels of gauges, depths of contours
AROUND = 3.0  # pixels around a gauge without labels
SINGLE, IN_ROW = 7.0, 4.0  # sizes of their crosses
DARK, LIGHT = "#3a2c0a", "#ffffff"
LABEL: Any = {"fontsize": 8, "color": DARK, "bbox": {"facecolor": LIGHT, "alpha": 0.7, "lw": 0, "pad": 0.5}}


def mark_places(axes: Axes, gauges: DataArray, *, rows: Collection[str] = (), ink: str = DARK) -> None:
    """Draw gauges at their positions (x, y), in plan view; a row of gauges has one label, at its first gauge."""
    names, x, y = gauges.gauge.values.astype(str), gauges.x.values, gauges.y.values
    row_of = np.array([name.rpartition("/")[0] for name in names], dtype=str)
    in_row = np.isin(row_of, list(rows))
    for some, size in ((~in_row, SINGLE), (in_row, IN_ROW)):
        axes.plot(x[some], y[some], "+", color=ink, ms=size, mew=1.2)
    single = np.flatnonzero(~in_row) if np.count_nonzero(~in_row) <= NAMED else ()
    first = [int(np.argmax(in_row & (row_of == row))) for row in dict.fromkeys(row_of[in_row])]
    for n, name in (*((n, names[n]) for n in single), *((n, row_of[n]) for n in first)):
        name_point(axes, name, (x[n], y[n]), (4, 3))


def mark_along(axes: Axes, gauges: DataArray, *, top: float) -> None:
    """Draw gauges as lines at their x over a diagram that ends at ``top``, with labels there."""
    for x in gauges.x.values:
        axes.axvline(x, color=DARK, lw=0.7, ls=(0, (1, 3)))
    for name, x in zip(gauges.gauge.values, gauges.x.values, strict=True) if gauges.x.size <= NAMED else ():
        name_point(axes, name, (x, top), (3, -3), va="top")


def name_point(axes: Axes, name: str, place: tuple[float, float], offset: tuple[int, int], **properties: Any) -> None:
    """Write a label at an offset [points of print] from a position; ``remove_overlaps`` may remove it."""
    axes.annotate(name, place, xytext=offset, textcoords="offset points", gid=GAUGE, **LABEL, **properties)


def mark_sponge(axes: Axes, place: tuple[float, float], **position: Any) -> None:
    """Write "sponge" at a position."""
    axes.annotate("sponge", place, ha="center", **position, **LABEL)


def remove_overlaps(axes: Axes) -> None:
    """Remove labels of points that overlap an earlier one or another point, and depths that overlap any of these.

    Their positions must be final.
    """
    axes.apply_aspect()
    marks, drawn = dict[Text, Bbox](), list[Bbox]()
    for text in axes.texts:
        if isinstance(text, Annotation) and text.get_gid() == GAUGE:
            place = axes.transData.transform(text.xy)
            marks[text] = Bbox.from_extents(*(place - AROUND), *(place + AROUND))
    for text in (*marks, *(text for text in axes.texts if text.get_gid() == DEPTH)):
        box = text.get_window_extent()
        if box.count_overlaps([*drawn, *(mark for name, mark in marks.items() if name is not text)]):
            text.remove()
        else:
            drawn.append(box)
