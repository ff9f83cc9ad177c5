"""Interior potentials of a slice or ring on one rank: conjugate gradients with a banded matrix for each vertical mode.

The preconditioner omits the coupling of vertical modes, which is due to the slope of the surface (docs/method.md,
section 4). Residuals are in double precision. One compiled function (``modes.c``) computes a correction in single
precision, which reduces the error by up to five digits. Residual and correction alternate until the tolerance is
reached.
"""

from math import isfinite
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import ConvergenceError
from wavetank.fem.cells import lanes
from wavetank.fem.chain import Chain, order_along
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.layers import LayerEnergy, LayerOperator, MoreCode
from wavetank.fem.plane import Field, Plane
from wavetank.fem.vertical import VerticalBasis

MOST = 200  # largest number of iterations
ABREAST = 8  # largest number of modes in a vector
NO_MINIMUM = "the interior potential has no minimum: the water column is not positive everywhere"


def _abreast(real: str) -> int:
    return min(ABREAST, lanes(real))


def _code(plane: Plane, modes: int, real: str, *sections: str) -> MoreCode:
    """Return the C code of modes that is compiled with an operator, its exported functions and its macros."""
    abreast = _abreast(real)
    sizes = {"MODES": modes, "BAND": plane.order, "ABREAST": abreast, "GROUPS": -(-modes // abreast)}
    functions = "take", "average", "factorise", *(("correct",) if sections else ("product", "derivative", "respond"))
    code = source("matrices.c", "banded") + source("modes.c", "average", "slice", *sections)
    return MoreCode(code, functions, sizes)


class SliceOperator(LayerOperator):
    """The interior operator of a slice or ring on one rank, with decoupled modes; see ``LayerOperator``."""

    def __init__(
        self, energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field, unit: Unit | None = None
    ):
        more = _code(plane, vertical.n + 1, "double")
        super().__init__(energy, plane, vertical, column=column, unit=unit, more=more)
        self._plane = plane

    def assemble(self) -> Vector:
        """Return the present fields, from which the modes compute averages."""
        self.update()
        return np.array(self.rows)

    def modes(self, eigenvalues: Vector) -> "AveragedModes":
        """Return the decoupled problems of some modes; see ``LayerMatrices``."""
        return AveragedModes(self, self._plane, eigenvalues)


class AveragedModes:
    """Decoupled problems (S_u + Lambda_j S_w) a_j = r_j of a slice, with layers averaged over the depth; see ``Modes``.

    Parameters
    ----------
    operator
        A ``SliceOperator``, or a ``LayerOperator`` in single precision.
    eigenvalues
        Lambda_j, shape (m,).

    Attributes
    ----------
    chain
        The matrices in C. Their number is padded to complete vectors of the processor.
    """

    def __init__(self, operator: LayerOperator, plane: Plane, eigenvalues: Vector):
        instance, cells, size = operator.instance, operator.cell_values, plane.size
        real, abreast = instance.dtype, _abreast(instance.real)
        padded = -(-int(operator.more.sizes["MODES"]) // abreast) * abreast
        self._eigenvalues = np.pad(eigenvalues, (0, padded - eigenvalues.size), mode="edge").astype(real)
        self._work, self._weights = np.empty((size, padded), dtype=real), np.zeros(padded, dtype=real)
        matrices = Chain(instance, plane, systems=padded, band=plane.order)
        self._entries, self.chain = matrices.entries, matrices.struct
        dofs = cells.parts["dofs"]
        rows = dofs if operator.order is not None else matrices.row[dofs]
        self._places = matrices.places(rows[:, :, None], rows[:, None, :]).ravel()
        tables = (cells.parts["slopes"][0], cells.parts["values"])
        self._products = [(one[:, :, None] * one[:, None, :]).reshape(len(one), -1).T for one in tables]
        self._averages = np.empty((len(dofs), len(cells.points), 2, cells.lanes), dtype=real)
        fields = Buffer(operator.rows.size, real)
        self._average = instance.function("average", operator.cells, operator.layers, fields, self._averages)
        self._factorise = instance.function("factorise", self.chain, 0)
        self._respond = instance.function("respond", self.chain, self._weights, Buffer(size), Buffer(size), self._work)

    def take(self, fields: Vector) -> None:
        """Assemble and factorise the matrices for fields of shape (dofs, fields)."""
        self._average(fields)
        S_u, S_w = (
            np.bincount(self._places, (product @ self._averages[:, :, k]).ravel(), len(self._entries) + 1)[:-1, None]
            for k, product in enumerate(self._products)
        )
        self._entries[:] = S_u + S_w * self._eigenvalues
        self._factorise()

    def compiled(self, weights: Vector) -> dict[str, Any]:
        """Return the members of an ``Advection`` for ``respond`` with these weights, which then are fixed."""
        self._weights[: weights.size] = weights
        return {"modes": self.chain, "shares": self._weights, "modes_work": self._work}

    def respond(self, weights: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """Return the exact solution; see ``Modes``."""
        result = np.empty_like(right)
        self._weights[: weights.size] = weights
        self._respond(np.ascontiguousarray(right), result)
        return result


class Minimum:
    """Solver for the interior potential of a slice or ring on one rank.

    Parameters
    ----------
    operator
        The operator in double precision.
    energy, column
        The energy and the column of the operator.
    tolerance
        Relative error of the potential in the energy norm.

    Attributes
    ----------
    flow
        Last column of A phi for the last solution, shape (dofs,).
    kinetic
        phi A phi for the last solution.
    steps
        Step lengths of the last correction by ``find`` and the coefficients of its directions, shape (steps, 2).
    """

    patience = 1

    def __init__(
        self,
        operator: LayerOperator,
        energy: LayerEnergy,
        plane: Plane,
        vertical: VerticalBasis,
        *,
        column: Field,
        tolerance: float,
        unit: Unit | None = None,
    ):
        self._operator, self._tolerance, n = operator, tolerance, vertical.n
        self._single = single = LayerOperator(
            energy,
            plane,
            vertical,
            column=column,
            more=_code(plane, n, "float", "correction"),
            unit=unit,
            prefix="single",
            real="float",
            order=order_along(plane),
            stored=True,
        )
        self._modes = AveragedModes(single, plane, vertical.eigenvalues)
        row = -(-n // _abreast("float")) * _abreast("float")
        self._work = np.empty((plane.size, 5 * row + 2), dtype=np.float32)
        self._steps = np.empty((MOST + 1, 2))
        self.steps: Vector = self._steps[:0]
        self._correction = np.zeros(2)  # phi A phi, and the energy of the residual over its target
        of, layered = (single.cells, single.layers, single.state, self._modes.chain), Buffer(plane.size * (n + 1))
        results = self._steps, self._correction, self._work
        function = single.instance.function
        self._correct = {
            stride: function("correct", *of, wall, stride, layered, layered, tolerance, int, *results)
            for stride, wall in ((0, Buffer(n + 1)), (n + 1, layered))
        }
        self._image = np.zeros((plane.size, n + 1))
        self.flow: Vector = np.zeros(plane.size)
        self.kinetic = 0.0

    def factor(self) -> None:
        """Assemble and factorise the preconditioner for the present fields."""
        self._single.update()
        self._modes.take(self._single.rows)

    def find(self, phi: Vector, wall: Vector) -> int:
        """Solve for the interior columns of phi, shape (dofs, n+1), from their initial values; return the iterations.

        ``wall`` is the load of the wall, broadcastable to that shape. Raises ``ConvergenceError``.
        """
        self._single.follow(self._operator)
        iterations, correct = 0, self._correct[wall.shape[1] if len(wall) > 1 else 0]
        wall = np.ascontiguousarray(wall)
        while True:
            self._operator.apply_to(phi, self._image)
            performed = correct(wall, phi, self._image, MOST - iterations)
            self.steps = self._steps[: max(0, performed)].copy()
            iterations += len(self.steps)
            if performed == -1:
                raise ConvergenceError(f"the interior potential did not converge in {MOST} iterations")
            self.flow = self._image[:, -1].copy()
            kinetic, remaining = map(float, self._correction)
            if performed < 0 or not self._operator.least > 0.0 or not isfinite(kinetic):
                raise ConvergenceError(NO_MINIMUM)
            if remaining <= 1.0:
                self.kinetic = kinetic
                return iterations

    @property
    def compiled(self) -> dict[str, Any]:
        """The members of a ``Tank`` in C that belong to this solver."""
        single = self._single
        return {
            "float_cells": single.cells,
            "float_layers": single.layers,
            "float_rows": single.rows,
            "float_state": single.state,
            "order": single.order,
            "modes": self._modes.chain,
            "tolerance": self._tolerance,
            "most_iterations": MOST,
            "steps": self._steps,
            "correction": self._correction,
            "work": self._work,
        }
