"""NetCDF in the classic 64-bit format, which every NetCDF library reads, by the CF conventions 1.8."""

import shlex
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

MAGIC = b"CDF\x02"
DIMENSION, VARIABLE, ATTRIBUTE = 10, 11, 12  # the format's tags of lists
KINDS = {2: np.dtype("S1"), 4: np.dtype(">i4"), 5: np.dtype(">f4"), 6: np.dtype(">f8")}  # and of numbers
TYPES = {kind: number for number, kind in KINDS.items()}

ELEVATION = {
    "standard_name": "sea_surface_height_above_mean_sea_level",
    "long_name": "elevation of the surface above still water",
    "units": "m",
}
TIME = {"long_name": "time since the start", "units": "s", "axis": "T"}  # no date to count from: not CF's ``time``
ALONG = {"long_name": "distance along the tank from the paddle at rest", "units": "m", "axis": "X"}
ACROSS = {"long_name": "distance across the tank", "units": "m", "axis": "Y"}
UPWARDS = {"long_name": "height above still water", "units": "m", "axis": "Z", "positive": "up"}


class Variable(NamedTuple):
    """A variable of a file: the names of its dimensions, its values, and what is said of it."""

    dimensions: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, str | np.float64]


def conventions(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Return what CF says of a run's file: title, source, history and conventions."""
    version = manifest.get("versions", {}).get("wavetank", "unknown")
    return {
        "title": str(manifest.get("scene", {}).get("title", "")),
        "source": f"wavetank {version}, revision {manifest.get('git') or 'unknown'}",
        "history": f"{manifest.get('started', '')} {shlex.join(manifest.get('command', []))}".strip(),
        "Conventions": "CF-1.8",
    }


def netcdf(variables: Mapping[str, Variable], attributes: Mapping[str, str], *, growing: str = "") -> bytes:
    """Return a file of variables; the dimension ``growing`` is the unlimited one, in which records can be added.

    Text is characters in UTF-8, along a dimension of its own. Raises ``ValueError`` for a length of zero: the format
    takes that for unlimited.
    """
    told = {name: _told(name, variable) for name, variable in variables.items()}
    lengths: dict[str, int] = {}
    for name, (dimensions, values, _) in told.items():
        for dimension, length in zip(dimensions, values.shape, strict=True):
            if dimension not in lengths and not length:
                raise ValueError(f"{name}: has no {dimension}")
            lengths.setdefault(dimension, length)
    places = {dimension: n for n, dimension in enumerate(lengths)}
    records = [name for name, one in told.items() if one.dimensions[:1] == (growing,)]
    whole = [name for name in told if name not in records]
    count = lengths.get(growing, 0)

    def head(begins: Mapping[str, int]) -> bytes:
        """Return what comes before the data, which begin there."""
        dimensions = [_text(name) + _number(0 if name == growing else length) for name, length in lengths.items()]
        each = [
            _text(name)
            + _number(len(one.dimensions))
            + b"".join(_number(places[dimension]) for dimension in one.dimensions)
            + _attributes(one.attributes)
            + _number(TYPES[one.values.dtype])
            + _number(len(_padded(one.values[:1] if name in records else one.values)))
            + begins.get(name, 0).to_bytes(8, "big")
            for name, one in ((name, told[name]) for name in (*whole, *records))
        ]
        parts = _listed(DIMENSION, dimensions), _attributes(attributes), _listed(VARIABLE, each)
        return MAGIC + _number(count if growing in lengths else 0) + b"".join(parts)

    begins, at = {}, len(head({}))
    for name in (*whole, *records):
        begins[name] = at
        at += len(_padded(told[name].values[:1] if name in records else told[name].values))
    data = [_padded(told[name].values) for name in whole]
    data += [_padded(told[name].values[n : n + 1]) for n in range(count) for name in records]
    return b"".join([head(begins), *data])


def variables_of(content: bytes) -> dict[str, NDArray[Any]]:
    """Return the variables of a file by their names; raises ``ValueError`` for less than its header tells."""
    try:
        return _variables_of(_Reading(content))
    except (IndexError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise ValueError("is no whole NetCDF in the classic 64-bit format") from error


class _Reading:
    """A header, read number by number."""

    def __init__(self, content: bytes):
        self.content, self._at = content, len(MAGIC)

    def number(self, size: int = 4) -> int:
        self._at += size
        if self._at > len(self.content):
            raise IndexError
        return int.from_bytes(self.content[self._at - size : self._at], "big")

    def skip(self, size: int) -> bytes:
        """Return so many bytes, after which others fill four."""
        begin, self._at = self._at, self._at + size + -size % 4
        return self.content[begin : begin + size]

    def text(self) -> str:
        return self.skip(self.number()).decode()

    def listed(self) -> range:
        _, count = self.number(), self.number()
        return range(count)

    def skip_attributes(self) -> None:
        for _ in self.listed():
            self.text()
            size = KINDS[self.number()].itemsize
            self.skip(size * self.number())


def _variables_of(head: _Reading) -> dict[str, NDArray[Any]]:
    count = head.number()
    lengths = [(head.text(), head.number())[1] for _ in head.listed()]
    head.skip_attributes()
    found: dict[str, tuple[list[int], np.dtype[Any], int, int]] = {}
    for _ in head.listed():
        name, dimensions = head.text(), [head.number() for _ in range(head.number())]
        head.skip_attributes()
        found[name] = dimensions, KINDS[head.number()], head.number(), head.number(8)
    record = sum(size for dimensions, _, size, _ in found.values() if dimensions and not lengths[dimensions[0]])
    variables: dict[str, NDArray[Any]] = {}
    for name, (dimensions, kind, _, begin) in found.items():
        shape = [lengths[one] or count for one in dimensions]
        of_one = np.empty(shape[1:], dtype=kind)
        grows = bool(dimensions) and not lengths[dimensions[0]]
        strides = (record if grows else of_one.nbytes, *of_one.strides) if shape else ()
        variables[name] = np.ndarray(shape, kind, head.content, begin, strides).copy()
    return variables


def _told(name: str, variable: Variable) -> Variable:
    """Return a variable as the file has it."""
    dimensions, values, said = variable
    if values.dtype.kind != "U":
        return Variable(dimensions, values.astype(values.dtype.newbyteorder(">")), said)
    encoded = np.char.encode(values, "utf-8")
    characters = encoded.view("S1").reshape(*values.shape, encoded.itemsize)
    return Variable((*dimensions, f"{name}_length"), characters, {**said, "_Encoding": "utf-8"})


def _number(value: int) -> bytes:
    return value.to_bytes(4, "big")


def _text(text: str) -> bytes:
    return _number(len(text.encode())) + _filled(text.encode())


def _filled(content: bytes) -> bytes:
    """Return bytes, with others to fill four."""
    return content + bytes(-len(content) % 4)


def _padded(values: NDArray[Any]) -> bytes:
    return _filled(values.tobytes())


def _listed(tag: int, items: list[bytes]) -> bytes:
    return _number(tag if items else 0) + _number(len(items)) + b"".join(items)


def _attributes(attributes: Mapping[str, str | np.float64]) -> bytes:
    items = list[bytes]()
    for name, value in attributes.items():
        kind = TYPES[np.dtype("S1" if isinstance(value, str) else ">f8")]
        content = _text(value) if isinstance(value, str) else _number(1) + np.array(value, dtype=">f8").tobytes()
        items.append(_text(name) + _number(kind) + content)
    return _listed(ATTRIBUTE, items)
