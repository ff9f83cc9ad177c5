"""Tables as TOML, which Python can read but not write."""

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any


def toml(content: Mapping[str, Any]) -> str:
    """Return tables of numbers, texts, truth values, lists and tables as TOML, without None."""
    return "\n".join(_lines(content, ())) + "\n"


def _lines(table: Mapping[str, Any], key: tuple[str, ...]) -> Iterator[str]:
    """Yield the lines of a table: first all other values, then the tables in it."""
    for name, value in table.items():
        if value is not None and not isinstance(value, Mapping):
            yield f"{_name(name)} = {_value(value)}"
    for name, value in table.items():
        if isinstance(value, Mapping):
            yield f"\n[{'.'.join(map(_name, (*key, name)))}]"
            yield from _lines(value, (*key, name))


def _name(name: str) -> str:
    return name if name.replace("_", "").replace("-", "").isalnum() and name.isascii() else json.dumps(name)


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        inside = (f"{_name(name)} = {_value(one)}" for name, one in value.items() if one is not None)
        return f"{{ {', '.join(inside)} }}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool):
        return str(value).lower()
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
