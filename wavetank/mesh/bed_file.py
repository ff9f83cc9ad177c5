"""Reads measured beds: NetCDF, by CF's conventions, CSV and XYZ; on a grid or as survey points."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from wavetank.errors import InputError
from wavetank.mesh.gridded import Gridded, Interpolation
from wavetank.mesh.survey import Survey
from wavetank.values.files import regular
from wavetank.values.formula import Array

if TYPE_CHECKING:  # half a second to import, which few cases need
    from pandas import DataFrame
    from xarray import DataArray, Dataset

Positive = Literal["down", "up"]
SIGN: dict[str, float] = {"down": 1.0, "up": -1.0}  # of a depth
OTHER = {"down": "up", "up": "down"}
METRES = ("m", "metre", "metres", "meter", "meters")
XYZ = ["x", "y", "depth"]
SURVEYS = 2e9  # bytes of a file
FILLED = 0.5  # of a grid, at least; what leaves more of it empty is survey points


class Measured(NamedTuple):
    """What a file holds: places by the names of their coordinates, values there, and whether down is positive."""

    places: dict[str, Array]
    values: Array
    gridded: bool
    positive: str


def read_bed(
    path: Path,
    *,
    variable: str | None = None,
    interpolation: Interpolation = "cubic",
    positive: Positive | None = None,
) -> Gridded | Survey:
    """Return the bed of a file of depths, in metres.

    Parameters
    ----------
    path
        NetCDF (``.nc``) with coordinates x, or x and y, in any order; CSV (``.csv``) that opens with a line of names:
        x, or x and y, and the depths' own; or XYZ (``.xyz``): x, y and depth in each row, and nothing else. Rows come
        in any order. Those that do not fill half of a grid are survey points, which are triangulated.
    variable
        The depths' name; needed where a file has several variables.
    interpolation
        That of ``Gridded`` or ``Survey``.
    positive
        ``"down"`` if these are depths, ``"up"`` if they are elevations of the bed above still water; by default what
        the variable's attribute ``positive`` says, or ``"down"``.

    Raises ``InputError`` that names the file if it cannot be used.
    """
    if path.suffix not in READERS:
        raise InputError(
            f"{path}: must end in {', '.join(READERS)}, which is how measured beds are known; "
            "gdal_translate -of XYZ makes one of a raster."
        )
    try:
        found = READERS[path.suffix](regular(path, largest=SURVEYS), variable)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error).strip().removesuffix(".")
        raise InputError(f"{path}: cannot be read ({reason}).") from None
    down = found.positive if positive is None else positive
    d = SIGN[down] * found.values
    if np.isfinite(d).any() and not (d > 0).any():
        raise InputError(f"{path}: no depth is positive; with positive = '{OTHER[down]}' all are.")
    if found.gridded:
        return Gridded(found.places, d, interpolation=interpolation, source=str(path))
    return Survey(found.places["x"], found.places["y"], d, interpolation=interpolation, source=str(path))


# ---------------------------------------------------------------- NetCDF
def _netcdf(path: Path, variable: str | None) -> Measured:
    import xarray

    with xarray.open_dataset(path, engine="netcdf4", decode_times=False) as dataset:
        data = _variable(dataset.load(), variable, path)
    names = _axes(data, path)
    data = data.sortby(names).transpose(*names)
    axes = {name: np.asarray(data[name], dtype=np.float64) for name in names}
    return Measured(axes, np.asarray(data, dtype=np.float64), gridded=True, positive=_positive(data, path))


def _variable(dataset: "Dataset", variable: str | None, path: Path) -> "DataArray":
    return dataset[_chosen([str(name) for name in dataset.data_vars], variable, path)]


def _axes(data: "DataArray", path: Path) -> list[str]:
    """Return the names of the variable's coordinates, which must be in metres, as it must be itself."""
    names = sorted(str(name) for name in data.dims)
    if names not in (["x"], ["x", "y"]) or not all(name in data.coords for name in names):
        received = ", ".join(names) or "none"
        how = "survey points go into a file of CSV or XYZ"
        raise InputError(f"{path}: coordinates of {data.name!r} must be x, or x and y; they are: {received}; {how}.")
    for part in (data, *(data[name] for name in names)):
        if (units := part.attrs.get("units", "m")) not in METRES:
            raise InputError(f"{path}: {part.name!r} is in {units!r}; must be in metres, 'm'.")
    return names


def _positive(data: "DataArray", path: Path) -> str:
    positive = str(data.attrs.get("positive", "down"))
    if positive not in SIGN:
        raise InputError(f"{path}: {data.name!r} is positive {positive!r}; must be positive 'down' or 'up'.")
    return positive


# ---------------------------------------------------------------- tables
def _csv(path: Path, variable: str | None) -> Measured:
    import pandas

    return _table(pandas.read_csv(path, comment="#", skipinitialspace=True, dtype=np.float64), variable, path)


def _xyz(path: Path, variable: str | None) -> Measured:
    import pandas

    table = pandas.read_csv(path, comment="#", sep=r"\s+", header=None, dtype=np.float64)
    if len(table.columns) != len(XYZ):
        raise ValueError(
            f"its rows must be x, y and depth, with blanks between; they have {len(table.columns)} columns"
        )
    return _table(table.set_axis(XYZ, axis=1), variable, path)


def _table(table: "DataFrame", variable: str | None, path: Path) -> Measured:
    """Return what columns hold; values are missing where a grid has no row for them."""
    names = [name for name in ("x", "y") if name in table]
    if "x" not in names:
        named = "its first line must name its columns, e.g. x,y,depth"
        raise ValueError(f"it needs a column x, or x and y; it has: {', '.join(map(str, table))}; {named}")
    values = table[_chosen([name for name in table if name not in names], variable, path)].to_numpy()
    places = {name: table[name].to_numpy() for name in names}
    axes, indices = zip(*(np.unique(place, return_inverse=True) for place in places.values()), strict=True)
    if names == ["x", "y"] and len(table) < FILLED * axes[0].size * axes[1].size:
        return Measured(places, values, gridded=False, positive="down")
    if table.duplicated(names).any():
        raise ValueError(f"two rows have the same {' and '.join(names)}")
    grid = np.full([axis.size for axis in axes], np.nan)
    grid[indices] = values
    return Measured(dict(zip(names, axes, strict=True)), grid, gridded=True, positive="down")


READERS = {".nc": _netcdf, ".csv": _csv, ".xyz": _xyz}


def _chosen(names: list[str], variable: str | None, path: Path) -> str:
    """Return the name of the variable that is meant."""
    wanted = names if variable is None else [variable]
    if len(wanted) != 1:
        raise InputError(f"{path}: one variable must be named, of: {', '.join(names) or 'none'}.")
    if wanted[0] not in names:
        raise InputError(f"{path}: has no variable {wanted[0]!r}; it has: {', '.join(names) or 'none'}.")
    return wanted[0]
