"""Interior potentials along a slice or ring: conjugate gradients, whose preconditioner is one banded matrix a mode.

Only what couples the vertical modes, the slope of the surface, is left out of the preconditioner (docs/method.md,
section 4). A residual is of double precision; what is added to the potential for it is found in single precision, all
of it compiled as one (``along.c``), and takes the error down by up to five digits. Then there is a new residual.
"""

from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fem.cells import lanes
from wavetank.fem.chain import CHAIN, chain, followed
from wavetank.fem.conjugate_gradients import condition_number
from wavetank.fem.kernels import defined, source
from wavetank.fem.layers import LayerEnergy, LayerOperator
from wavetank.fem.plane import Field, Plane
from wavetank.fem.vertical import VerticalBasis

MOST = 200  # iterations
ABREAST = 8  # modes in a vector, at most
NO_MINIMUM = "the interior potential has no minimum: the water column is not positive everywhere"
DECLARATIONS = """
void decouple(const Cells *, const Layers *, const REAL *fields, const REAL *lambda, const Chain *);
void respond(const Chain *, const REAL *s, const double *r, double *x, REAL *work);
"""
CORRECTION = """
typedef struct {
    double kinetic, residual;
} Found;
int correct(const Cells *, const Layers *, const REAL *state, const Chain *, const double *wall, int stride,
            double *phi, double *image, double tolerance, int most, double *steps, Found *, REAL *work);
"""


def along(energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field) -> LayerOperator:
    """Return the operator of a slice or ring, with its modes where layers are averaged; see ``LayerOperator``."""
    more = _code(plane, vertical.n + 1, "double", ordered=False), CHAIN + DECLARATIONS
    return LayerOperator(energy, plane, vertical, column=column, more=more)


def _single(energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field) -> LayerOperator:
    """Return the same in single precision, its rows as places follow each other, with what is compiled for solves."""
    more = _code(plane, vertical.n, "float", ordered=True) + source("along.c"), CHAIN + DECLARATIONS + CORRECTION
    order = followed(plane)
    return LayerOperator(energy, plane, vertical, column=column, more=more, real="float", order=order, stored=True)


def _code(plane: Plane, modes: int, real: str, *, ordered: bool) -> str:
    sizes = {"MODES": modes, "BAND": plane.order, "ABREAST": _abreast(real), "ORDERED": int(ordered)}
    sizes["GROUPS"] = _room(modes, real) // sizes["ABREAST"]
    return defined(sizes) + source("chain.c") + source("decoupled.c")


def _abreast(real: str) -> int:
    return min(ABREAST, lanes(real))


def _room(modes: int, real: str) -> int:
    """Return how many there are with those that fill the last vector of some."""
    return -(-modes // _abreast(real)) * _abreast(real)


class Averaged:
    """A layer averaged over the depth, along a slice or ring; see ``Layer``.

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
        """See ``Layer``."""
        return AveragedModes(self._operator, self._plane, eigenvalues, room=_room(self._operator.numbers, "double"))


class AveragedModes:
    """The decoupled problems of some vertical modes: (S_u + Lambda_j S_w) a_j = r_j, layers averaged; see ``Modes``.

    Parameters
    ----------
    operator
        Made by ``along``, or the same in single precision.
    eigenvalues
        Lambda_j, shape (m,).
    room
        For how many it is compiled.
    """

    def __init__(self, operator: LayerOperator, plane: Plane, eigenvalues: Vector, *, room: int):
        self._operator, real = operator, operator.kernel.real
        self._eigenvalues = np.pad(eigenvalues, (0, room - eigenvalues.size), mode="edge").astype(real)
        self._work, self._shares = np.empty((plane.size, room), dtype=real), np.zeros(room, dtype=real)
        self._at_work, self._at_shares = map(operator.kernel.pointer, (self._work, self._shares))
        self.chain = chain(operator.kernel, plane, systems=room)

    def take(self, averages: NDArray[Any]) -> None:
        """Take over the operator with these fields."""
        kernel, operator, at = self._operator.kernel, self._operator, self._operator.kernel.pointer
        kernel.call.decouple(operator.cells, operator.layers, at(averages), at(self._eigenvalues), self.chain)

    def compiled(self, shares: Vector) -> dict[str, Any]:
        """Return what responses of these shares are called with, for another kernel; there are to be no others."""
        self._shares[: shares.size] = shares
        address, room = self._operator.kernel.address, {"shares": self._shares, "modes_work": self._work}
        return {"respond": address("respond"), "modes": address(self.chain), **room}

    def respond(self, shares: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """See ``Modes``; exactly."""
        kernel, result, at = self._operator.kernel, np.empty_like(right), self._operator.kernel.pointer
        self._shares[: shares.size] = shares
        kernel.call.respond(self.chain, self._at_shares, at(np.ascontiguousarray(right)), at(result), self._at_work)
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
    ):
        self._operator, self._tolerance = operator, tolerance
        self._single = single = _single(energy, plane, vertical, column=column)
        self._modes = AveragedModes(single, plane, vertical.eigenvalues, room=_room(vertical.n, "float"))
        row = _room(vertical.n, "float")
        self._work = np.empty((plane.size, 5 * row + 2), dtype=np.float32)
        self._steps, self.last = np.empty((MOST + 1, 2)), 0
        kernel = single.kernel
        self._found = kernel.struct("Found", {"kinetic": 0.0, "residual": 0.0})
        self._of = single.cells, single.layers, kernel.pointer(single.state), self._modes.chain
        self._image = np.zeros((plane.size, vertical.n + 1))
        self._room = kernel.pointer(self._steps), self._found, kernel.pointer(self._work)
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
        iterations, call, kernel = 0, self._single.kernel.call, self._single.kernel
        by_wall = kernel.pointer(np.ascontiguousarray(wall)), wall.shape[1] if len(wall) > 1 else 0
        corrected = kernel.known(phi), kernel.known(self._image), self._tolerance
        while True:
            self._operator.apply_to(phi, self._image)
            taken = call.correct(*self._of, *by_wall, *corrected, MOST - iterations, *self._room)
            self.last = max(0, taken)
            iterations += self.last
            if taken == -1:
                raise ConvergenceError(f"the interior potential did not converge in {MOST} iterations")
            self.flow = self._image[:, -1].copy()
            if taken < 0 or not self._operator.least > 0.0 or not isfinite(self._found.kinetic):
                raise ConvergenceError(NO_MINIMUM)
            if self._found.residual <= 1.0:
                self.kinetic = self._found.kinetic
                return iterations

    @property
    def compiled(self) -> dict[str, Any]:
        """What corrections are called with, for ``whole.c``."""
        single, address = self._single, self._single.kernel.address
        called = {"take_single": "take", "correct": "correct"}
        return {
            **{name: address(function) for name, function in called.items()},
            "single_cells": address(single.cells),
            "single_layers": address(single.layers),
            "single_rows": single.rows,
            "single_state": single.state,
            "order": single.order,
            "modes": address(self._modes.chain),
            "tolerance": self._tolerance,
            "iterations": MOST,
            "lengths": self._steps,
            "found": address(self._found),
            "work": self._work,
        }

    @property
    def condition_number(self) -> float:
        """The estimate that the last solve gave of the preconditioned operator's, by Lanczos."""
        return condition_number(self._steps[: self.last])
