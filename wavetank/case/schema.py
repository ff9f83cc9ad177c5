"""The JSON schema of case files, by which editors complete and check them."""

from typing import Any

from wavetank.case.keys import tables, tag
from wavetank.case.numerics import Gauge
from wavetank.case.probes import Probe
from wavetank.case.scene import Scene
from wavetank.case.tanks import SliceTank

DRAFT = "http://json-schema.org/draft-07/schema#"


def schema() -> dict[str, Any]:
    """Return the schema: pydantic's, in what TOML has (no null), with what a case may leave out."""
    whole: dict[str, Any] = {"$schema": DRAFT, **_plain(Scene.model_json_schema())}
    whole["title"] = "a case of wavetank"
    known = whole["$defs"]
    for noun in {noun for table in tables() for noun in table.nouns if tag(noun) and noun is not SliceTank}:
        known[noun.__name__].setdefault("required", []).insert(0, "type")
    for noun in (known[one.__name__] for one in (Gauge, Probe)):
        noun["required"].remove("name")
        noun["properties"]["name"]["description"] += "; default: its number"
    gauges = whole["properties"]["gauges"]
    gauges["items"] = {"anyOf": [gauges["items"], known[Gauge.__name__]["properties"]["x"]]}
    return whole


def _plain(part: Any) -> Any:
    """Return a part of the schema without what only pydantic or Python needs."""
    if isinstance(part, list):
        return [_plain(one) for one in part]
    if not isinstance(part, dict):
        return part
    part = {key: _plain(value) for key, value in part.items() if not _is_python(key, value)}
    if "description" in part and isinstance(part["description"], str):
        part["description"] = " ".join(part["description"].partition("\n\n")[0].split())
    if alternatives := [one for one in part.pop("anyOf", ()) if one != {"type": "null"}]:
        part = {**alternatives[0], **part} if len(alternatives) == 1 else {**part, "anyOf": alternatives}
    return part


def _is_python(key: str, value: Any) -> bool:
    """Return whether a key of the schema is of no use to an editor: names of classes, tags, defaults that TOML has not.

    A key of a case that is called so has a table here.
    """
    match key:
        case "title":
            return isinstance(value, str)
        case "default":
            return value is None or isinstance(value, dict)
        case _:
            return key == "discriminator"
