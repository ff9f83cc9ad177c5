"""Motions from records: a cubic spline through measured positions or velocities.

The ``paddle.csv`` of a run has positions, velocities and accelerations; a spline of degree 5 interpolates all of them.
"""

from pathlib import Path
from typing import Any

import numpy as np
import scipy

from wavetank.base.columns import check_ascending, check_gaps, first_line, read_columns
from wavetank.base.errors import InputError
from wavetank.base.python_file import PythonFunction
from wavetank.motion.motion import Array, Motion


def hermite(t: Array, X: Array, velocity: Array, acceleration: Array) -> "scipy.interpolate.PPoly":
    """Return the polynomials of degree 5 between times t [s], shape (N,), through values at these times.

    Position, velocity and acceleration are in m, m/s, m/s², shape (N,) or (N, M). All three are continuous.
    """
    h = np.diff(t).reshape(-1, *(1,) * (X.ndim - 1))
    v, a = velocity * np.ones_like(X), acceleration
    step, v0, v1, a0, a1 = np.diff(X, axis=0), h * v[:-1], h * v[1:], h**2 * a[:-1], h**2 * a[1:]
    c3 = (20 * step - 8 * v1 - 12 * v0 - 3 * a0 + a1) / (2 * h**3)
    c4 = (-30 * step + 14 * v1 + 16 * v0 + 3 * a0 - 2 * a1) / (2 * h**4)
    c5 = (12 * step - 6 * v1 - 6 * v0 - a0 + a1) / (2 * h**5)
    return scipy.interpolate.PPoly(np.stack([c5, c4, c3, a[:-1] / 2, v[:-1], X[:-1]]), t)


TIME, ELEVATION, STATE = "t [s]", "elevation [m]", ("position [m]", "velocity [m/s]", "acceleration [m/s^2]")
MIN_ROWS = 4
_ALLOWED = "allowed are two finite numbers, a time [s] and a value, separated by blanks or a comma"


def in_metres(path: Path, *, named: str | None = None) -> bool:
    """Return whether a file's header, or the name of its column, states units of positions or velocities."""
    if named is not None:
        return named in STATE
    line = first_line(path)
    return any(name in line for name in STATE)


def read_record(path: Path, *, column: str = "position [m]", named: str | None = None) -> tuple[Array, ...]:
    """Return times [s] and values, shapes (N,), N >= 4, of a file of columns separated by blanks or commas.

    Without names there are two columns. With names the values are the first column ``column``, as in a run's
    ``paddle.csv``, with the derivatives of a position if it has them, or the column ``named``, times being the first.

    Raises ``InputError`` naming the file and the line if it cannot be read, if a row is not as many finite numbers, if
    times do not ascend or have a gap (``check_gaps``), if there are fewer than four rows, or no such column.
    """
    names, values, lines = read_columns(path, allowed=_ALLOWED)
    time, derivatives = TIME, STATE if column == STATE[0] and {*STATE} <= {*names} else (column,)
    if named is not None:
        time, derivatives = next(iter(names), ""), (named,)
    elif not names:
        names = (TIME, column)
        if values.shape[1] > 2:
            raise InputError(f"{path}: {values.shape[1]} columns received; {_ALLOWED}, or columns with names above.")
    if missing := [name for name in (time, *derivatives) if name not in names]:
        other = " (wall.motion.column names another one, wall.motion.gain converts its values)" * (missing[0] in STATE)
        raise InputError(
            f"{path}: has no column {missing[0]!r}; its columns are {', '.join(names) or 'without names'}{other}."
        )
    if "[" in time and not time.endswith("[s]"):
        raise InputError(f"{path}: its first column is {time!r}; allowed are times in seconds, such as {TIME!r}.")
    check_rows(path, len(lines))
    t, *state = (values[:, names.index(name)] for name in (time, *derivatives))
    check_ascending(path, lines, t)
    check_gaps(path, t, state[0], lines)
    return t, *state


def check_rows(path: Path | str, rows: int) -> None:
    """Raise ``InputError`` for too few rows of a record."""
    if rows < MIN_ROWS:
        raise InputError(f"{path}: {rows} rows received; at least {MIN_ROWS} are needed for a cubic spline.")


DIFFERENCE_STEP = 1e-4  # step of difference quotients [s]
DERIVATIVE_ERROR = 1e-3  # largest difference of a derivative from the quotient, over the largest derivative


def programmed_motion(function: PythonFunction) -> Motion:
    """Return X by a user's function of times t [s] and an order: X [m], or its first or second derivative.

    Its check raises ``InputError`` if a derivative differs from the difference quotient of the lower order.
    """

    def rates(t: Array, y: Any = None) -> list[Array]:
        return [function.at({"t": t}, order) for order in range(3)]

    def check(times: Array) -> None:
        below, above = rates(times - DIFFERENCE_STEP), rates(times + DIFFERENCE_STEP)
        for order, given in enumerate(rates(times)[1:], start=1):
            differences = (above[order - 1] - below[order - 1]) / (2 * DIFFERENCE_STEP)
            off = np.abs(given - differences)
            if (off > DERIVATIVE_ERROR * np.abs(differences).max() + 1e-9).any():
                worst = int(off.argmax())
                allowed = f"by differences of order {order - 1} it must be {differences[worst]:.6g}"
                when = f"t = {times[worst]:.6g} s"
                raise InputError(f"its derivative of order {order} at {when} is {given[worst]:.6g}; {allowed}.")

    return Motion(rates, check=check)


DEGREE, PIECES = 5, 2.5  # degree of a least-squares spline, and its pieces in the period of its highest frequency


def spline_motion(spline: "scipy.interpolate.PPoly", *, measured: bool = True) -> Motion:
    """Return X(t) [m] of piecewise polynomials whose breakpoints are the times of a record.

    ``measured`` states that the record has noise. Before the record the paddle is at rest at its first position. Times
    beyond the record raise ``InputError``.
    """
    start, end = (float(time) for time in spline.x[[0, -1]])

    def rates(t: Array, y: Any) -> list[Array]:
        # The last step may end beyond the record by round-off, where the spline is extrapolated.
        last = t.max(initial=start)
        if last > end + 1e-9 * max(1.0, abs(end)):
            raise InputError(f"paddle motion: t = {last:g} s asked for; the record ends at {end:g} s.")
        X, velocity, acceleration = (spline(np.maximum(t, start), order) for order in range(3))
        return [X, velocity * (t >= start), acceleration * (t >= start)]

    interval = float(np.mean(np.diff(spline.x))) if measured else None
    return Motion(rates, start=start, duration=end, interval=interval)


def positions_motion(t: Array, values: Array, *, highest: float | None = None) -> Motion:
    """Return the cubic spline through positions [m] at ascending times t [s], shapes (N,), N >= 4.

    Frequencies above ``highest`` [Hz] are removed. Raises ``InputError`` if there are too few rows.
    """
    return spline_motion(_through(t, values, highest))


def velocities_motion(t: Array, values: Array, *, highest: float | None = None) -> Motion:
    """Return the integral, zero at t[0], of the cubic spline through velocities [m/s]; see ``positions_motion``."""
    return spline_motion(_through(t, values, highest).antiderivative())


def _through(t: Array, values: Array, highest: float | None) -> "scipy.interpolate.PPoly":
    """Return the cubic spline through values, or, up to a frequency [Hz], the least-squares spline of degree 5."""
    if highest is None:
        return scipy.interpolate.CubicSpline(t, values)
    begin, end = float(t[0]), float(t[-1])
    pieces = max(1, int(np.ceil(PIECES * highest * (end - begin))))
    if pieces + DEGREE > t.size / 2:
        most = (t.size / 2 - DEGREE) / (PIECES * (end - begin))
        raise InputError(f"{highest:g} Hz received; must be at most {most:.3g} Hz, a fifth of the rows of a second")
    knots = np.linspace(begin, end, pieces + 1, dtype=np.float64)
    knots = np.concatenate([[begin] * DEGREE, knots, [end] * DEGREE])
    rows = (np.ascontiguousarray(one) for one in (t, values))
    result = scipy.interpolate.PPoly.from_spline(scipy.interpolate.make_lsq_spline(*rows, knots, k=DEGREE))
    inside = slice(DEGREE, -DEGREE)  # the first and last knots are multiple
    return scipy.interpolate.PPoly(result.c[:, inside], result.x[inside])
