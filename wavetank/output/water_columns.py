"""Recorded columns of water, interpolated to times and heights of another program."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wavetank.base.errors import InputError
from wavetank.output.directory import RunDirectory

if TYPE_CHECKING:
    import xarray

Array = NDArray[np.float64]

UNEVEN = 1e-6  # largest difference of two intervals of rows, relative to the interval
FEWEST = 4  # rows of a cubic spline


@dataclass(frozen=True)
class WaterColumns:
    """Flow in C columns of water at N equidistant times.

    Attributes
    ----------
    source
        Run directory and windows, for messages.
    begin
        Time in the run of the first row [s].
    dt
        Interval of the rows [s].
    x, y
        Positions of the columns [m], shape (C,).
    depth
        Still-water depth of each column [m], shape (C,).
    elevation
        Elevation [m], shape (N, C).
    zeta
        Relative heights of the L points of a column, 0 at the bed and 1 at the surface, shape (L,).
    density, gravity
        Of the water [kg/m³], of the case [m/s²].
    quantities
        Values at the points by the names of a window, shape (N, C, L).
    """

    source: str
    begin: float
    dt: float
    x: Array
    y: Array
    depth: Array
    elevation: Array
    zeta: Array
    density: float
    gravity: float
    quantities: dict[str, Array]

    @property
    def t(self) -> Array:
        """Times from the first row on [s], shape (N,)."""
        return np.arange(len(self.elevation), dtype=np.float64) * self.dt

    def values(self, name: str, zeta: Array) -> Array:
        """Return a quantity at relative heights, by a cubic spline.

        Parameters
        ----------
        name
            Name of the quantity; one that a table lacks, such as the y component of a slice, is zero.
        zeta
            Relative heights of K points, shape (K,), or of each time and column, shape (N, C, K).

        Returns
        -------
        array
            Shape (N, C, K).
        """
        zeta = np.broadcast_to(zeta, (*self.elevation.shape, zeta.shape[-1]))
        if name not in self.quantities:
            return np.zeros(zeta.shape)
        from scipy.interpolate import CubicSpline

        pieces = CubicSpline(self.zeta, self.quantities[name], axis=2).c  # powers, intervals, times, columns
        interval = np.clip(np.searchsorted(self.zeta, zeta, side="right") - 1, 0, len(self.zeta) - 2)
        time, column, _ = np.ogrid[tuple(slice(size) for size in zeta.shape)]
        offset = zeta - self.zeta[interval]
        result = np.zeros(zeta.shape)
        for power in pieces:
            result = result * offset + power[interval, time, column]
        return result


def water_columns(run: RunDirectory, windows: Sequence[str], every: float | None = None) -> WaterColumns:
    """Return the columns of windows of a run, in the order of the windows, with a row ``every`` so many seconds.

    The rows are those of the windows by default; others are interpolated by a cubic spline in time. Raises
    ``InputError`` for windows that are missing, have too few rows, or differ in their times or levels.
    """
    parts = [_window(run, name) for name in windows]
    source = f"{run.path}: window {', '.join(windows)}"
    first = parts[0]
    for name, part in zip(windows, parts, strict=True):
        if not (np.array_equal(part.time, first.time) and np.array_equal(part.zeta, first.zeta)):
            received = f"windows {windows[0]} and {name} differ in times or levels"
            raise InputError(f"{run.path}: {received}; begin, until, every and levels of [[windows]] must be equal.")
    data = first if len(parts) == 1 else _joined(parts)
    t = np.asarray(data.time.values, dtype=np.float64)
    if t.size < FEWEST:
        raise InputError(f"{source}: has {t.size} rows; at least {FEWEST} are needed.")
    dt, even = float((t[-1] - t[0]) / (t.size - 1)), _even(t)
    if every is not None and not 0.0 < every <= (t[-1] - t[0]) / (FEWEST - 1):
        longest = (t[-1] - t[0]) / (FEWEST - 1)
        allowed = f"above 0 and at most {longest:.4g} s: at least {FEWEST} rows are needed"
        raise InputError(f"--every {every:g} received; must be {allowed}.")
    names = [str(name) for name, one in data.data_vars.items() if one.dims == ("time", "column", "level")]
    quantities = {name: np.asarray(data[name].values, dtype=np.float64) for name in names}
    elevation = np.asarray(data.elevation.values, dtype=np.float64)
    depth = -np.asarray(data.z.values[0, :, 0], dtype=np.float64)
    quantities.pop("z", None)
    if every is not None or not even:
        from scipy.interpolate import CubicSpline

        dt = dt if every is None else every
        times = t[0] + dt * np.arange(int((t[-1] - t[0]) / dt * (1.0 + 1e-12)) + 1)
        elevation = CubicSpline(t, elevation)(times)
        quantities = {name: CubicSpline(t, values)(times) for name, values in quantities.items()}
    x, y, zeta = (np.asarray(data[name].values, dtype=np.float64) for name in ("x", "y", "zeta"))
    density, gravity = (_property(run, name) for name in ("density", "gravity"))
    return WaterColumns(
        source=source,
        begin=float(t[0]),
        dt=dt,
        x=x,
        y=y,
        depth=depth,
        elevation=elevation,
        zeta=zeta,
        density=density,
        gravity=gravity,
        quantities=quantities,
    )


def _window(run: RunDirectory, name: str) -> "xarray.Dataset":
    """Return a window; raise ``InputError`` for a data set of another kind."""
    data = run.window(name)
    if lacking := [one for one in ("time", "x", "y", "zeta", "elevation", "z", "velocity_x") if one not in data]:
        raise InputError(f"{run.path}: window {name} has no {lacking[0]}; a record of [[windows]] is needed.")
    return data


def _property(run: RunDirectory, name: str) -> float:
    """Return a number of the tank of a run."""
    try:
        return float(run.manifest["case"]["tank"][name])
    except (KeyError, TypeError, ValueError):
        raise InputError(f"{run.path}: its manifest has no {name} of the tank.") from None


def _joined(parts: Sequence["xarray.Dataset"]) -> "xarray.Dataset":
    from xarray import concat

    return concat(parts, "column", data_vars="minimal", coords="minimal", compat="override", join="override")


def _even(t: Array) -> bool:
    """Return whether times have equal intervals."""
    intervals = np.diff(t)
    return bool(np.ptp(intervals) <= UNEVEN * intervals.mean())
