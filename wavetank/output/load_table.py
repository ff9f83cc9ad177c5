"""What the table of loads says: its columns, forces and moments of each wall."""

from collections.abc import Sequence

FORCES = ("force_x", "force_y", "force_z")
MOMENTS = ("moment_x", "moment_y", "moment_z")


def quantities(dimensions: int) -> dict[str, str]:
    """Return the units of each quantity of a wall by its name; in a tank of one horizontal dimension per width."""
    if dimensions == 2:
        return dict.fromkeys(FORCES, "N") | dict.fromkeys(MOMENTS, "N m")
    return {"force_x": "N/m", "force_z": "N/m", "moment_y": "N m/m"}


def columns(names: Sequence[str], dimensions: int) -> list[str]:
    """Return the table's columns: all quantities of the first wall, such as ``force_x paddle [N/m]``, ..."""
    return ["t [s]", *(f"{one} {name} [{unit}]" for name in names for one, unit in quantities(dimensions).items())]


def wall(column: str) -> tuple[str, str, str]:
    """Return quantity, wall and units of a column."""
    told, _, units = column.removesuffix("]").rpartition(" [")
    quantity, _, name = told.partition(" ")
    return quantity, name, units
