"""CF-NetCDF files that grow by records, each at a time: what is cut is not counted, what grows can be read.

How many records there are stands in four bytes of the NetCDF header, which are rewritten after each.
"""

from bisect import bisect_left
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wavetank.output.growing import GrowingFile
from wavetank.output.netcdf import COUNT, NUMBER, Variable, netcdf
from wavetank.stateful import Held

MAGIC = b"CDF\x02"  # the first bytes of the header
STANDS = "_records", "_begin"  # what tells where a record is


class GrowingNetCDF(GrowingFile):
    """A file of records, all of one length.

    Parameters
    ----------
    attributes
        What is said of the file, title and the like.
    """

    def __init__(self, path: Path, attributes: Mapping[str, str]):
        super().__init__(path)
        self._attributes = attributes
        self._records = self._begin = 0

    def open(self) -> None:
        """Make the file, or go on with it; raises ``RecordError``."""
        super().open()
        self._tell()

    def held(self) -> Held:
        """Return how far it has grown, and where its records stand."""
        return super().held() | {name: getattr(self, name) for name in STANDS}

    def take(self, held: Held) -> None:
        """Go on from there, once it is opened."""
        super().take(held)
        for name in STANDS:
            setattr(self, name, held[name])

    def append_records(self, rows: NDArray[np.float64], first: Callable[[], dict[str, Variable]]) -> None:
        """Append records, (K, numbers) in the order of the variables, time first; ``first`` are those of the first one.

        Raises ``RunError`` for a number that is not finite, before anything of its record is written, but those before;
        and for a file that cannot be written, which has none of them then.
        """
        whole = rows if np.isfinite(np.vdot(rows, rows)) else _before_others(rows)
        content = memoryview(whole.astype(NUMBER).ravel().view(np.uint8))
        if not self._records and len(whole):
            head, each = netcdf(first(), self._attributes, growing="time"), len(content) // len(whole)
            self._begin, content = len(head) - each, memoryview(head + content[each:])
        self.write(content)
        self._records += len(whole)
        self._tell()
        if len(whole) < len(rows):
            self._check(rows[len(whole)])

    def _tell(self) -> None:
        """Write into the header how many records there are."""
        if self._size:
            self.write(self._records.to_bytes(4, "big"), at=COUNT.start)


def _before_others(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rows before the first with a number that is not finite, if there is one."""
    finite = np.isfinite(rows).all(axis=1)
    return rows if finite.all() else rows[: finite.argmin()]


def whole(content: bytes) -> bytes:
    """Return the file with as many records as are complete in it; empty where there are none.

    Raises ``ValueError`` for what is no NetCDF of this format.
    """
    if content[: len(MAGIC)] != MAGIC[: len(content)]:
        raise ValueError("is no NetCDF in the classic 64-bit format")
    claimed = int.from_bytes(content[COUNT], "big")
    if claimed and _complete(content):
        return content
    complete = bisect_left(range(claimed + 1), True, lo=1, key=lambda n: not _complete(_counted(content, n))) - 1
    return _counted(content, complete) if complete else b""


def _counted(content: bytes, number: int) -> bytes:
    """Return a file whose header tells this number of records."""
    return content[: COUNT.start] + number.to_bytes(4, "big") + content[COUNT.stop :]


def _complete(content: bytes) -> bool:
    """Return whether a file holds all that its header tells."""
    from scipy.io import netcdf_file

    with suppress(Exception), netcdf_file(BytesIO(content), mmap=False) as file:  # a header that is cut says anything
        return all(np.size(variable.data) for variable in file.variables.values())
    return False
