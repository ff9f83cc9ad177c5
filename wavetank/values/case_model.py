"""The base class of case models, frozen and validated data, and the problems that they report."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from wavetank.errors import InputError, printable
from wavetank.values.formula import Formula, Helper

T = TypeVar("T")
KEY_SHOWN = 200  # characters of a key in a message


class Problem(NamedTuple):
    """An inconsistency of a case whose single values are allowed.

    Attributes
    ----------
    key
        Its key in the case, e.g. ``("gauges", 0, "x")``.
    received, allowed
        The value there, and what it may be.
    """

    key: tuple[str | int, ...]
    received: Any
    allowed: str

    def at(self, key: str, name: str) -> "Problem":
        """Return the same with a first key renamed."""
        return self._replace(key=(name, *self.key[1:])) if self.key[:1] == (key,) else self

    def __str__(self) -> str:
        """Return the sentence, e.g. ``tank.depth = -1: must be greater than 0``; a value of None was not given."""
        shown = "" if self.received is None else f" = {_shown(self.received)}"
        key = printable(".".join(map(str, self.key))[:KEY_SHOWN]).replace("\n", "\\n")
        return f"{key}{shown}: {self.allowed}"


def _shown(received: Any) -> str:
    """Return the beginning of a value in JSON."""
    try:
        return json.dumps(received, default=str)[:80]
    except (ValueError, RecursionError):  # a number of too many digits, lists in lists in lists
        return f"{type(received).__name__} of no sensible size"


class CaseError(InputError):
    """An invalid case, with its problems."""

    def __init__(self, problems: Sequence[Problem]):
        super().__init__(problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(f"{problem}." for problem in self.problems)


@contextmanager
def about(*key: str | int) -> Iterator[None]:
    """Raise an ``InputError`` of the block as a ``CaseError`` that names a key."""
    try:
        yield
    except CaseError:
        raise
    except InputError as error:
        raise CaseError([Problem(key, None, str(error).removesuffix("."))]) from error


@contextmanager
def renamed(key: str, name: str) -> Iterator[None]:
    """Rename the first key of the problems of a ``CaseError`` of the block."""
    try:
        yield
    except CaseError as error:
        raise CaseError([problem.at(key, name) for problem in error.problems]) from error


class CaseModel(BaseModel):
    """A part of the case: frozen, unknown keys refused, numbers finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    location: ClassVar[tuple[str, ...]] = ()  # its key in a case

    def problem(self, field: str, allowed: str) -> Problem:
        """Return a problem of a field: its value, and what is allowed."""
        return Problem((*self.location, field), getattr(self, field), allowed)

    def problems(self, context: Any) -> Iterator[Problem]:
        """Yield what does not fit the rest of the case, its ``Context``; by default nothing."""
        yield from ()


def entry(table: Mapping[type[CaseModel], T], model: CaseModel, name: str) -> T:
    """Return the entry of a table for a model's class or its nearest base; raises ``TypeError`` if there is none.

    ``name`` is the name of the table and its file.
    """
    for cls in type(model).__mro__:
        if cls in table:
            return table[cls]
    raise TypeError(f"{type(model).__name__} has no entry in {name}; add it there.")


def one_of(*keys: str, needed: bool = True) -> Any:
    """Return a validator of a model: exactly one of these keys is given, or at most one if none is ``needed``."""

    def check(model: CaseModel) -> CaseModel:
        given = sum(getattr(model, key) is not None for key in keys)
        if given > 1 or (needed and not given):
            names = " and ".join(map(repr, keys))
            raise ValueError(f"must have {'exactly' if needed else 'at most'} one of the keys {names}")
        return model

    return model_validator(mode="after")(check)


class Located(str):
    """A path that a model names, absolute, or data:NAME/FILE."""


def _located(reference: str, info: ValidationInfo) -> Located:
    """Return a path made absolute from the case file's folder; data:NAME/FILE stays, it is resolved when read."""
    folder = (info.context or {}).get("folder", Path())
    return Located(reference if reference.startswith("data:") else (folder / reference).resolve())


FilePath = Annotated[str, Field(min_length=1), AfterValidator(_located)]


# ---------------------------------------------------------------- formulae
def _valid_formula(text: str, info: ValidationInfo, *, variables: Sequence[str]) -> str:
    """Return a formula's text if it parses with its helpers; invalid helpers have their own error."""
    if "where" in info.data:
        _parse(text, info.data["where"], variables)
    return text


def _parse_alone(where: dict[str, Helper], *, variables: Sequence[str]) -> dict[str, Helper]:
    _parse("0", where, variables)
    return where


def _parse(text: str, where: dict[str, Helper], variables: Sequence[str]) -> None:
    try:
        Formula(text, where=where, variables=variables)
    except InputError as error:
        raise ValueError(str(error).removesuffix(".")) from None


def _checked_by(check: Any, *variables: str) -> AfterValidator:
    return AfterValidator(partial(check, variables=variables))


FormulaText = Annotated[str, Field(min_length=1), _checked_by(_valid_formula, "x", "y")]
TimeFormulaText = Annotated[str, Field(min_length=1), _checked_by(_valid_formula, "t")]
HeightFormulaText = Annotated[str, Field(min_length=1), _checked_by(_valid_formula, "z")]
HeightHelpers = Annotated[dict[str, Helper], _checked_by(_parse_alone, "z")]
TimeHelpers = Annotated[dict[str, Helper], _checked_by(_parse_alone, "t")]


class FormulaModel(CaseModel):
    """A model whose ``FormulaText`` fields share named parts, defined first, as fields are checked with them."""

    where: Annotated[dict[str, Helper], _checked_by(_parse_alone, "x", "y")] = Field(
        default={}, description="parts of the formula by name, numbers or formulae; default: none"
    )

    def formula(self, text: str) -> Formula:
        """Return a field's formula of x and y [m]."""
        return Formula(text, where=self.where)
