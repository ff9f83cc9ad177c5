"""Banded matrices along a slice or ring, for compiled kernels (``chain.c``)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.fe.kernels import Kernel
from wavetank.fe.plane import Plane

CHAIN = """
typedef struct {
    int dofs, cut, groups;
    const int *row;
    REAL *L, *column, *reduced, *corner;
} Chain;
"""


def followed(plane: Plane) -> NDArray[np.intp]:
    """Return the degrees of freedom of one rank in the order in which they follow each other; a ring is cut."""
    return np.roll(np.argsort(plane.x, kind="stable"), -1 if _closed(plane) else 0)  # at a vertex


def chain(kernel: Kernel, plane: Plane, *, groups: int, abreast: int) -> Any:
    """Return a struct with room for matrices of an element's bandwidth, in groups of some that are treated at once."""
    cut = int(_closed(plane))
    rows, border = plane.size - cut, (groups, cut * (plane.size - cut), abreast)
    return kernel.struct(
        "Chain",
        {
            "dofs": plane.size,
            "cut": cut,
            "groups": groups,
            "row": np.argsort(followed(plane)),
            "L": np.zeros((groups, rows + plane.order, plane.order + 1, abreast)),
            "column": np.zeros(border),
            "reduced": np.zeros(border),
            "corner": np.zeros((groups, abreast)),
        },
    )


def _closed(plane: Plane) -> bool:
    return bool(plane.mesh.geometry.dim == 2)
