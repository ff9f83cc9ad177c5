"""The amplification matrix of a scheme in closed form, by running the scheme on symbols.

The harmonic oscillator with omega = 1 and dt = theta = omega dt is general (scaling of q gives any other omega). Its
stages are affine and are solved exactly. Numbers in a scheme, such as 2/3, are converted to fractions.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy.polys.matrices import DomainMatrix

from examples.paper.schemes import Scheme
from wavetank.integrators.oscillators import Oscillators

THETA = sympy.Symbol("theta", positive=True)
LAMBDA = sympy.Symbol("lambda")
ALPHA = sympy.Symbol("alpha", positive=True)


def exact(expressions: Any) -> sympy.Matrix:
    """Return expressions as a column, floating-point numbers as a + b sqrt(3) with rational a, b."""

    def number(value: sympy.Float) -> Any:
        return sympy.nsimplify(value, [sympy.sqrt(3)], tolerance=1e-13)

    column = sympy.Matrix(list(expressions))
    return column.xreplace({value: number(value) for value in column.atoms(sympy.Float)}).applyfunc(sympy.expand)


class SymbolicOscillator(Oscillators):
    """H = (p² + q²) / 2 for arrays of expressions; its stages z = c + A z are solved exactly."""

    def H_q(self, q: Any, p: Any, t: Any) -> Any:
        """Return q."""
        return q

    def H_p(self, q: Any, p: Any, t: Any) -> Any:
        """Return p."""
        return p

    def energy(self, q: Any, p: Any, t: Any) -> float:
        """Return nan: nobody asks for it."""
        return np.nan

    def fixed_point(self, image: Callable[[Any], Any], start: Any) -> Any:
        """Return z = image(z), an array of expressions of the shape of the start."""
        zero = np.full(start.shape, sympy.Integer(0))
        constant = exact(image(zero).ravel())
        units = [np.array(unit).reshape(start.shape) for unit in sympy.eye(start.size).tolist()]
        columns = [exact((unit - image(unit)).ravel()) + constant for unit in units]
        system, right = (DomainMatrix.from_Matrix(m, extension=True) for m in (sympy.Matrix.hstack(*columns), constant))
        system, right = system.unify(right, fmt="dense")
        return np.array(list(system.to_field().lu_solve(right.to_field()).to_Matrix())).reshape(start.shape)


def amplification(scheme: Scheme) -> sympy.Matrix:
    """Return M(theta) with z' = M z, the scheme run on unit vectors, shape (width, width)."""
    system: Any = SymbolicOscillator()
    columns = []
    for i in range(scheme.width):
        unit = np.array([sympy.Integer(int(i == j)) for j in range(scheme.width)])
        after = scheme.step(system, unit, 0.0, THETA)
        columns.append(exact(after))
    return sympy.Matrix.hstack(*columns).applyfunc(lambda entry: sympy.cancel(entry, extension=True))


def characteristic(matrix: sympy.Matrix) -> sympy.Expr:
    """Return the characteristic polynomial in lambda, factored."""
    return sympy.factor(matrix.charpoly(LAMBDA).as_expr())
