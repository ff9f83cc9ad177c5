"""Interior potentials along a slice or ring: conjugate gradients, whose preconditioner is one banded matrix per mode.

Only what couples the vertical modes, the slope of the surface, is omitted from the preconditioner (docs/method.md,
section 4). Residuals have double precision; corrections to the potential are computed in single precision in one
compiled function (``modes.c``) and reduce the error by up to five digits. Then there is a new residual.
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

MOST = 200  # iterations
ABREAST = 8  # largest number of modes in a vector
NO_MINIMUM = "the interior potential has no minimum: the water column is not positive everywhere"


def _abreast(real: str) -> int:
    return min(ABREAST, lanes(real))


def _code(plane: Plane, modes: int, real: str, *sections: str) -> MoreCode:
    """Return the code of modes that is compiled with an operator, and its functions."""
    abreast = _abreast(real)
    sizes = {"MODES": modes, "BAND": plane.order, "ABREAST": abreast, "GROUPS": -(-modes // abreast)}
    functions = "take", "average", "factorise", *(("correct",) if sections else ("product", "derivative", "respond"))
    code = source("matrices.c", "banded") + source("modes.c", "average", "slice", *sections)
    return MoreCode(code, functions, sizes)


class SliceOperator(LayerOperator):
    """The operator of a slice or ring on one rank, with its modes where layers are averaged; see ``LayerOperator``."""

    def __init__(
        self, energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field, unit: Unit | None = None
    ):
        more = _code(plane, vertical.n + 1, "double")
        super().__init__(energy, plane, vertical, column=column, unit=unit, more=more)
        self._plane = plane

    def assemble(self) -> Vector:
        """Return the fields as they are, of which modes make averages themselves."""
        self.update()
        return np.array(self.rows)

    def modes(self, eigenvalues: Vector) -> "AveragedModes":
        """See ``LayerMatrices``."""
        return AveragedModes(self, self._plane, eigenvalues)


class AveragedModes:
    """The decoupled problems of some vertical modes: (S_u + Lambda_j S_w) a_j = r_j, layers averaged; see ``Modes``.

    Parameters
    ----------
    operator
        A ``SliceOperator``, or the same in single precision.
    eigenvalues
        Lambda_j, shape (m,).

    Attributes
    ----------
    chain
        The matrices in C, their number filled up to whole vectors.
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
        """Replace S_u and S_w by those of fields, (dofs, fields)."""
        self._average(fields)
        S_u, S_w = (
            np.bincount(self._places, (product @ self._averages[:, :, k]).ravel(), len(self._entries) + 1)[:-1, None]
            for k, product in enumerate(self._products)
        )
        self._entries[:] = S_u + S_w * self._eigenvalues
        self._factorise()

    def compiled(self, weights: Vector) -> dict[str, Any]:
        """Return the parts of an ``Advection`` for responses with these weights; there are to be no others."""
        self._weights[: weights.size] = weights
        return {"modes": self.chain, "shares": self._weights, "modes_work": self._work}

    def respond(self, weights: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """See ``Modes``; exactly."""
        result = np.empty_like(right)
        self._weights[: weights.size] = weights
        self._respond(np.ascontiguousarray(right), result)
        return result


class Minimum:
    """Finds the interior of potentials along a slice or ring, all of it on this rank.

    Parameters
    ----------
    operator
        In double precision.
    energy, column
        As given to that.
    tolerance
        Of the error's energy, relative to that of the potential; its square root.

    Attributes
    ----------
    flow
        The last column of A phi, of the potential found last, shape (dofs,).
    kinetic
        phi A phi of that.
    last
        Iterations of the last correction.
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
        self._steps, self.last = np.empty((MOST + 1, 2)), 0
        self._correction = np.zeros(2)  # phi A phi, and the residual's energy over that wanted
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
        """Make a preconditioner of the operator for the fields as they are."""
        self._single.update()
        self._modes.take(self._single.rows)

    def find(self, phi: Vector, wall: Vector) -> int:
        """Set the interior columns of phi, shape (dofs, n+1), from what they are; return the iterations.

        ``wall`` is what the wall adds, broadcastable to that shape. Raises ``ConvergenceError``.
        """
        self._single.follow(self._operator)
        iterations, correct = 0, self._correct[wall.shape[1] if len(wall) > 1 else 0]
        wall = np.ascontiguousarray(wall)
        while True:
            self._operator.apply_to(phi, self._image)
            performed = correct(wall, phi, self._image, MOST - iterations)
            self.last = max(0, performed)
            iterations += self.last
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
        """The parts of a ``Tank`` that it finds minima with."""
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

    @property
    def steps(self) -> Vector:
        """Lengths of the steps of the last correction, and parts of each direction in the next, shape (steps, 2)."""
        return self._steps[: self.last]
