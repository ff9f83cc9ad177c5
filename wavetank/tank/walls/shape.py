"""The mode shape f(z) of a paddle at x = f(z) X_p, for its mapping and for columns beside it.

A vertical wall has f = 1. All others are polynomials in z, so that all integrals have closed forms, and compiled code
depends on the degree only. A shape with a kink, such as a flap hinged above the bed, is approximated by a polynomial of
degree 16. It is the nearest one, from the bed to half a depth above still water, among those with the shape's value and
slope at still water and its moments with all polynomials of degree up to 8 below. Linear theory depends on int f cosh
k(z + d) dz, whose error is 1e-6 for k d up to 10. The potential, itself a polynomial over the column, cannot resolve
more.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem, mesh
from numpy.polynomial import Polynomial as Powers
from numpy.polynomial import legendre

from wavetank.base.arrays import Vector
from wavetank.motion.motion import TOP

DEGREES, HIGHEST, MOMENTS = (0, 1, 2, 4, 8), 16, 9
EXACT = 1e-11  # error of an exact fit, relative to the largest value
POINTS = 40  # number of Gauss points between two kinks


@dataclass(frozen=True)
class Polynomial:
    """f = sum_k c_k tau^k, tau = -z / unit: 0 at still water, and 1 one unit below.

    (In powers of +z compiled code is twice as large: common terms of its parts differ by signs then.)

    Attributes
    ----------
    coefficients
        c_k, constants of a mesh or numbers.
    unit
        Unit [m], a constant or a number.
    """

    coefficients: Sequence[Any]
    unit: Any

    @property
    def degree(self) -> int:
        """Degree of the polynomial."""
        return len(self.coefficients) - 1

    @property
    def powers(self) -> tuple[Vector, float]:
        """c_k and the unit [m], as numbers."""
        unit, *c = (float(getattr(one, "value", one)) for one in (self.unit, *self.coefficients))
        return np.array(c), unit

    @cached_property
    def at_still_water(self) -> tuple[float, float, float]:
        """Value and slope f' [1/m] at still water, and the mean of f down to one unit below it, the bed."""
        c, unit = self.powers
        mean = sum(one / (k + 1) for k, one in enumerate(c))
        return c[0], -(c[1] if len(c) > 1 else 0.0) / unit, mean

    @classmethod
    def fit(
        cls, f: Callable[[Vector], Vector], depth: float, on: mesh.Mesh, *, kinks: Sequence[float] = ()
    ) -> "Polynomial":
        """Return the polynomial fitted to a shape f(z) above a bed at -depth [m], with kinks at some z [m]."""
        upwards = fitted(f, depth, kinks=kinks)
        powers = upwards * (-1.0) ** np.arange(len(upwards))
        return cls([fem.Constant(on, float(c)) for c in powers], fem.Constant(on, float(depth)))

    def value(self, z: Any) -> Any:
        """Return f(z)."""
        return horner(self.coefficients, -z / self.unit)

    def slope(self, z: Any) -> Any:
        """Return f'(z) [1/m]."""
        return horner([-k * c for k, c in enumerate(self.coefficients)][1:], -z / self.unit) / self.unit

    def mean(self, eta: Any) -> Any:
        """Return the mean of f between still water and eta, by the moment of heights: 2 / eta² int f z dz."""
        return horner([2 * c / (k + 2) for k, c in enumerate(self.coefficients)], -eta / self.unit)

    def column(self, h: Any, d: Any) -> Any:
        """Return int f dz [m] over a column h on the bed at -d."""
        integral = [c / (k + 1) for k, c in enumerate(self.coefficients)]
        return (h - d) * horner(integral, (d - h) / self.unit) + d * horner(integral, d / self.unit)

    def at(self, z: Vector) -> Vector:
        """Return f at heights [m], numbers in an array of any shape."""
        c, unit = self.powers
        return np.asarray(horner([*c], -z / unit) + 0.0 * z)


class Upright(Polynomial):
    """f = 1, whose terms vanish before compilation."""

    def column(self, h: Any, d: Any) -> Any:
        """Return h."""
        return h

    def mean(self, eta: Any) -> Any:
        """Return 1."""
        return ufl.as_ufl(1)


UPRIGHT = Upright((1,), 1)


def horner(coefficients: Sequence[Any], x: Any) -> Any:
    """Return sum_k c_k x^k; 0 without coefficients."""
    if not coefficients:
        return 0 * x
    *rest, value = coefficients
    for c in reversed(rest):
        value = c + x * value
    return value


def fitted(f: Callable[[Vector], Vector], depth: float, *, kinks: Sequence[float] = ()) -> Vector:
    """Return the coefficients of (z / depth)^k, shape (degree + 1,), of the polynomial for a shape f(z).

    It is the shape itself if that is a polynomial of one of the ``DEGREES``.
    """
    top = TOP * depth
    below, above = ([-depth, *(z for z in sorted(kinks) if -depth < z < 0.0), 0.0], [0.0, top])
    (z_b, w_b), (z_a, w_a) = _gauss(below), _gauss(above)
    z, w = np.concatenate([z_b, z_a]), np.concatenate([w_b, w_a])

    def basis(z: Vector, degree: int) -> Vector:
        return np.asarray(legendre.legvander((2.0 * z + depth - top) / (depth + top), degree))

    wanted = f(z)
    for degree in DEGREES:
        scaled = np.sqrt(w)[:, None] * basis(z, degree)
        result = np.linalg.lstsq(scaled, np.sqrt(w) * wanted, rcond=None)[0]
        if np.abs(basis(z, degree) @ result - wanted).max() <= EXACT * np.abs(wanted).max():
            return _powers(result)
    test = legendre.legvander(2.0 * z_b / depth + 1.0, MOMENTS - 1).T * w_b
    step = 1e-6 * depth
    ends = np.array([step, -step])
    constraints = np.vstack([test @ basis(z_b, HIGHEST), basis(ends, HIGHEST)])
    given = np.concatenate([test @ f(z_b), f(ends)])
    V = basis(z, HIGHEST)
    return _powers(_nearest(V.T @ (w[:, None] * V), V.T @ (w * wanted), constraints, given))


def _powers(coefficients: Vector) -> Vector:
    """Return the coefficients of powers of z / depth for Legendre's on [-depth, TOP depth]."""
    return np.asarray(Powers(legendre.leg2poly(coefficients))(Powers([1.0 - TOP, 2.0]) / (1.0 + TOP)).coef)


def _gauss(ends: Sequence[float]) -> tuple[Vector, Vector]:
    """Return points and weights of Gauss' rule between consecutive ends [m]."""
    x, w = legendre.leggauss(POINTS)
    edges = np.asarray(ends)
    middle, half = 0.5 * (edges[1:] + edges[:-1])[:, None], 0.5 * np.diff(edges)[:, None]
    return (middle + half * x).ravel(), (half * w).ravel()


def _nearest(A: Vector, b: Vector, C: Vector, c: Vector) -> Vector:
    """Return the minimiser x of 1/2 x A x - b x under C x = c."""
    system = np.block([[A, C.T], [C, np.zeros((len(c), len(c)))]])
    return np.asarray(np.linalg.lstsq(system, np.concatenate([b, c]), rcond=1e-13)[0][: len(b)])
