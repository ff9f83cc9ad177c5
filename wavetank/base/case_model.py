"""The base class of case models, i.e. frozen and validated data, and the problems that they report."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from wavetank.base.errors import InputError, printable
from wavetank.base.formula import Formula, Helper

T = TypeVar("T")
KEY_SHOWN = 200  # characters of a key in a message
Key = tuple[str | int, ...]


class Problem(NamedTuple):
    """An inconsistency of a case whose single values are valid.

    Attributes
    ----------
    key
        Key in the case, e.g. ``("gauges", 0, "x")``.
    received, allowed
        Received value, and what is allowed.
    """

    key: Key
    received: Any
    allowed: str

    def at(self, key: str, name: str) -> "Problem":
        """Return the same problem with another first key."""
        return self._replace(key=(name, *self.key[1:])) if self.key[:1] == (key,) else self

    def __str__(self) -> str:
        """Return the sentence, e.g. ``tank.depth = -1: must be greater than 0``; None is a missing value."""
        shown = "" if self.received is None else f" = {_shown(self.received)}"
        key = printable(".".join(map(str, self.key))[:KEY_SHOWN]).replace("\n", "\\n")
        return f"{key}{shown}: {self.allowed}"


def _shown(received: Any) -> str:
    """Return the beginning of a value in JSON."""
    try:
        return json.dumps(received, default=str)[:80]
    except (ValueError, RecursionError):  # a number of too many digits, deeply nested lists
        return f"{type(received).__name__} of no sensible size"


class CaseError(InputError):
    """An invalid case, with its problems."""

    def __init__(self, problems: Sequence[Problem]):
        super().__init__(problems)
        self.problems = problems

    def __str__(self) -> str:
        return "\n".join(f"{problem}." for problem in self.problems)


@contextmanager
def about(*key: str | int, received: Any = None) -> Iterator[None]:
    """Raise an ``InputError`` of the block as a ``CaseError`` with a key and the value received there."""
    try:
        yield
    except CaseError:
        raise
    except InputError as error:
        raise CaseError([Problem(key, received, str(error).removesuffix("."))]) from error


@contextmanager
def renamed(key: str, name: str) -> Iterator[None]:
    """Rename the first key of the problems of a ``CaseError`` of the block."""
    try:
        yield
    except CaseError as error:
        raise CaseError([problem.at(key, name) for problem in error.problems]) from error


Checked = str | tuple[Key, Any]  # a field, or key and value elsewhere
Check = tuple[Checked, bool, str] | tuple[Checked, bool, str, bool]  # satisfied, allowed, decisive


class CaseModel(BaseModel):
    """A part of the case: frozen, without unknown keys, with finite numbers."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    @property
    def reads_file(self) -> bool:
        """Whether the model is checked against the rest of the case only when its file is read."""
        return False

    def named_files(self, *key: str) -> Iterator[tuple[str, str]]:
        """Yield dotted key and path of each file in the model, at a key, and in its parts."""
        for name, value in self:
            if isinstance(value, Located):
                yield ".".join((*key, name)), value
            elif isinstance(value, CaseModel):
                yield from value.named_files(*key, name)

    def checks(self, end: Any) -> Iterator[Check]:
        """Yield the conditions on the rest of the case, which is given as an ``EndWall``.

        The first problem of each key is reported. A failed check of ``type``, or one whose fourth entry is true, ends
        the iteration: later checks, and those of the models inside, may depend on it.
        """
        yield from ()

    def problems(self, end: Any, *key: str | int) -> list[Problem]:
        """Return the problems of this model, at a key, and of the models in it."""
        result: dict[Key, Problem] = {}
        for at, fits, allowed, *decisive in self.checks(end):
            if not fits:
                where, received = ((*key, at), getattr(self, at)) if isinstance(at, str) else at
                shown = None if isinstance(received, CaseModel) else received
                result.setdefault(where, Problem(where, shown, allowed))
                if at == "type" or any(decisive):
                    return [*result.values()]
        inside = ((part, (*key, *more)) for part, more in self.models_inside() if not part.reads_file)
        return [*result.values(), *(problem for part, at in inside for problem in part.problems(end, *at))]

    def models_inside(self) -> Iterator[tuple["CaseModel", Key]]:
        """Yield the models in this one, also those in its lists, with their keys."""
        for name, value in self:
            if isinstance(value, CaseModel):
                yield value, (name,)
            elif isinstance(value, tuple):
                yield from ((one, (name, n)) for n, one in enumerate(value) if isinstance(one, CaseModel))


def entry(table: Mapping[type[CaseModel], T], model: CaseModel, name: str) -> T:
    """Return the entry of a table for the class of a model or its nearest base; raises ``TypeError`` if there is none.

    ``name`` is the name of the table and its file.
    """
    for cls in type(model).__mro__:
        if cls in table:
            return table[cls]
    raise TypeError(f"{type(model).__name__} has no entry in {name}; add it there.")


def one_of(*keys: str, needed: bool = True) -> Any:
    """Return a validator of a model: exactly one of these keys is set, or at most one unless ``needed``."""

    def check(model: CaseModel) -> CaseModel:
        given = sum(getattr(model, key) is not None for key in keys)
        if given > 1 or (needed and not given):
            names = " and ".join(map(repr, keys))
            raise ValueError(f"must have {'exactly' if needed else 'at most'} one of the keys {names}")
        return model

    return model_validator(mode="after")(check)


class Located(str):
    """A path in a model: absolute, or data:NAME/FILE."""


def _located(reference: str, info: ValidationInfo) -> Located:
    """Return a path made absolute from the folder of the case file; data:NAME/FILE is resolved when it is read."""
    folder = (info.context or {}).get("folder", Path())
    return Located(reference if reference.startswith("data:") else (folder / reference).resolve())


FilePath = Annotated[str, Field(min_length=1), AfterValidator(_located)]


# ---------------------------------------------------------------- formulae
def _parsed_with(*variables: str) -> AfterValidator:
    """Return a validator of a formula, or of its helpers, in some variables; invalid helpers have their own error."""

    def check(value: Any, info: ValidationInfo) -> Any:
        text, helpers = ("0", value) if isinstance(value, dict) else (value, info.data.get("where"))
        try:
            if helpers is not None:
                Formula(text, where=helpers, variables=variables)
        except InputError as error:
            raise ValueError(str(error).removesuffix(".")) from None
        return value

    return AfterValidator(check)


FormulaText = Annotated[str, Field(min_length=1), _parsed_with("x", "y")]
TimeFormulaText = Annotated[str, Field(min_length=1), _parsed_with("t")]
HeightFormulaText = Annotated[str, Field(min_length=1), _parsed_with("z")]
HeightHelpers = Annotated[dict[str, Helper], _parsed_with("z")]
TimeHelpers = Annotated[dict[str, Helper], _parsed_with("t")]


class FormulaModel(CaseModel):
    """A model whose ``FormulaText`` fields have common helpers, which are validated before them."""

    where: Annotated[dict[str, Helper], _parsed_with("x", "y")] = Field(
        default={}, description="parts of the formula by name, numbers or formulae; default: none"
    )

    def formula(self, text: str) -> Formula:
        """Return the formula of x and y [m] in a field."""
        return Formula(text, where=self.where)
