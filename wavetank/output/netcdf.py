"""NetCDF in the classic 64-bit format, which all NetCDF libraries read, by the CF conventions 1.8.

Records can be appended to a file. The number of records is in four bytes of the header, which are rewritten after each;
incomplete records are not counted. The netCDF library itself can neither truncate a file to the records of a checkpoint
nor remove a record that a full disk has truncated. Its files can end in padding (4096 bytes instead of 1044), after
which no record can be appended.
"""

import shlex
from bisect import bisect_left
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from wavetank.output.columns import Variable
from wavetank.output.tables import AppendFile, Extent

NUMBER = np.dtype(">f8")  # the format's
COUNT = slice(4, 8)  # bytes of the header: the number of records


def conventions(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Return the global attributes of a run's file by CF: title, source, history and conventions."""
    version = manifest.get("versions", {}).get("wavetank", "unknown")
    return {
        "title": str(manifest.get("case", {}).get("title", "")),
        "source": f"wavetank {version}, revision {manifest.get('git') or 'unknown'}",
        "history": f"{manifest.get('started', '')} {shlex.join(manifest.get('command', []))}".strip(),
        "Conventions": "CF-1.8",
    }


def netcdf(variables: Mapping[str, Variable], attributes: Mapping[str, str], *, unlimited: str = "") -> bytes:
    """Return a file of variables; records can be appended in the ``unlimited`` dimension.

    Text is characters in UTF-8, along a separate dimension. Raises ``ValueError`` for a length of zero, which means
    unlimited in this format.
    """
    from scipy.io import netcdf_file

    content = BytesIO()
    with netcdf_file(content, "w", version=2) as file:
        _set_attributes(file, attributes)
        for name, (dimensions, values, details) in variables.items():
            if values.dtype.kind == "U":
                encoded = np.char.encode(values, "utf-8")
                values = encoded.view("S1").reshape(*values.shape, encoded.itemsize)
                dimensions, details = (*dimensions, f"{name}_length"), {**details, "_Encoding": "utf-8"}
            for dimension, length in zip(dimensions, values.shape, strict=True):
                if dimension not in file.dimensions:
                    if not length:
                        raise ValueError(f"{name}: has no {dimension}")
                    file.createDimension(dimension, None if dimension == unlimited else length)
            variable = file.createVariable(name, values.dtype, dimensions)
            variable[:] = values
            _set_attributes(variable, details)
        file.flush()
        return content.getvalue()


def write_records(file: BinaryIO, blocks: Iterable[Mapping[str, Variable]], attributes: Mapping[str, str]) -> int:
    """Write a file of variables with times in blocks; return the number of times. The memory is that of one block.

    Parameters
    ----------
    file
        Output file, written from the first byte.
    blocks
        Blocks with all variables. Variables over ``time``, their first and an unlimited dimension, have the rows that
        follow those of the block before; the others are those of the first block.
    attributes
        Attributes of the file.
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
            file.write(netcdf(one_time, attributes, unlimited="time")[: -rows[0].nbytes])
        file.write(rows.tobytes())
        count += len(rows)
    if count:
        file.seek(COUNT.start)
        file.write(count.to_bytes(4, "big"))
    return count


def _set_attributes(named: Any, attributes: Mapping[str, str | np.float64]) -> None:
    """Set the attributes of a file or variable."""
    for name, value in attributes.items():
        setattr(named, name, value.encode() if isinstance(value, str) else value)


MAGIC = b"CDF\x02"  # first bytes of the header


class AppendNetCDF(AppendFile):
    """A NetCDF file to which records of equal length are appended.

    Parameters
    ----------
    attributes
        Global attributes, such as the title.
    layout
        Returns the variables of the first record, in the order of its numbers, time first.
    """

    def __init__(
        self, path: Path, attributes: Mapping[str, str], layout: Callable[[NDArray[np.float64]], dict[str, Variable]]
    ):
        import scipy.io  # noqa: F401  # 0.13 CPU s, which would count as the cost of the first steps

        super().__init__(path)
        self._attributes, self._layout = attributes, layout
        self._records = self._begin = 0

    def open(self) -> None:
        """Create the file, or open it to append; raises ``RecordError``."""
        super().open()
        self._write_count()

    def extent(self) -> Extent:
        """Return the size, the number of records and the offset of the first."""
        return super().extent() | {"_records": self._records, "_begin": self._begin}

    def resume_at(self, extent: Extent) -> None:
        """Truncate the file to a size when it is opened, and append there."""
        super().resume_at(extent)
        self._records, self._begin = extent["_records"], extent["_begin"]

    def _write_rows(self, rows: NDArray[Any]) -> None:
        content = memoryview(rows.astype(NUMBER).ravel().view(np.uint8))
        if not self._records and len(rows):
            head, each = netcdf(self._layout(rows[0]), self._attributes, unlimited="time"), len(content) // len(rows)
            self._begin, content = len(head) - each, memoryview(head + content[each:])
        elif len(rows) and len(content) // len(rows) != (length := (self._size - self._begin) // self._records):
            received, length = rows.shape[1], length // NUMBER.itemsize
            raise ValueError(f"{self._path.name}: {received} values received; it has {length} in a record.")
        self.write(content)
        self._records += len(rows)
        self._write_count()

    def _write_count(self) -> None:
        """Write the number of records into the header."""
        if self._size:
            self.write(self._records.to_bytes(4, "big"), at=COUNT.start)


def complete_records(content: bytes) -> bytes:
    """Return the file with its complete records; empty if there are none.

    Raises ``ValueError`` for a content that is not NetCDF of this format.
    """
    if content[: len(MAGIC)] != MAGIC[: len(content)]:
        raise ValueError("is no NetCDF in the classic 64-bit format")
    claimed = int.from_bytes(content[COUNT], "big")
    if claimed and _complete(content):
        return content
    complete = bisect_left(range(claimed + 1), True, lo=1, key=lambda n: not _complete(_with_count(content, n))) - 1
    return _with_count(content, complete) if complete else b""


def _with_count(content: bytes, number: int) -> bytes:
    """Return a file whose header has this number of records."""
    return content[: COUNT.start] + number.to_bytes(4, "big") + content[COUNT.stop :]


def _complete(content: bytes) -> bool:
    """Return whether a file has all the data that its header declares."""
    from scipy.io import netcdf_file

    with suppress(Exception), netcdf_file(BytesIO(content), mmap=False) as file:  # a truncated header is arbitrary
        return all(np.size(variable.data) for variable in file.variables.values())
    return False
