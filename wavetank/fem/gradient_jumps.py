"""The gradient-jump penalty of a slice on one rank: N = strength sum of [[du/dx]] [[dv/dx]] over facets.

N couples degrees of freedom of adjacent cells, so that M_J + N has twice the bandwidth of M_J. Its factors are stored
like those of M_J (``matrices.c``).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.codegen import Buffer, Instance, Struct, Unit
from wavetank.fem.mass import ROUND_OFF, BandedMass
from wavetank.fem.plane import Plane


class GradientJumpPenalty(BandedMass):
    """M_J + N with its factors, for v' = (M_J + N)^-1 M_J v.

    Parameters
    ----------
    J
        The Jacobian in UFL.
    strength
        Factor of the penalty.
    shift
        Displacement of the degrees of freedom by the wall [m], shape (dofs,): derivatives are with respect to x = X +
        shift; None for fixed walls.
    """

    functions = *BandedMass.functions, "apply_penalty"
    coupled = 2

    def __init__(self, plane: Plane, J: Any, *, strength: float, shift: Vector | None):
        self._strength, self._shift = strength, shift
        self._dofs, self._slopes = _at_facets(plane)
        self._jumps = self._slopes.copy()
        super().__init__(plane, J, unit=Unit(plane.comm, "jumps"), prefix="jumps")
        arguments = self._parts["penalty"], plane.size, *2 * [Buffer(plane.size)]
        self._apply_penalty = self._instance.function("apply_penalty", *arguments)
        self.update()

    def _penalty(self, instance: Instance, plane: Plane) -> Struct:
        parts = {"dofs": self._dofs, "jumps": self._jumps}
        return instance.struct("Penalty", facets=len(self._dofs), strength=self._strength, **parts)

    def update(self) -> None:
        """Set M_J and N for the present position of the wall."""
        if self._shift is not None:
            stretch = (self._slopes * self._shift[self._dofs]).sum(axis=2, keepdims=True)
            self._jumps[:] = self._slopes / (1.0 + stretch * [[-1.0], [1.0]])
        super().update()

    def penalty(self, values: Vector) -> Vector:
        """Return N v, shape (dofs,)."""
        result = np.empty_like(values)
        self._apply_penalty(np.ascontiguousarray(values), result)
        return result

    def solve(self, right: Vector, start: Vector | None = None, *, within: float = ROUND_OFF) -> Vector:
        """Return the solution for r, both (dofs,), to round-off."""
        return super().solve(right, within=within)


def _at_facets(plane: Plane) -> tuple[NDArray[np.int32], Vector]:
    """Return degrees of freedom of the cells before and behind facets, and slopes of their basis functions there.

    Both have the shape (facets, 2, nodes). The slopes are d/dX, those before a facet with the other sign.
    """
    element, geometry = plane.V.element.basix_element, plane.mesh.geometry
    start, end = geometry.x[geometry.dofmap, 0].T
    order = np.argsort(start + end)
    dofs, widths, backwards = plane.V.dofmap.list[order], (end - start)[order, None], (end < start)[order, None]
    first, last = tabulate(element, 1, np.array([[0.0], [1.0]]))[1]
    ahead, behind = np.where(backwards, first, last) / widths, np.where(backwards, last, first) / widths
    return np.stack([dofs[:-1], dofs[1:]], axis=1), np.stack([-ahead[:-1], behind[1:]], axis=1)
