"""What the table of probes says: its columns, quantity by quantity at each point, and the points of these."""

from collections.abc import Sequence
from typing import NamedTuple

from wavetank.output.series import named_place, place_named

VECTORS = {  # with their units and what they are
    "velocity": ("m/s", "velocity of the water"),
    "local_acceleration": ("m/s^2", "rate of change of the velocity at the point"),
    "acceleration": ("m/s^2", "acceleration of the water that passes the point"),
}
PRESSURE = ("Pa", "pressure above that of the air, still water's included")


class Point(NamedTuple):
    """A probe: its name and place [m]."""

    name: str
    x: float
    y: float
    z: float


def quantities(dimensions: int) -> dict[str, tuple[str, str]]:
    """Return units and meaning of each quantity of a point by its name; vectors by their components.

    There is no component along y in a tank of one horizontal dimension.
    """
    axes = "xyz" if dimensions == 2 else "xz"
    each = ((axis, name, units, told) for name, (units, told) in VECTORS.items() for axis in axes)
    vectors = {f"{name}_{axis}": (units, f"{told}, along {axis}") for axis, name, units, told in each}
    return vectors | {"pressure": PRESSURE}


def columns(points: Sequence[tuple[str, float, float, float]], dimensions: int) -> list[str]:
    """Return the table's columns: all quantities of the first point, such as ``velocity_x A@x=2;z=-0.1 [m/s]``, ..."""
    told = quantities(dimensions)
    return ["t [s]", *(f"{name} {_told(Point(*point))} [{told[name][0]}]" for point in points for name in told)]


def _told(point: Point) -> str:
    place = {"x": point.x, "y": point.y, "z": point.z}
    return named_place(point.name, {axis: at for axis, at in place.items() if at or axis != "y"})


def point(column: str) -> tuple[str, Point]:
    """Return quantity and point of a column; raises ``ValueError`` if it tells none."""
    quantity, _, rest = column.rpartition(" [")[0].partition(" ")
    name, place = place_named(rest)
    return quantity, Point(name, place["x"], place.get("y", 0.0), place["z"])
