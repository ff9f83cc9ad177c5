"""Values with their first two derivatives with respect to a variable; numpy's functions apply the chain rule.

``np.sin(Jet(t, 1, 0))`` is sin t with cos t and -sin t. Comparisons and conditions use the values.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

ONE_OF: dict[Any, Callable[[Any, Any], tuple[Any, Any]]] = {  # function -> slope and curvature, of u and f
    np.positive: lambda u, f: (1.0, 0.0),
    np.negative: lambda u, f: (-1.0, 0.0),
    np.absolute: lambda u, f: (np.sign(u), 0.0 * u),
    np.sqrt: lambda u, f: (0.5 / f, -0.25 / (f * u)),
    np.exp: lambda u, f: (f, f),
    np.log: lambda u, f: (1.0 / u, -1.0 / u**2),
    np.sin: lambda u, f: (np.cos(u), -f),
    np.cos: lambda u, f: (-np.sin(u), -f),
    np.tan: lambda u, f: (1.0 + f**2, 2.0 * f * (1.0 + f**2)),
    np.arcsin: lambda u, f: ((1.0 - u**2) ** -0.5, u * (1.0 - u**2) ** -1.5),
    np.arccos: lambda u, f: (-((1.0 - u**2) ** -0.5), -u * (1.0 - u**2) ** -1.5),
    np.arctan: lambda u, f: (1.0 / (1.0 + u**2), -2.0 * u / (1.0 + u**2) ** 2),
    np.sinh: lambda u, f: (np.cosh(u), f),
    np.cosh: lambda u, f: (np.sinh(u), f),
    np.tanh: lambda u, f: (1.0 - f**2, -2.0 * f * (1.0 - f**2)),
    np.arcsinh: lambda u, f: ((1.0 + u**2) ** -0.5, -u * (1.0 + u**2) ** -1.5),
    np.arccosh: lambda u, f: ((u**2 - 1.0) ** -0.5, -u * (u**2 - 1.0) ** -1.5),
    np.arctanh: lambda u, f: (1.0 / (1.0 - u**2), 2.0 * u / (1.0 - u**2) ** 2),
}


def _times(value: Any, factor: Any) -> Any:
    """Return a product that is zero if the factor is, for any value."""
    return np.where(factor == 0.0, 0.0, value * factor)


def _sum(products: Any) -> Any:
    """Return the sum of products of partial derivatives and rates, without those of constants."""
    return sum((partial * rate for partial, rate in products if np.any(rate)), start=0.0)


TWO_OF: dict[
    Any, Callable[[Any, Any, Any], tuple[Any, ...]]
] = {  # partial derivatives of f(a, b): by a, by b, by aa, by ab, by bb
    np.add: lambda a, b, f: (1.0, 1.0, 0.0, 0.0, 0.0),
    np.subtract: lambda a, b, f: (1.0, -1.0, 0.0, 0.0, 0.0),
    np.multiply: lambda a, b, f: (b, a, 0.0, 1.0, 0.0),
    np.divide: lambda a, b, f: (1.0 / b, -f / b, 0.0, -1.0 / b**2, 2.0 * f / b**2),
    np.power: lambda a, b, f: (
        _times(a ** (b - 1.0), b),
        f * np.log(a),
        _times(a ** (b - 2.0), b * (b - 1.0)),
        a ** (b - 1.0) * (1.0 + b * np.log(a)),
        f * np.log(a) ** 2,
    ),
    np.hypot: lambda a, b, f: (a / f, b / f, b**2 / f**3, -a * b / f**3, a**2 / f**3),
    np.arctan2: lambda a, b, f: tuple(
        part / (a**2 + b**2) ** n
        for part, n in ((b, 1), (-a, 1), (-2.0 * a * b, 2), (a**2 - b**2, 2), (2.0 * a * b, 2))
    ),
    np.minimum: lambda a, b, f: (1.0 * (a <= b), 1.0 * (a > b), 0.0, 0.0, 0.0),
    np.maximum: lambda a, b, f: (1.0 * (a >= b), 1.0 * (a < b), 0.0, 0.0, 0.0),
}


class Jet(NamedTuple):
    """A value f with f' and f'', arrays of one shape."""

    f: Any
    slope: Any
    curvature: Any

    def __array_ufunc__(self, function: Any, method: str, *arguments: Any, **more: Any) -> Any:
        jets = [_jet(one) for one in arguments]
        f = function(*(one.f for one in jets))
        if function in ONE_OF:
            (u,) = jets
            first, second = ONE_OF[function](u.f, f)
            return Jet(f, first * u.slope, second * u.slope**2 + first * u.curvature)
        if function not in TWO_OF:
            return f
        a, b = jets
        by_a, by_b, by_aa, by_ab, by_bb = TWO_OF[function](a.f, b.f, f)
        first = (by_a, a.slope), (by_b, b.slope)
        second = (by_aa, a.slope**2), (2.0 * by_ab, a.slope * b.slope), (by_bb, b.slope**2)
        second = *second, (by_a, a.curvature), (by_b, b.curvature)
        return Jet(f, _sum(first), _sum(second))

    def __array_function__(self, function: Any, types: Any, arguments: Any, more: Any) -> Any:
        if function is np.where:
            condition, chosen, other = arguments
            pairs = zip(_jet(chosen), _jet(other), strict=True)
            return Jet(*(np.where(condition, *pair) for pair in pairs))
        if function is np.clip:
            return np.minimum(np.maximum(*arguments[:2]), arguments[2])
        return NotImplemented


def _jet(value: Any) -> Jet:
    return value if isinstance(value, Jet) else Jet(value, 0.0, 0.0)
