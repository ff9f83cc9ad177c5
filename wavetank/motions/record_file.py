"""Reads records: text files of two columns, time [s] and value, with ``#`` for comments."""

from pathlib import Path

import numpy as np

from wavetank.errors import InputError
from wavetank.motions.motion import Array
from wavetank.values.files import regular

_ALLOWED = "allowed are two finite numbers, a time [s] and a value, separated by blanks or a comma"


def read_record(path: Path) -> tuple[Array, Array]:
    """Return times [s] and values, shapes (N,), N >= 4, of a file of two columns separated by blanks or commas.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not two finite numbers, if
    times do not ascend, or if there are fewer than four rows.
    """
    rows = [(number, _row(path, number, line)) for number, line in _lines(path)]
    if len(rows) < 4:
        raise InputError(f"{path}: {len(rows)} rows received; at least 4 are needed for a cubic spline.")
    for (_, (before, _)), (number, (time, _)) in zip(rows, rows[1:], strict=False):
        if not time > before:
            raise InputError(f"{path}, line {number}: time {time:g} received after {before:g}; times must ascend.")
    t, values = np.array([row for _, row in rows]).T
    return t, values


def _lines(path: Path) -> list[tuple[int, str]]:
    try:
        text = regular(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(f"{path}: cannot be read ({reason}); a text file of two columns is needed.") from None
    lines = ((number, line.partition("#")[0].strip()) for number, line in enumerate(text.splitlines(), start=1))
    return [(number, line) for number, line in lines if line]


def _row(path: Path, number: int, line: str) -> tuple[float, float]:
    try:
        time, value = (float(column) for column in line.replace(",", " ").split())
    except ValueError:
        raise InputError(f"{path}, line {number}: {line!r} received; {_ALLOWED}.") from None
    if not np.isfinite([time, value]).all():
        raise InputError(f"{path}, line {number}: {line!r} received; {_ALLOWED}.")
    return time, value
