"""What a part of a run holds, said by itself and taken back: where a run stands, and what is remembered of how it came.

A run that takes back what an equal one has held goes on as that one does, bit for bit on as many ranks: numbers of
later steps depend on start values, sums and preconditioners of earlier ones, and all of these are held.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import InputError

Held = dict[str, Any]
"""By name: arrays, whose last axis runs over the degrees of freedom that this rank owns, so that their places order
them (of several numbers at each, as layers of the potential, the axes before); and numbers, words, lists and further
such dictionaries, the same on all ranks, as JSON has them."""


@runtime_checkable
class Stateful(Protocol):
    """What remembers something that later steps depend on."""

    def held(self) -> Held:
        """Return what is remembered, none of which changes later; collective."""

    def take(self, held: Held) -> None:
        """Take back what has been held, in place of what is remembered; collective."""


@runtime_checkable
class Carrying(Protocol):
    """What remembers something that outlives a change of numerics."""

    def carry(self, held: Held) -> None:
        """Take that of what has been held with others; collective."""


@runtime_checkable
class Undoing(Protocol):
    """What looks at a step that may still fail."""

    def undo(self) -> None:
        """Forget the last look: the step has failed, and who goes on takes it anew."""


@runtime_checkable
class Added(Protocol):
    """What a run that goes on may have though it had not before.

    Attributes
    ----------
    added
        That it may.
    """

    added: bool


def named(parts: Iterable[object]) -> dict[str, Stateful]:
    """Return those parts that remember something by the names of their kinds, the second of a kind as "kind 2"."""
    result: dict[str, Stateful] = {}
    for part in parts:
        if isinstance(part, Stateful):
            kind = type(part).__name__
            before = sum(type(other) is type(part) for other in result.values())
            result[f"{kind} {before + 1}" if before else kind] = part
    return result


def count(value: object) -> int:
    """Return a count that was held, by which compiled code finds places; raise ``ValueError`` for anything else."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**31:
        raise ValueError(f"{value!r} is no count")
    return value


def held_by(parts: Mapping[str, Stateful]) -> Held:
    """Return what the parts hold, by their names; collective."""
    return {name: part.held() for name, part in parts.items()}


def give_back(parts: Mapping[str, Stateful], held: Held) -> None:
    """Let the parts take back what is theirs; collective.

    Raises ``InputError`` unless it was held by the same, but for what is ``Added``.
    """
    mine = {name: part for name, part in parts.items() if name in held or not isinstance(part, Added)}
    if mine.keys() != held.keys():
        holders, takers = (", ".join(names) or "nothing" for names in (held, mine))
        raise InputError(f"what was held by {holders} cannot be taken back by {takers}.")
    for name, part in mine.items():
        part.take(held[name])


def carry_over(parts: Mapping[str, object], held: Held) -> None:
    """Let those parts that were there already take what outlives a change of numerics; collective.

    So does a part that replaces one of the kinds that it ``follows``.
    """
    for name, part in parts.items():
        kind = next((one for one in (name, *getattr(part, "follows", ())) if one in held), None)
        if isinstance(part, Carrying) and kind is not None:
            part.carry(held[kind])


def serialize(held: Held) -> tuple[str, list[Vector]]:
    """Return what is held as JSON, {"array": n} in the place of its n-th array, and the arrays."""
    arrays: list[Vector] = []

    def number(value: object) -> dict[str, int]:
        if not isinstance(value, np.ndarray):
            raise TypeError(f"{value!r} is held: neither an array nor anything that JSON has")
        arrays.append(value)
        return {"array": len(arrays) - 1}

    return json.dumps(held, default=number), arrays


def deserialize(text: str, arrays: Sequence[Vector]) -> Held:
    """Return the tree from its JSON text and arrays; the inverse of ``serialize``."""
    held: Held = json.loads(text, object_hook=lambda one: arrays[one["array"]] if one.keys() == {"array"} else one)
    return held
