"""The schema of cases and the reference made of it: what they say is what the reader of cases does."""

import json
import re
import tomllib
from copy import deepcopy
from operator import ge, gt, le, lt
from typing import Any

import pytest
from pydantic import ValidationError
from ranks import CHECKOUT
from test_bad_input import EVERY, EXTREME, NONSENSE, entries, limits

from wavetank.case import Case
from wavetank.case.new import SCHEMA
from wavetank.case.reading import set_key
from wavetank.case.schema import schema, tables, tag
from wavetank.cli import main

CASES = sorted((CHECKOUT / "cases").glob("*.toml"))
PAGE = CHECKOUT / "docs" / "reference.md"
WHOLE = schema()
KINDS = {"object": dict, "array": list, "string": str, "boolean": bool, "number": (int, float), "integer": int}
ENDS = {"minimum": ge, "maximum": le, "exclusiveMinimum": gt, "exclusiveMaximum": lt}


def conforms(value: Any, rule: dict[str, Any]) -> bool:
    """Return whether a value is what a schema allows: of JSON schema, draft 7, what ours has."""
    if "$ref" in rule:
        return conforms(value, WHOLE["$defs"][rule["$ref"].rpartition("/")[2]])
    kind = rule.get("type", "")
    if kind == "null" or (kind and not isinstance(value, KINDS[kind])):
        return False
    number = kind in ("number", "integer")
    return (
        not (number and isinstance(value, bool))
        and (kind != "object" or _table_conforms(value, rule))
        and all(compare(float(value), float(rule[end])) for end, compare in ENDS.items() if end in rule)
        and (kind != "string" or len(value) >= rule.get("minLength", 0))
        and (kind != "array" or _list_conforms(value, rule))
        and value in ([rule["const"]] if "const" in rule else rule.get("enum", [value]))
        and ("anyOf" not in rule or any(conforms(value, one) for one in rule["anyOf"]))
        and ("oneOf" not in rule or sum(conforms(value, one) for one in rule["oneOf"]) == 1)
    )


def _list_conforms(values: list[Any], rule: dict[str, Any]) -> bool:
    if not rule.get("minItems", 0) <= len(values) <= rule.get("maxItems", 10**9):
        return False
    rules = rule.get("prefixItems") or [rule["items"]] * len(values)
    return all(conforms(value, one) for value, one in zip(values, rules, strict=True))


def _table_conforms(table: dict[str, Any], rule: dict[str, Any]) -> bool:
    known, others = rule.get("properties", {}), rule["additionalProperties"]
    if not {*rule.get("required", ())} <= {*table} or (others is False and not {*table} <= {*known}):
        return False
    return all(conforms(value, known.get(key, others)) for key, value in table.items())


def test_the_files_are_those_of_this_version(capsys):
    """``make reference`` writes them anew."""
    for arguments, path in ((["schema"], SCHEMA), (["schema", "--reference"], PAGE)):
        assert main(arguments) == 0
        same = path.read_text() == capsys.readouterr().out
        assert same, f"{path} is not that of the models of wavetank/case: run make reference"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.stem)
def test_a_case_names_the_schema_and_conforms_to_it(case):
    found = re.match(r"#:schema (\S+)\n", case.read_text())
    assert (case.parent / found[1]).resolve() == SCHEMA
    assert conforms(tomllib.loads(case.read_text()), json.loads(SCHEMA.read_text()))


def test_schema_refuses_single_values_as_the_reader_does():
    """All that pydantic refuses for its kind or range, of each key with nonsense; what only fits ill it cannot know."""
    tried = set[tuple[type, str]]()
    for text in EVERY.values():
        case = tomllib.loads(text)
        assert conforms(case, WHOLE)
        for entry in entries(Case.model_validate(case)):
            key, model, field = entry
            values = (*NONSENSE, *(EXTREME if limits(entry) else EXTREME[:2]))
            for value in () if (model, field) in tried else values:
                content = deepcopy(case)
                set_key(content, f"{key}={value}")
                assert conforms(content, WHOLE) == (not refused_by_itself(content)), f"{key} = {value}"
            tried.add((model, field))


def refused_by_itself(content: dict[str, Any]) -> bool:
    try:
        Case.model_validate(content)
    except ValidationError as error:
        return any(one["type"] not in ("inconsistent", "value_error") for one in error.errors())
    return False


def test_reference_has_meaning_and_default_of_every_key():
    sections = re.split(r"^## ", PAGE.read_text(), flags=re.MULTILINE)[1:]
    assert len(sections) == len(tables())
    for section, table in zip(sections, tables(), strict=True):
        assert section.startswith(f"`{table.header}`" if table.path else "Before all tables")
        rows = [row.strip("| ").split(" | ") for row in section.splitlines() if row.startswith("| `")]
        keys = [key for model in table.models for key, field in model.model_fields.items() if key != "type"]
        assert {row[0].strip("`") for row in rows} == {*keys}, "run make reference"
        assert all(len(row) == 5 and row[1].strip() and row[4].strip() for row in rows)
        assert re.findall(r'^### `type = "(.*)"`', section, flags=re.MULTILINE) == [
            *filter(None, map(tag, table.models))
        ]
    assert "| `dt` | time step | s | 1e-6 to 1e9 | from accuracy and stability |" in PAGE.read_text()
