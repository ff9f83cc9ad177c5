"""State of a run as a tree of plain data, written as JSON and arrays, and read again.

A tree consists of dataclasses, named tuples, dictionaries, lists, numbers, strings, None and arrays. The last axis of
an array runs over the degrees of freedom of this rank, so that a checkpoint orders its values by location.
``Replicated`` arrays are equal on all ranks, and lists in JSON. An object with state of the run has one dataclass
``state``, which is replaced on resume: the resumed run equals the uninterrupted one bit for bit.
"""

import itertools
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, fields, is_dataclass
from functools import cache
from math import inf
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.base.errors import InputError

Replicated = Annotated[Vector, "the same on all ranks"]
MAX_NUMBER = 1e30  # of all numbers
StateTree = dict[str, Any]  # tree without dataclasses


def has_state(part: object) -> bool:
    """Return whether an object has state of the run."""
    return is_dataclass(getattr(part, "state", None))


def restore(part: Any, tree: Any, where: str) -> None:
    """Replace the state of an object; collective. Raises ``ValueError`` for a tree of another type or shape."""
    value = typed(type(part.state), tree, where)
    check_like(part.state, value, where)
    part.state = value


def check_like(example: Any, value: Any, where: str, *, exact: bool = False) -> None:
    """Raise ``ValueError`` for a value whose types or shapes of arrays differ from those of an example.

    An axis without entries in the example may have any length. Unless ``exact``, None has any type, and integers may be
    floats.
    """
    if example is None or value is None and not exact:
        return
    mine, its, kind = _fields_of(example), _fields_of(value), type(example)
    if mine is not None and its is not None:
        for name in mine.keys() & its.keys():
            check_like(mine[name], its[name], f"{where}.{name}", exact=exact)
    elif isinstance(example, np.ndarray) and isinstance(value, np.ndarray):
        like = len(value.shape) == len(example.shape) and value.dtype == np.float64
        if not like or any(size not in (0, own) for size, own in zip(example.shape, value.shape, strict=True)):
            raise ValueError(f"{where} is an array of shape {value.shape}: must be like {example.shape}")
    elif isinstance(example, list | tuple) and isinstance(value, list | tuple):
        for n, one in enumerate(value if example else ()):
            check_like(example[0], one, f"{where}[{n}]", exact=exact)
    elif kind in (bool, int, float, str):
        typed(float if kind is int and not exact else kind, value, where)
    else:
        raise _type_error(kind, value, where)


def _fields_of(value: Any) -> Mapping[str, Any] | None:
    """Return the fields of a dataclass, named tuple or dictionary; None for other objects."""
    kind: Any = type(value)
    if _has_fields(kind):
        return {name: getattr(value, name) for name in hints_of(kind)}
    return value if isinstance(value, dict) else None


def named(parts: Iterable[object]) -> dict[str, Any]:
    """Return objects with state by the names of their classes, the second of a class as "Class 2".

    Classes that may replace each other in a resumed run have one ``state_name``.
    """
    result: dict[str, Any] = {}
    for part in parts:
        if has_state(part):
            name = getattr(part, "state_name", type(part).__name__)
            before = sum(getattr(other, "state_name", type(other).__name__) == name for other in result.values())
            result[f"{name} {before + 1}" if before else name] = part
    return result


def restore_all(parts: Mapping[str, Any], trees: Mapping[str, Any], *, may_be_new: Sequence[str] = ()) -> None:
    """Replace the states of objects; collective.

    Raises ``InputError`` unless the trees have the same names; objects that ``may_be_new`` keep their states if they
    have no tree.
    """
    mine = {name: part for name, part in parts.items() if name in trees or name.partition(" ")[0] not in may_be_new}
    if mine.keys() != trees.keys():
        its, ours = (", ".join(names) or "nothing" for names in (trees, mine))
        raise InputError(f"the state of {its} cannot be that of {ours}: a resumed run needs the same diagnostics.")
    for name, part in mine.items():
        restore(part, trees[name], name)


def count(value: object) -> int:
    """Return a count, an index of arrays in compiled code; raises ``ValueError`` for other values."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**31:
        raise ValueError(f"{value!r} is no count")
    return value


def ascends(times: Sequence[float]) -> bool:
    """Return whether times ascend."""
    return all(later > earlier for earlier, later in itertools.pairwise(times))


@cache
def hints_of(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a dataclass or named tuple."""
    names = [one.name for one in fields(kind)] if is_dataclass(kind) else kind._fields
    hints = get_type_hints(kind, include_extras=True)
    return {name: hints[name] for name in names}


def _has_fields(kind: Any) -> bool:
    return isinstance(kind, type) and (is_dataclass(kind) or (issubclass(kind, tuple) and hasattr(kind, "_fields")))


def plain(tree: Any, kind: Any = Any) -> Any:
    """Return a tree with dictionaries for dataclasses and named tuples, and lists for replicated arrays."""
    own: Any = type(tree)
    if _has_fields(own):
        return {name: plain(getattr(tree, name), hint) for name, hint in hints_of(own).items()}
    if isinstance(tree, np.ndarray):
        return tree.tolist() if Replicated in (kind, *get_args(kind)) else tree
    if isinstance(tree, list | tuple):
        return [plain(one, next(iter(get_args(kind)), Any)) for one in tree]
    return {name: plain(one) for name, one in tree.items()} if isinstance(tree, dict) else tree


def typed(kind: Any, tree: Any, where: str) -> Any:
    """Return the value of a type for a tree of ``plain``.

    Raises ``ValueError`` with the path ``where`` for a tree of another type.
    """
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return tree
    if origin in (Union, UnionType):
        for one in arguments[:-1]:
            with suppress(ValueError):
                return typed(one, tree, where)
        return typed(arguments[-1], tree, where)
    if _has_fields(kind) and isinstance(tree, dict) and tree.keys() == hints_of(kind).keys():
        return kind(**{name: typed(hint, tree[name], f"{where}.{name}") for name, hint in hints_of(kind).items()})
    if origin is np.ndarray and isinstance(tree, np.ndarray) and tree.dtype == np.float64:
        return tree
    if origin is Annotated and isinstance(tree, list):
        return np.array(tree, dtype=np.float64)
    if origin is list and isinstance(tree, list):
        return [typed(arguments[0], one, f"{where}[{n}]") for n, one in enumerate(tree)]
    if origin is tuple and isinstance(tree, list):
        kinds = arguments[:1] * len(tree) if arguments[1:] == (...,) else arguments
        return tuple(typed(one, value, f"{where}[{n}]") for n, (one, value) in enumerate(zip(kinds, tree, strict=True)))
    if origin in (dict, Mapping) and isinstance(tree, dict):
        return {name: typed(arguments[1], one, f"{where}.{name}") for name, one in tree.items()}
    if kind is float and isinstance(tree, int | float) and not isinstance(tree, bool):
        if MAX_NUMBER <= abs(tree) < inf:
            raise ValueError(f"{where}: must be less than {MAX_NUMBER:g}")
        return float(tree)
    if kind is int and type(tree) is int and not 0 <= tree < MAX_NUMBER:
        raise ValueError(f"{where}: must be from 0 to {MAX_NUMBER:g}")
    if isinstance(kind, type) and not _has_fields(kind) and type(tree) is kind:
        return tree
    raise _type_error(kind, tree, where)


def _type_error(kind: Any, value: Any, where: str) -> ValueError:
    """Return the error for a value of a wrong type; values of several parts are described by their kind."""
    kinds = {np.ndarray: "an array", dict: "a table", list: "a list"}
    shown = kinds.get(type(value)) or json.dumps(value, default=str)[:60]
    return ValueError(f"{where} = {shown}: must be of type {getattr(kind, '__name__', kind)}")


def check_fields(kind: Any, tree: dict[str, Any], where: str) -> None:
    """Raise ``ValueError`` unless values have the types of the fields of a dataclass; defaults may be missing."""
    for one in fields(kind):
        if one.name in tree:
            typed(hints_of(kind)[one.name], tree[one.name], f"{where}.{one.name}")
        elif one.default is MISSING and one.default_factory is MISSING:
            raise ValueError(f"{where}.{one.name} is missing")


def serialize(tree: Any) -> tuple[str, list[Vector]]:
    """Return a tree as JSON, with {"array": n} for its n-th array, and the arrays."""
    arrays: list[Vector] = []

    def number(value: object) -> dict[str, int]:
        if not isinstance(value, np.ndarray):
            raise TypeError(f"{value!r} is part of a state: neither an array nor a type of JSON")
        arrays.append(value)
        return {"array": len(arrays) - 1}

    return json.dumps(plain(tree), default=number), arrays


def deserialize(text: str, arrays: Sequence[Vector]) -> StateTree:
    """Return the plain tree of a JSON text and arrays, the inverse of ``serialize``; raises ``ValueError``."""

    def value(table: dict[str, Any]) -> Any:
        if table.keys() != {"array"}:
            return table
        number = table["array"]
        if type(number) is not int or not 0 <= number < len(arrays):
            raise ValueError(f"array = {number!r}: must be the number of one of {len(arrays)} arrays")
        return arrays[number]

    tree: StateTree = json.loads(text, object_hook=value)
    return tree
