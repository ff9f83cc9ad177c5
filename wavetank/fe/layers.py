"""The interior operator without matrices, from the energy of a horizontal layer.

A layer at height zeta, with potential u and vertical derivative w, has an energy e(grad u, w; zeta), quadratic in
(grad u, w) and depends on fields (the water column, the bed, the wall's mapping) and on zeta in any way. With
phi = sum_j phi_j(X) P_j(zeta) the second derivative A of int e dzeta dX is applied as it is written: interpolate phi to
the quadrature points, contract with the vertical functions at the levels zeta_q, multiply by the energy's second
derivatives there, and go back (``layers.c``). These are evaluated once for a state of the fields. Nothing is assembled.
"""

from collections.abc import Callable
from importlib.resources import files
from typing import Any

import basix
import numpy as np
from dolfinx import fem
from ffcx.naming import compute_signature
from ufl.algorithms import extract_coefficients
from ufl.algorithms.analysis import extract_constants

from wavetank.arrays import Vector
from wavetank.fe.halo import Halo
from wavetank.fe.kernels import Kernel
from wavetank.fe.plane import Field, Plane
from wavetank.fe.vertical import VerticalBasis

LayerEnergy = Callable[[Any, Any, Any], Any]  # (u, w, zeta) -> energy density

LANES = 8  # cells at a time
DECLARATIONS = """
typedef struct {
    int batches;
    const int *dofs;
    const double *values, *slopes, *zeta, *levels, *P, *dP, *inverse, *measure, *squares;
} Cells;
void hessians(const Cells *, const double *fields, const double *constants, double *out);
void product(const Cells *, const double *hessians, const double *x, double *y);
void interior_product(const Cells *, const double *hessians, const double *x, double *y);
void coupling_product(const Cells *, const double *hessians, const double *x, double *y);
void surface_product(const Cells *, const double *hessians, const double *x, double *y);
void derivative(const Cells *, const double *fields, const double *constants, const double *x, double *y);
void averages(const Cells *, const double *hessians, double *out);
void interior_modes(const Cells *, const double *averages, const double *lambda, const double *x, double *y);
void modes(const Cells *, const double *averages, const double *lambda, const double *x, double *y);
void diagonals(const Cells *, const double *averages, double *y);
"""


def source(name: str) -> str:
    """Return C code that stands beside this file."""
    return files("wavetank.fe").joinpath(name).read_text(encoding="utf-8")


class LayerOperator:
    """A, its products, and the derivative of its energy by the water column.

    Parameters
    ----------
    energy
        e(u, w, zeta), in UFL.
    column
        The field by which derivatives are taken.
    more
        C code, and its declarations, that is compiled with the operator's.

    Attributes
    ----------
    kernel, cells, hessians
        The compiled functions, and what they are called with.
    """

    def __init__(
        self,
        energy: LayerEnergy,
        plane: Plane,
        vertical: VerticalBasis,
        *,
        column: Field,
        more: tuple[str, str] = ("", ""),
    ):
        density = _Density(energy, plane, column)
        self._fields, self._constants = density.fields, density.constants
        self._owned, self._n = plane.owned, vertical.n
        rule = Rule(plane)
        sizes = {
            **rule.sizes,
            "LANES": LANES,
            "GDIM": plane.mesh.geometry.dim,
            "NUMBERS": vertical.n + 1,
            "LEVELS": len(vertical.zeta),
            "FIELDS": len(self._fields),
        }
        head = "".join(f"#define {key} {value}\n" for key, value in sizes.items())
        code = head + source("layers.c") + more[0]
        made = code + source("pointwise.py") + source("layers.py")
        key = compute_signature([(density.e, rule.points)], f"{density.by} {made}")
        kernel = Kernel("layers", DECLARATIONS + more[1], key=key, source=lambda: density.put_in(code), comm=plane.comm)
        levels = {"zeta": vertical.zeta, "levels": vertical.weights, "P": vertical.values, "dP": vertical.slopes}
        geometry = rule.geometry(plane)
        batches = len(geometry["dofs"])
        self.kernel = kernel
        self.cells = kernel.struct("Cells", {"batches": batches, **rule.tables, **levels, **geometry})
        self._means = sizes["MEANS"]
        self.hessians = np.empty((batches, len(rule.points), len(vertical.zeta), sizes["HESSIANS"], LANES))
        self._halos = {numbers: Halo(plane.V.dofmap.index_map, numbers) for numbers in (1, vertical.n, vertical.n + 1)}

    def _inputs(self) -> tuple[Any, Any]:
        fields = np.stack([field.x.array for field in self._fields], axis=1)
        constants = np.array([float(constant.value) for constant in self._constants] or [0.0])
        return self.kernel.pointer(fields), self.kernel.pointer(constants)

    def update(self) -> None:
        """Take over the fields as they are, ghosts included."""
        self.kernel.call.hessians(self.cells, *self._inputs(), self.kernel.pointer(self.hessians))

    def apply(self, rows: Vector) -> Vector:
        """Return A x, shape (owned, n+1), for the owned rows of x or more; collective."""
        return self._product(self.kernel.call.product, rows, self._n + 1)

    def apply_interior(self, rows: Vector) -> Vector:
        """Return A_II x, shape (owned, n), for the owned rows of x or more; collective."""
        return self._product(self.kernel.call.interior_product, rows, self._n)

    def apply_coupling(self, surface: Vector) -> Vector:
        """Return A_In psi, shape (owned, n), for the owned values of psi or more; collective."""
        return self._product(self.kernel.call.coupling_product, surface[:, None], self._n)

    def apply_surface(self, rows: Vector) -> Vector:
        """Return (A x)_n, shape (owned,), for the owned rows of x or more; collective."""
        return self._product(self.kernel.call.surface_product, rows, 1)[:, 0]

    def _product(self, part: Any, rows: Vector, wanted: int) -> Vector:
        x, y, at = self._reached(rows), np.zeros((self._halos[wanted].size, wanted)), self.kernel.pointer
        part(self.cells, at(self.hessians), at(x), at(y))
        return self._halos[wanted].collect(y)

    def derivative(self, rows: Vector) -> Vector:
        """Return the derivative of 1/2 x A x by the water column, shape (owned,), for x of (owned, n+1); collective."""
        x, y, at = self._reached(rows), np.zeros((self._halos[1].size, 1)), self.kernel.pointer
        self.kernel.call.derivative(self.cells, *self._inputs(), at(x), at(y))
        return self._halos[1].collect(y)[:, 0]

    def averages(self) -> Vector:
        """Return the second derivatives by u and by w alone at the points, averaged over the depth."""
        batches, points, _, _, lanes = self.hessians.shape
        out, at = np.empty((batches, points, self._means, lanes)), self.kernel.pointer
        self.kernel.call.averages(self.cells, at(self.hessians), at(out))
        return out

    def each_mode(self, averages: Vector, eigenvalues: Vector, rows: Vector) -> Vector:
        """Return (S_u + Lambda_j S_w) x_j of n modes j, or of n + 1, shape (owned, modes); collective.

        S_u and S_w are the matrices of ``averages``, in which u and w are not coupled.
        """
        part = self.kernel.call.interior_modes if eigenvalues.size == self._n else self.kernel.call.modes
        x, y, at = self._reached(rows), np.zeros((self._halos[1].size, eigenvalues.size)), self.kernel.pointer
        part(self.cells, at(averages), at(eigenvalues), at(x), at(y))
        return self._halos[eigenvalues.size].collect(y)

    def diagonals(self, averages: Vector) -> Vector:
        """Return the diagonals of S_u and S_w, shape (owned, 2); collective."""
        y, at = np.zeros((self._halos[1].size, 2)), self.kernel.pointer
        self.kernel.call.diagonals(self.cells, at(averages), at(y))
        return np.column_stack([self._halos[1].collect(np.ascontiguousarray(part[:, None])) for part in y.T])

    def _reached(self, rows: Vector) -> Vector:
        return self._halos[rows.shape[1]].fetch(rows[: self._owned])


class Rule:
    """The quadrature of a kind of cell, and an element's values there: on an edge, where cells are products of edges.

    Attributes
    ----------
    points, weights
        In the cell's own coordinates.
    sizes, tables
        As ``layers.c`` has them.
    """

    def __init__(self, plane: Plane):
        element, degree = plane.V.element.basix_element, 3 * plane.order
        dim = plane.mesh.topology.dim
        if element.cell_type == basix.CellType.quadrilateral:
            edge = basix.create_element(
                basix.ElementFamily.P, basix.CellType.interval, plane.order, element.lagrange_variant
            )
            x, w = basix.make_quadrature(basix.CellType.interval, degree)
            self.points = np.array([(a, b) for a in x[:, 0] for b in x[:, 0]])
            self.weights = np.outer(w, w).ravel()
            along = np.argsort(edge.points[:, 0])
            values, slopes = edge.tabulate(1, x)[:, :, along, 0]
            self._order = np.lexsort((np.round(element.points[:, 1], 9), np.round(element.points[:, 0], 9)))
            side, rule = values.shape[1], len(x)
        else:
            self.points, self.weights = basix.make_quadrature(element.cell_type, degree)
            self._order = np.arange(element.dim)
            side = rule = 0
        whole = element.tabulate(1, self.points)[..., 0][:, :, self._order]
        if not side:
            values, *slopes = whole
        pairs = [whole[1 + a] * whole[1 + d] * (1 + (d < a)) for a in range(dim) for d in range(a + 1)]
        squares = np.array([*pairs, whole[0] ** 2])
        self.tables = {"values": values, "slopes": np.array(slopes), "squares": squares}
        self.sizes = {
            "NODES": element.dim,
            "POINTS": len(self.points),
            "SIDE": side,
            "RULE": rule,
            "DIM": dim,
            "HESSIANS": dim * (dim + 1) // 2 + dim + 1,
            "MEANS": dim * (dim + 1) // 2 + 1,
            "BAND": plane.order,
        }

    def geometry(self, plane: Plane) -> dict[str, Vector]:
        """Return degrees of freedom, inverse Jacobians and weights of a rank's cells, LANES cells to a batch."""
        mesh = plane.mesh
        cells = mesh.topology.index_map(mesh.topology.dim).size_local
        batches = -(-cells // LANES)
        number = np.arange(batches * LANES).reshape(LANES, batches).T  # neighbours are in other batches
        chosen, there = np.minimum(number, cells - 1), number < cells
        slopes = mesh.ufl_domain().ufl_coordinate_element().basix_element.tabulate(1, self.points)[1:, :, :, 0]
        corners = mesh.geometry.x[mesh.geometry.dofmap][:, :, : mesh.geometry.dim]
        jacobians = np.einsum("aqi,cik->cqka", slopes, corners)  # (cell, point, axis of space, axis of cell)
        square = np.einsum("cqka,cqkb->cqab", jacobians, jacobians)
        inverse = np.einsum("cqka,cqab->cqkb", jacobians, np.linalg.inv(square))
        measure = np.sqrt(np.linalg.det(square)) * self.weights
        return {
            "dofs": plane.V.dofmap.list[:, self._order][chosen].transpose(0, 2, 1),
            "inverse": np.moveaxis(inverse[chosen], 1, -1),
            "measure": np.moveaxis(np.where(there[..., None], measure[chosen], 0.0), 1, -1),
        }


class _Density:
    """The layer's energy with all that it depends on."""

    def __init__(self, energy: LayerEnergy, plane: Plane, column: Field):
        u, w, zeta = fem.Function(plane.V), fem.Function(plane.V), fem.Constant(plane.mesh, 0.0)
        self.e, self._gdim = energy(u, w, zeta), plane.mesh.geometry.dim
        found = extract_coefficients(self.e)
        self.by = found.index(column.function) if column.function in found else None  # which of them is the column
        others = [one for one in found if one not in (u, w, column.function)]
        self.fields = [column.function, *others]
        self.constants = [one for one in extract_constants(self.e) if one is not zeta]
        self._names = {u: "u", w: "w", zeta: "zeta"}
        self._names |= {one: f"f{n}" for n, one in enumerate(self.fields)}
        self._names |= {one: f"c{n}" for n, one in enumerate(self.constants)}

    def put_in(self, code: str) -> str:
        """Return code with the density's derivatives where it names them."""
        from wavetank.fe.pointwise import named, statements, symbols  # SymPy takes half a second to load

        axes = range(self._gdim)
        e, u, w = symbols(self.e, self._names), [named("u", i) for i in axes], named("w")
        second = {f"uu[{i}][{j}]": e.diff(u[i], u[j]) for i in axes for j in axes}
        second |= {f"uw[{i}]": e.diff(u[i], w) for i in axes} | {"ww": e.diff(w, w)}
        first = {"by": e.diff(named("f0"))} | {f"by_slope[{i}]": e.diff(named("f0", i)) for i in axes}
        of_fields = [f"const v f{n} = f[{n}];" for n in range(len(self.fields))]
        of_fields += [f"const v f{n}_{i} = slope[{n}][{i}];" for n in range(len(self.fields)) for i in axes]
        of_fields += [f"const double c{n} = constants[{n}];" for n in range(len(self.constants))]
        of_u = [f"const v u_{i} = u[{i}];" for i in axes]
        for name, lines in (
            ("HESSIAN", [*of_fields, statements(second)]),
            ("DERIVATIVE", [*of_fields, *of_u, statements(first)]),
        ):
            code = code.replace(f" {name}\n", " {\n" + "\n".join(lines) + "\n}\n")
        return code
