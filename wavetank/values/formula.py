"""Formulae in a case file: arithmetic of x and y, parsed safely and evaluated by numpy.

Python's grammar parses the text; the tables of this file translate its tree into functions of numpy, and what is not in
them is refused. A formula thus reaches nothing but arithmetic, and always in float64.
"""

import ast
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from graphlib import CycleError, TopologicalSorter
from itertools import pairwise
from keyword import iskeyword
from typing import Any, Literal, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavetank.errors import InputError, choice
from wavetank.values.jet import Jet

Array = NDArray[np.float64]
Helper = float | str  # a number, or a formula of its own
Kind = Literal["number", "condition"]
LONGEST = 4000  # characters of one formula
DEEPEST = 100  # levels of its tree, terms of a sum among them: well inside Python's own limit

CONSTANTS = {"pi": np.pi}
UNARY: dict[type[ast.unaryop], tuple[np.ufunc, Kind]] = {  # operator -> function, and what it takes and gives
    ast.USub: (np.negative, "number"),
    ast.UAdd: (np.positive, "number"),
    ast.Not: (np.logical_not, "condition"),
    ast.Invert: (np.logical_not, "condition"),
}
BINARY: dict[type[ast.operator], tuple[np.ufunc, Kind]] = {
    ast.Add: (np.add, "number"),
    ast.Sub: (np.subtract, "number"),
    ast.Mult: (np.multiply, "number"),
    ast.Div: (np.divide, "number"),
    ast.Pow: (np.power, "number"),
    ast.BitAnd: (np.logical_and, "condition"),
    ast.BitOr: (np.logical_or, "condition"),
}
JOINS: dict[type[ast.boolop], np.ufunc] = {ast.And: np.logical_and, ast.Or: np.logical_or}
COMPARISONS: dict[type[ast.cmpop], np.ufunc] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
ALLOWED = "allowed are numbers, names, + - * / **, comparisons, and, or, not, and functions"
HINTS: dict[type[ast.AST], str] = {
    ast.BitXor: "a power is written **",
    ast.IfExp: "a choice is written where(condition, a, b)",
}
_ONE = "abs sqrt exp log sin cos tan arcsin arccos arctan sinh cosh tanh arcsinh arccosh arctanh"
FUNCTIONS: dict[str, tuple[Callable[..., Any], tuple[Kind, ...]]] = {  # name -> function and its arguments
    **{name: (getattr(np, name), ("number",)) for name in _ONE.split()},
    "arctan2": (np.arctan2, ("number", "number")),
    "hypot": (np.hypot, ("number", "number")),
    "min": (np.minimum, ("number", "number")),
    "max": (np.maximum, ("number", "number")),
    "clip": (np.clip, ("number", "number", "number")),
    "where": (np.where, ("condition", "number", "number")),
}

Values = dict[str, Any]


class Formula:
    """An expression of coordinates, such as ``0.45 - where(xr < -5.82, 0, (5.82 + xr)/50)``.

    Allowed are numbers, ``pi``, ``+ - * / **``, comparisons, conditions joined by ``and``, ``or``, ``not`` (or
    ``& | ~`` between parentheses), and the functions of ``FUNCTIONS``, with numpy's names and meaning.

    Parameters
    ----------
    text
        The expression.
    where
        Named parts of it, which may name one another: ``{"xr": "x*cos(a) - y*sin(a)", "a": 0.349}``.
    variables
        What the formula is a function of.

    Raises ``InputError`` that names the offending part, its column and what is allowed.
    """

    def __init__(self, text: str, *, where: Mapping[str, Helper] | None = None, variables: Sequence[str] = ("x", "y")):
        self.text, self._variables = _flat(text), tuple(variables)
        helpers = {name: _flat(str(helper)) for name, helper in (where or {}).items()}
        kinds: dict[str, Kind] = dict.fromkeys((*self._variables, *CONSTANTS), "number")
        _check_names(helpers, kinds)
        trees = {name: _parsed(helper, f"helper {name!r}") for name, helper in helpers.items()}
        self._helpers: dict[str, _Part] = {}
        for name in _in_order(trees):
            part = _Translator(f"helper {name!r}", helpers[name], kinds, helped=True).visit(trees[name])
            self._helpers[name], kinds[name] = part, part.kind
        translator = _Translator("formula", self.text, kinds, helped=where is not None)
        self._part = translator.number(_parsed(self.text, "formula"))

    def __call__(self, *coordinates: ArrayLike) -> Array:
        """Return the values, float64 of the coordinates' common shape; raise ``InputError`` where one is not finite."""
        arrays = np.broadcast_arrays(*(np.asarray(one, dtype=np.float64) for one in coordinates))
        places = dict(zip(self._variables, arrays, strict=True))
        return self._checked(self._evaluate(places), places)

    def derivatives(self, coordinate: ArrayLike) -> Array:
        """Return value, slope and curvature of a formula of one variable, exact; raise as a call does.

        Shape (3, ...), for coordinates of shape (...).
        """
        array = np.asarray(coordinate, dtype=np.float64)
        (variable,) = self._variables
        result = self._evaluate({variable: Jet(array, np.ones_like(array), np.zeros_like(array))})
        jet = result if isinstance(result, Jet) else Jet(result, 0.0, 0.0)
        return np.array([self._checked(one, {variable: array}) for one in jet])

    def _evaluate(self, variables: Mapping[str, Any]) -> Any:
        values: Values = {**CONSTANTS, **variables}
        with np.errstate(all="ignore"):  # an unused branch of where() may be undefined
            for name, helper in self._helpers.items():
                values[name] = helper.value(values)
            return self._part.value(values)

    def _checked(self, values: Any, places: Mapping[str, Array]) -> Array:
        shape = next(iter(places.values())).shape
        return finite(np.full(shape, values, dtype=np.float64), places, source=f"formula {self.text!r}")


def finite(values: Array, places: Mapping[str, Array], *, source: str) -> Array:
    """Return values if all are finite; raise ``InputError`` that names the first place where one is not.

    Values and the places' coordinates have one shape; the source is named first.
    """
    right = np.isfinite(values)
    if not right.all():
        index = int(right.argmin())
        where = ", ".join(f"{name} = {place.flat[index]:.6g}" for name, place in places.items())
        raise InputError(f"{source}: {values.flat[index]} at {where}; must be finite.")
    return values


class _Part(NamedTuple):
    """A part of a formula: how it follows from the values of the names, and whether it is a number or a condition."""

    value: Callable[[Values], Any]
    kind: Kind


# ---------------------------------------------------------------- reading
def _check_names(helpers: Mapping[str, str], reserved: Mapping[str, Kind]) -> None:
    for name in helpers:
        if name in reserved or name in FUNCTIONS or iskeyword(name):
            raise InputError(f"helper {name!r}: must have another name; this one has a meaning in every formula.")
        if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
            raise InputError(f"helper {name!r}: must have a name of letters, digits and _, a letter first.")


def _flat(text: str) -> str:
    """Return the text on one line, which columns count in; Python's grammar would end it at the first break."""
    return re.sub(r"\s", " ", text).strip()


def _parsed(text: str, label: str) -> ast.expr:
    if len(text) > LONGEST:
        raise InputError(f"{label}: has {len(text)} characters; at most {LONGEST} are allowed.")
    if other := re.search("[^ -~]|#", text):  # a comment would silently end the formula
        raise InputError(f"{label}, column {other.start() + 1}: {other[0]!r} received; must be ASCII, no comments.")
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise InputError(f"{label}, column {max(1, error.offset or 1)}: {error.msg} in {text[:60]!r}.") from None
    except (MemoryError, RecursionError):
        raise InputError(f"{label}: is nested too deeply; at most {DEEPEST} levels are allowed.") from None


def _in_order(trees: Mapping[str, ast.expr]) -> list[str]:
    """Return the helpers' names, each after those that it names."""
    names = {
        name: {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)} & set(trees)
        for name, tree in trees.items()
    }
    try:
        return list(TopologicalSorter(names).static_order())
    except CycleError as error:
        circle = " -> ".join(error.args[1][::-1])
        raise InputError(f"helpers must not need one another in a circle: {circle}.") from None


# ---------------------------------------------------------------- translating
class _Translator(ast.NodeVisitor):
    """Translates a text's tree into parts; a node without a method here is refused.

    Parameters
    ----------
    label
        What the text is, for errors.
    text
        What the tree was parsed from.
    kinds
        The allowed names and their values.
    helped
        Whether others may be given in ``where``.
    """

    def __init__(self, label: str, text: str, kinds: Mapping[str, Kind], *, helped: bool):
        self._label, self._text, self._kinds, self._helped, self._depth = label, text, kinds, helped, 0

    def refuse(self, node: ast.AST, what: str) -> NoReturn:
        """Raise the ``InputError`` on a node."""
        received = ast.get_source_segment(self._text, node) or self._text
        raise InputError(f"{self._label}, column {getattr(node, 'col_offset', 0) + 1}: {received[:60]!r} {what}.")

    def visit(self, node: ast.AST) -> _Part:
        """Return the part that a node is."""
        self._depth += 1
        if self._depth > DEEPEST:
            self.refuse(node, f"is nested too deeply; at most {DEEPEST} levels, or terms of a sum, are allowed")
        part: _Part = super().visit(node)
        self._depth -= 1
        return part

    def of_kind(self, kind: Kind, node: ast.expr) -> _Part:
        """Return the part that a node is, which must be of a kind."""
        part = self.visit(node)
        if part.kind != kind:
            self.refuse(node, f"is a {part.kind}; a {kind} is needed here")
        return part

    def number(self, node: ast.expr) -> _Part:
        """Return the part that a node is, which must be a number."""
        return self.of_kind("number", node)

    def generic_visit(self, node: ast.AST) -> NoReturn:
        """Refuse what has no method of its own."""
        self.refuse(node, f"is not allowed in a formula; {HINTS.get(type(node), ALLOWED)}")

    def visit_Constant(self, node: ast.Constant) -> _Part:
        """Return a number, float64 whatever its spelling."""
        value = node.value
        if not isinstance(value, int | float) or isinstance(value, bool) or abs(value) > sys.float_info.max:
            self.refuse(node, "is not a finite real number")
        number = np.float64(value)
        return _Part(lambda values: number, "number")

    def visit_Name(self, node: ast.Name) -> _Part:
        """Return the value of a name."""
        name = node.id
        if name in FUNCTIONS:
            self.refuse(node, f"is a function and needs its arguments, {name}(...)")
        if name not in self._kinds:
            own = f"; what it stands for is said by where = {{ {name} = ... }}" if self._helped else ""
            self.refuse(node, f"is an unknown name{choice(name, sorted([*self._kinds, *FUNCTIONS]))}{own}")
        return _Part(lambda values: values[name], self._kinds[name])

    def visit_UnaryOp(self, node: ast.UnaryOp) -> _Part:
        """Return a number with a sign, or a negated condition."""
        function, kind = UNARY[type(node.op)]
        return _applied(function, kind, [self.of_kind(kind, node.operand)])

    def visit_BinOp(self, node: ast.BinOp) -> _Part:
        """Return two numbers, or conditions, joined by an operator."""
        if type(node.op) not in BINARY:
            self.refuse(node, f"holds an operator that is not allowed; {HINTS.get(type(node.op), ALLOWED)}")
        function, kind = BINARY[type(node.op)]
        return _applied(function, kind, [self.of_kind(kind, side) for side in (node.left, node.right)])

    def visit_BoolOp(self, node: ast.BoolOp) -> _Part:
        """Return conditions joined by ``and`` or ``or``."""
        conditions = [self.of_kind("condition", one) for one in node.values]
        return _applied(lambda *values: reduce(JOINS[type(node.op)], values), "condition", conditions)

    def visit_Compare(self, node: ast.Compare) -> _Part:
        """Return the condition of a comparison, such as ``0 < x <= 1``: all of its neighbours compare so."""
        if not all(type(one) in COMPARISONS for one in node.ops):
            self.refuse(node, "holds a comparison that is not allowed; allowed are < <= > >= == !=")
        functions = [COMPARISONS[type(one)] for one in node.ops]

        def compare(*values: Any) -> Any:
            pairs = zip(functions, pairwise(values), strict=True)
            return reduce(np.logical_and, [function(*pair) for function, pair in pairs])

        return _applied(compare, "condition", [self.number(one) for one in (node.left, *node.comparators)])

    def visit_Call(self, node: ast.Call) -> _Part:
        """Return a function of its arguments."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in FUNCTIONS:
            self.refuse(node.func, f"is not a function of a formula{choice(name, sorted(FUNCTIONS))}")
        function, kinds = FUNCTIONS[name]
        if node.keywords or len(node.args) != len(kinds):
            self.refuse(node, f"must have {len(kinds)} argument{'s' * (len(kinds) > 1)}")
        arguments = zip(kinds, node.args, strict=True)
        return _applied(function, "number", [self.of_kind(kind, argument) for kind, argument in arguments])


def _applied(function: Callable[..., Any], kind: Kind, parts: Sequence[_Part]) -> _Part:
    """Return the part that is a function of parts."""
    return _Part(lambda values: function(*[part.value(values) for part in parts]), kind)
