"""C code of UFL densities and their derivatives at a point.

Fields, their gradients and constants become inputs. The type of the C variables is that of the inputs: numbers or GCC's
vectors.
SymPy differentiates and eliminates common subexpressions. It is loaded only if code is compiled.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.classes import (
    Coefficient,
    ComponentTensor,
    Conj,
    Constant,
    Division,
    Grad,
    Index,
    Indexed,
    IndexSum,
    ListTensor,
    Power,
    Product,
    ScalarValue,
    Sum,
    Variable,
    Zero,
)

from wavetank.base.errors import WavetankError


def symbols(density: Any, names: Mapping[Any, str]) -> Any:
    """Return a scalar density as a SymPy expression.

    Its inputs have the given names, such as ``h``; components of vectors and gradients have a number, ``h_0``.
    """
    return _value(apply_derivatives(apply_algebra_lowering(density)), (), {}, names)


def _value(o: Any, component: tuple[int, ...], at: Mapping[Any, int], names: Mapping[Any, str]) -> Any:
    def value(part: Any, of: tuple[int, ...] = ()) -> Any:
        return _value(part, of, at, names)

    parts = o.ufl_operands
    match o:
        case Zero():
            return sympy.Integer(0)
        case ScalarValue():
            number = float(o)
            return sympy.Integer(int(number)) if number.is_integer() else sympy.Float(number, 17)
        case Coefficient() | Constant():
            return named(names[o], *component)
        case Grad():
            return named(names[parts[0]], *component)
        case Conj() | Variable():
            return value(parts[0], component)
        case Sum():
            return value(parts[0], component) + value(parts[1], component)
        case Product():
            return value(parts[0]) * value(parts[1])
        case Division():
            return value(parts[0]) / value(parts[1])
        case Power():
            return value(parts[0]) ** value(parts[1])
        case Indexed():
            places = tuple(at[i] if isinstance(i, Index) else int(i) for i in parts[1])
            return value(parts[0], places)
        case ListTensor():
            return value(parts[component[0]], component[1:])
        case ComponentTensor():
            return _value(parts[0], (), {**at, **dict(zip(parts[1], component, strict=True))}, names)
        case IndexSum():
            (index,) = parts[1]
            return sum(_value(parts[0], component, {**at, index: k}, names) for k in range(o.dimension()))
    raise WavetankError(
        f"an energy with {type(o).__name__} in UFL: no code is made of that (wavetank/fem/pointwise.py)."
    )


def named(name: str, *component: int) -> Any:
    """Return the symbol of an input, or of one of its components."""
    return sympy.Symbol("_".join([name, *map(str, component)]), real=True)


def branches(
    density: Any,
    makes: Callable[[Any], Mapping[str, Any]],
    *,
    fields: Sequence[Sequence[str]],
    constants: Sequence[str],
) -> str:
    """Return C statements that set results of a density, with a branch without constants if these have no effect.

    The constants that vanish with a field, its value and its slopes, belong to a paddle's shape. Far from the paddle
    its displacement is zero in all lanes of a vector, and the density is that of water in a fixed tank.
    """
    freeing = [n for n, field in enumerate(fields) if _frees(density, field, constants)]
    everywhere = statements(makes(density))
    if not freeing:
        return everywhere
    bare = density.xreplace({named(name): sympy.Integer(0) for n in freeing for name in fields[n]})
    there = " && ".join(f"nothing(f + {n * len(fields[n])}, {len(fields[n])})" for n in freeing)
    return f"if ({there}) {{\n{statements(makes(bare))}\n}} else {{\n{everywhere}\n}}"


def _frees(density: Any, field: Sequence[str], constants: Sequence[str]) -> bool:
    """Return whether the density is finite and has fewer constants if a field is zero."""
    rest = density.xreplace({named(name): sympy.Integer(0) for name in field})
    of = {named(name) for name in constants}
    return bool(rest.free_symbols & of < density.free_symbols & of and not rest.has(sympy.zoo, sympy.nan))


def statements(outputs: Mapping[str, Any]) -> str:
    """Return C statements that set ``outputs`` to SymPy expressions.

    ``zero`` is added to them, so that constants have the same type. Reciprocals of divisors are separate statements,
    which compilers move out of loops.
    """
    values, inverses = [sympy.sympify(value) for value in outputs.values()], dict[Any, Any]()

    def times_inverse(base: Any, exponent: Any) -> Any:
        return inverses.setdefault(base, sympy.Symbol(f"i_{len(inverses)}", real=True)) ** -exponent

    def divides(e: Any) -> bool:
        return bool(e.is_Pow and e.exp.is_Integer and e.exp < 0)

    values = [value.replace(divides, lambda e: times_inverse(*e.args)) for value in values]
    shared, values = sympy.cse(values, symbols=sympy.numbered_symbols("t_"))
    lines = [f"const __auto_type {name} = 1.0 / ({_code(base)});" for base, name in inverses.items()]
    lines += [f"const __auto_type {name} = {_code(value)};" for name, value in shared]
    lines += [f"{name} = {_code(value)} + zero;" for name, value in zip(outputs, values, strict=True)]
    return "\n".join(lines)


def _code(value: Any) -> str:
    return str(sympy.ccode(value, user_functions={"Pow": [(lambda b, e: e.is_Integer, _power)]}))


def _power(base: str, power: str) -> str:
    """Return an integer power as a product, since C's pow does not accept vectors."""
    product = " * ".join([f"({base})"] * abs(int(power)))
    return f"({product})" if int(power) > 0 else f"1.0 / ({product})"
