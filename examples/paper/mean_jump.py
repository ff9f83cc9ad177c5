"""The scheme (23) in the mean and the jump of its traces, in symbols; derivation in docs/integrators.md.

Four statements are checked by exact arithmetic:

- ``form_defects``: (20) written in weighted means and jumps, for every weight alpha;
- ``local_error`` and ``modified_term``: on a smooth solution the mean has a local error dt⁵ times a combination of
  derivatives for any system, forced ones included: it is of fourth order;
- ``alternating_part``: an alternating part of the jump does not enter the mean in the first three orders, and obeys
  the parasitic equation;
- ``physical_root``: the effect of damping the third difference of the jump on frequency and amplitude of the
  oscillator.
"""

from math import factorial
from typing import Any, NamedTuple

import sympy
from sympy import QQ_I

t, h = sympy.symbols("t h")
q, p = sympy.symbols("q p")

# A non-separable, forced Hamiltonian of degree four with no symmetry that could hide a term.
HAMILTONIAN = (
    p**2 / 2
    + q**2
    + q**3 / 3
    - q * p**2 / 5
    + q**2 * p / 7
    + q**2 * p**2 / 2
    + t * q / 3
    + t**2 * q * p / 4
    - t**3 * p / 6
)
POINT = {q: sympy.Rational(1, 3), p: sympy.Rational(-2, 5), t: sympy.Rational(1, 2)}


# ---------------------------------------------------------------- the form
def form_defects() -> list[Any]:
    """Return the residual of (20) in means and jumps for every alpha; zero if the form is correct.

    With beta = 1 - alpha, the mean q = alpha q⁺ + beta q⁻ and the jump d = q⁺ - q⁻, and p with the weights swapped:

        q½ = q - beta d / 2 + dt/4 (f₀ + f½),     q' = q + dt/6 (f₀ + 4 f½ + f₁),
        d' = -beta/alpha d + dt/(6 alpha) (f₀ - 2 f½ + f₁).
    """
    alpha, q_minus, q_plus, f_0, f_half, f_1 = sympy.symbols("alpha q_minus q_plus f_0 f_half f_1")
    beta = 1 - alpha
    middle = (1 - 3 * beta / 2) * q_plus + 3 * beta / 2 * q_minus + h / 4 * (f_0 + f_half)
    minus = q_plus + h * f_half
    plus = (2 * middle / 3 - q_plus / 6 + (alpha - sympy.Rational(1, 2)) * minus + h / 6 * f_1) / alpha
    mean, jump = alpha * q_plus + beta * q_minus, q_plus - q_minus
    defects = (
        middle - (mean - beta * jump / 2 + h / 4 * (f_0 + f_half)),
        alpha * plus + beta * minus - (mean + h / 6 * (f_0 + 4 * f_half + f_1)),
        plus - minus - (-beta / alpha * jump + h / (6 * alpha) * (f_0 - 2 * f_half + f_1)),
    )
    return [sympy.simplify(defect) for defect in defects]


# ---------------------------------------------------------------- smooth solutions
def field() -> sympy.Matrix:
    """Return f = (H_p, -H_q) in q, p and t."""
    return sympy.Matrix([sympy.diff(HAMILTONIAN, p), -sympy.diff(HAMILTONIAN, q)])


def along(expression: Any) -> Any:
    """Return the derivative of an expression in q, p and t along the flow."""
    f = field()
    partial = [expression.diff(symbol) for symbol in (q, p, t)]
    return (partial[0] * f[0] + partial[1] * f[1] + partial[2]).applyfunc(sympy.expand)


def derivatives(order: int) -> list[sympy.Matrix]:
    """Return z', z'', ... up to that order along the flow, in q, p and t."""
    found = [field()]
    while len(found) < order:
        found.append(along(found[-1]))
    return found


def truncated(vector: sympy.Matrix, order: int) -> sympy.Matrix:
    """Return a polynomial in h without its powers above ``order``."""

    def cut(entry: Any) -> Any:
        return sum(c * h**n for (n,), c in sympy.Poly(sympy.expand(entry), h).terms() if n <= order)

    return vector.applyfunc(cut)


class Step(NamedTuple):
    """Mean and jump after a step, polynomials in h and in the previous jump."""

    mean: sympy.Matrix
    jump: sympy.Matrix


def step(jump: sympy.Matrix, order: int) -> Step:
    """Return a step of (23) from the point ``POINT`` with that jump up to a power of h, the stage solved exactly."""

    def f(z: sympy.Matrix, later: Any) -> sympy.Matrix:
        moved = {q: z[0], p: z[1], t: POINT[t] + later}
        return truncated(field().subs(moved, simultaneous=True), order)

    z = sympy.Matrix([POINT[q], POINT[p]])
    f_0 = f(z + jump / 2, 0)
    z_half = z
    for _ in range(order + 1):
        z_half = truncated(z - jump / 4 + h / 4 * (f_0 + f(z_half, h / 2)), order)
    f_half = f(z_half, h / 2)
    f_1 = f(z + jump / 2 + h * f_half, h)
    mean = truncated(z + h / 6 * (f_0 + 4 * f_half + f_1), order)
    return Step(mean, truncated(-jump + h / 3 * (f_0 - 2 * f_half + f_1), order))


def local_error() -> list[sympy.Matrix]:
    """Return the coefficients of h, ..., h⁵ in the mean's error after a step with the jump of a smooth solution."""
    z = [one.subs(POINT) for one in derivatives(5)]
    exact = sympy.Matrix([POINT[q], POINT[p]])
    for n, one in enumerate(z, start=1):
        exact += h**n / sympy.factorial(n) * one
    error = step(h**3 / 24 * z[2], 5).mean - exact
    return [error.applyfunc(lambda entry, n=n: sympy.expand(entry).coeff(h, n)) for n in range(1, 6)]


def modified_term() -> sympy.Matrix:
    """Return g of the mean's modified equation dz/dt = f + dt⁴ g + ..., at ``POINT``.

    g = z⁽⁵⁾/2880 - f_z z⁗/576 - (f_z)' z‴/288 + f_z² z‴/288, all derivatives along the flow.
    """
    z = derivatives(5)
    slope = field().jacobian([q, p])
    change = sympy.Matrix(2, 2, lambda i, j: along(sympy.Matrix([slope[i, j]]))[0])
    g = z[4] / 2880 - slope * z[3] / 576 - change * z[2] / 288 + slope * slope * z[2] / 288
    return g.subs(POINT)


def alternating_part() -> Step:
    """Return the effect of a small alternating part e of the jump in a step: in the mean to h², in the jump to h.

    Both less what they should be, (0 and the parasitic equation's -(1 - h/2 f_z) e): zero if theory is right.
    """
    small = sympy.Symbol("small")
    e = sympy.Matrix([sympy.Rational(3, 7), sympy.Rational(-1, 4)])
    smooth = h**3 / 24 * derivatives(3)[2].subs(POINT)
    with_e = step(smooth + small * e, 2)

    def linear(vector: sympy.Matrix, power: int) -> sympy.Matrix:
        return truncated(vector.applyfunc(lambda entry: sympy.expand(entry).coeff(small, 1)), power)

    slope = field().jacobian([q, p]).subs(POINT)
    return Step(linear(with_e.mean, 2), linear(with_e.jump, 1) + e - h / 2 * slope * e)


# ---------------------------------------------------------------- the damped jump on the oscillator
def physical_root(kappa: Any, *, order: int = 10) -> list[Any]:
    """Return the coefficients of 1, theta, ..., theta^order of lambda exp(-i theta), exact, for a rational kappa.

    lambda is the root that the oscillator's motion belongs to, of the scheme whose jumps are damped.
    """
    theta, root = sympy.symbols("theta lambda")
    polynomial = sympy.Poly(characteristic(theta, sympy.Rational(kappa), root), theta, root, domain=QQ_I)
    rate = _at(polynomial.diff(root), [QQ_I(1)], 0)[0]
    found = [QQ_I(1)]
    for n in range(1, order + 1):  # one coefficient after another: P(theta, lambda) = 0, P_lambda(0, 1) = rate
        found.append(-_at(polynomial, [*found, QQ_I(0)], n)[n] / rate)
    turned = [QQ_I.from_sympy((-sympy.I) ** n / factorial(n)) for n in range(order + 1)]
    return [QQ_I.to_sympy(value) for value in _product(found, turned, order)]


def characteristic(theta: Any, kappa: Any, root: Any) -> Any:
    """Return the polynomial of the modes (z, d) lambda^n of dz/dt = i z, omega dt = theta."""
    z, d = sympy.symbols("z d")
    plus = z + d / 2
    half = (z - d / 4 + sympy.I * theta / 4 * plus) / (1 - sympy.I * theta / 4)
    f_0, f_half, f_1 = (sympy.I * theta * one for one in (plus, half, plus + sympy.I * theta * half))
    new = -d + (f_0 - 2 * f_half + f_1) / 3
    damped = new - kappa / 8 * (new - 3 * d + 3 * d / root - d / root**2)
    rows = (z + (f_0 + 4 * f_half + f_1) / 6 - root * z, damped - root * d)
    matrix = sympy.Matrix([[sympy.diff(sympy.expand(row), symbol) for symbol in (z, d)] for row in rows])
    return sympy.expand(sympy.numer(sympy.together(matrix.det())))


def _at(polynomial: sympy.Poly, root: list[Any], order: int) -> list[Any]:
    """Return a polynomial in theta and lambda at a power series for lambda, as one up to theta^order."""
    powers, total = [[QQ_I(1)]], [QQ_I(0)] * (order + 1)
    for _ in range(polynomial.degree(1)):
        powers.append(_product(powers[-1], root, order))
    for (n, m), coefficient in polynomial.rep.to_dict().items():
        for i, value in enumerate(powers[m][: max(0, order + 1 - n)]):
            total[n + i] += coefficient * value
    return total


def _product(a: list[Any], b: list[Any], order: int) -> list[Any]:
    """Return the product of two power series up to theta^order."""
    product = [QQ_I(0)] * (order + 1)
    for i, one in enumerate(a[: order + 1]):
        for j, other in enumerate(b[: order + 1 - i]):
            product[i + j] += one * other
    return product
