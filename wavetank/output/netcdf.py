"""NetCDF in the classic 64-bit format, which every NetCDF library reads, by the CF conventions 1.8."""

import shlex
from collections.abc import Iterable, Mapping
from io import BytesIO
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

NUMBER = np.dtype(">f8")  # the format's
COUNT = slice(4, 8)  # bytes of the header: the number of records
ELEVATION = {
    "standard_name": "sea_surface_height_above_mean_sea_level",
    "long_name": "elevation of the surface above still water",
    "units": "m",
}
TIME = {"long_name": "time since the start", "units": "s", "axis": "T"}  # no date to count from: not CF's ``time``
ALONG = {"long_name": "distance along the tank from the paddle at rest", "units": "m", "axis": "X"}
ACROSS = {"long_name": "distance across the tank", "units": "m", "axis": "Y"}
UPWARDS = {"long_name": "height above still water", "units": "m", "axis": "Z", "positive": "up"}


class Variable(NamedTuple):
    """A variable of a file: the names of its dimensions, its values, and what is said of it."""

    dimensions: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, str | np.float64]


def conventions(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Return what CF says of a run's file: title, source, history and conventions."""
    version = manifest.get("versions", {}).get("wavetank", "unknown")
    return {
        "title": str(manifest.get("scene", {}).get("title", "")),
        "source": f"wavetank {version}, revision {manifest.get('git') or 'unknown'}",
        "history": f"{manifest.get('started', '')} {shlex.join(manifest.get('command', []))}".strip(),
        "Conventions": "CF-1.8",
    }


def netcdf(variables: Mapping[str, Variable], attributes: Mapping[str, str], *, growing: str = "") -> bytes:
    """Return a file of variables; the dimension ``growing`` is the unlimited one, in which records can be added.

    Text is characters in UTF-8, along a dimension of its own. Raises ``ValueError`` for a length of zero: the format
    takes that for unlimited.
    """
    from scipy.io import netcdf_file

    content = BytesIO()
    with netcdf_file(content, "w", version=2) as file:
        _tell(file, attributes)
        for name, (dimensions, values, said) in variables.items():
            if values.dtype.kind == "U":
                encoded = np.char.encode(values, "utf-8")
                values = encoded.view("S1").reshape(*values.shape, encoded.itemsize)
                dimensions, said = (*dimensions, f"{name}_length"), {**said, "_Encoding": "utf-8"}
            for dimension, length in zip(dimensions, values.shape, strict=True):
                if dimension not in file.dimensions:
                    if not length:
                        raise ValueError(f"{name}: has no {dimension}")
                    file.createDimension(dimension, None if dimension == growing else length)
            variable = file.createVariable(name, values.dtype, dimensions)
            variable[:] = values
            _tell(variable, said)
        file.flush()
        return content.getvalue()


def write_records(file: BinaryIO, blocks: Iterable[Mapping[str, Variable]], attributes: Mapping[str, str]) -> None:
    """Write a file of variables whose times come in blocks; the memory needed is that of one block.

    Parameters
    ----------
    file
        Where it is written, from the first byte.
    blocks
        One or more, each with all variables. Those over ``time``, which is their first and an unlimited dimension, have
        rows that follow those of the block before; the others are those of the first block.
    attributes
        Of the file.
    """
    count = 0
    for block in blocks:
        records = [one.values for one in block.values() if "time" in one.dimensions]
        rows = np.column_stack([values.reshape(len(values), -1) for values in records]).astype(NUMBER)
        if not count:
            one_time = {
                name: one._replace(values=one.values[:1]) if "time" in one.dimensions else one
                for name, one in block.items()
            }
            file.write(netcdf(one_time, attributes, growing="time")[: -rows[0].nbytes])
        file.write(rows.tobytes())
        count += len(rows)
    file.seek(COUNT.start)
    file.write(count.to_bytes(4, "big"))


def _tell(named: Any, attributes: Mapping[str, str | np.float64]) -> None:
    """Give a file, or a variable of one, its attributes."""
    for name, value in attributes.items():
        setattr(named, name, value.encode() if isinstance(value, str) else value)
