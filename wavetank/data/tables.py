"""Tables of gauges: text files of columns, and the windows and gauges of a run, in text and NetCDF.

The columns of water of a window are gauges with the names 1, 2, ...
"""

from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from wavetank.base.columns import ColumnTable, Header, read_columns, read_header
from wavetank.base.errors import InputError
from wavetank.base.files import regular
from wavetank.output.columns import Variable, gauge_columns, window_variables

LARGEST = 10**11  # bytes of a NetCDF file, of which only the elevation is read
NETCDF, NETCDF_4 = b"CDF", b"\x89HDF"  # first bytes of a file
WINDOW = {"t [s]", "z [m]", "elevation [m]"}  # columns of the table of a window


def read_gauges(path: Path) -> ColumnTable:
    """Return the table of a file: the time, then the elevation at gauges.

    Raises ``InputError`` as ``read_columns``, and for a NetCDF file without elevations over time and place.
    """
    if not _is_netcdf(path) and not {*read_header(path).names} >= WINDOW:
        return read_columns(path)
    state = path.stat()
    return _recorded_table(path, (state.st_size, state.st_mtime_ns))


def gauges_header(path: Path) -> Header:
    """Return the header of the table of a file."""
    if _is_netcdf(path):
        return Header(1, read_gauges(path).names)
    header = read_header(path)
    return header._replace(names=read_gauges(path).names) if {*header.names} >= WINDOW else header


@lru_cache(maxsize=1)  # a file is read for its header, then for its values
def _recorded_table(path: Path, state: tuple[int, int]) -> ColumnTable:
    """Return the table of a NetCDF file, or of a window in a text file, of a size [bytes] and a time [ns]."""
    if _is_netcdf(path):
        return _netcdf_table(path)
    table = read_columns(path)
    return _window_table(window_variables(table.names, table.values))


def _is_netcdf(path: Path) -> bool:
    """Return whether a file is NetCDF; raise ``InputError`` for NetCDF-4."""
    first = b""
    with suppress(OSError), regular(path, largest=LARGEST).open("rb") as file:
        first = file.read(len(NETCDF_4))
    if first == NETCDF_4:
        raise InputError(f"{path}: is NetCDF-4; allowed is the classic format, to which `nccopy -k classic` converts.")
    return first.startswith(NETCDF)


def _netcdf_table(path: Path) -> ColumnTable:
    """Return the elevations of a NetCDF file."""
    from scipy.io import netcdf_file

    try:
        with netcdf_file(regular(path, largest=LARGEST), mmap=True) as file:
            variables = {name: _variable(file.variables[name]) for name in ("time", "x", "y", "elevation")}
            place = next(one for one in variables["elevation"].dimensions if one != "time")
            names = _names(file.variables[place][:]) if place in file.variables else ()
    except Exception as error:  # of any type for a damaged file
        needed = "a NetCDF file of gauges or of a window has elevation over time and place, x and y"
        raise InputError(f"{path}: cannot be read ({type(error).__name__}: {error}); {needed}.") from None
    if any(variables[axis].dimensions != (place,) for axis in "xy"):
        raise InputError(f"{path}: has no gauges; allowed are gauges.nc and window-NAME.nc of a run.")
    return _window_table(variables, names)


def _variable(variable: Any) -> Variable:
    """Return a variable of an open file."""
    return Variable(tuple(variable.dimensions), np.array(variable[:], dtype=np.float64), {})


def _names(characters: Any) -> tuple[str, ...]:
    """Return names of gauges from their characters, shape (gauges, length)."""
    return tuple(b"".join(row).decode().rstrip("\0 ") for row in characters)


def _window_table(variables: dict[str, Variable], names: tuple[str, ...] = ()) -> ColumnTable:
    """Return the table of the elevation, over time and place, of variables."""
    x, y = (variables[axis].values for axis in ("x", "y"))
    eta, t = variables["elevation"], variables["time"].values
    values = eta.values if eta.dimensions[0] == "time" else eta.values.T
    gauges = zip(names or map(str, range(1, len(x) + 1)), x.tolist(), y.tolist(), strict=True)
    return ColumnTable(tuple(gauge_columns([*gauges])), np.column_stack([t, values]), tuple(range(1, len(t) + 1)))
