"""A paddle whose place depends on the height, x = f(z) X_p: a flap, or any other shape (docs/method.md, section 7).

The mapping is x = X + s(X) f(z) X_p, so that a column of water h has the mass

    Q = int v (h + a . grad(s X_p) R(h)) dX = M_J h with the mean of J over the column,     R = int f dz over it,
    dQ/dh = M_J with J at the surface.
"""

from typing import Any

import numpy as np
import ufl

from wavetank.base.arrays import Vector, summed
from wavetank.base.errors import ConvergenceError
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import PRODUCTS, MassMatrix
from wavetank.fem.plane import Plane
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.piston import Piston

MOST = 30  # iterations
ROUND_OFF = 1e-15  # of the columns


class Shaped(Piston):
    """A paddle of a shape f(z); over its reach the bed must be flat."""

    part = Part("wall", "∫ ψ ∇·(s G) dX + Ẋ_p ∫ h f φ dζ at the paddle,  G = Ẋ_p ∫ f dz")
    description = "x = X + s(X) f(z) X_p, F = ∂x/∂X, J = det F: a wall of the shape f moves"
    leans = True

    def _facets(self) -> ufl.Measure:
        """Return the measure over the paddle, of the water's quadrature: a shape's powers would ask for far more."""
        return super()._facets()(metadata=self._plane.dx.metadata())

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """See ``Wall``."""
        (far, fast), (f, slope, mean) = self.travel.at_nodes, self.shape.at_still_water
        f_surface = f + slope * eta
        flux = mean * still + 0.5 * (f + f_surface) * eta
        return np.array([far * f_surface, fast * f_surface, fast * flux, far * slope])

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> "ShapedColumns":
        """Return what finds columns by Newton's method."""
        return ShapedColumns(self, energy, mass, plane=self._plane, unit=unit)


class ShapedColumns:
    """Columns beside paddles of any shape; at the owned degrees of freedom.

    They and the mass matrix have the methods ``solve`` and ``apply``.

    Newton's method takes M_J as it was last told, which is near enough to converge by a factor of a hundred a step.

    Attributes
    ----------
    mean, column, trials, round_off
        As ``fem/slice.py`` has them.
    """

    def __init__(self, wall: Any, energy: WaterEnergy, mass: MassMatrix, *, plane: Plane, unit: Unit):
        self._mass, self._plane = mass, plane
        self._start: Vector = energy.h.x.array[: plane.owned]
        self._h = plane.function("columns")
        self._h.set(self._start)
        h = self._h.function
        self.column: Vector = h.x.array
        self.trials, self.round_off = MOST, ROUND_OFF
        stretching = wall.mapping.stretching
        mean = 1 + stretching(lambda shape: shape.column(h, energy.d)) / h
        self.mean = MassMatrix(plane, mean, unit=unit, prefix="mean", functions=PRODUCTS)

    def apply(self, h: Vector) -> Vector:
        """Return the masses of columns [m]; collective."""
        self._h.set(h)
        self.mean.update()
        return self.mean.apply(h)

    def solve(self, q: Vector) -> Vector:
        """Return the columns [m] of masses; collective. Raises ``ConvergenceError``."""
        h = self._start.copy()
        bound, last = ROUND_OFF**2 * self._square(h), 0.0
        for _ in range(MOST):
            change = self._mass.solve(q - self.apply(h))
            h += change
            square = self._square(change)
            if square <= bound or square**2 <= bound * last:  # the next change, if they go on falling as they do
                return h
            last = square
        raise ConvergenceError(f"the columns of water beside the paddle did not converge in {MOST} iterations")

    def _square(self, values: Vector) -> float:
        return summed(self._plane.comm, float(values @ values))
