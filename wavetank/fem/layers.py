"""The matrix-free interior operator, from the energy of a horizontal layer.

A layer at height zeta with potential u and vertical derivative w has an energy e(grad u, w; zeta). It is quadratic in
(grad u, w). It depends in any way on zeta and on fields: the water column, the bed, the wall's mapping. With phi =
sum_j phi_j(X) P_j(zeta), A is the second derivative of int e dzeta dX. A product with A interpolates phi to the
quadrature points, contracts it with the vertical functions at levels zeta_q, multiplies by the second derivatives of e
there, and applies the transposes (``layers.c``). No matrix is assembled. Each product evaluates the second derivatives
from the fields, unless they are ``stored``: this is faster for many products with the same fields.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from wavetank.base.arrays import Vector
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.density import Density, Statements, named
from wavetank.fem.plane import Field, Plane
from wavetank.fem.vertical import VerticalBasis

LayerEnergy = Callable[[Any, Any, Any], Any]  # (u, w, zeta) -> energy density
Indices = NDArray[np.intp]
Array = NDArray[Any]  # in the precision of the operator


class LayerDensity(Density):
    """The energy density of a layer at a point.

    Parameters
    ----------
    energy
        e(u, w, zeta), in UFL.
    column
        The first of its fields.
    """

    def __init__(self, energy: LayerEnergy, plane: Plane, column: Field):
        u, w, zeta = fem.Function(plane.V), fem.Function(plane.V), fem.Constant(plane.mesh, 0.0)
        super().__init__(energy(u, w, zeta), plane, inputs={u: "u", w: "w", zeta: "zeta"}, first=column.function)
        dim = plane.mesh.topology.dim
        self._axes = range(plane.mesh.geometry.dim)
        self.sizes = {
            "FIELDS": self.fields,
            "HESSIANS": dim * (dim + 1) // 2 + dim + 1,
            "MEANS": dim * (dim + 1) // 2 + 1,
        }

    def second(self, e: Any) -> Statements:
        """Return the second derivatives with respect to grad u and w."""
        u, w = [named("u", i) for i in self._axes], named("w")
        second = {f"uu[{i}][{j}]": e.diff(u[i]).diff(u[j]) for i in self._axes for j in self._axes}
        return second | {f"uw[{i}]": e.diff(u[i]).diff(w) for i in self._axes} | {"ww": e.diff(w).diff(w)}

    def first(self, e: Any) -> Statements:
        """Return the derivatives with respect to the column and its slope, for grad u in an array."""
        first = {"by": e.diff(named("f0"))} | {f"by_slope[{i}]": e.diff(named("f0", i)) for i in self._axes}
        slope = {named("u", i): named(f"u[{i}]") for i in self._axes}
        return {name: derivative.xreplace(slope) for name, derivative in first.items()}


class MoreCode(NamedTuple):
    """Further C code of an operator: code, exported functions, and macros."""

    code: str = ""
    functions: tuple[str, ...] = ("take", "product", "interior_product", "derivative")
    sizes: dict[str, Any] = {}  # noqa: RUF012


class LayerOperator:
    """The operator A, its products, and the derivative of its energy with respect to the water column.

    Parameters
    ----------
    energy
        e(u, w, zeta), in UFL.
    column
        The field with respect to which ``derivative`` differentiates.
    more
        Further code.
    unit, prefix
        Translation unit of its functions, and their prefix there; default: a separate unit.
    real
        Precision: "double" or "float".
    order
        Degree of freedom of each row of arrays; default: the numbering of the space.
    stored
        Whether the second derivatives of the energy are stored.

    Attributes
    ----------
    density
        The energy at a point.
    numbers
        Values for each degree of freedom: n + 1.
    cell_values
        The quadrature on cells.
    instance, cells, layers, state
        The C functions and their arguments; the state is the fields or the stored derivatives.
    rows
        The fields at the last update, shape (dofs, fields), in the order of rows.
    least
        Least value of the column at the quadrature points of this rank's cells; between nodes it can be lower than
        there.
    """

    def __init__(
        self,
        energy: LayerEnergy,
        plane: Plane,
        vertical: VerticalBasis,
        *,
        column: Field,
        more: MoreCode = MoreCode(),  # noqa: B008
        unit: Unit | None = None,
        prefix: str = "layers",
        real: str = "double",
        order: Indices | None = None,
        stored: bool = False,
    ):
        self.density, self.more, self.numbers = LayerDensity(energy, plane, column), more, vertical.n + 1
        self.order = None if order is None else np.ascontiguousarray(order, dtype=np.int32)
        self.cell_values = cells = Cells(plane, plane.degree, real=real)
        if order is not None:
            cells.parts["dofs"] = np.argsort(order)[cells.parts["dofs"]]
        sizes = {
            **cells.sizes,
            **self.density.sizes,
            "NUMBERS": self.numbers,
            "LEVELS": len(vertical.zeta),
            "MOST": self.numbers + self.density.fields,
            "STORED": int(stored),
            **more.sizes,
        }
        self.instance = instance = (unit or Unit(plane.comm)).add(
            prefix,
            source("cells.c") + source("layers.c", "layer", "operator") + more.code,
            exports=more.functions,
            sizes=sizes,
            real=real,
            density=self.density,
            made={"HESSIAN": self.density.second, "DERIVATIVE": self.density.first},
        )
        self.cells = instance.struct("Cells", **cells.parts)
        parts = {"zeta": vertical.zeta, "weights": vertical.weights, "P": vertical.values, "dP": vertical.slopes}
        self._constants = self.density.constants().astype(instance.dtype)
        self.layers = instance.struct("Layers", **parts, constants=self._constants)
        derivatives = len(vertical.zeta) * self.density.sizes["HESSIANS"]
        self.rows, self.least = self.density.rows().astype(instance.dtype), np.inf
        shape = cells.parts["batches"], len(cells.points), derivatives, cells.lanes
        self.state = np.empty(shape, dtype=instance.dtype) if stored else self.rows
        self._halos = {count: cells.halo(count, instance.dtype) for count in (1, self.numbers)}
        self._image = np.zeros((self._halos[1].size, self.numbers), dtype=instance.dtype)
        one, layered = (Buffer(self._halos[1].size * count, instance.dtype) for count in (1, self.numbers))
        of, function = (self.cells, self.layers), instance.function
        self._functions = {
            "take": function("take", *of, self.rows, self.state),
            "derivative": function("derivative", *of, self.rows, layered, one),
            **{name: function(name, *of, self.state, layered, layered) for name in ("product", "interior_product")},
        }

    def update(self) -> None:
        """Copy the present fields, ghosts included."""
        self._constants[:] = self.density.constants()
        self._take(self.density.rows())

    def follow(self, other: "LayerOperator") -> None:
        """Copy the fields of another operator of the same energy, whose rows are in the numbering of the space."""
        self._constants[:] = other._constants
        self._take(other.rows)

    def _take(self, rows: Array) -> None:
        self.rows[:] = rows if self.order is None else rows[self.order]
        self.least = self._functions["take"]()

    def apply(self, rows: Array) -> Array:
        """Return A x, shape (owned, n+1), for owned rows of x, or more rows; collective."""
        return self._applied("product", rows, np.zeros_like(self._image))

    def apply_to(self, rows: Array, image: Array) -> None:
        """Set A x, shape (dofs, n+1), for x of that shape, on one rank."""
        image[:] = 0.0
        self._functions["product"](rows, image)

    def apply_to_interior(self, rows: Array) -> Array:
        """Return A x, shape (owned, n+1), for x of that shape whose last column is zero; collective.

        The array is reused by the next call.
        """
        self._image[:] = 0.0
        return self._applied("interior_product", rows, self._image)

    def _applied(self, product: str, rows: Array, y: Array) -> Array:
        halo = self._halos[self.numbers]
        self._functions[product](halo.fetch(rows[: halo.owned]), y)
        return halo.collect(y)

    def derivative(self, rows: Vector) -> Vector:
        """Return the derivative of 1/2 x A x with respect to the column, (owned,), for x (owned, n+1); collective."""
        halo = self._halos[1]
        x, y = self._halos[self.numbers].fetch(rows[: halo.owned]), np.zeros((halo.size, 1))
        self._functions["derivative"](x, y)
        return halo.collect(y)[:, 0]
