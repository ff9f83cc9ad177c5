"""What every part of a scene is: frozen and validated data that can say what does not fit."""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from wavetank.errors import InputError, printable
from wavetank.values.formula import Formula, Helper

KEY_SHOWN = 200  # characters of a key in a message


class Problem(NamedTuple):
    """What does not fit together in a scene whose values are each allowed.

    Attributes
    ----------
    key
        The place in the scene, e.g. ``("gauges", 0, "x")``.
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
    """Return the beginning of a value, as JSON has it."""
    try:
        return json.dumps(received, default=str)[:80]
    except (ValueError, RecursionError):  # a number of too many digits, lists in lists in lists
        return f"{type(received).__name__} of no sensible size"


class CaseError(InputError):
    """A scene that is refused, with its problems."""

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
    """A part of the scene: frozen, unknown keys refused, numbers finite."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def problems(self, context: Any) -> Iterator[Problem]:
        """Yield what does not fit the rest of the case, its ``Context``; by default nothing."""
        yield from ()


def one_of(*keys: str, needed: bool = True) -> Any:
    """Return a check of a noun: that it has exactly one of these keys, or where none is ``needed`` at most one."""

    def check(noun: CaseModel) -> CaseModel:
        given = sum(getattr(noun, key) is not None for key in keys)
        if given > 1 or (needed and not given):
            names = " and ".join(map(repr, keys))
            raise ValueError(f"must have {'exactly' if needed else 'at most'} one of the keys {names}")
        return noun

    return model_validator(mode="after")(check)


class Located(str):
    """A path that a noun names, absolute, or data:NAME/FILE."""


def _located(reference: str, info: ValidationInfo) -> Located:
    """Return a path made absolute from the case file's folder; data:NAME/FILE is kept, it is looked up when read."""
    folder = (info.context or {}).get("folder", Path())
    return Located(reference if reference.startswith("data:") else (folder / reference).resolve())


FilePath = Annotated[str, Field(min_length=1), AfterValidator(_located)]


# ---------------------------------------------------------------- formulae
def _parses(text: str, info: ValidationInfo, *, variables: Sequence[str]) -> str:
    """Return a formula's text if it parses with its helpers; helpers that do not have an error of their own."""
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


FormulaText = Annotated[str, Field(min_length=1), _checked_by(_parses, "x", "y")]
TimeFormulaText = Annotated[str, Field(min_length=1), _checked_by(_parses, "t")]
HeightFormulaText = Annotated[str, Field(min_length=1), _checked_by(_parses, "z")]
HeightHelpers = Annotated[dict[str, Helper], _checked_by(_parse_alone, "z")]
TimeHelpers = Annotated[dict[str, Helper], _checked_by(_parse_alone, "t")]


class FormulaNoun(CaseModel):
    """A noun whose ``FormulaText`` fields share named parts: these stand first, for a field is checked with them."""

    where: Annotated[dict[str, Helper], _checked_by(_parse_alone, "x", "y")] = Field(
        default={}, description="parts of the formula by name, numbers or formulae; default: none"
    )

    def formula(self, text: str) -> Formula:
        """Return a field's formula of x and y [m]."""
        return Formula(text, where=self.where)
