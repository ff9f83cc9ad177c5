"""Values with their first two derivatives in a variable: numpy's functions of them follow the chain rule.

``np.sin(Jet(t, 1, 0))`` is sin t with cos t and -sin t. Comparisons and conditions are those of the values.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

ONE_OF: dict[Any, Callable[[Any, Any], tuple[Any, Any]]] = {  # function -> slope and curvature, of u and the value f
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


class Jet(NamedTuple):
    """A value f with f' and f'', arrays of one shape."""

    f: Any
    slope: Any
    curvature: Any

    def __array_ufunc__(self, function: Any, method: str, *arguments: Any, **more: Any) -> Any:
        if function in ONE_OF:
            return _of(function, arguments[0])
        parts = [_jet(one) for one in arguments]
        return TWO_OF[function](*parts) if function in TWO_OF else function(*(one.f for one in parts))

    def __array_function__(self, function: Any, types: Any, arguments: Any, more: Any) -> Any:
        if function is np.where:
            condition, chosen, other = arguments
            return _chosen(condition, _jet(chosen), _jet(other))
        if function is np.clip:
            return np.minimum(np.maximum(*arguments[:2]), arguments[2])
        return NotImplemented


def _jet(value: Any) -> Jet:
    return value if isinstance(value, Jet) else Jet(value, 0.0, 0.0)


def _of(function: Any, a: Jet) -> Jet:
    """Return a function of one value."""
    f = function(a.f)
    first, second = ONE_OF[function](a.f, f)
    return Jet(f, first * a.slope, second * a.slope**2 + first * a.curvature)


def _chosen(condition: Any, a: Jet, b: Jet) -> Jet:
    return Jet(*(np.where(condition, *pair) for pair in zip(a, b, strict=True)))


def _product(a: Jet, b: Jet) -> Jet:
    curvature = a.curvature * b.f + 2.0 * a.slope * b.slope + a.f * b.curvature
    return Jet(a.f * b.f, a.slope * b.f + a.f * b.slope, curvature)


def _quotient(a: Jet, b: Jet) -> Jet:
    f = a.f / b.f
    slope = (a.slope - f * b.slope) / b.f
    return Jet(f, slope, (a.curvature - 2.0 * slope * b.slope - f * b.curvature) / b.f)


def _power(a: Jet, b: Jet) -> Jet:
    """Return a**b; of a constant b also where a is not positive."""
    if not (np.any(b.slope) or np.any(b.curvature)):
        n = np.asarray(b.f)
        first = np.where(n == 0.0, 0.0, n * np.power(a.f, np.where(n == 0.0, 1.0, n - 1.0)))
        second = np.where(n * (n - 1.0) == 0.0, 0.0, n * (n - 1.0) * np.power(a.f, np.where(n == 1.0, 1.0, n - 2.0)))
        return Jet(np.power(a.f, n), first * a.slope, second * a.slope**2 + first * a.curvature)
    return _of(np.exp, _product(b, _of(np.log, a)))


def _angle(a: Jet, b: Jet) -> Jet:
    square, turning = a.f**2 + b.f**2, b.f * a.slope - a.f * b.slope
    changing = b.f * a.curvature - a.f * b.curvature
    second = changing / square - 2.0 * turning * (a.f * a.slope + b.f * b.slope) / square**2
    return Jet(np.arctan2(a.f, b.f), turning / square, second)


def _sum(a: Jet, b: Jet, sign: float = 1.0) -> Jet:
    return Jet(*(one + sign * other for one, other in zip(a, b, strict=True)))


def _hypot(a: Jet, b: Jet) -> Jet:
    return _of(np.sqrt, _sum(_product(a, a), _product(b, b)))


TWO_OF: dict[Any, Callable[..., Jet]] = {
    np.positive: lambda a: a,
    np.negative: lambda a: Jet(-a.f, -a.slope, -a.curvature),
    np.add: _sum,
    np.subtract: lambda a, b: _sum(a, b, -1.0),
    np.multiply: _product,
    np.divide: _quotient,
    np.power: _power,
    np.hypot: _hypot,
    np.arctan2: _angle,
    np.minimum: lambda a, b: _chosen(a.f <= b.f, a, b),
    np.maximum: lambda a, b: _chosen(a.f >= b.f, a, b),
}
