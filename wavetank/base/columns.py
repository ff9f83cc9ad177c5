"""Text files of numbers in columns, separated by blanks, commas or semicolons, with ``#`` for comments."""

import csv
import gzip
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.base.errors import InputError
from wavetank.base.files import TEXT, regular

Array = NDArray[np.float64]
MAX_INTERVALS, MAX_PERIODS = 10.0, 0.25  # largest gap between rows, in median intervals and in periods of the motion
CELL = re.compile(r"[-+]?\d*(,\d+)?([eE][-+]?\d+)?")  # a number with a decimal comma, or an integer


class Header(NamedTuple):
    """The first line of a file without comments: its number, and the names of the columns; empty if it has numbers."""

    line: int
    names: tuple[str, ...]


class ColumnTable(NamedTuple):
    """The content of a file of columns.

    Attributes
    ----------
    names
        Names of the columns, from a first line of text; empty without one.
    values
        Values, shape (rows, columns).
    lines
        Line number of each row.
    """

    names: tuple[str, ...]
    values: Array
    lines: tuple[int, ...]


def read_columns(
    path: Path, *, columns: int = 0, allowed: str = "allowed are finite numbers, as many in each row"
) -> ColumnTable:
    """Return the numbers in a file, which may be compressed (``.gz``).

    Raises ``InputError`` with the file and the line if it cannot be read, or if a row is not ``columns`` finite
    numbers; default: the number of columns of the first line, which may be names. ``allowed`` ends the sentence.
    """
    names, rows, numbers = tuple[str, ...](), list[list[float]](), list[int]()
    for number, line in _lines(path):
        if _has_decimal_commas(line):
            raise InputError(f"{path}, line {number}: {line!r} received: decimal commas; allowed are decimal points.")
        row = _row(line)
        if not (row or columns):
            names = _names(line)
        elif not (len(row) == (columns or len(row)) and np.isfinite(row).all()):
            raise InputError(f"{path}, line {number}: {line!r} received; {allowed}.")
        else:
            rows.append(row)
            numbers.append(number)
        columns = columns or len(row or names)
    return ColumnTable(names, np.array(rows).reshape(len(rows), columns), tuple(numbers))


def read_header(path: Path) -> Header:
    """Return the header of a file, without its rows; raises ``InputError`` if it cannot be read or has no line."""
    number, line = next(iter(_lines(path)), (1, ""))
    if not line:
        raise InputError(f"{path}: is empty.")
    return Header(number, () if _row(line) else _names(line))


def _row(line: str) -> list[float]:
    """Return the numbers in a line; empty if it has other cells."""
    try:
        return [float(cell) for cell in re.sub("[,;]", " ", line).split()]
    except ValueError:
        return []


def _has_decimal_commas(line: str) -> bool:
    """Return whether a line has cells such as ``0,5``, separated by blanks or semicolons, and no decimal point."""
    if "," not in line or "." in line:
        return False
    cells = re.split(r"[;\s]+", line.strip())
    return len(cells) > 1 and all(CELL.fullmatch(cell) for cell in cells)


def check_ascending(
    path: Path, lines: Sequence[int], values: Array, *, what: tuple[str, str] = ("time", "times")
) -> None:
    """Raise ``InputError`` with the line for one or many columns of values that do not ascend."""
    for before, value, number in zip(values, values[1:], lines[1:], strict=False):
        if not value > before:
            received = f"{what[0]} {value:g} received after {before:g}"
            raise InputError(f"{path}, line {number}: {received}; {what[1]} must ascend.")


def check_gaps(path: Path | str, t: Array, values: Array, lines: Sequence[int] = ()) -> None:
    """Raise ``InputError`` for a gap between two rows that is too long to interpolate; it names a given line.

    Intervals up to ten median intervals are allowed, and up to a quarter of the motion's period: over that a cubic
    through values and slopes at both ends has an error of 2 % of a sine's amplitude. The period is that of the sine
    with the range and the largest rate of the values at times t [s], shape (N,).
    """
    if (intervals := np.diff(t)).size == 0:
        return
    widest, usual = int(intervals.argmax()), float(np.median(intervals))
    rate = float(np.abs(np.diff(values) / intervals).max())
    period = np.pi * float(np.ptp(values)) / rate if rate else np.inf
    allowed = max(MAX_INTERVALS * usual, MAX_PERIODS * period)
    if intervals[widest] > allowed:
        where = f"{path}, line {lines[widest + 1]}" if lines else path
        raise InputError(
            f"{where}: gap of {intervals[widest]:.4g} s after t = {t[widest]:.6g} s; "
            f"allowed are {allowed:.3g} s (median interval {usual:.3g} s, period about {period:.3g} s): add rows."
        )


def first_line(path: Path) -> str:
    """Return the first line of a file, a comment or not; raises ``InputError`` as ``read_columns`` does."""
    return _text(path).partition("\n")[0]


def _names(line: str) -> tuple[str, ...]:
    """Return the names of the columns in a header."""
    if mark := next((mark for mark in ",;" if mark in line), None):
        return tuple(name.strip() for name in next(csv.reader([line], delimiter=mark, skipinitialspace=True)))
    return tuple(re.findall(r"\S+(?:\s+(?:\[[^]]*\]|\([^)]*\)))?", line))


def name_and_unit(column: str) -> tuple[str, str]:
    """Return the name of a column and its unit in brackets or parentheses, ``5 [mm]`` or ``5 (mm)``; empty without one.

    A number in parentheses belongs to the name, as in ``WG(1)``.
    """
    match = re.fullmatch(r"(.*?)\s*\[(.*?)\]?", column) or re.fullmatch(r"(.*?)\s*\((\D[^()]*)\)", column)
    return (match[1].strip(), match[2].strip()) if match else (column.strip(), "")


def _lines(path: Path) -> list[tuple[int, str]]:
    """Return the lines except comments, with their numbers."""
    numbered = enumerate(_text(path).splitlines(), start=1)
    lines = ((number, line.partition("#")[0].strip()) for number, line in numbered)
    return [(number, line) for number, line in lines if line]


def _text(path: Path) -> str:
    """Return the text of a file, at most ``TEXT`` bytes if it is compressed; raises ``InputError``."""
    try:
        with (gzip.open if path.suffix == ".gz" else open)(regular(path), "rb") as file:
            return file.read(TEXT).decode("utf-8-sig")
    except (OSError, EOFError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(f"{path}: cannot be read ({reason}); a text file of columns is needed.") from None
