"""CSV files and tables of comparisons."""

import csv
from collections.abc import Iterable, Sequence
from dataclasses import astuple, replace
from io import StringIO
from math import isnan
from pathlib import Path

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from wavetank.analysis.compare import (
    LARGEST_SHIFT,
    GaugeComparison,
    HarmonicComparison,
    SectionComparison,
    compare,
)
from wavetank.errors import InputError
from wavetank.output.files import atomic_file
from wavetank.output.tables import GaugeSeries

# ---------------------------------------------------------------- gauges
GAUGE_COLUMNS = (
    "gauge",
    "x [m]",
    "nrms",
    "nrms_fitted",
    "gain",
    "shift [s]",
    "correlation",
    "crest_computed [m]",
    "t_crest_computed [s]",
    "crest_reference [m]",
    "t_crest_reference [s]",
    "clock_offset [s]",
    "trough_computed [m]",
    "trough_reference [m]",
    "crest_error",
    "trough_error",
    "arrival_error [s]",
    "similarity",
)


def clock_line(compared: Sequence[GaugeComparison]) -> str:
    """Return the line about the offset between both clocks; empty where it is zero."""
    offset = compared[0].clock_offset
    return f"clock: {offset:+.4g} s added to the reference's times; shifts and arrivals are relative to it" * bool(
        offset
    )


def clock_note(
    computed: Sequence[GaugeSeries], reference: Sequence[GaugeSeries], compared: Sequence[GaugeComparison]
) -> str:
    """Return that another clock explains half of the misfit and more, by when waves arrive; nothing where none does."""
    late = float(np.median([one.arrival_error for one in compared if not isnan(one.arrival_error)] or [0.0]))
    if not abs(late) > LARGEST_SHIFT:
        return ""
    try:
        nearer = compare(computed, [replace(one, t=one.t + late) for one in reference])
    except InputError:
        return ""
    before, after = (float(np.mean([one.nrms for one in each])) for each in (compared, nearer))
    if after > 0.5 * before:
        return ""
    shifted = f"with {late:+.3f} s added to the reference's times nrms is {after:.3f} instead of {before:.3f}"
    return f"waves arrive at other times than in the reference, {shifted}: --clock free finds what is to be added"


def write_comparison(path: Path, comparisons: Sequence[GaugeComparison]) -> None:
    """Write ``compare.csv``, one row a gauge."""
    write_rows(path, GAUGE_COLUMNS, map(astuple, comparisons))


def write_rows(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    """Write a table as CSV, numbers with six digits; raises ``InputError`` where it cannot be written."""
    try:
        text = StringIO()
        writer = csv.writer(text)
        writer.writerow(columns)
        writer.writerows([f"{value:.6g}" if isinstance(value, float) else value for value in row] for row in rows)
        with atomic_file(path) as file:
            file.write(text.getvalue().encode())
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}).") from None


def comparison_table(comparisons: Sequence[GaugeComparison]) -> Table:
    """Return the misfits as a table for the terminal."""
    names = ("gauge", "x [m]", "nrms", "fitted", "gain", "shift [s]", "correlation", "similarity")
    table = Table(*names, box=SIMPLE, padding=0)
    for one in comparisons:
        numbers = (one.nrms, one.nrms_fitted, one.gain, one.shift, one.correlation, one.similarity)
        table.add_row(one.gauge, f"{one.x:g}", *(f"{number:.3f}" for number in numbers))
    return table


def extremes_table(comparisons: Sequence[GaugeComparison]) -> Table:
    """Return crests, troughs and arrivals as a table for the terminal; errors that no gauge has are left out."""
    table = Table("gauge", "crest [m]", "reference", "error", box=SIMPLE, padding=0)
    late = not all(isnan(one.arrival_error) for one in comparisons)
    for name in ("trough [m]", "reference", "error", *["arrival [s]"] * late):
        table.add_column(name)
    for one in comparisons:
        crests = (f"{one.crest_computed:.4g}", f"{one.crest_reference:.4g}", _percent(one.crest_error))
        troughs = (f"{one.trough_computed:.4g}", f"{one.trough_reference:.4g}", _percent(one.trough_error))
        arrival = "" if isnan(one.arrival_error) else f"{one.arrival_error:+.3f}"
        table.add_row(one.gauge, *crests, *troughs, *[arrival] * late)
    return table


def _percent(share: float) -> str:
    return "" if isnan(share) else f"{round(100 * share, 1) + 0.0:+.1f} %"


# ---------------------------------------------------------------- harmonics
HARMONIC_COLUMNS = ("gauge", "x [m]", "harmonic", "computed [m]", "reference [m]", "error", "ahead [rad]")


def write_harmonics(path: Path, found: Sequence[HarmonicComparison]) -> None:
    """Write ``compare-harmonics.csv``, one row a gauge and harmonic."""
    write_rows(path, HARMONIC_COLUMNS, map(astuple, found))


def harmonics_table(found: Sequence[HarmonicComparison]) -> Table:
    """Return the harmonics as a table for the terminal, amplitudes in mm."""
    names = ("gauge", "x [m]", "harmonic", "computed [mm]", "reference", "error", "ahead [rad]")
    table = Table(*names, box=SIMPLE, padding=0)
    for one in found:
        told = ("", "") if isnan(one.error) else (f"{100 * one.error:+.1f} %", f"{one.ahead:+.3f}")
        sizes = (f"{1e3 * one.computed:.4g}", f"{1e3 * one.reference:.4g}")
        table.add_row(one.gauge, f"{one.x:g}", f"{one.harmonic}", *sizes, *told)
    return table


# ---------------------------------------------------------------- wave heights along sections
SECTION_COLUMNS = (
    "section",
    "line",
    "measured",
    "points",
    "nrms",
    "bias",
    "nrms_incident",
    "largest_computed",
    "largest_measured",
)


def write_heights(path: Path, comparisons: Sequence[SectionComparison]) -> None:
    """Write ``compare.csv``, one row a section and origin of its measurements."""
    write_rows(path, SECTION_COLUMNS, map(astuple, comparisons))


def heights_table(comparisons: Sequence[SectionComparison]) -> Table:
    """Return the comparison as a table for the terminal."""
    names = ("section", "line", "measured", "points", "nrms", "bias", "own H0", "max", "measured")
    table = Table(*names, box=SIMPLE, padding=0)
    for one in comparisons:
        own = "" if one.nrms_incident is None else f"{one.nrms_incident:.3f}"
        misfits = (f"{one.nrms:.3f}", f"{one.bias:+.3f}", own)
        largest = (f"{one.largest_computed:.2f}", f"{one.largest_measured:.2f}")
        table.add_row(one.section, one.line, one.measured, str(one.points), *misfits, *largest)
    return table
