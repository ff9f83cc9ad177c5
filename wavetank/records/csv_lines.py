"""Numbers as text, compiled: objects of Python for them and JSON took two to three times as long, ``repr`` more."""

from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

DECLARATION = "long lines(long rows, long columns, const double *values, double *text);"
LEAST, MOST = -292, 324  # the powers of ten that doubles need
ROOM = 48  # for a number, what follows it, and what is put there at once [bytes]


def csv_lines(values: NDArray[np.float64]) -> bytes:
    """Return lines of numbers, (rows, columns), with as few digits as reading them back needs; nothing of nan."""
    values, text = np.ascontiguousarray(values), np.empty(values.size * ROOM // 8 + 1)
    at = _kernel().pointer
    length = _kernel().call.lines(*values.shape, at(values), at(text))
    return text.view(np.uint8)[:length].tobytes()


def _powers() -> str:
    """Return the powers of ten as the code has them."""
    found = list[str]()
    for k in range(LEAST, MOST + 1):
        shift = (k * 1741647 >> 19) - 127
        over, under = 10 ** max(k, 0) << max(-shift, 0), 10 ** max(-k, 0) << max(shift, 0)
        high, low = divmod(-(-over // under), 2**64)
        found.append(f"{{{high:#x}, {low:#x}}}")
    return ", ".join(found)


@cache
def _kernel() -> Any:
    """Return what is compiled, which whoever only reads records has no need of."""
    from mpi4py import MPI

    from wavetank.fe.kernels import EXACT, Kernel, defined

    code = files(__package__).joinpath("csv_lines.c").read_text(encoding="utf-8")

    def source() -> str:
        return defined({"LEAST": LEAST, "POWERS": _powers()}) + code

    return Kernel("csv_lines", DECLARATION, key=code, source=source, comm=MPI.COMM_SELF, flags=EXACT)
