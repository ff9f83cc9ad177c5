"""Interior potentials along a slice or ring: conjugate gradients, whose preconditioner is one banded matrix a mode.

Only what couples the vertical modes, the slope of the surface, is left out of the preconditioner (docs/method.md,
section 4). All of a solve is compiled as one (``along.c``).
"""

import numpy as np
from scipy.linalg import eigvalsh_tridiagonal

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fe.cells import source
from wavetank.fe.layers import LANES, LayerEnergy, LayerOperator
from wavetank.fe.plane import Field, Plane
from wavetank.fe.vertical import VerticalBasis

MOST = 200  # iterations
NO_MINIMUM = "the interior potential has no minimum: the water column is not positive everywhere"
DECLARATIONS = """
typedef struct {
    int dofs, cut, groups;
    const int *order, *row;
    const double *lambda;
    double *L, *column, *reduced, *corner;
} Chain;
void decouple(const Cells *, const double *hessians, Chain *);
void solve_chain(const Chain *, double *x);
int find_interior(const Cells *, const Layers *, const double *hessians, const Chain *, const double *wall,
                  double *phi, double *flow, double tolerance, int most, double *steps, double *work);
"""


def along(energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field) -> LayerOperator:
    """Return the operator of a slice or ring, with what is compiled for solves; see ``LayerOperator``."""
    return LayerOperator(energy, plane, vertical, column=column, more=(source("along.c"), DECLARATIONS))


class Chains:
    """A layer averaged over the depth, along a slice or ring; see ``Layer``.

    Parameters
    ----------
    operator
        Made by ``along``.
    """

    def __init__(self, operator: LayerOperator, plane: Plane):
        self._operator, self._plane = operator, plane

    def assemble(self) -> Vector:
        """Return the operator's state, of which chains make averages themselves."""
        return self._operator.state.copy()

    def modes(self, eigenvalues: Vector) -> "Chain":
        """See ``Layer``."""
        return Chain(self._operator, self._plane, eigenvalues)


class Chain:
    """The decoupled problems of some vertical modes: (S_u + Lambda_j S_w) a_j = r_j, layers averaged.

    Parameters
    ----------
    operator
        Made by ``along``.
    eigenvalues
        Lambda_j, shape (m,).
    """

    def __init__(self, operator: LayerOperator, plane: Plane, eigenvalues: Vector):
        self._operator = operator
        ring = plane.mesh.geometry.dim == 2
        order = np.roll(np.argsort(plane.x, kind="stable"), -1 if ring else 0)  # a ring is cut at a vertex
        groups, rows = -(-eigenvalues.size // LANES), plane.size - ring
        self._rows = np.zeros((plane.size, groups * LANES))
        self.struct = operator.kernel.struct(
            "Chain",
            {
                "dofs": plane.size,
                "cut": int(ring),
                "groups": groups,
                "order": order,
                "row": np.argsort(order),
                "lambda": np.pad(eigenvalues, (0, groups * LANES - eigenvalues.size), mode="edge"),
                "L": np.zeros((rows + plane.order, plane.order + 1, groups, LANES)),
                "column": np.zeros((rows, groups, LANES)),
                "reduced": np.zeros((rows, groups, LANES)),
                "corner": np.zeros((groups, LANES)),
            },
        )

    def take(self, averages: Vector) -> None:
        """Take over the operator with this state."""
        kernel = self._operator.kernel
        kernel.call.decouple(self._operator.cells, kernel.pointer(averages), self.struct)

    def solve(self, right: Vector, *, cycles: int = 1) -> Vector:
        """Return a for r, both of shape (dofs, m), exactly."""
        modes, kernel = right.shape[1], self._operator.kernel
        self._rows[:, :modes] = right
        kernel.call.solve_chain(self.struct, kernel.pointer(self._rows))
        return self._rows[:, :modes].copy()


class Minimum:
    """Finds the interior of potentials along a slice or ring, all of it on this rank.

    Parameters
    ----------
    operator
        Made by ``along``.
    tolerance
        Of the error's energy, relative to that of the potential; its square root.

    Attributes
    ----------
    flow
        The last column of A phi, of the potential found last, shape (dofs,).
    """

    def __init__(self, operator: LayerOperator, plane: Plane, vertical: VerticalBasis, *, tolerance: float):
        self._operator, self._tolerance = operator, tolerance
        self._modes = Chain(operator, plane, vertical.eigenvalues)
        modes = LANES * -(-vertical.n // LANES)
        self._work = np.empty((plane.size, 2 * (modes + vertical.n + 1)))
        self._steps, self._last = np.empty((MOST + 1, 2)), 0
        self._wall = np.empty((plane.size, vertical.n + 1))
        self.flow: Vector = np.zeros(plane.size)

    def factor(self) -> None:
        """Make a preconditioner of the operator as it is."""
        self._modes.take(self._operator.state)

    def find(self, phi: Vector, wall: Vector) -> int:
        """Set the interior columns of phi, shape (dofs, n+1), from what they are; return the iterations.

        ``wall`` is what the wall adds, of that shape. Raises ``ConvergenceError``.
        """
        operator = self._operator
        call, at = operator.kernel.call, operator.kernel.pointer
        self._wall[:], self.flow = wall, np.empty_like(self.flow)
        iterations: int = call.find_interior(
            operator.cells,
            operator.layers,
            at(operator.state),
            self._modes.struct,
            at(self._wall),
            at(phi),
            at(self.flow),
            self._tolerance,
            MOST,
            at(self._steps),
            at(self._work),
        )
        self._last = max(0, iterations)
        if iterations == -1:
            raise ConvergenceError(f"the interior potential did not converge in {MOST} iterations")
        if iterations < 0 or not operator.least > 0.0 or not np.isfinite(self.flow.sum()):
            raise ConvergenceError(NO_MINIMUM)
        return iterations

    @property
    def condition_number(self) -> float:
        """The estimate that the last solve gave of the preconditioned operator's, by Lanczos."""
        lengths, kept = self._steps[: self._last].T
        if not lengths.size:
            return 1.0
        diagonal = 1 / lengths + np.append(0.0, kept[:-1] / lengths[:-1])
        eigenvalues = eigvalsh_tridiagonal(diagonal, np.sqrt(kept[:-1]) / lengths[:-1])
        return float(eigenvalues[-1] / eigenvalues[0])
