"""What a study sweeps: every combination of the values given for some keys of a case."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from urllib.parse import quote

from wavetank.case import Scene
from wavetank.case.reading import read_case
from wavetank.errors import InputError
from wavetank.values.noun import Noun

SHORT_NAMES = {
    "dt": "numerics.dt",
    "dx": "numerics.cell_size",
    "cells": "numerics.cells",
    "n": "numerics.vertical_order",
    "p": "numerics.order",
    "order": "numerics.order",
    "integrator": "numerics.integrator",
    "tolerance": "numerics.tolerance",
}
UNITS = {"dt": "s", "dx": "m"}
NUMERICAL = ("numerics", "output")  # tables of the case that change nothing of the water
MOST = 1000  # values of FIRST..LAST
READABLE = "=,.+-"  # characters a folder's name may have besides letters and digits; the others are escaped


@dataclass(frozen=True)
class Axis:
    """A key of the case and the values it takes, as given.

    Attributes
    ----------
    key
        Dotted key of the case, e.g. ``numerics.vertical_order``.
    values
        All different.
    """

    key: str
    values: tuple[str, ...]

    @classmethod
    def of(cls, name: str, *values: str) -> "Axis":
        """Return the axis of a dotted key or a short name."""
        return cls(SHORT_NAMES.get(name, name), values)

    @property
    def name(self) -> str:
        """The key's short name if it has one, e.g. ``n``."""
        return next((name for name, key in SHORT_NAMES.items() if key == self.key), self.key)

    @property
    def label(self) -> str:
        """The name with its unit, e.g. ``dt [s]``."""
        return f"{self.name} [{UNITS[self.name]}]" if self.name in UNITS else self.name

    @property
    def physical(self) -> bool:
        """Whether it changes what is modelled, not how it is computed."""
        return self.key.partition(".")[0] not in NUMERICAL

    @property
    def seeds(self) -> bool:
        """Whether its values are seeds: of the same sea, others."""
        return self.key.rpartition(".")[2] == "seed"


@dataclass(frozen=True)
class Combination:
    """One run of a study.

    Attributes
    ----------
    name
        Of its run directory.
    values
        By the names of the axes, as given.
    overrides
        All that changes the case, ``KEY=VALUE``; of two for one key the later one holds.
    scene
        What is run.
    """

    name: str
    values: dict[str, str]
    overrides: tuple[str, ...]
    scene: Scene


@dataclass(frozen=True)
class Refused:
    """A combination that cannot be run, and why; see ``Combination``."""

    name: str
    values: dict[str, str]
    cause: str


def unit(scene: Scene, key: str) -> str:
    """Return the unit of a dotted key as its description tells it, e.g. ``"m"``; "" where it tells none."""
    *path, last = key.split(".")
    noun: object = scene
    for part in path:
        noun = getattr(noun, part, None)
    field = type(noun).model_fields.get(last) if isinstance(noun, Noun) else None
    found = re.search(r"\[([^\]]+)\]", (field.description if field else None) or "")
    return found[1] if found else ""


def parse_axis(text: str) -> Axis:
    """Return the axis of ``KEY=VALUE,VALUE,...``; KEY is dotted or short, ``1..20`` all from 1 to 20.

    Raises ``InputError``.
    """
    name, _, values = text.partition("=")
    given = tuple(one for value in values.split(",") for one in _counted(value.strip()))
    if not name.strip() or not all(given):
        raise InputError(f"sweep {text!r} received; allowed is KEY=VALUE,VALUE,..., such as dt=0.02,0.04.")
    if len(set(given)) < len(given):
        raise InputError(f"sweep {text!r} received; its values must be different.")
    return Axis.of(name.strip(), *given)


def _counted(value: str) -> list[str]:
    """Return all whole numbers of ``FIRST..LAST``, or the value as it is."""
    if (ends := re.fullmatch(r"(\d{1,9})\.\.(\d{1,9})", value)) is None:
        return [value]
    first, last = int(ends[1]), int(ends[2])
    if not first <= last < first + MOST:
        raise InputError(f"sweep of {value} received; allowed is FIRST..LAST, at most {MOST} whole numbers.")
    return [str(one) for one in range(first, last + 1)]


def parse_axes(texts: Sequence[str], overrides: Sequence[str] = ()) -> list[Axis]:
    """Return the axes of a study; raises ``InputError`` if there is none, or for a key that is given twice."""
    if not texts:
        names = ", ".join(SHORT_NAMES)
        raise InputError(f"no sweep received; give one or more KEY=VALUE,VALUE,...; short names are {names}.")
    axes = [parse_axis(text) for text in texts]
    fixed = {override.partition("=")[0].strip() for override in overrides}
    count = Counter([*(axis.key for axis in axes), *fixed])
    twice = [key for key, times in count.items() if times > 1]
    if twice:
        raise InputError(f"{twice[0]} received twice; it must be swept or set once.")
    return axes


def combinations(case: Path, axes: Sequence[Axis], overrides: Sequence[str] = ()) -> list[Combination]:
    """Return every combination that can be run; see ``swept``."""
    return swept(case, axes, overrides)[0]


def swept(case: Path, axes: Sequence[Axis], overrides: Sequence[str] = ()) -> tuple[list[Combination], list[Refused]]:
    """Return every combination, the last axis varying fastest, and those that are refused.

    Raises ``InputError`` where all are, and for two combinations that are the same run.
    """
    found, refused = list[Combination](), list[Refused]()
    for values in _product(axes):
        settings = dict(zip(axes, values, strict=True))
        try:
            found.append(combination(case, settings, overrides))
        except InputError as error:
            named = {axis.name: value for axis, value in settings.items()}
            refused.append(Refused(_named(named), named, "; ".join(str(error).splitlines())))
            if len(refused) == 1:
                first = error
    if not found:
        raise first
    for n, one in enumerate(found):
        same = next((other for other in found[:n] if other.scene == one.scene), None)
        if same:
            raise InputError(f"the combinations {same.name} and {one.name} are the same run; values must be different.")
    return found, refused


def _named(values: dict[str, str]) -> str:
    return quote(",".join(f"{key}={value}" for key, value in values.items()), safe=READABLE)


def _product(axes: Sequence[Axis]) -> Iterator[tuple[str, ...]]:
    return product(*(axis.values for axis in axes))


def combination(case: Path, values: dict[Axis, str], overrides: Sequence[str] = ()) -> Combination:
    """Return one combination, validated; raises ``InputError``."""
    changes = (*overrides, *(f"{axis.key}={value}" for axis, value in values.items()))
    named = {axis.name: value for axis, value in values.items()}
    return Combination(_named(named), named, changes, read_case(case, changes))


def marked_combination(case: Path, settings: Sequence[str], overrides: Sequence[str] = ()) -> Combination:
    """Return a combination beside the swept ones from ``KEY=VALUE`` each, keys dotted or short; raises ``InputError``.

    Settings go before overrides of the same key.
    """
    values = {axis: value for axis in map(parse_axis, settings) for value in axis.values}
    found = combination(case, values, overrides)
    return replace(found, name=f"plan,{found.name}")
