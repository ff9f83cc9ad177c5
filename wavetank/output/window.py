"""What columns of water do, for other programs: a CF-NetCDF file, or a table with a row for each point at each time.

window-NAME.nc    over time [s], column and level: z [m], elevation [m], velocity [m/s], accelerations [m/s²] and
pressure [Pa]; columns at x and y [m], levels by their height zeta over the column's, 0 to 1
window-NAME.csv   t, x, y (of a basin), z, elevation, velocity, pressure
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wavetank.output.growing import TableWriter
from wavetank.output.growing_netcdf import GrowingNetCDF
from wavetank.output.netcdf import ACROSS, ALONG, ELEVATION, TIME, UPWARDS, Variable
from wavetank.output.probe_table import quantities

Array = NDArray[np.float64]
STANDARD = {  # names of the CF conventions, where there is one
    "velocity_x": "sea_water_x_velocity",
    "velocity_y": "sea_water_y_velocity",
    "velocity_z": "upward_sea_water_velocity",
    "pressure": "sea_water_pressure_due_to_sea_water",
}
ZETA = {"long_name": "height above the bed over that of the surface", "units": "1"}
AXES = {"x": ALONG, "y": ACROSS}
TABLED = "velocity", "pressure"  # what the table has of the quantities


def file_of(name: str, form: str) -> str:
    """Return what the file of a window is called, ``form`` being netcdf or csv."""
    return f"window-{name}.{'nc' if form == 'netcdf' else form}"


class WindowFile(GrowingNetCDF):
    """The motion of columns as NetCDF.

    Parameters
    ----------
    places
        (x, y) of each column [m], shape (columns, 2).
    levels
        Points in each.
    dimensions
        Of the tank, horizontally.
    """

    def __init__(self, path: Path, attributes: Mapping[str, str], *, places: Array, levels: int, dimensions: int):
        super().__init__(path, attributes)
        self._places, self._levels, self._told = places, levels, quantities(dimensions)

    def append(self, t: float, z: Array, eta: Array, moved: Array) -> None:
        """Append a record: see ``observers.windows.WindowRecord``; raises as ``append_records``."""
        row = np.concatenate([[t], eta, z.ravel(), moved.ravel()])
        self.append_records(row[None], lambda: self._first(t, z, eta, moved))

    def _first(self, t: float, z: Array, eta: Array, moved: Array) -> dict[str, Variable]:
        each, zeta = ("time", "column", "level"), np.linspace(0.0, 1.0, self._levels)
        of_points = {
            name: Variable(each, values[None], _said(name, units, told))
            for (name, (units, told)), values in zip(self._told.items(), moved, strict=True)
        }
        return {
            "time": Variable(("time",), np.array([t]), TIME),
            "x": Variable(("column",), self._places[:, 0], ALONG),
            "y": Variable(("column",), self._places[:, 1], ACROSS),
            "zeta": Variable(("level",), zeta, ZETA),
            "elevation": Variable(each[:2], eta[None], ELEVATION | {"coordinates": "x y"}),
            "z": Variable(each, z[None], UPWARDS),
            **of_points,
        }


def tabled(header: Sequence[str], rows: Array) -> dict[str, Variable]:
    """Return the variables of a window's table, of times that are whole, by its columns' names."""
    names = [one.partition(" [")[0] for one in header]
    at = [n for n, name in enumerate(names) if name in ("x", "y")]
    time, many = np.unique(rows[:, 0], return_counts=True)
    each = int(many[0]) if many.size else 1
    columns = len(np.unique(rows[:each, at], axis=0)) if many.size else 1
    whole = time[many == each]
    values = rows[: whole.size * each].reshape(whole.size, columns, -1, len(names))
    told, of_points, of_columns = quantities(2), ("time", "column", "level"), ("time", "column")
    found = {
        "time": Variable(("time",), whole, TIME),
        "zeta": Variable(("level",), np.linspace(0.0, 1.0, values.shape[2]), ZETA),
    }
    for n, name in enumerate(names[1:], start=1):
        if name in AXES:
            found[name] = Variable(("column",), values[0, :, 0, n] if whole.size else np.zeros(columns), AXES[name])
        elif name == "elevation":
            found[name] = Variable(of_columns, values[:, :, 0, n], ELEVATION)
        else:
            said = UPWARDS if name == "z" else _said(name, *told[name])
            found[name] = Variable(of_points, values[..., n], said)
    return {"y": Variable(("column",), np.zeros(columns), ACROSS)} | found


def _said(name: str, units: str, told: str) -> dict[str, str]:
    said = {"units": units, "long_name": told, "coordinates": "x y z"}
    return said | ({"standard_name": STANDARD[name]} if name in STANDARD else {})


class WindowTable(TableWriter):
    """The motion of columns as a table, row by row: columns one after another, each from the bed to the surface."""

    def __init__(self, path: Path, *, places: Array, dimensions: int):
        told = quantities(dimensions)
        self._tabled = [n for n, name in enumerate(told) if name.startswith(TABLED)]
        shown = [f"{name} [{units}]" for name, (units, _) in told.items() if name.startswith(TABLED)]
        self._places = places[:, :dimensions]
        at = ["x [m]", "y [m]"][:dimensions]
        super().__init__(path, ["t [s]", *at, "z [m]", "elevation [m]", *shown])

    def append_columns(self, t: float, z: Array, eta: Array, moved: Array) -> None:
        """Append rows: see ``observers.windows.WindowRecord``; raises as ``extend``."""
        self.extend(
            [
                [t, *place, height, top, *moved[self._tabled, column, level]]
                for column, (place, top) in enumerate(zip(self._places, eta, strict=True))
                for level, height in enumerate(z[column])
            ]
        )
