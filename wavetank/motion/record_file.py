"""Reads records of paddles: text files of two columns, time [s] and value, ``#`` for comments, or of named columns."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from wavetank.errors import InputError
from wavetank.motion.motion import Array
from wavetank.values.columns import check_ascending, first_line, read_columns

TIME, STATE = "t [s]", ("position [m]", "velocity [m/s]", "acceleration [m/s^2]")
INTERVALS, PERIODS = 10.0, 0.25  # of the median, of the motion: allowed between two rows
_ALLOWED = "allowed are two finite numbers, a time [s] and a value, separated by blanks or a comma"


class ColumnError(InputError):
    """A file that has no column of a name."""


def says_metres(path: Path, *, named: str | None = None) -> bool:
    """Return whether a file's first line, or the name of its column, says that its values are positions or velocities.

    So do a run's ``paddle.csv`` and, in either format, a file of ``wavetank motion``. Raises ``InputError``.
    """
    if named is not None:
        return named in STATE
    line = first_line(path)
    return any(name in line for name in STATE)


def read_record(path: Path, *, column: str = "position [m]", named: str | None = None) -> tuple[Array, ...]:
    """Return times [s] and values, shapes (N,), N >= 4, of a file of columns separated by blanks or commas.

    There are two of them without names, or those of a run's ``paddle.csv``, which may be more: the first that goes by
    ``column`` is taken, with the derivatives of a position if they are there. Otherwise the ``named`` one is, behind
    the times in the first.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not as many finite numbers, if
    times do not ascend or have a gap (``check_gaps``), if there are fewer than four rows; ``ColumnError`` if it has no
    such column.
    """
    names, values, lines = read_columns(path, allowed=_ALLOWED)
    if named is not None:
        if named not in names[1:]:
            there = f"allowed are {', '.join(names[1:])}" if names else "its columns have no names"
            raise ColumnError(f"{path} has no such column; {there}.")
        names, values = (TIME, column), values[:, [0, names.index(named)]]
    if not names and values.shape[1] > 2:
        raise InputError(f"{path}: {values.shape[1]} columns received; {_ALLOWED}, or columns with names above.")
    if names and not {TIME, column} <= {*names}:
        raise InputError(f"{path}: columns {', '.join(names)} received; allowed are '{TIME}' and '{column}'.")
    if len(lines) < 4:
        raise InputError(f"{path}: {len(lines)} rows received; at least 4 are needed for a cubic spline.")
    wanted = names or (TIME, column)
    t = values[:, wanted.index(TIME)]
    check_ascending(path, lines, t)
    check_gaps(path, lines, t, values[:, wanted.index(column)])
    whole = column == STATE[0] and {*STATE} <= {*names}
    return t, *(values[:, wanted.index(name)] for name in (STATE if whole else (column,)))


def check_gaps(path: Path, lines: Sequence[int], t: Array, values: Array) -> None:
    """Raise ``InputError``, which names the line, for two rows too far apart to interpolate between them.

    Intervals up to ten median intervals are allowed, and up to a quarter of the motion's period: over that a cubic
    through values and slopes at both ends is within 2 % of a sine's amplitude. The period is that of the sine with the
    range and the largest rate of the values at times t [s], shape (N,).
    """
    intervals = np.diff(t)
    widest, usual = int(intervals.argmax()), float(np.median(intervals))
    rate = float(np.abs(np.diff(values) / intervals).max())
    period = np.pi * float(np.ptp(values)) / rate if rate else np.inf
    allowed = max(INTERVALS * usual, PERIODS * period)
    if intervals[widest] > allowed:
        raise InputError(
            f"{path}, line {lines[widest + 1]}: gap of {intervals[widest]:.4g} s after t = {t[widest]:.6g} s; "
            f"allowed are {allowed:.3g} s (median interval {usual:.3g} s, period about {period:.3g} s): add rows."
        )
