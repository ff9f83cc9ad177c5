"""Interior potentials along a slice or ring: conjugate gradients, whose preconditioner is one banded matrix a mode.

Only what couples the vertical modes, the slope of the surface, is left out of the preconditioner (docs/method.md,
section 4). A residual is of double precision; what is added to the potential for it is found in single precision, all
of it compiled as one (``along.c``), and takes the error down by up to five digits. Then there is a new residual.
"""

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.errors import ConvergenceError
from wavetank.fe.cells import defined, source
from wavetank.fe.chain import CHAIN, chain, followed
from wavetank.fe.conjugate_gradients import condition_number
from wavetank.fe.layers import LayerEnergy, LayerOperator
from wavetank.fe.plane import Field, Plane
from wavetank.fe.vertical import VerticalBasis

Singles = NDArray[np.float32]

MOST = 200  # iterations
ABREAST = 8  # modes at a time
NO_MINIMUM = "the interior potential has no minimum: the water column is not positive everywhere"
DECLARATIONS = f"""{CHAIN}
typedef struct {{
    double kinetic, residual;
}} Found;
void decouple(const Cells *, const Layers *, const REAL *state, const REAL *lambda, const Chain *);
void respond(const Chain *, const REAL *s, const double *r, double *x, REAL *work);
int correct(const Cells *, const Layers *, const REAL *state, const Chain *, const double *wall, int stride,
            double *phi, double *image, double tolerance, int most, double *steps, Found *, REAL *work);
"""


class Along:
    """The operator of a slice or ring in single precision, and its modes where layers are averaged; see ``Layer``.

    Parameters
    ----------
    energy
        e(u, w, zeta), in UFL.
    column
        The field by which derivatives are taken.

    Attributes
    ----------
    operator
        See ``LayerOperator``; its rows stand as places follow each other.
    """

    def __init__(self, energy: LayerEnergy, plane: Plane, vertical: VerticalBasis, *, column: Field):
        sizes = {"MODES": vertical.n, "BAND": plane.order, "ABREAST": ABREAST}
        more = defined(sizes) + source("chain.c") + source("along.c"), DECLARATIONS
        self.plane = plane
        self.operator = LayerOperator(
            energy, plane, vertical, column=column, more=more, real="float", order=followed(plane), stored=True
        )

    def assemble(self) -> Singles:
        """Return the operator's state for the fields as they are, of which modes make averages themselves."""
        self.operator.update()
        return self.operator.state.copy()

    def modes(self, eigenvalues: Vector) -> "AlongModes":
        """See ``Layer``."""
        return AlongModes(self, eigenvalues)


class AlongModes:
    """The decoupled problems of some vertical modes: (S_u + Lambda_j S_w) a_j = r_j, layers averaged; see ``Modes``.

    Parameters
    ----------
    eigenvalues
        Lambda_j, shape (m,).
    """

    def __init__(self, along: Along, eigenvalues: Vector):
        self._operator, plane, m = along.operator, along.plane, eigenvalues.size
        self._padding = (0, -m % ABREAST)
        groups = (m + self._padding[1]) // ABREAST
        self._eigenvalues = np.pad(eigenvalues, self._padding, mode="edge").astype(np.float32)
        self._work = np.empty((plane.size, ABREAST), dtype=np.float32)
        self.chain = chain(self._operator.kernel, plane, groups=groups, abreast=ABREAST)

    def take(self, averages: Singles) -> None:
        """Take over the operator with this state."""
        kernel, operator, at = self._operator.kernel, self._operator, self._operator.kernel.pointer
        kernel.call.decouple(operator.cells, operator.layers, at(averages), at(self._eigenvalues), self.chain)

    def respond(self, shares: Vector, right: Vector, *, cycles: int = 1) -> Vector:
        """See ``Modes``; to single precision."""
        kernel, found, at = self._operator.kernel, np.empty_like(right), self._operator.kernel.pointer
        shares = np.pad(shares, self._padding).astype(np.float32)
        kernel.call.respond(self.chain, at(shares), at(np.ascontiguousarray(right)), at(found), at(self._work))
        return found


class Minimum:
    """Finds the interior of potentials along a slice or ring, all of it on this rank.

    Parameters
    ----------
    operator
        Of the energy, in double precision.
    along
        The same in single precision.
    tolerance
        Of the error's energy, relative to that of the potential; its square root.

    Attributes
    ----------
    flow
        The last column of A phi, of the potential found last, shape (dofs,).
    kinetic
        phi A phi of that.
    """

    def __init__(
        self, operator: LayerOperator, along: Along, plane: Plane, vertical: VerticalBasis, *, tolerance: float
    ):
        self._operator, self._along, self._tolerance = operator, along, tolerance
        self._modes = along.modes(vertical.eigenvalues)
        row = ABREAST * -(-vertical.n // ABREAST)
        self._work = np.empty((plane.size, 5 * row + 2), dtype=np.float32)
        self._steps, self._last = np.empty((MOST + 1, 2)), 0
        self._found = along.operator.kernel.struct("Found", {"kinetic": 0.0, "residual": 0.0})
        self.flow: Vector = np.zeros(plane.size)
        self.kinetic = 0.0

    def factor(self) -> None:
        """Make a preconditioner of the operator for the fields as they are."""
        self._modes.take(self._along.assemble())

    def find(self, phi: Vector, wall: Vector) -> int:
        """Set the interior columns of phi, shape (dofs, n+1), from what they are; return the iterations.

        ``wall`` is what the wall adds, broadcastable to that shape. Raises ``ConvergenceError``.
        """
        self._along.operator.update()
        iterations, wall = 0, np.ascontiguousarray(wall)
        while True:
            image = self._operator.apply(phi)
            taken = self._correct(phi, image, wall, MOST - iterations)
            iterations += max(0, taken)
            if taken == -1:
                raise ConvergenceError(f"the interior potential did not converge in {MOST} iterations")
            self.flow = np.ascontiguousarray(image[:, -1])
            if taken < 0 or not self._operator.least > 0.0 or not np.isfinite(self.flow.sum()):
                raise ConvergenceError(NO_MINIMUM)
            if self._found.residual <= 1.0:
                self.kinetic = self._found.kinetic
                return iterations

    def _correct(self, phi: Vector, image: Vector, wall: Vector, most: int) -> int:
        """Add to phi what takes its error down, and to its image's last column; return the iterations."""
        operator, at = self._along.operator, self._along.operator.kernel.pointer
        taken: int = operator.kernel.call.correct(
            operator.cells,
            operator.layers,
            at(operator.state),
            self._modes.chain,
            at(wall),
            wall.shape[1] if len(wall) > 1 else 0,
            at(phi),
            at(image),
            self._tolerance,
            most,
            at(self._steps),
            self._found,
            at(self._work),
        )
        self._last = max(0, taken)
        return taken

    @property
    def condition_number(self) -> float:
        """The estimate that the last solve gave of the preconditioned operator's, by Lanczos."""
        return condition_number(self._steps[: self._last])
