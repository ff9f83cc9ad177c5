"""Banded matrices along a slice or ring, for compiled kernels (``matrices.c``)."""

import numpy as np
from numpy.typing import NDArray

from wavetank.fem.codegen import Instance, Struct
from wavetank.fem.plane import Plane


def followed(plane: Plane) -> NDArray[np.intp]:
    """Return the degrees of freedom of one rank in the order in which they follow each other; a ring is cut."""
    return np.roll(np.argsort(plane.x, kind="stable"), -1 if _closed(plane) else 0)  # at a vertex


def chain(
    instance: Instance, plane: Plane, *, systems: int, band: int | None = None, backwards: bool = False
) -> Struct:
    """Return a struct with room for matrices, by default of an element's bandwidth, so many that are treated at once.

    The rows of a slice begin at its near end, or, ``backwards``, end there.
    """
    cut, band = int(_closed(plane)), plane.order if band is None else band
    order = followed(plane)[:: -1 if backwards and not cut else 1]
    rows, border = plane.size - cut, (cut * (plane.size - cut), systems)
    return instance.struct(
        "Chain",
        dofs=plane.size,
        cut=cut,
        row=np.argsort(order),
        L=np.zeros((rows + band, band + 1, systems)),
        column=np.zeros(border),
        reduced=np.zeros(border),
        corner=np.zeros(systems),
    )


def _closed(plane: Plane) -> bool:
    return bool(plane.mesh.geometry.dim == 2)
