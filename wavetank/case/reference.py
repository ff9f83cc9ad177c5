"""The reference of case files: all tables, keys, units, ranges and defaults, as a page."""

import json
import re
from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from wavetank.case.model import Case
from wavetank.case.schema import Table, schema, table_at, tables, tag

INTRODUCTION = """# Every key of a case

Made by `make reference` from the classes that read a case; `wavetank schema` prints the same for editors. A case is a
TOML file: experiment and numerics. `[tank]` and `[run]` are required; other tables have defaults. `type` selects the
type of a table; a tank without `type` is a slice. Gauges may be given by x alone: `gauges = [2.0, 4.0]` before all
tables defines two gauges, named 1 and 2 (errors and `--set` count from 0: `gauges.0.x`). Unknown keys are refused.
Lengths are in metres, times in seconds, angles in degrees (in radians with `motion_as = "angle"`). z is upwards from
still water, x from the rest position of the paddle into the water.
"""
HEAD = "| key | meaning | unit | allowed | default |\n|---|---|---|---|---|\n"


def reference() -> str:
    """Return the page, in Markdown."""
    document = schema()
    return "\n".join([INTRODUCTION, *(part for table in tables() for part in _sections(table, document))])


def _sections(table: Table, document: dict[str, Any]) -> Iterator[str]:
    """Yield the sections of a table: one for each of its types."""
    yield f"## {'Before all tables' if not table.path else f'`{table.header}`'}\n"
    for model in table.models:
        own = document if model is Case else document["$defs"][model.__name__]
        if table.path:
            yield f"{_title(model)}{own['description'].replace('``', '`')}\n"
        if rows := list(_rows(table, model, own)):
            yield HEAD + "\n".join(rows) + "\n"


def _title(model: type[BaseModel]) -> str:
    """Return the heading of a type, if there are several."""
    return f'### `type = "{tag(model)}"`\n\n' if tag(model) else ""


def _rows(table: Table, model: type[BaseModel], own: dict[str, Any]) -> Iterator[str]:
    for key, what in own["properties"].items():
        if key != "type" and what.get("type") != "null":
            inside = table_at((*table.path, key), model.model_fields[key])
            allowed = f"[`{inside.header}`](#{''.join(inside.path)})" if inside else _allowed(what)
            if "description" not in what:
                raise KeyError(f"{model.__module__}: {model.__name__}.{key} has no description")
            meaning, unit, default = _described(what["description"], measured="text" not in allowed)
            if key in own.get("required", ()):
                default = "**needed**"
            elif "default" in what:
                default = f"`{_toml(what['default'])}`" if inside is None else "none"
            elif isinstance(usual := model.model_fields[key].default, BaseModel):
                default = f"`{tag(type(usual))}`" if tag(type(usual)) else "as there"
            yield f"| `{key}` | {meaning} | {unit} | {allowed} | {default} |"


def _described(description: str, *, measured: bool) -> tuple[str, str, str]:
    """Return meaning, unit and default of a key from its description; the unit is separated if ``measured``."""
    meaning, _, default = re.sub(r"; default:? ", "\0", description).partition("\0")
    if not measured or not (unit := re.search(r" ?\[([^\]]+)\]", meaning)):
        return meaning, "", default
    return meaning.replace(unit[0], ""), unit[1], default


def _toml(value: Any) -> str:
    return _short(json.dumps(value))


def _allowed(what: dict[str, Any]) -> str:
    """Return the allowed values in words."""
    if "anyOf" in what:
        return " or ".join(_allowed(one) for one in what["anyOf"])
    if "enum" in what:
        return ", ".join(f"`{_toml(one)}`" for one in what["enum"])
    match what.get("type"):
        case "number" | "integer":
            kind = "integer, " if what["type"] == "integer" else ""
            return f"{kind}{_range(what)}"
        case "array" if "prefixItems" not in what:
            return f"list of {what['minItems']} to {what['maxItems']}, each {_allowed(what['items'])}"
        case "array":
            return f"list of {len(what['prefixItems'])}, each {_allowed(what['prefixItems'][0])}"
        case "object":
            return f"table of {_allowed(what['additionalProperties'])}"
        case kind:
            return {"string": "text", "boolean": "`true`, `false`"}[str(kind)]


def _range(what: dict[str, Any]) -> str:
    ends = {key: _number(value) for key, value in what.items() if "imum" in key}
    if not ends:
        return "any number"
    least = ends.get("minimum") or f"above {ends['exclusiveMinimum']}"
    return f"{least} to {ends.get('maximum') or 'below ' + ends['exclusiveMaximum']}"


def _number(value: float) -> str:
    return _short(f"{value:g}")


def _short(text: str) -> str:
    return re.sub(r"e([+-])0*", lambda exponent: "e" + exponent[1].replace("+", ""), text)
