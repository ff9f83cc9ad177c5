"""CSV files and terminal tables of studies, analyses and comparisons."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from rich.box import SIMPLE
from rich.table import Table
from xarray import Dataset

from wavetank.base.errors import InputError, WavetankError, write_errors
from wavetank.output.files import write_atomically

if TYPE_CHECKING:
    from pandas import DataFrame


class Column(NamedTuple):
    """A column of a terminal table: name in a data frame, heading, and format of the values."""

    name: str
    head: str
    format: str = "{}"


PLACE = [Column("gauge", "gauge"), Column("x", "x [m]", "{:g}")]
MISFIT = [*PLACE, Column("nrms", "nrms", "{:.3f}")]
COMPARISON = [
    *MISFIT,
    Column("correlation", "correlation", "{:.3f}"),
    Column("similarity", "similarity", "{:.3f}"),
]
FITTED = [
    *MISFIT,
    Column("nrms_fitted", "fitted", "{:.3f}"),
    Column("gain", "gain", "{:.3f}"),
    Column("shift", "shift [s]", "{:.3f}"),
    Column("clock_offset", "clock [s]", "{:+.4g}"),
]
VALIDATION = [
    Column("gauge", "gauge"),
    Column("nrms", "E", "{:.1%}"),
    Column("U_SN", "U_SN", "{:.2%}"),
    Column("U_D", "U_D", "{:.2%}"),
    Column("U_D_contents", "of"),
    Column("u_input", "u_input", "{:.2%}"),
    Column("U_V", "U_V", "{:.2%}"),
    Column("within", "within", "{:.0%}"),
    Column("validation", "record"),
]
CREST_VALIDATION = [
    Column("gauge", "gauge"),
    Column("crest_E", "E", "{:+.1%}"),
    Column("crest_U_SN", "U_SN", "{:.2%}"),
    Column("crest_U_D", "U_D", "{:.2%}"),
    Column("crest_u_input", "u_input", "{:.2%}"),
    Column("crest_U_V", "U_V", "{:.2%}"),
    Column("crest_validation", "highest crest"),
]
REGULAR = [
    Column("gauge", "gauge"),
    Column("record", "record"),
    Column("height", "H [m]", "{:.4g}"),
    Column("height_deviation", "of mean", "{:+.1%}"),
    Column("period", "T [s]", "{:.4g}"),
    Column("period_deviation", "of mean", "{:+.1%}"),
]
EXTREMES = [
    Column("gauge", "gauge"),
    Column("crest_computed", "crest [m]", "{:.4g}"),
    Column("crest_reference", "reference", "{:.4g}"),
    Column("crest_error", "error", "{:+.1%}"),
    Column("trough_computed", "trough [m]", "{:.4g}"),
    Column("trough_reference", "reference", "{:.4g}"),
    Column("trough_error", "error", "{:+.1%}"),
    Column("arrival_error", "arrival [s]", "{:+.3f}"),
]
HARMONICS = [
    *PLACE,
    Column("harmonic", "harmonic"),
    Column("computed", "computed [m]", "{:.4g}"),
    Column("reference", "reference", "{:.4g}"),
    Column("error", "error", "{:+.1%}"),
    Column("ahead", "ahead [rad]", "{:+.3f}"),
]
HEIGHTS = [
    Column("section", "section"),
    Column("line", "line"),
    Column("measured", "measured"),
    Column("points", "points"),
    Column("nrms", "nrms", "{:.3f}"),
    Column("bias", "bias", "{:+.3f}"),
    Column("nrms_incident", "own H0", "{:.3f}"),
    Column("largest_computed", "max", "{:.2f}"),
    Column("largest_measured", "measured", "{:.2f}"),
]


def data_frame(columns: Mapping[str, ArrayLike]) -> "DataFrame":
    """Return columns of equal length as pandas' DataFrame."""
    return Dataset({name: ("row", np.asarray(values)) for name, values in columns.items()}).to_dataframe()


def write_frame(path: Path, frame: "DataFrame", *, digits: int = 6, error: type[WavetankError] = InputError) -> None:
    """Write a data frame as CSV, atomically, with a number of digits; raises ``error`` if it cannot be written."""
    text = frame.to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\r\n")
    with write_errors(path, error):
        write_atomically(path, text.encode())


def write_dataset(path: Path, data: Dataset, names: Sequence[str] = ()) -> None:
    """Write a data set as CSV, all or named quantities: a row for each combination of its dimensions."""
    frame = data.to_dataframe().reset_index()
    frame = frame[[*names]] if names else frame
    units = {name: data[name].attrs.get("units") for name in frame}
    write_frame(path, frame.rename(columns=lambda name: f"{name} [{units[name]}]" if units[name] else name))


def plain_columns(frame: "DataFrame", digits: int) -> list[Column]:
    """Return the columns of a data frame by name, numbers with a number of digits, places x with six."""
    formats = dict.fromkeys(frame.select_dtypes("number"), f"{{:.{digits}g}}") | {"x [m]": "{:g}"}
    return [Column(name, name, formats.get(name, "{}")) for name in frame]


def terminal_table(frame: "DataFrame", columns: Iterable[Column], *, caption: str | None = None) -> Table:
    """Return columns of a data frame for the terminal: nan is empty, and empty columns are omitted."""
    shown = [column for column in columns if frame[column.name].notna().any()]
    table = Table(*(column.head for column in shown), box=SIMPLE, padding=0, caption=caption)
    cells = [["" if one != one else column.format.format(one) for one in frame[column.name]] for column in shown]
    for row in zip(*cells, strict=True):
        table.add_row(*row)
    return table
