"""Reads records: text files of two columns, time [s] and value, with ``#`` for comments."""

from pathlib import Path

from wavetank.errors import InputError
from wavetank.motions.motion import Array
from wavetank.values.columns import check_ascending, read_columns

_ALLOWED = "allowed are two finite numbers, a time [s] and a value, separated by blanks or a comma"


def read_record(path: Path) -> tuple[Array, Array]:
    """Return times [s] and values, shapes (N,), N >= 4, of a file of two columns separated by blanks or commas.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not two finite numbers, if
    times do not ascend, or if there are fewer than four rows.
    """
    _, values, lines = read_columns(path, columns=2, allowed=_ALLOWED)
    if len(lines) < 4:
        raise InputError(f"{path}: {len(lines)} rows received; at least 4 are needed for a cubic spline.")
    check_ascending(path, lines, values[:, 0])
    return values[:, 0], values[:, 1]
