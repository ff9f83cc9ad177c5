"""Combinations of settings of a case, and the refined run that is their reference.

The reference is the finest combination, refined once more: dt/2, twice the cells (order p + 1 on a mesh file), n + 2, a
tenth of the tolerance. It records its gauges at every step and snapshots at the steps of the finest combination.
"""

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import isfinite
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from wavetank.base.errors import InputError, choice
from wavetank.case import Case
from wavetank.case.numerics import HIGHEST_ORDER, HIGHEST_VERTICAL_ORDER
from wavetank.case.reading import read_case
from wavetank.integrators import INTEGRATORS

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
NUMERICAL = ("numerics", "output")  # tables of the case that do not change the physical case
MOST = 1000  # values of FIRST..LAST
UNESCAPED = "=,.+-"  # characters of the name of a folder besides letters and digits
TIGHTEST = 1e-12  # tolerance
MOST_SNAPSHOTS = 2000


def is_number(value: str) -> bool:
    """Return whether a text is a finite number."""
    try:
        return isfinite(float(value))
    except ValueError:
        return False


@dataclass(frozen=True)
class Axis:
    """A key of the case and its values, as given.

    Attributes
    ----------
    key
        Dotted key of the case, e.g. ``numerics.vertical_order``.
    values
        Different texts.
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
        """Whether the key changes the physical case, not only its computation."""
        return self.key.partition(".")[0] not in NUMERICAL

    @property
    def numeric(self) -> bool:
        """Whether all values are finite numbers."""
        return all(map(is_number, self.values))

    @property
    def seeds(self) -> bool:
        """Whether the values are seeds of random phases."""
        return self.key.rpartition(".")[2] == "seed"


@dataclass(frozen=True)
class Combination:
    """One run of a study.

    Attributes
    ----------
    name
        Name of its run directory.
    values
        Values by the names of the axes, as given.
    overrides
        All changes of the case, ``KEY=VALUE``; of two for one key the later one applies.
    case
        The case.
    mark
        ``"plan"`` for a marked combination, else empty.
    """

    name: str
    values: dict[str, str]
    overrides: tuple[str, ...]
    case: Case
    mark: str = ""


class Refused(NamedTuple):
    """A combination that cannot be run, and the reason; see ``Combination``."""

    name: str
    values: dict[str, str]
    cause: str


def parse_axis(text: str) -> Axis:
    """Return the axis of ``KEY=VALUE,VALUE,...``; KEY is dotted or short, ``1..20`` are the integers from 1 to 20.

    Raises ``InputError``.
    """
    name, _, values = text.partition("=")
    given = tuple(one for value in values.split(",") for one in _values_of(value.strip()))
    if not name.strip() or not all(given):
        raise InputError(f"sweep {text!r} received; allowed is KEY=VALUE,VALUE,..., such as dt=0.02,0.04.")
    if len(set(given)) < len(given):
        raise InputError(f"sweep {text!r} received; its values must be different.")
    if "." not in name and name.strip() not in {*SHORT_NAMES, *Case.model_fields}:
        known = choice(name.strip(), [*SHORT_NAMES])
        raise InputError(f"sweep {text!r} received; its name is unknown{known}, or a key such as wall.motion.height.")
    return Axis.of(name.strip(), *given)


def _values_of(value: str) -> list[str]:
    """Return all integers of ``FIRST..LAST``, or the value unchanged."""
    if (ends := re.fullmatch(r"(\d{1,9})\.\.(\d{1,9})", value)) is None:
        return [value]
    first, last = int(ends[1]), int(ends[2])
    if not first <= last < first + MOST:
        raise InputError(f"sweep of {value} received; allowed is FIRST..LAST, at most {MOST} whole numbers.")
    return [str(one) for one in range(first, last + 1)]


def parse_axes(texts: Sequence[str], overrides: Sequence[str] = ()) -> list[Axis]:
    """Return the axes of a study; raise ``InputError`` if there is none, or for a repeated key."""
    if not texts:
        names = ", ".join(SHORT_NAMES)
        raise InputError(f"no sweep received; give one or more KEY=VALUE,VALUE,...; short names are {names}.")
    axes = [parse_axis(text) for text in texts]
    fixed = {override.partition("=")[0].strip() for override in overrides}
    for key, times in Counter([*(axis.key for axis in axes), *fixed]).items():
        if times > 1:
            raise InputError(f"{key} received twice; it must be swept or set once.")
    return axes


def combinations(
    case_file: Path, axes: Sequence[Axis], overrides: Sequence[str] = ()
) -> tuple[list[Combination], list[Refused]]:
    """Return all combinations, the last axis varying fastest, and the refused ones.

    Raises ``InputError`` if all are refused, and for two combinations that are the same run.
    """
    runnable, refused, errors = list[Combination](), list[Refused](), list[InputError]()
    for values in product(*(axis.values for axis in axes)):
        settings = dict(zip(axes, values, strict=True))
        try:
            runnable.append(combination(case_file, settings, overrides))
        except InputError as error:
            errors.append(error)
            refused.append(Refused(*_named(settings), "; ".join(str(error).splitlines())))
    if not runnable:
        raise errors[0]
    for n, one in enumerate(runnable):
        if same := next((other for other in runnable[:n] if other.case == one.case), None):
            raise InputError(f"the combinations {same.name} and {one.name} are the same run; values must be different.")
    return runnable, refused


def _named(settings: dict[Axis, str]) -> tuple[str, dict[str, str]]:
    """Return the name of a combination's run directory, and its values by the names of the axes."""
    values = {axis.name: value for axis, value in settings.items()}
    return quote(",".join(f"{key}={value}" for key, value in values.items()), safe=UNESCAPED), values


def combination(case_file: Path, settings: dict[Axis, str], overrides: Sequence[str] = ()) -> Combination:
    """Return one combination, validated; raises ``InputError``."""
    changes = (*overrides, *(f"{axis.key}={value}" for axis, value in settings.items()))
    return Combination(*_named(settings), changes, read_case(case_file, changes))


def marked_combination(case_file: Path, settings: Sequence[str], overrides: Sequence[str] = ()) -> Combination:
    """Return a combination of ``KEY=VALUE`` settings, keys dotted or short; raises ``InputError``.

    Settings go before overrides of the same key.
    """
    named = {axis: value for axis in map(parse_axis, settings) for value in axis.values}
    one = combination(case_file, named, overrides)
    return replace(one, name=f"plan,{one.name}", mark="plan")


def same_but_numerics(combinations: Iterable[Combination]) -> list[list[Combination]]:
    """Return combinations in groups of cases that differ in numerics only; a group has one reference."""
    groups: dict[str, list[Combination]] = {}
    for one in combinations:
        groups.setdefault(one.case.model_dump_json(exclude={"numerics", "output"}), []).append(one)
    return list(groups.values())


def finest(group: Iterable[Combination]) -> Combination:
    """Return the combination with the smallest step, the most cells, the highest orders and the tightest tolerance."""

    def coarseness(one: Combination) -> tuple[float, ...]:
        numerics = one.case.numerics
        orders = numerics.order, numerics.vertical_order, INTEGRATORS[numerics.integrator].order
        return (numerics.dt or 0.0, one.case.cell_size, *(-order for order in orders), numerics.tolerance)

    return min(group, key=coarseness)


def refined(case_file: Path, coarse: Combination, *, dt: float, name: str) -> Combination:
    """Return a combination refined once more, given its step [s], which the case may omit."""
    case, numerics = coarse.case, coarse.case.numerics
    if case.on_mesh_file:
        cells = f"order={min(numerics.order + 1, HIGHEST_ORDER)}"
    elif numerics.cells is None:
        cells = f"cell_size={case.cell_size / 2!r}"
    else:
        cells = f"cells={2 * case.cells}"
    changes = (
        f"numerics.dt={dt / 2!r}",
        f"numerics.{cells}",
        f"numerics.vertical_order={min(numerics.vertical_order + 2, HIGHEST_VERTICAL_ORDER)}",
        f"numerics.tolerance={min(numerics.tolerance, max(numerics.tolerance / 10, TIGHTEST))!r}",
        f"output.surface_every={max(dt, case.run.duration / MOST_SNAPSHOTS)!r}",
        "output.gauges_every=1",
    )
    overrides = (*coarse.overrides, *changes)
    return replace(coarse, name=name, overrides=overrides, case=read_case(case_file, overrides))
