"""A gauge's record: surface elevation against time at one place, measured or computed; how tables name its place."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class GaugeSeries:
    """Elevation at one gauge.

    Attributes
    ----------
    name
        What the gauge is called, e.g. ``"5"``.
    x
        Distance from the paddle's rest position [m].
    t
        Times [s], ascending, shape (N,).
    eta
        Elevation above still water [m], shape (N,).
    source
        Where the record comes from, for legends: ``"measured"``, ``"computed"``, ``"Gagarina et al. 2014"``.
    y
        Distance across the tank [m].
    """

    name: str
    x: float
    t: NDArray[np.float64]
    eta: NDArray[np.float64]
    source: str
    y: float = 0.0


def column(name: str, x: float, y: float = 0.0) -> str:
    """Return how the header of the gauges' table names one."""
    place = {"x": x, "y": y} if y else {"x": x}
    return f"{name}@" + ",".join(f"{axis}={np.format_float_positional(at, trim='-')}" for axis, at in place.items())


def place(column: str) -> tuple[str, float, float]:
    """Return name, x and y [m] of a gauge from its column; raises ``ValueError`` if it tells none."""
    name, told, place = column.rpartition("@x=")
    if not told:
        raise ValueError(f"{column!r} tells no place")
    x, _, y = place.partition(",y=")
    return name, float(x), float(y or 0.0)
