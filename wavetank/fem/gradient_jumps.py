"""The gradient-jump penalty along a slice on one rank: N = strength sum of [[du/dx]] [[dv/dx]] over facets.

N has an entry where two degrees of freedom are of neighbouring cells, so M_J + N has twice the bandwidth of M_J, and
its factors are kept as those of M_J are (``matrices.c``).
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.cells import Cells
from wavetank.fem.chain import chain
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.mass import BandedMass
from wavetank.fem.plane import Plane


class GradientJumpPenalty:
    """N of v' = (M_J + N)^-1 M_J v, and that map.

    Parameters
    ----------
    strength
        As above.
    shift
        Displacement of the degrees of freedom by the wall [m], shape (dofs,): derivatives are by x = X + shift; None
        where it stands still.
    """

    def __init__(self, plane: Plane, mass: BandedMass, *, strength: float, shift: Vector | None):
        cells, band, size = Cells(plane, plane.degree), 2 * plane.order, plane.size
        self.instance = instance = Unit(plane.comm, "jumps").add(
            "jumps",
            source("cells.c") + source("matrices.c", "banded", "factors"),
            exports=("jumps_of", "factor_jumps", "smooth"),
            sizes={**cells.sizes, "MOST": 1, "BAND": band, "ABREAST": 1, "GROUPS": 1, "JUMPS": 1},
        )
        dofs, slopes = _at_facets(plane)
        self._mass = mass
        struct = instance.struct(
            "Jumps",
            facets=len(dofs),
            strength=strength,
            dofs=dofs,
            slopes=slopes,
            shift=shift,
            jumps=0.0 * slopes,
            mass=instance.struct("Mass", cells=instance.struct("Cells", **cells.parts), weights=mass.weights),
            factors=chain(instance, plane, systems=1, band=band, backwards=True),
            factored=np.zeros_like(mass.weights),
            eta=np.empty(size),
            work=np.empty(2 * size),
        )
        n, function = Buffer(size), instance.function
        self.update: Callable[[], None] = function("factor_jumps", struct)  # takes over M_J and N as the wall stands
        self._apply = function("jumps_of", struct, n, n)
        self._smooth = {m: function("smooth", struct, n, m, *2 * [Buffer(2 * m * size)]) for m in (1, 2)}
        mass.make_ready()
        self.update()

    def penalty(self, values: Vector) -> Vector:
        """Return N v, shape (dofs,)."""
        result = np.empty_like(values)
        self._apply(np.ascontiguousarray(values), result)
        return result

    def smoothed(self, pairs: Vector, still: Vector | float) -> Vector:
        """Return Q - N eta' and psi' of points [Q, psi], shape (m, 2, dofs), over columns of still water [m]."""
        result = np.empty_like(pairs)
        resting = self._mass.apply(np.broadcast_to(still, pairs.shape[2]))
        self._smooth[len(pairs)](resting, np.ascontiguousarray(pairs), result)
        return result


def _at_facets(plane: Plane) -> tuple[NDArray[np.int32], Vector]:
    """Return degrees of freedom of the cells on both sides of facets, and slopes of theirs, shape (facets, both).

    The slopes are d/dX there, those before a facet with the other sign.
    """
    element, geometry = plane.V.element.basix_element, plane.mesh.geometry
    start, end = geometry.x[geometry.dofmap, 0].T
    order = np.argsort(start + end)
    dofs, widths, backwards = plane.V.dofmap.list[order], (end - start)[order, None], (end < start)[order, None]
    first, last = tabulate(element, 1, np.array([[0.0], [1.0]]))[1]
    ahead, behind = np.where(backwards, first, last) / widths, np.where(backwards, last, first) / widths
    return np.hstack([dofs[:-1], dofs[1:]]), np.hstack([-ahead[:-1], behind[1:]])
