"""Reads gridded beds from NetCDF, by CF's conventions, or CSV."""

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from wavetank.beds.gridded import Gridded, Interpolation
from wavetank.errors import InputError

if TYPE_CHECKING:  # half a second to import, which few cases need
    from xarray import DataArray, Dataset

Positive = Literal["down", "up"]
SIGN: dict[str, float] = {"down": 1.0, "up": -1.0}  # of a depth
METRES = ("m", "metre", "metres", "meter", "meters")


def read_grid(
    path: Path,
    *,
    variable: str | None = None,
    interpolation: Interpolation = "cubic",
    positive: Positive | None = None,
) -> Gridded:
    """Return the bed of a file of gridded data, in metres.

    Parameters
    ----------
    path
        NetCDF (``.nc``) with coordinates x, or x and y, in any order; or CSV (``.csv``) that opens with a line of
        names: x, or x and y, and the depths' own; its rows come in any order.
    variable
        The depths' name; needed where a file has several variables.
    interpolation
        That of ``Gridded``.
    positive
        ``"down"`` if these are depths, ``"up"`` if they are elevations of the bed above still water; by default what
        the variable's attribute ``positive`` says, or ``"down"``.

    Raises ``InputError`` that names the file if it cannot be used.
    """
    data = _variable(_opened(path), variable, path)
    names = _axes(data, path)
    sign = SIGN[_positive(data, path) if positive is None else positive]
    data = data.sortby(names).transpose(*names)
    axes = {name: np.asarray(data[name], dtype=np.float64) for name in names}
    return Gridded(axes, sign * np.asarray(data, dtype=np.float64), interpolation=interpolation, source=str(path))


# ---------------------------------------------------------------- files
def _opened(path: Path) -> "Dataset":
    if path.suffix not in READERS:
        raise InputError(f"{path}: must end in {' or '.join(READERS)}, which is how gridded data are known.")
    try:
        return READERS[path.suffix](path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error).removesuffix(".")
        raise InputError(f"{path}: cannot be read ({reason}).") from None


def _netcdf(path: Path) -> "Dataset":
    import xarray

    with xarray.open_dataset(path, engine="netcdf4", decode_times=False) as dataset:
        return dataset.load()


def _csv(path: Path) -> "Dataset":
    """Return the columns on the grid that x, or x and y, span; values are missing where there is no row for them."""
    import pandas
    import xarray

    table = pandas.read_csv(path, comment="#", skipinitialspace=True, dtype=np.float64)
    names = [name for name in ("x", "y") if name in table]
    if not names:
        raise ValueError(f"it needs a column x, or x and y; it has: {', '.join(table)}")
    if table.duplicated(names).any():
        raise ValueError(f"two rows have the same {' and '.join(names)}")
    return xarray.Dataset.from_dataframe(table.set_index(names))


READERS = {".nc": _netcdf, ".csv": _csv}


# ---------------------------------------------------------------- what is in them
def _variable(dataset: "Dataset", variable: str | None, path: Path) -> "DataArray":
    names = [str(name) for name in dataset.data_vars]
    wanted = names if variable is None else [variable]
    if len(wanted) != 1:
        raise InputError(f"{path}: one variable must be named, of: {', '.join(names) or 'none'}.")
    if wanted[0] not in names:
        raise InputError(f"{path}: has no variable {wanted[0]!r}; it has: {', '.join(names) or 'none'}.")
    return dataset[wanted[0]]


def _axes(data: "DataArray", path: Path) -> list[str]:
    """Return the names of the variable's coordinates, which must be in metres, as it must be itself."""
    names = sorted(str(name) for name in data.dims)
    if names not in (["x"], ["x", "y"]) or not all(name in data.coords for name in names):
        received = ", ".join(names) or "none"
        raise InputError(f"{path}: coordinates of {data.name!r} must be x, or x and y; they are: {received}.")
    for part in (data, *(data[name] for name in names)):
        if (units := part.attrs.get("units", "m")) not in METRES:
            raise InputError(f"{path}: {part.name!r} is in {units!r}; must be in metres, 'm'.")
    return names


def _positive(data: "DataArray", path: Path) -> str:
    positive = str(data.attrs.get("positive", "down"))
    if positive not in SIGN:
        raise InputError(f"{path}: {data.name!r} is positive {positive!r}; must be positive 'down' or 'up'.")
    return positive
