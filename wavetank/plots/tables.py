"""CSV files and terminal tables of analyses and comparisons."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from io import StringIO
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.box import SIMPLE
from rich.table import Table
from xarray import Dataset

from wavetank.errors import InputError, WavetankError, write_errors
from wavetank.output.files import write_atomically

if TYPE_CHECKING:
    from pandas import DataFrame

HARMONICS = ("gauge", "x", "harmonic", "computed", "reference", "error", "ahead")  # columns


def write_rows(
    path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]], error: type[WavetankError] = InputError
) -> None:
    """Write a table as CSV, numbers with six digits, complete or not at all; raises ``error`` if it cannot."""
    text = StringIO()
    writer = csv.writer(text)
    writer.writerow(columns)
    writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in row] for row in rows)
    with write_errors(path, error):
        write_atomically(path, text.getvalue().encode())


def write_frame(path: Path, frame: "DataFrame", *, digits: int = 7, error: type[WavetankError] = InputError) -> None:
    """Write a DataFrame as CSV, complete or not at all; raises ``error`` if it cannot."""
    text = frame.to_csv(index=False, float_format=f"%.{digits}g", lineterminator="\r\n")
    with write_errors(path, error):
        write_atomically(path, text.encode())


def write_dataset(path: Path, data: Dataset, names: Sequence[str] = ()) -> None:
    """Write a data set as CSV, all quantities or those named: a row for each combination of its dimensions."""
    columns, rows = table_rows(data, names)
    write_rows(path, columns, rows)


def table_rows(data: Dataset, names: Sequence[str] = ()) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Return the columns of a data set, with their units, and its rows."""
    frame = data.to_dataframe().reset_index()
    frame = frame[[*names]] if names else frame
    units = [data[name].attrs.get("units") for name in frame]
    columns = [f"{name} [{unit}]" if unit else str(name) for name, unit in zip(frame, units, strict=True)]
    return columns, [*frame.itertuples(index=False, name=None)]


def terminal_table(columns: Sequence[str], rows: Iterable[Iterable[str]], *, caption: str | None = None) -> Table:
    """Return a table for the terminal."""
    table = Table(*columns, box=SIMPLE, padding=0, caption=caption)
    for row in rows:
        table.add_row(*row)
    return table


def frame_table(frame: "DataFrame", *, digits: int) -> Table:
    """Return a DataFrame as a table for the terminal, numbers with so many digits, of nan none."""
    rows = frame.itertuples(index=False, name=None)
    return terminal_table([*frame.columns], ([format_cell(one, digits) for one in row] for row in rows))


def format_cell(value: str | float, digits: int = 4) -> str:
    """Return a text, or a number with so many digits, of nan none."""
    return value if isinstance(value, str) else "" if isnan(value) else f"{value:.{digits}g}"


# ---------------------------------------------------------------- gauges
def clock_line(offset: float) -> str:
    """Return the line about an offset [s] between both clocks; empty where it is zero."""
    added = f"{offset:+.4g} s added to the reference's times"
    return f"clock: {added}; shifts and arrivals are relative to it" if offset else ""


def comparison_table(compared: Dataset) -> Table:
    """Return the misfits as a table for the terminal."""
    names = ("gauge", "x", "nrms", "nrms_fitted", "gain", "shift", "correlation", "similarity")
    heads = ("gauge", "x [m]", "nrms", "fitted", "gain", "shift [s]", "correlation", "similarity")
    _, rows = table_rows(compared, names)
    return terminal_table(heads, ([gauge, f"{x:g}", *(f"{one:.3f}" for one in numbers)] for gauge, x, *numbers in rows))


def extremes_table(compared: Dataset) -> Table:
    """Return crests, troughs and arrivals as a table for the terminal; arrivals are omitted if no gauge has one."""
    heads = ["gauge", "crest [m]", "reference", "error", "trough [m]", "reference", "error", "arrival [s]"]
    extremes = [(f"{name}_computed", f"{name}_reference", f"{name}_error") for name in ("crest", "trough")]
    rows = []
    for gauge, *numbers, arrival in table_rows(compared, ["gauge", *extremes[0], *extremes[1], "arrival_error"])[1]:
        cells = [_percent(one) if n in (2, 5) else f"{one:.4g}" for n, one in enumerate(numbers)]
        rows.append([gauge, *cells, "" if isnan(arrival) else f"{arrival:+.3f}"])
    number = len(heads) - bool(np.isnan(compared.arrival_error).all())
    return terminal_table(heads[:number], (row[:number] for row in rows))


def _percent(fraction: float) -> str:
    return "" if isnan(fraction) else f"{round(100 * fraction, 1) + 0.0:+.1f} %"


def harmonics_table(compared: Dataset) -> Table:
    """Return the harmonics as a table for the terminal, amplitudes in mm."""
    heads = ("gauge", "x [m]", "harmonic", "computed [mm]", "reference", "error", "ahead [rad]")
    rows = []
    for gauge, x, harmonic, computed, reference, error, ahead in table_rows(compared, HARMONICS)[1]:
        errors = ("", "") if isnan(error) else (f"{100 * error:+.1f} %", f"{ahead:+.3f}")
        rows.append([gauge, f"{x:g}", f"{harmonic}", f"{1e3 * computed:.4g}", f"{1e3 * reference:.4g}", *errors])
    return terminal_table(heads, rows)


# ---------------------------------------------------------------- wave heights along sections
def heights_table(rows: Iterable[Mapping[str, Any]]) -> Table:
    """Return the comparison of wave heights as a table for the terminal."""
    heads = ("section", "line", "measured", "points", "nrms", "bias", "own H0", "max", "measured")
    cells = []
    for row in rows:
        own = "" if row["nrms_incident"] is None else f"{row['nrms_incident']:.3f}"
        misfits = (f"{row['nrms']:.3f}", f"{row['bias']:+.3f}", own)
        largest = (f"{row['largest_computed']:.2f}", f"{row['largest_measured']:.2f}")
        cells.append([row["section"], row["line"], row["measured"], str(row["points"]), *misfits, *largest])
    return terminal_table(heads, cells)
