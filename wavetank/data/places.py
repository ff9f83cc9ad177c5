"""Folders of data sets: ``$WAVETANK_DATA/NAME``, ``../shared/data/NAME`` next to the checkout, and the cache."""

import os
from collections.abc import Mapping
from pathlib import Path

from pydantic import ValidationError

from wavetank.base.cache import places
from wavetank.base.columns import Header, name_and_unit
from wavetank.base.errors import InputError
from wavetank.data.description import (
    DATASET,
    METRES,
    SECONDS,
    Dataset,
    GaugePosition,
    RecordFiles,
    Units,
    read_dataset,
    refused,
)
from wavetank.data.tables import gauges_header
from wavetank.output.columns import parse_position_label

PART = "data"  # name of the folder in the cache
HERE = Path(__file__).resolve().parent
BUILT_IN = HERE / "known"
OTHER_UNITS = frozenset(  # of columns that are no elevations
    """
    N kN N/m kN/m Nm kNm N.m N*m Pa hPa kPa MPa bar mbar m/s cm/s mm/s m/s2 m/s^2 m/s² g kg deg ° rad deg/s °/s rad/s
    C °C degC K V mV A mA W kW Hz rpm % -
    """.split()  # noqa: SIM905
)


def folders() -> list[Path]:
    """Return the folders of data sets in the order of search."""
    chosen = os.environ.get("WAVETANK_DATA")
    shared = HERE.parents[2] / "shared" / "data"
    return [*([Path(chosen)] if chosen else []), shared, *places(PART)]


def names() -> list[str]:
    """Return the names of the described data sets, in the folders or in this package."""
    return sorted({path.parent.name for folder in (*folders(), BUILT_IN) for path in folder.glob(f"*/{DATASET}")})


def dataset(name: str) -> Dataset:
    """Return the data set of a name; raise ``InputError`` for an unknown one."""
    for folder in (*folders(), BUILT_IN):
        if name and "/" not in name and os.path.isfile(folder / name / DATASET):
            return read_dataset(folder / name)
    raise InputError(f"data set {name!r} received; known data sets are: {', '.join(names())}.")


def opened(reference: str) -> Dataset:
    """Return a data set by its name, its folder with a ``dataset.toml``, or a plain CSV file.

    ``NAME:SOURCE`` selects the records of one source. Raises ``InputError`` for other texts.
    """
    path, (name, colon, source) = Path(reference), reference.rpartition(":")
    if colon and not path.exists():
        data = opened(name)
        if chosen := [records for records in data.records if records.source == source]:
            return data.model_copy(update={"records": tuple(chosen[:1])})
        have = ", ".join(records.source for records in data.records) or "none"
        raise InputError(f"{data.name}:{source}: there are no records {source!r}; there are {have}.")
    if reference in names():
        return dataset(reference)
    folder = path.parent if path.name == DATASET else path
    if (folder / DATASET).exists():
        return read_dataset(folder)
    if path.is_file():
        return plain(path)
    why = f"is no run directory, no folder with a {DATASET}, no CSV file, and no data set"
    if not path.exists() and ("/" in reference or path.suffix):
        why = f"does not exist; allowed are a run directory, a folder with a {DATASET}, a CSV file, and a data set"
    raise InputError(f"{reference}: {why}; known data sets are: {', '.join(names())}.")


def plain(path: Path) -> Dataset:
    """Return a table as a data set: the first column is the time, the header names the gauges of the others.

    Windows and gauges of a run in NetCDF are tables, too (``tables.py``).

    A name may contain the position, ``5@x=50`` or ``5@x=50;y=2``, as in ``gauges.csv`` of a run, and a unit of
    ``SECONDS`` or ``METRES``, ``5 [mm]`` or ``5 (mm)``; without one it is the first. Columns with ``OTHER_UNITS`` are
    omitted. Raises ``InputError`` for a file without a header or elevations, for unknown units, and for gauges of equal
    names.
    """
    header = gauges_header(path)
    if len(header.names) < 2:
        raise InputError(f"{path}: its first line must name the columns: the time [s], then the gauges [m].")
    _, time = _name_and_unit(path, header, 0, SECONDS)
    columns = [n for n, name in enumerate(header.names) if n and name_and_unit(name)[1] not in OTHER_UNITS]
    if not columns:
        raise InputError(f"{path}: has no column of elevations; allowed are the units {', '.join(METRES)}.")
    names, units = zip(*(_name_and_unit(path, header, n, METRES) for n in columns), strict=True)
    records = RecordFiles(
        files=(path.name,),
        columns=tuple(n + 1 for n in columns),
        source=path.stem,
        units=Units.model_validate({"time": time}),
        gains=tuple(METRES[unit] for unit in units),
    )
    try:
        return Dataset(name=path.stem, folder=path.parent, gauges=tuple(map(_gauge, names)), records=(records,))
    except ValidationError as error:
        raise refused(path, error) from None


def other_columns(reference: str) -> dict[str, str]:
    """Return the columns of a table that are no elevations, by their names; none of a data set."""
    columns = {name_and_unit(column): column for column in _columns(reference)[1:]}
    return {name: column for (name, unit), column in columns.items() if unit in OTHER_UNITS}


def _columns(reference: str) -> tuple[str, ...]:
    """Return the columns of a table by its path; none of a data set."""
    path = Path(reference)
    described = reference in names() or path.name == DATASET or not path.is_file()
    return () if described else gauges_header(path).names


def units_note(reference: str) -> str:
    """Return the assumed units of a table whose first line has none, and omitted columns; empty without any.

    A position in a name, as in the table of a run, implies metres. Raises ``InputError`` as ``opened``.
    """
    time, *columns = _columns(reference) or ("",)
    notes, silent = [], [name for name in columns if not name_and_unit(name)[1] and "@" not in name]
    if silent:
        units = f"{', '.join(silent)} in m{'' if name_and_unit(time)[1] else f' and {time} in s'}"
        notes.append(f"{units}, as its first line says no units; a {DATASET} beside it says others")
    if others := other_columns(reference).values():
        notes.append(f"{', '.join(others)} omitted: no elevations")
    return f"{reference}: {'; '.join(notes)}" if notes else ""


def _name_and_unit(path: Path, header: Header, number: int, units: Mapping[str, float]) -> tuple[str, str]:
    """Return name and unit of a column; without a unit it is the first of the units."""
    column = header.names[number]
    name, unit = name_and_unit(column)
    unit = unit or next(iter(units))
    if unit not in units:
        allowed = f"allowed are the units {', '.join(units)}"
        raise InputError(f"{path}, line {header.line}: column {column!r} received; {allowed}.")
    return name, unit


def _gauge(column: str) -> GaugePosition:
    try:
        name, x, y, _ = parse_position_label(column)
        return GaugePosition(name=name, x=x, y=y)
    except ValueError:
        return GaugePosition(name=column)


def _first(paths: list[Path]) -> Path | None:
    """Return the first path that is a file; ``Path.is_file`` fails if a folder cannot be entered."""
    return next((path for path in paths if os.path.isfile(path)), None)


def present(data: Dataset, file: str) -> Path | None:
    """Return the path of a file of a data set, next to its description or in a folder of data sets; None if missing."""
    return _first([data.folder / file, *(folder / data.name / file for folder in folders())])


def located(data: Dataset, file: str) -> Path:
    """Return the same path; for a missing file in a user's folder the expected one, otherwise raise ``InputError``."""
    if path := present(data, file):
        return path
    return find(data.name, file) if data.folder.parent in (*folders(), BUILT_IN) else data.folder / file


def find(name: str, file: str) -> Path:
    """Return the path of a file of a data set; raise ``InputError`` with the searched folders."""
    searched = [folder / name / file for folder in folders()]
    if path := _first(searched):
        return path
    if name not in names():
        remedy = f"set WAVETANK_DATA to the folder that holds {name!r} (known data sets: {', '.join(names())})"
    elif file in (files := [one.name for one in dataset(name).files]):
        remedy = f"'wavetank data fetch {name}' downloads it"
    else:
        remedy = f"the files of {name} are: {', '.join(files)}"
    raise InputError(f"data:{name}/{file} is not in any of: {', '.join(map(str, searched))}; {remedy}.")


def summary(name: str) -> str:
    """Return title, folders, citation and licence of a data set, one line each."""
    try:
        data = dataset(name)
    except InputError as error:
        return f"{name}: {error}"
    files = dict.fromkeys([*(one.name for one in data.files), *data.parts()])
    paths = {file: path.parent for file in files if (path := present(data, file))}
    where = ", ".join(map(str, dict.fromkeys(paths.values()))) or "not here"
    if missing := ", ".join(file for file in files if file not in paths):
        where += f", without {missing}" * bool(paths) + f"; 'wavetank data fetch {name}' brings it" * bool(
            data.urls and data.files
        )
    facts = {"data": where, "cite": data.citation or "?", "licence": data.licence or "?"}
    return "\n".join([f"{name}: {data.title}", *(f"    {key}: {fact}" for key, fact in facts.items())])


def resolve(reference: str, folder: Path = Path()) -> Path:
    """Return the path of a file that a case file in ``folder`` names: ``data:NAME/FILE``, or a path relative to it.

    Raises ``InputError`` for another form of reference, and for missing data.
    """
    scheme, colon, where = reference.partition(":")
    if not (colon and scheme == "data"):
        return (folder / reference).resolve()
    name, *parts = where.split("/")
    if not parts or any(part in ("", ".", "..") or "\0" in part for part in (name, *parts)):
        raise InputError(f"path {reference!r} received; allowed is data:NAME/FILE, a file in the data set's folder.")
    return find(name, "/".join(parts))
