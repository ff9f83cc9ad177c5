"""Interior potentials along a slice or ring: conjugate gradients, whose preconditioner is one banded matrix a mode.

Only what couples the vertical modes, the slope of the surface, is left out of the preconditioner (docs/method.md,
section 4). A residual is of double precision; what is added to the potential for it is found in single precision, all
of it compiled as one (``modes.c``), and takes the error down by up to five digits. Then there is a new residual.
"""

from math import isfinite
from typing import Any

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fem.cells import lanes
from wavetank.fem.chain import chain, followed
from wavetank.fem.codegen import Buffer, Function, Unit, source
from wavetank.fem.conjugate_gradients import condition_number
from wavetank.fem.layers import LayerEnergy, LayerOperator
from wavetank.fem.plane import Field, Plane
from wavetank.fem.vertical import VerticalBasis

MOST = 200  # iterations
ABREAST = 8  # modes in a vector, at most
NO_MINIMUM = "the interior potential has no minimum: the water column is not positive everywhere"


def along(
    energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field, unit: Unit | None = None
) -> LayerOperator:
    """Return the operator of a slice or ring, with its modes where layers are averaged; see ``LayerOperator``."""
    more = source("matrices.c", "banded") + source("modes.c", "slice")
    sizes, exports = (
        _sizes(plane, vertical.n + 1, "double", ordered=False),
        ("take", "product", "derivative", "decouple", "respond"),
    )
    return LayerOperator(
        energy, plane, vertical, column=column, more=more, exports=exports, more_sizes=sizes, unit=unit
    )


def _single(
    energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field, unit: Unit | None
) -> LayerOperator:
    """Return the same in single precision, its rows as places follow each other, with what is compiled for solves."""
    return LayerOperator(
        energy,
        plane,
        vertical,
        column=column,
        more=source("matrices.c", "banded") + source("modes.c", "slice", "correction"),
        exports=("take", "decouple", "correct"),
        more_sizes=_sizes(plane, vertical.n, "float", ordered=True),
        unit=unit,
        prefix="single",
        real="float",
        order=followed(plane),
        stored=True,
    )


def _sizes(plane: Plane, modes: int, real: str, *, ordered: bool) -> dict[str, object]:
    abreast, groups = _abreast(real), _padded(modes, real) // _abreast(real)
    return {"MODES": modes, "BAND": plane.order, "ABREAST": abreast, "ORDERED": int(ordered), "GROUPS": groups}


def _abreast(real: str) -> int:
    return min(ABREAST, lanes(real))


def _padded(modes: int, real: str) -> int:
    """Return the number of modes, filled up to whole vectors."""
    return -(-modes // _abreast(real)) * _abreast(real)


class Averaged:
    """A layer averaged over the depth, along a slice or ring; see ``LayerMatrices``.

    Parameters
    ----------
    operator
        Made by ``along``.
    """

    def __init__(self, operator: LayerOperator, plane: Plane):
        self._operator, self._plane = operator, plane

    def assemble(self) -> Vector:
        """Return the fields as they are, of which modes make averages themselves."""
        self._operator.update()
        return np.array(self._operator.rows)

    def modes(self, eigenvalues: Vector) -> "AveragedModes":
        """See ``LayerMatrices``."""
        return AveragedModes(self._operator, self._plane, eigenvalues, padded=_padded(self._operator.numbers, "double"))


class AveragedModes:
    """The decoupled problems of some vertical modes: (S_u + Lambda_j S_w) a_j = r_j, layers averaged; see ``Modes``.

    Parameters
    ----------
    operator
        Made by ``along``, or the same in single precision.
    eigenvalues
        Lambda_j, shape (m,).
    padded
        The number of modes that it is compiled for, m filled up to whole vectors.
    """

    def __init__(self, operator: LayerOperator, plane: Plane, eigenvalues: Vector, *, padded: int):
        instance, real, size = operator.instance, operator.instance.dtype, plane.size
        eigenvalues = np.pad(eigenvalues, (0, padded - eigenvalues.size), mode="edge").astype(real)
        self._work, self._weights = np.empty((size, padded), dtype=real), np.zeros(padded, dtype=real)
        self.chain, fields = chain(instance, plane, systems=padded), Buffer(operator.rows.size, real)
        of = operator.cells, operator.layers
        self.take = instance.function("decouple", *of, fields, eigenvalues, self.chain)
        self._respond: Function | None = None
        if real == np.float64:
            self._respond = instance.function(
                "respond", self.chain, self._weights, Buffer(size), Buffer(size), self._work
            )

    def compiled(self, weights: Vector) -> dict[str, Any]:
        """Return the parts of an ``Advection`` for responses with these weights; there are to be no others."""
        self._weights[: weights.size] = weights
        return {"modes": self.chain, "shares": self._weights, "modes_work": self._work}

    def respond(self, weights: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """See ``Modes``; exactly."""
        result = np.empty_like(right)
        self._weights[: weights.size] = weights
        assert self._respond is not None
        self._respond(np.ascontiguousarray(right), result)
        return result


class Minimum:
    """Finds the interior of potentials along a slice or ring, all of it on this rank.

    Parameters
    ----------
    operator
        Made by ``along``.
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
        self._operator, self._tolerance = operator, tolerance
        self._single = single = _single(energy, plane, vertical, column=column, unit=unit)
        self._modes = AveragedModes(single, plane, vertical.eigenvalues, padded=_padded(vertical.n, "float"))
        row = _padded(vertical.n, "float")
        self._work = np.empty((plane.size, 5 * row + 2), dtype=np.float32)
        self._steps, self.last = np.empty((MOST + 1, 2)), 0
        self._correction = np.zeros(2)  # phi A phi, and the residual's energy over that wanted
        layered = Buffer(plane.size * (vertical.n + 1))
        self._correct = {
            stride: single.instance.function(
                "correct",
                *(single.cells, single.layers, single.state, self._modes.chain),
                *(Buffer(plane.size * stride if stride else vertical.n + 1), stride, layered, layered, tolerance, int),
                *(self._steps, self._correction, self._work),
            )
            for stride in (0, vertical.n + 1)
        }
        self._image = np.zeros((plane.size, vertical.n + 1))
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
    def condition_number(self) -> float:
        """The estimate that the last solve gave of the preconditioned operator's, by Lanczos."""
        return condition_number(self._steps[: self.last])
