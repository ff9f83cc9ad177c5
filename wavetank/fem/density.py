"""Densities at points, in UFL, for compiled kernels: their inputs, and C code of their derivatives."""

import re
from collections.abc import Callable, Mapping
from itertools import chain
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from ffcx.naming import compute_signature
from ufl.algorithms import extract_coefficients
from ufl.algorithms.analysis import extract_constants

from wavetank.base.arrays import Vector
from wavetank.fem.plane import Plane

Statements = dict[str, Any]  # what is set, to expressions of SymPy's
Makes = Callable[[Any], Statements]  # of the density, as one
LITERAL = re.compile(r"(?<![\w.])((?:\d+\.\d*|\.\d+)(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+)(?![\w.])")  # of C, a double


def named(name: str, *component: int) -> Any:
    """Return SymPy's symbol of an input, or of one of its components."""
    from wavetank.fem import pointwise  # SymPy takes half a second to load, and only compilation needs it

    return pointwise.named(name, *component)


class Density:
    """A scalar density with its inputs.

    Parameters
    ----------
    e
        The density in UFL.
    inputs
        Functions and constants that are not fields of the mesh, by their names in C.
    first
        The first field.

    Attributes
    ----------
    fields
        Number of fields, ``f0``, ``f1`` ... in C with slopes ``f0_0``, ...
    values
        Values of the fields on this rank, each of shape (size,).
    """

    def __init__(self, e: Any, plane: Plane, *, inputs: Mapping[Any, str] | None = None, first: Any = None):
        inputs = inputs or {}
        self._e, self._plane = e, plane
        remaining = [one for one in extract_coefficients(e) if one not in inputs and one is not first]
        self._fields: list[fem.Function] = [*([first] if first is not None else []), *remaining]
        self._constants = [one for one in extract_constants(e) if one not in inputs]
        index_map = plane.V.dofmap.index_map
        self.values: list[Vector] = [one.x.array for one in self._fields]
        self._rows = np.empty((index_map.size_local + index_map.num_ghosts, len(self._fields)))
        self._numbers = [one.value for one in self._constants]  # where they are kept
        self.fields = len(self._fields)
        self._names = dict(inputs)
        self._names |= {one: f"f{n}" for n, one in enumerate(self._fields)}
        self._names |= {one: f"c{n}" for n, one in enumerate(self._constants)}

    def signature(self) -> str:
        """Return a text that is equal for densities with the same code, on any mesh."""
        cell, dim = self._plane.mesh.basix_cell(), self._plane.mesh.geometry.dim
        domain = ufl.Mesh(basix.ufl.element("Lagrange", cell, 1, shape=(dim,)), ufl_id=0)
        space = ufl.FunctionSpace(domain, basix.ufl.element("Lagrange", cell, 1))
        usual = dict[Any, Any]()
        for n, one in enumerate(self._names):
            is_field = isinstance(one, fem.Function)
            usual[one] = ufl.Coefficient(space, count=n) if is_field else ufl.Constant(domain, one.ufl_shape, count=n)
        return f"{compute_signature([(ufl.replace(self._e, usual), np.zeros((1, dim)))], '')} {[*self._names.values()]}"

    def rows(self) -> Vector:
        """Return the present fields at all degrees of freedom of this rank, shape (size, fields).

        The array is reused by the next call.
        """
        for n, values in enumerate(self.values):
            self._rows[:, n] = values
        return self._rows

    def constants(self) -> Vector:
        """Return the present constants; at least one number."""
        return np.array([float(number) for number in self._numbers] or [0.0])

    def index(self, field: Any) -> int:
        """Return the index of a field."""
        return self._fields.index(field)

    def put_in(self, code: str, made: Mapping[str, Makes], *, real: str = "double") -> str:
        """Return C code in which lines that are keys of ``made`` are replaced by statements for this density.

        The code must define the vectors ``v f[field][value, slopes ...]`` in one array, the constants ``REAL
        constants[]``, and ``nothing``, whether some vectors are zero. ``real`` is the type REAL.
        """
        from wavetank.fem.pointwise import branches, symbols  # SymPy takes half a second to load

        density, width = symbols(self._e, self._names), 1 + self._plane.mesh.geometry.dim
        of_fields = [[f"f{n}", *(f"f{n}_{i}" for i in range(width - 1))] for n in range(self.fields)]
        constants = [f"c{n}" for n in range(len(self._constants))]
        inputs = [f"UNUSED const v {one} = f[{n}];" for n, one in enumerate(chain.from_iterable(of_fields))]
        inputs += [f"UNUSED const REAL {one} = constants[{n}];" for n, one in enumerate(constants)]
        for name, makes in made.items():
            made_of_it = branches(density, makes, fields=of_fields, constants=constants)
            lines = [*inputs, LITERAL.sub(r"\1f", made_of_it) if real == "float" else made_of_it]
            code = code.replace(f" {name}\n", " {\n" + "\n".join(lines) + "\n}\n")
        return code
