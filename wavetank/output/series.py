"""A gauge's record: surface elevation against time at one place, measured or computed; how tables name its place."""

from collections.abc import Mapping
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
    return named_place(name, {"x": x, "y": y} if y else {"x": x})


def place(column: str) -> tuple[str, float, float]:
    """Return name, x and y [m] of a gauge from its column; raises ``ValueError`` if it tells none."""
    name, at = place_named(column)
    return name, at["x"], at.get("y", 0.0)


def named_place(name: str, place: Mapping[str, float]) -> str:
    """Return a name with its place [m], axis by axis from x on, as ``5@x=50;y=2``: without a table's comma."""
    return f"{name}@" + ";".join(f"{axis}={np.format_float_positional(at, trim='-')}" for axis, at in place.items())


def place_named(told: str) -> tuple[str, dict[str, float]]:
    """Return name and place [m] by axis of what ``named_place`` tells, or told once, with commas.

    Raises ``ValueError`` for anything else.
    """
    name, found, place = told.rpartition("@x=")
    if not found:
        raise ValueError(f"{told!r} tells no place")
    axes = (part.partition("=") for part in f"x={place}".replace(",", ";").split(";"))
    return name, {axis: float(at) for axis, _, at in axes}
