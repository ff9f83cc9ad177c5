"""W of a paddle that leans along a slice that is on one rank, and its derivatives, written out (``leaning.c``).

At 1 m/s, with R = int f dz over the column, and at the paddle's own column the rule of ``WaterEnergy.wall_flux``,

    W = - int s psi_X R(h) dX  +  h int f(zeta h - d) (phi - psi) dzeta,     dR/dh = f at the surface.
"""

import basix
import numpy as np

from wavetank.arrays import Vector
from wavetank.fem.cell_places import tabulate
from wavetank.fem.kernels import Kernel, defined, source
from wavetank.fem.plane import LayeredField, Plane
from wavetank.fem.vertical import VerticalBasis, gauss_legendre
from wavetank.tank.bed import Bed
from wavetank.tank.walls.shape import Shape, coefficients
from wavetank.tank.walls.travel import Travel
from wavetank.tank.walls.work import CompiledWork, Indices

LEANING = """
typedef struct {
    int cells, node;
    double depth, unit;
    const int *dofs;
    const double *carried, *values, *slopes, *zeta, *rows, *shape, *slope, *integral, *moment;
} Leaning;
"""
DECLARATIONS = f"""{LEANING}
void by_potential(const Leaning *, double factor, const double *column, double *y);
void by_column(const Leaning *, double factor, const double *column, const double *phi, double *y);
"""
SOURCE = LEANING + source("leaning.c", __package__)


class LeaningWork(CompiledWork):
    """W of a paddle of a polynomial's shape; see ``Work``.

    Parameters
    ----------
    phi, h
        The potential and the water column, shape (dofs,).
    cells
        Those that are carried.
    node
        The degree of freedom at the paddle.
    bed
        As deep as the paddle reaches, in all its cells.
    """

    def __init__(
        self,
        shape: Shape,
        phi: LayeredField,
        h: Vector,
        *,
        travel: Travel,
        cells: Indices,
        node: int,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
    ):
        element, geometry = plane.V.element.basix_element, plane.mesh.geometry
        points, weights = basix.make_quadrature(element.cell_type, plane.degree)
        values, slopes = tabulate(element, 1, points)
        dofs, (start, end) = plane.V.dofmap.list[cells], geometry.x[geometry.dofmap[cells], 0].T
        direction = np.sign(end - start)[:, None]  # of the cell's own coordinate: a slope times the length has it
        zeta, shares = gauss_legendre(vertical.n + 1 + shape.degree // 2)
        sizes = {"NODES": element.dim, "POINTS": len(points), "LEVELS": len(zeta), "NUMBERS": vertical.n + 1}
        code = defined({**sizes, "DEGREE": shape.degree}) + SOURCE
        self._kernel = Kernel("leaning", DECLARATIONS, key=code, comm=plane.comm)
        over_cells = {
            "dofs": dofs,
            "carried": -direction * (travel.share.x.array[dofs] @ values.T) * weights,
            "values": values,
            "slopes": slopes,
        }
        upwards = {"zeta": zeta, "rows": shares[:, None] * vertical.at(zeta)[:, :-1]}
        numbers = {"cells": len(cells), "node": node, "depth": float(np.broadcast_to(bed.still, plane.owned)[node])}
        parts = {**numbers, **over_cells, **upwards, **coefficients(shape)}
        self._struct = self._kernel.struct("Leaning", parts)
        super().__init__(self._kernel, self._struct, self._struct, phi=phi.rows, h=h, travel=travel)
