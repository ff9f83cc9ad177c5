"""Reads a case file into a ``Case``; errors are listed, one per line."""

import hashlib
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from wavetank import data
from wavetank.base.case_model import CaseError, CaseModel, Problem
from wavetank.base.errors import InputError, choice
from wavetank.base.files import regular
from wavetank.base.python_file import trusting
from wavetank.case import Case
from wavetank.case.new import cases_at_hand
from wavetank.case.schema import models, tag

Key = tuple[str | int, ...]
LONGEST_INDEX = 9  # digits of an index
MAX_LISTED = 20  # largest number of listed errors; others are counted


def read_case(path: Path | str, overrides: Sequence[str] = (), *, trust: bool = False) -> Case:
    """Return the case of a file, with ``KEY=VALUE`` overrides such as ``"numerics.dt=0.01"``.

    ``trust`` allows the execution of Python files of the case. Raises ``InputError`` that lists all errors, one per
    line: the file, the line, the key, the received value and what is allowed.
    """
    path = Path(path)
    text = _read(path)
    with trusting(trust):
        return _validated(path, text, _parse(path, text), overrides)


def changed_case(path: Path, content: dict[str, Any], overrides: Sequence[str]) -> Case:
    """Return the case of a file's content, given from another file, with overrides; raises as ``read_case`` does."""
    return _validated(path, "", content, overrides)


def _validated(path: Path, text: str, content: dict[str, Any], overrides: Sequence[str]) -> Case:
    overridden, context = [set_key(content, override) for override in overrides], {"folder": path.resolve().parent}
    try:
        case, problems = Case.model_validate(content, context=context), list[Problem]()
        for read in (*(end.motion for end in case.ends), case.depths):
            try:
                read()
            except CaseError as error:
                problems += error.problems
        if not problems:
            return case
    except ValidationError as error:
        problems = [one for details in error.errors(include_url=False) for one in _problems(details)]
    raise InputError(_sentences(path, text, problems, overridden))


@contextmanager
def located(path: Path, overrides: Sequence[str] = ()) -> Iterator[None]:
    """Add file and line to errors of a case that are raised after reading."""
    try:
        yield
    except CaseError as error:
        keys = [_split(override.partition("=")[0]) for override in overrides]
        raise InputError(_sentences(path, _read(path), error.problems, keys)) from error


def _sentences(path: Path, text: str, problems: Sequence[Problem], overridden: Sequence[Key]) -> str:
    """Return a line for each problem, the first ones if there are many."""
    lines = [f"{path}{_where(text, problem.key, overridden)}: {problem}." for problem in problems[:MAX_LISTED]]
    if more := len(problems) - len(lines):
        lines.append(f"{path}: and {more} more mistakes.")
    return "\n".join(lines)


def _read(path: Path) -> str:
    try:
        return regular(path).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not a text file"
        raise InputError(
            f"{path}: cannot be read ({reason}); a case file in TOML is needed{_suggestion(path)}"
        ) from None


def _suggestion(path: Path) -> str:
    """Return the end of a sentence that suggests an existing case of a similar name; a full stop if there is none."""
    cases = {one.stem: one for one, _ in cases_at_hand()}
    close = get_close_matches(path.stem, cases, n=1)
    return f"; did you mean {cases[close[0]]}?" if close and not path.exists() else "."


def _parse(path: Path, text: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{path}: not valid TOML: nested too deeply.") from None
    except ValueError as error:  # an error of TOML, or a number of too many digits
        if twice := re.match(r"Cannot declare \((.*?),?\) twice \(at line (\d+)", str(error)):
            table = ".".join(re.findall(r"'([^']*)'", twice[1]))
            raise InputError(f"{path}, line {twice[2]}: [{table}] received twice; allowed is one such table.") from None
        raise InputError(f"{path}: not valid TOML: {error}.") from None


# ---------------------------------------------------------------- overrides
def set_key(content: dict[str, Any], override: str) -> Key:
    """Set one ``KEY=VALUE`` in the content and return its key; missing tables are created."""
    dotted, equals, text = override.partition("=")
    if not (dotted.strip() and equals):
        raise InputError(f"override {override!r} received; allowed is KEY=VALUE, such as numerics.dt=0.01.")
    key, value = _split(dotted), _value(text.strip())
    place: Any = content
    try:
        for part in key[:-1]:
            place = place.setdefault(part, {}) if isinstance(place, dict) else place[part]
        if not isinstance(place, dict):
            place[key[-1]]  # it must exist
        place[key[-1]] = value
    except (IndexError, TypeError):
        raise InputError(f"override {override!r} received; there is no table or list to set it in.") from None
    return key


def _value(text: str) -> Any:
    """Return a TOML value, or the text if it is not one; raise ``InputError`` for more than a value."""
    try:
        value, *more = tomllib.loads(f"value = {text}").items()
    except RecursionError:
        raise InputError(f"override value {text[:20]!r}... received; it is nested too deeply.") from None
    except ValueError:
        return text
    if more:
        raise InputError(f"override value {text[:80]!r} received; allowed is one value, without lines of others.")
    return value[1]


def _split(dotted: str) -> Key:
    parts = (part.strip().strip("\"'") for part in dotted.strip().split("."))
    return tuple(int(part) if part.isdecimal() and len(part) < LONGEST_INDEX else part for part in parts)


# ---------------------------------------------------------------- lines of keys
def _where(text: str, key: Key, overridden: Iterable[Key]) -> str:
    """Return the origin of a key: the command line if it sets the complete key, else the line in the file."""
    line = _line(text, key)
    if any(key[: len(other)] == other or (not line and other[: len(key)] == key) for other in overridden):
        return ", overridden"
    return f", line {line}" if line else ""


def _line(text: str, key: Key) -> int:
    """Return the line that sets a key, or the nearest one that contains it, or 0."""
    lines = _lines(text)
    return next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), 0)


@lru_cache(maxsize=1)
def _lines(text: str) -> dict[Key, int]:
    """Return the first line of every table and entry."""
    lines: dict[Key, int] = {}
    for number, key in _entries(text):
        lines.setdefault(key, number)
    return lines


def _entries(text: str) -> Iterator[tuple[int, Key]]:
    """Yield line and key of each table and entry that begins a line, as usual in case files."""
    table: Key = ()
    count: Counter[Key] = Counter()
    for number, line in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*(\[\[?)([\w\s.\"'-]+)\]", line):
            table = _split(header[2])
            if header[1] == "[[":
                count[table] += 1
                table = (*table, count[table] - 1)
            yield number, table
        elif (entry := line.partition("="))[1] and re.fullmatch(r"[\w\s.\"'-]+", entry[0]):
            yield number, (*table, *_split(entry[0]))


# ---------------------------------------------------------------- what is wrong
class _Place(NamedTuple):
    """A position in the case: its key, the tables allowed there, and its description."""

    key: Key
    models: list[type[BaseModel]]
    meaning: str

    @property
    def tags(self) -> list[str]:
        return [tag(model) for model in self.models]

    @property
    def fields(self) -> list[str]:
        return sorted({field for model in self.models for field in model.model_fields})


def _place(location: Key) -> _Place:
    """Return the position of a location of pydantic, which includes the type of each union."""
    place = _Place((), [Case], "")
    for part in location:
        fields = [model.model_fields[part] for model in place.models if part in model.model_fields]
        if fields:
            place = _Place((*place.key, part), list(models(fields[0].annotation)), fields[0].description or "")
        elif len(place.models) > 1 and part in place.tags:
            place = place._replace(models=[place.models[place.tags.index(str(part))]])
        else:
            place = place._replace(key=(*place.key, part))
    return place


def _problems(details: ErrorDetails) -> Iterator[Problem]:
    """Yield the problems of an error of pydantic: key, received value, what is allowed."""
    context = details.get("ctx", {})
    place, received = _place(details["loc"]), details["input"]
    match details["type"]:
        case "inconsistent":
            yield from context["problems"]
        case "missing":
            yield Problem(place.key, None, f"is missing; needed is {place.meaning or 'a table'}")
        case "extra_forbidden":
            fields = _place(details["loc"][:-1]).fields
            name = str(place.key[-1])
            own = f"; {name} of the case belongs above the first [table]" if name in Case.model_fields else ""
            yield Problem(place.key, received, f"is an unknown key{choice(name, fields)}{own}")
        case "union_tag_not_found":
            yield Problem((*place.key, "type"), None, f"is missing{choice('', place.tags)}")
        case "union_tag_invalid":
            received = str(context["tag"])
            yield Problem((*place.key, "type"), received, f"is an unknown type{choice(received, place.tags)}")
        case "model_type" | "model_attributes_type":
            yield Problem(place.key, received, f"must be a table{choice('', place.fields)}")
        case "value_error":
            yield Problem(place.key, received, str(context["error"]))
        case _:
            yield Problem(place.key, received, _in_words(details["msg"], place.meaning))


def _in_words(message: str, meaning: str) -> str:
    """Return the message of pydantic as the end of a sentence."""
    message = re.sub(r"0\.000\d+", lambda small: f"{float(small[0]):g}", message)
    words = (
        re.sub(r"^(Input|String|Value) should", "must", message)
        .replace("valid tuple", "list")
        .replace("dictionary", "table")
        .replace("be None", "be left out")
    )
    return f"{words} ({meaning})" if meaning else words


# ---------------------------------------------------------------- files that a case names
def contents(case: CaseModel) -> dict[str, str]:
    """Return the SHA-256 of each existing file that a case names, by its dotted key."""
    checksums = {}
    for key, reference in case.named_files():
        with suppress(InputError, OSError), regular(data.resolve(reference), largest=inf).open("rb") as file:
            checksums[key] = hashlib.file_digest(file, "sha256").hexdigest()
    return checksums
