"""Formulae in a case file: arithmetic of x and y, parsed safely and evaluated by numpy.

Python's grammar parses the text. The tables of this file translate its tree into functions of numpy and refuse
everything else. A formula is thus restricted to arithmetic, always in float64.
"""

import ast
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from keyword import iskeyword
from typing import Any, Literal, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavetank.base.errors import InputError, choice
from wavetank.base.jet import Jet

Array = NDArray[np.float64]
Helper = float | str  # a number or a formula
Kind = Literal["number", "condition"]
MAX_LENGTH = 4000  # largest number of characters of a formula
MAX_DEPTH = 100  # largest depth of its tree, which grows with the terms of a sum; far below Python's limit

CONSTANTS = {"pi": np.pi}
OPERATORS: dict[type[ast.AST], tuple[np.ufunc, Kind, Kind]] = {  # operator -> function, kinds of argument and value
    ast.USub: (np.negative, "number", "number"),
    ast.UAdd: (np.positive, "number", "number"),
    ast.Add: (np.add, "number", "number"),
    ast.Sub: (np.subtract, "number", "number"),
    ast.Mult: (np.multiply, "number", "number"),
    ast.Div: (np.divide, "number", "number"),
    ast.Pow: (np.power, "number", "number"),
    ast.Lt: (np.less, "number", "condition"),
    ast.LtE: (np.less_equal, "number", "condition"),
    ast.Gt: (np.greater, "number", "condition"),
    ast.GtE: (np.greater_equal, "number", "condition"),
    ast.Eq: (np.equal, "number", "condition"),
    ast.NotEq: (np.not_equal, "number", "condition"),
    **dict.fromkeys((ast.Not, ast.Invert), (np.logical_not, "condition", "condition")),
    **dict.fromkeys((ast.And, ast.BitAnd), (np.logical_and, "condition", "condition")),
    **dict.fromkeys((ast.Or, ast.BitOr), (np.logical_or, "condition", "condition")),
}
ALLOWED = "allowed are numbers, names, + - * / **, comparisons < <= > >= == !=, and, or, not, and functions"
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

    Allowed are numbers, ``pi``, ``+ - * / **``, comparisons, conditions joined by ``and``, ``or``, ``not`` (or ``& |
    ~`` between parentheses), and the functions of ``FUNCTIONS``, with numpy's names and meaning.

    Parameters
    ----------
    text
        The expression.
    where
        Named helpers, which may depend on each other: ``{"xr": "x*cos(a) - y*sin(a)", "a": 0.349}``.
    variables
        Variables of the formula.

    Raises ``InputError`` with the invalid part, its column and what is allowed.
    """

    def __init__(self, text: str, *, where: Mapping[str, Helper] | None = None, variables: Sequence[str] = ("x", "y")):
        self.text, self._variables = _flat(text), tuple(variables)
        helpers = {name: _flat(str(helper)) for name, helper in (where or {}).items()}
        kinds: dict[str, Kind] = dict.fromkeys((*self._variables, *CONSTANTS), "number")
        _check_names(helpers, kinds)
        trees = {name: _parsed(helper, f"helper {name!r}") for name, helper in helpers.items()}
        self._helpers: dict[str, _Part] = {}
        for name in _in_order(trees):
            source = _Source(f"helper {name!r}", helpers[name], kinds, helped=True)
            self._helpers[name] = source.part(trees[name])
            kinds[name] = self._helpers[name].kind
        source = _Source("formula", self.text, kinds, helped=where is not None)
        self._part = source.part(_parsed(self.text, "formula"), "number")

    def __call__(self, *coordinates: ArrayLike) -> Array:
        """Return the values, float64 in the shape of the coordinates; raise ``InputError`` unless they are finite."""
        arrays = np.broadcast_arrays(*(np.asarray(one, dtype=np.float64) for one in coordinates))
        places = dict(zip(self._variables, arrays, strict=True))
        return self._checked(self._evaluate(places), places)

    def derivatives(self, coordinate: ArrayLike) -> Array:
        """Return value, slope and curvature of a formula of one variable, exact; raise as a call does.

        The result has shape (3, ...) for coordinates of shape (...).
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
    """Return values if all are finite; raise ``InputError`` with the first position of a value that is not.

    Values and coordinates have one shape; the message begins with the source.
    """
    right = np.isfinite(values)
    if not right.all():
        index = int(right.argmin())
        where = ", ".join(f"{name} = {place.flat[index]:.6g}" for name, place in places.items())
        raise InputError(f"{source}: {values.flat[index]} at {where}; must be finite.")
    return values


class _Part(NamedTuple):
    """A part of a formula: its function of the values of names, and its kind, number or condition."""

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
    """Return the text on one line, to which columns refer; Python's grammar would end at the first line break."""
    return re.sub(r"\s", " ", text).strip()


def _parsed(text: str, label: str) -> ast.expr:
    if len(text) > MAX_LENGTH:
        raise InputError(f"{label}: has {len(text)} characters; at most {MAX_LENGTH} are allowed.")
    if other := re.search("[^ -~]|#", text):  # a comment would end the formula
        raise InputError(f"{label}, column {other.start() + 1}: {other[0]!r} received; must be ASCII, no comments.")
    try:
        return ast.parse(text, mode="eval").body
    except SyntaxError as error:
        raise InputError(f"{label}, column {max(1, error.offset or 1)}: {error.msg} in {text[:60]!r}.") from None
    except (MemoryError, RecursionError):
        raise InputError(f"{label}: is nested too deeply; at most {MAX_DEPTH} levels are allowed.") from None


def _in_order(trees: Mapping[str, ast.expr]) -> list[str]:
    """Return the names of the helpers, each after those on which it depends."""
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
class _Source(NamedTuple):
    """A text whose tree is translated into parts.

    Attributes
    ----------
    label
        Name of the text in errors.
    text
        The parsed text.
    kinds
        Allowed names and the kinds of their values.
    helped
        Whether further names may be defined in ``where``.
    """

    label: str
    text: str
    kinds: Mapping[str, Kind]
    helped: bool

    def refuse(self, node: ast.AST, what: str) -> NoReturn:
        """Raise the ``InputError`` for a node."""
        received = ast.get_source_segment(self.text, node) or self.text
        raise InputError(f"{self.label}, column {getattr(node, 'col_offset', 0) + 1}: {received[:60]!r} {what}.")

    def part(self, node: ast.AST, needed: Kind | None = None, depth: int = 1) -> _Part:
        """Return the part of a node, of a required kind, if any; refuse nodes that are not in the tables."""
        if depth > MAX_DEPTH:
            self.refuse(node, f"is nested too deeply; at most {MAX_DEPTH} levels, or terms of a sum, are allowed")
        match node:
            case ast.Constant(value=value):
                if not isinstance(value, int | float) or isinstance(value, bool) or abs(value) > sys.float_info.max:
                    self.refuse(node, "is not a finite real number")
                number = np.float64(value)  # any spelling
                result = _Part(lambda values: number, "number")
            case ast.Name(id=name):
                result = _Part(lambda values: values[name], self._kind(node, name))
            case _:
                function, kinds, kind, nodes = self._operation(node)
                parts = [self.part(*pair, depth + 1) for pair in zip(nodes, kinds, strict=True)]
                result = _Part(lambda values: function(*[one.value(values) for one in parts]), kind)
        if needed not in (None, result.kind):
            self.refuse(node, f"is a {result.kind}; a {needed} is needed here")
        return result

    def _kind(self, node: ast.AST, name: str) -> Kind:
        """Return the kind of the value of a name."""
        if name in FUNCTIONS:
            self.refuse(node, f"is a function and needs its arguments, {name}(...)")
        if name not in self.kinds:
            own = f"; what it stands for is said by where = {{ {name} = ... }}" if self.helped else ""
            self.refuse(node, f"is an unknown name{choice(name, sorted([*self.kinds, *FUNCTIONS]))}{own}")
        return self.kinds[name]

    def _operation(self, node: ast.AST) -> tuple[Callable[..., Any], Sequence[Kind], Kind, Sequence[ast.AST]]:
        """Return the function of a node, the kinds of its arguments and of its value, and the nodes of arguments."""
        match node:
            case ast.UnaryOp(op=op, operand=operand):
                nodes = [operand]
            case ast.BinOp(left=left, op=op, right=right) | ast.Compare(left=left, ops=[op], comparators=[right]):
                nodes = [left, right]
            case ast.BoolOp(op=op, values=[first, *others]):
                rest = ast.copy_location(ast.BoolOp(op, others), others[0])
                nodes = [first, rest if len(others) > 1 else others[0]]
            case ast.Compare(left=left, ops=[first, *others], comparators=[middle, *rest]):
                pair, following = ast.Compare(left, [first], [middle]), ast.Compare(middle, others, rest)
                op, nodes = ast.And(), [ast.copy_location(one, node) for one in (pair, following)]
            case ast.Call(func=called, args=nodes, keywords=keywords):
                name = called.id if isinstance(called, ast.Name) else ""
                if name not in FUNCTIONS:
                    self.refuse(called, f"is not a function of a formula{choice(name, sorted(FUNCTIONS))}")
                function, kinds = FUNCTIONS[name]
                if keywords or len(nodes) != len(kinds):
                    self.refuse(node, f"must have {len(kinds)} argument{'s' * (len(kinds) > 1)}")
                return function, kinds, "number", nodes
            case _:
                self.refuse(node, f"is not allowed in a formula; {HINTS.get(type(node), ALLOWED)}")
        if type(op) not in OPERATORS:
            self.refuse(node, f"holds an operator that is not allowed; {HINTS.get(type(op), ALLOWED)}")
        ufunc, takes, gives = OPERATORS[type(op)]
        return ufunc, [takes] * len(nodes), gives, nodes
