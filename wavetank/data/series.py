"""Records of data sets: elevations at gauges, wave heights along sections."""

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.base.columns import ColumnTable, check_ascending, check_gaps, read_columns
from wavetank.base.errors import InputError
from wavetank.data.description import (
    METRES,
    SECONDS,
    Column,
    Dataset,
    HeightColumn,
    HeightRecords,
    RecordFiles,
    Section,
)
from wavetank.data.places import located, present
from wavetank.data.tables import read_gauges
from wavetank.output.columns import gauge_array

if TYPE_CHECKING:
    from xarray import DataArray

SECOND = 2  # number of the column, from 1


class HeightSeries(NamedTuple):
    """Wave heights along a section: positions along its axis [m], ascending, and H / H0, both of shape (N,)."""

    section: Section
    places: NDArray[np.float64]
    ratios: NDArray[np.float64]
    source: str


def gauge_records(data: Dataset) -> "list[DataArray]":
    """Return the records of a data set at its gauges: first the reference of comparisons, then published computations.

    Each is the elevation [m] over gauge and time [s], with the positions x and y [m] of the gauges: not a number at
    times of other gauges, and x not a number if it is unknown. Attributes are ``source`` and ``clock_offset``, the
    bounds [s] of the offset that is added to its times. A published computation with missing files is omitted. Raises
    ``InputError`` if there are no records, for missing files of the reference, and for unreadable files.
    """
    if not data.records:
        files = ", ".join(file.name for file in data.files) or "nothing"
        raise InputError(f"{data.name}: has no records of gauges over time, which are compared; its files are {files}.")
    first, *published = data.records
    there = [one for one in published if all(present(data, file) for file in one.files)]
    return [_records(data, one) for one in (first, *there)]


def _records(data: Dataset, records: RecordFiles) -> "DataArray":
    from xarray import concat

    number = len(data.gauges)
    each = len(records.files) == number
    paths = [located(data, file) for file in records.files] * (1 if each else number)
    tables = {path: read_gauges(path) for path in dict.fromkeys(paths)}
    seconds, metres = SECONDS[records.units.time], METRES[records.units.elevation]
    series = []
    for n, (gauge, path) in enumerate(zip(data.gauges, paths, strict=True)):
        table = tables[path]
        column = records.columns[n] if records.columns else _usual(gauge.name, table, SECOND if each else SECOND + n)
        t, eta = (_column(path, table, one) for one in (records.time, column))
        check_ascending(path, table.lines, t)
        check_gaps(path, seconds * t, eta, table.lines)
        scale = metres * (records.gains[n] if records.gains else 1.0)
        clock = records.clocks[n] if records.clocks else 0.0
        x = np.nan if gauge.x is None else gauge.x
        series.append(gauge_array([gauge.name], [x], [gauge.y], seconds * t + clock, [scale * eta]))
    result = concat(series, "gauge", coords="minimal", compat="override", join="outer")
    return result.assign_attrs(source=records.source, clock_offset=records.clock_offset)


def _usual(gauge: str, table: ColumnTable, number: int) -> Column:
    """Return the default column of a gauge: by its name, else by its number."""
    alone = number == SECOND and len(table.names) == SECOND
    return gauge if table.names and (gauge in table.names or not alone) else number


def _column(path: Path, table: ColumnTable, column: Column) -> NDArray[np.float64]:
    """Return a column of a table; raise ``InputError`` if there is none."""
    if isinstance(column, str):
        if column not in table.names:
            have = ", ".join(table.names) or "none: it begins with numbers"
            raise InputError(f"{path}: column {column!r} asked for; the names in its first line are: {have}.")
        column = table.names.index(column) + 1
    if column > table.values.shape[1]:
        raise InputError(f"{path}: column {column} asked for; it has {table.values.shape[1]}.")
    return table.values[:, column - 1]


def height_series(data: Dataset) -> list[HeightSeries]:
    """Return the wave heights of a data set along sections, ordered by origin; empty if it has none.

    Raises ``InputError`` for files that are missing or cannot be read, and for sections without a description.
    """
    if data.heights is None:
        return []
    sections = {section.name: section for section in data.heights.sections}
    return [
        _heights(located(data, column.file), column, records, sections[column.section])
        for records in data.heights.records
        for column in records.columns
    ]


def _heights(path: Path, column: HeightColumn, records: HeightRecords, section: Section) -> HeightSeries:
    table = read_columns(path)
    places, heights = column.sign * _column(path, table, 1), _column(path, table, column.column)
    ascending = np.argsort(places)
    ratios = np.divide(heights[ascending], records.incident, dtype=np.float64)
    return HeightSeries(section, places[ascending], ratios, records.source)
