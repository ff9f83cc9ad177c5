"""What takes kinks between cells out of a field along a slice on one rank: N = strength sum of [[du/dx]] [[dv/dx]].

N has an entry where two degrees of freedom are of neighbouring cells, so M_J + N has twice the bandwidth of M_J, and
its factors are kept as those of M_J are (``kinks.c``).
"""

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.cells import DECLARATION, Cells
from wavetank.fem.chain import CHAIN, chain
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.mass import BandedMass
from wavetank.fem.plane import Plane

KINKS = """
typedef struct {
    int facets;
    double strength;
    const int *dofs;
    const double *slopes, *shift;
    double *jumps;
} Kinks;
typedef struct {
    void *multiply, *mass_cells;
    const double *weights;
    double *resting, *eta, *work;
} Mass;
"""
DECLARATIONS = f"""{DECLARATION}{CHAIN}{KINKS}
void kinks_of(const Kinks *, int dofs, const double *x, double *y);
void factor_kinks(const Kinks *, const Cells *, const double *weights, double *kept, const Chain *);
void smooth(const Kinks *, const Chain *, const Mass *, const double *still, int points, const double *pairs,
            double *found);
"""


class KinkSmoothing:
    """N of v' = (M_J + N)^-1 M_J v, and what it does.

    Parameters
    ----------
    strength
        As above.
    shift
        How far the wall has carried the degrees of freedom [m], shape (dofs,): derivatives are by x = X + shift; None
        where it stands still.
    """

    def __init__(self, plane: Plane, mass: BandedMass, *, strength: float, shift: Vector | None):
        cells, band = Cells(plane, plane.degree), 2 * plane.order
        sizes = {"REAL": "double", **cells.sizes, "MOST": 1, "BAND": band, "ABREAST": 1, "GROUPS": 1}
        files = ("cells.c", "chain.c", "banded_mass.c", "kinks.c")
        code = defined(sizes) + "".join(map(source, files))
        self._kernel = Kernel("kinks", DECLARATIONS, key=code, source=lambda: code, comm=plane.comm)
        dofs, slopes = _at_facets(plane)
        parts = {"facets": len(dofs), "strength": strength, "dofs": dofs, "slopes": slopes, "jumps": 0.0 * slopes}
        self._cells, self._kinks = self._kernel.struct("Cells", cells.parts), self._kernel.struct("Kinks", parts)
        if shift is not None:
            self._kinks.shift = self._kernel.known(shift)
        self._factors = chain(self._kernel, plane, systems=1, band=band, backwards=True)
        given = mass.weights, np.zeros_like(mass.weights)  # those that the factors are of
        self._at_weights, self._at_kept = map(self._kernel.known, given)
        room = {name: np.empty(sides * plane.size) for name, sides in (("resting", 1), ("eta", 1), ("work", 2))}
        self._mass = self._kernel.shared("Mass", {**mass.compiled_product, **room})
        self.update()

    def update(self) -> None:
        """Take over M_J as it is, and N as the wall stands."""
        self._kernel.call.factor_kinks(self._kinks, self._cells, self._at_weights, self._at_kept, self._factors)

    def apply(self, values: Vector) -> Vector:
        """Return N v, shape (dofs,)."""
        result, at = np.empty_like(values), self._kernel.pointer
        self._kernel.call.kinks_of(self._kinks, values.size, at(np.ascontiguousarray(values)), at(result))
        return result

    def smoothed(self, pairs: Vector, still: Vector | float) -> Vector:
        """Return Q - N eta' and psi' of points [Q, psi], shape (m, 2, dofs), over columns of still water [m]."""
        result, at = np.empty_like(pairs), self._kernel.doubles
        of = self._kernel.spread(still, pairs.shape[2]), len(pairs), at(np.ascontiguousarray(pairs)), at(result)
        self._kernel.call.smooth(self._kinks, self._factors, self._mass, *of)
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
