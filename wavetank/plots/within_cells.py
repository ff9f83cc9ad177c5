"""The surface between the nodes: what a cell of high order holds, and straight lines from node to node do not show."""

from math import ceil

import numpy as np
from numpy.typing import NDArray

from wavetank.output.fields import Surface

ENOUGH = 1200  # places along a tank: about the pixels of a picture


def within_cells(surface: Surface, order: int) -> Surface:
    """Return the surface at places between the nodes as well, by the polynomial of its order that each cell holds.

    Cells are alike, each between every ``order``-th node and the next; x is a polynomial in them, too. A surface of
    more places than a picture shows is returned as it is, and so is one whose cells cannot be told.
    """
    intervals = surface.x.shape[1] - 1
    if order == 1 or intervals < order or intervals % order or intervals >= ENOUGH:
        return surface
    cells = intervals // order
    nodes = order * np.arange(cells)[:, None] + np.arange(order + 1)
    last = surface.x[0, -order - 1 :]  # of the last cell, which no paddle moves
    shapes = _shapes((last - last[0]) / (last[-1] - last[0]), each=ceil(ENOUGH / cells))
    fields = (
        np.column_stack([(field[:, nodes] @ shapes).reshape(len(field), -1), field[:, -1]])
        for field in (surface.x, surface.eta, surface.psi)
    )
    return Surface(surface.t, *fields)


def _shapes(nodes: NDArray[np.float64], *, each: int) -> NDArray[np.float64]:
    """Return Lagrange's polynomials of nodes in [0, 1] at so many places from 0 on, shape (nodes, each)."""
    places = np.arange(each) / each
    others = [np.delete(nodes, j) for j in range(nodes.size)]
    return np.array([np.prod((places[:, None] - x) / (at - x), axis=1) for at, x in zip(nodes, others, strict=True)])
