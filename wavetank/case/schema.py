"""The tables and keys of a case, and their JSON schema."""

from collections.abc import Iterator
from functools import cache
from typing import Any, NamedTuple, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from wavetank.case.model import Case
from wavetank.case.output import Gauge, Probe
from wavetank.case.tank import SliceTank


# ---------------------------------------------------------------- tables
class Table(NamedTuple):
    """A table of a case, with its models.

    Attributes
    ----------
    path
        Its key; empty for the keys before all tables.
    models
        One model for each type.
    listed
        Whether it is an array of tables.
    """

    path: tuple[str, ...]
    models: tuple[type[BaseModel], ...]
    listed: bool = False

    @property
    def header(self) -> str:
        """Its header in a case file."""
        name = ".".join(self.path)
        return f"[[{name}]]" if self.listed else f"[{name}]"


def models(annotation: Any) -> Iterator[type[BaseModel]]:
    """Yield the models of an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in get_args(annotation):
        yield from models(argument)


def tag(model: type[BaseModel]) -> str:
    """Return the type that selects the class of a table in a case; empty if there is only one."""
    return str(model.model_fields["type"].default) if "type" in model.model_fields else ""


@cache
def tables() -> tuple[Table, ...]:
    """Return all tables of a case, each before the tables in it."""
    return tuple(_tables(Table((), (Case,))))


def _tables(table: Table) -> Iterator[Table]:
    yield table
    inside: dict[str, Table] = {}
    for name, field in ((name, field) for model in table.models for name, field in model.model_fields.items()):
        if types := tuple(models(field.annotation)):
            earlier = inside.get(name, Table((), ())).models
            inside[name] = Table(
                (*table.path, name), tuple(dict.fromkeys((*earlier, *types))), get_origin(field.annotation) is tuple
            )
    first = dict[tuple[type[BaseModel], ...], Table]()
    for one in inside.values():
        if first.setdefault(one.models, one) is one:  # the far wall is documented with the wall
            yield from _tables(one)


def table_at(path: tuple[str, ...], field: FieldInfo) -> Table | None:
    """Return the table of a key, or the documented one of the same models; None for a value."""
    types = tuple(models(field.annotation))
    same = [one for one in tables() if one.path == path or (types and one.models == types)]
    return max(same, key=lambda one: one.path == path, default=None)


# ---------------------------------------------------------------- JSON schema
DRAFT = "http://json-schema.org/draft-07/schema#"


def schema() -> dict[str, Any]:
    """Return the JSON schema of a case file: that of pydantic without null, with optional keys."""
    document: dict[str, Any] = {"$schema": DRAFT, **_plain(Case.model_json_schema())}
    document["title"] = "a case of wavetank"
    definitions = document["$defs"]
    for model in {model for table in tables() for model in table.models if tag(model) and model is not SliceTank}:
        definitions[model.__name__].setdefault("required", []).insert(0, "type")
    for model in (definitions[one.__name__] for one in (Gauge, Probe)):
        model["required"].remove("name")
        model["properties"]["name"]["description"] += "; default: its number"
    gauges = document["properties"]["gauges"]
    gauges["items"] = {"anyOf": [gauges["items"], definitions[Gauge.__name__]["properties"]["x"]]}
    return document


def _plain(part: Any) -> Any:
    """Return a part of the schema without class names, tags, and defaults that TOML cannot represent.

    A key of a case with such a name has a table as its value.
    """
    if isinstance(part, list):
        return [_plain(one) for one in part]
    if not isinstance(part, dict):
        return part
    useless = {"discriminator": object, "title": str, "default": dict | None}
    part = {key: _plain(value) for key, value in part.items() if not isinstance(value, useless.get(key, ()))}
    if "description" in part and isinstance(part["description"], str):
        part["description"] = " ".join(part["description"].partition("\n\n")[0].split())
    if alternatives := [one for one in part.pop("anyOf", ()) if one != {"type": "null"}]:
        part = {**alternatives[0], **part} if len(alternatives) == 1 else {**part, "anyOf": alternatives}
    return part
