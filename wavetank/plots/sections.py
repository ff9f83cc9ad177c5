"""Wave heights along sections against measured ones.

The heights computed at gauges along a section are joined by a cubic spline and read at the measured places. With r the
ratio H / H0, the wave height over the incident one, per section and origin of the measurements:

    nrms          rms(computed r - measured r) / rms(measured r), H0 the experiment's
    bias          mean(computed r - measured r) / mean(measured r), the same H0
    nrms_incident as nrms, but with the computation's own incident wave height
"""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.box import SIMPLE
from rich.table import Table
from scipy.interpolate import CubicSpline

from wavetank.analysis.statistics import mean_wave_height
from wavetank.data import HeightSeries, Section, WaveHeights
from wavetank.errors import InputError
from wavetank.output.tables import GaugeSeries
from wavetank.plots.compare import MATCH, rms, write_rows

FEWEST = 4  # gauges along a section: a cubic's
ALL = "all"  # sections together

COLUMNS = (
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


class SectionProfile(NamedTuple):
    """Wave heights along a section, computed: places along its axis [m], ascending, and H [m], both of shape (N,)."""

    section: Section
    places: NDArray[np.float64]
    heights: NDArray[np.float64]

    def at(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return H [m] at other places along the section [m]."""
        return np.asarray(CubicSpline(self.places, self.heights)(places))

    def reaches(self, places: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which places [m] are between the first and the last gauge."""
        first, last = self.places[0] - MATCH, self.places[-1] + MATCH
        return np.asarray((places >= first) & (places <= last))


def profile(gauges: Sequence[GaugeSeries], section: Section, *, start: float) -> SectionProfile | None:
    """Return the mean wave heights after ``start`` [s] along a section; None with fewer than four gauges there.

    Raises ``InputError`` if a record is too short for wave heights.
    """
    along = {}
    for gauge in gauges:
        place, beside = section.coordinates(gauge.x, gauge.y)
        if abs(beside) < MATCH and section.reach[0] - MATCH <= place <= section.reach[1] + MATCH:
            along[round(place / MATCH)] = (place, gauge)  # where sections cross, several gauges stand at one place
    if len(along) < FEWEST:
        return None
    places, there = zip(*(along[key] for key in sorted(along)), strict=True)
    return SectionProfile(
        section, np.array(places), np.array([mean_wave_height(gauge, start=start) for gauge in there])
    )


class ComputedHeights(NamedTuple):
    """A run's wave heights: along each section that has gauges, and H of its incident wave [m], None if unknown."""

    profiles: list[SectionProfile]
    incident: float | None


def computed_heights(gauges: Sequence[GaugeSeries], known: WaveHeights) -> ComputedHeights:
    """Return the wave heights at the gauges along the sections of known ones.

    Raises ``InputError`` if no section has gauges, or if a record is too short for wave heights.
    """
    found = [profile(gauges, section, start=known.start) for section in known.sections]
    if not any(found):
        lines = ", ".join(line(section) for section in known.sections)
        raise InputError(
            f"no section with gauges: the run has {len(gauges)} gauges; needed are {FEWEST} along one of {lines}."
        )
    incident = profile(gauges, known.incident, start=known.start)
    return ComputedHeights(
        [one for one in found if one is not None], None if incident is None else float(incident.heights.mean())
    )


def line(section: Section) -> str:
    """Return where a section is, e.g. ``x = 5 m``."""
    return f"{section.across} = {section.at:g} m"


@dataclass(frozen=True)
class SectionComparison:
    """How computed wave heights compare with one origin's measured ones; fields as in ``COLUMNS``."""

    section: str
    line: str
    measured: str
    points: int
    nrms: float
    bias: float
    nrms_incident: float | None
    largest_computed: float
    largest_measured: float


class _Points(NamedTuple):
    """Heights at the measured places of one or all sections: computed [m], and measured H / H0."""

    section: str
    line: str
    heights: NDArray[np.float64]
    ratios: NDArray[np.float64]


def compare_heights(
    computed: ComputedHeights, measured: Sequence[HeightSeries], *, incident: float
) -> list[SectionComparison]:
    """Return a comparison for each measured section that has gauges, and for each origin one of all its sections.

    ``incident`` is the experiment's incident wave height H0 [m].
    """
    along = {one.section.name: one for one in computed.profiles}
    comparisons: list[SectionComparison] = []
    for source in dict.fromkeys(series.source for series in measured):
        theirs = [series for series in measured if series.source == source and series.section.name in along]
        if points := [_points(along[series.section.name], series) for series in theirs]:
            heights, ratios = (np.concatenate(part) for part in list(zip(*points, strict=True))[2:])
            points.append(_Points(ALL, "", heights, ratios))
        comparisons += [_compared(one, source, incident, computed.incident) for one in points if one.ratios.size]
    return comparisons


def _points(computed: SectionProfile, measured: HeightSeries) -> _Points:
    there, section = computed.reaches(measured.places), measured.section
    return _Points(section.name, line(section), computed.at(measured.places[there]), measured.ratios[there])


def _compared(points: _Points, source: str, nominal: float, own: float | None) -> SectionComparison:
    ratios, misfit = points.ratios, points.heights / nominal - points.ratios
    return SectionComparison(
        section=points.section,
        line=points.line,
        measured=source,
        points=ratios.size,
        nrms=rms(misfit) / rms(ratios),
        bias=float(misfit.mean() / ratios.mean()),
        nrms_incident=None if own is None else rms(points.heights / own - ratios) / rms(ratios),
        largest_computed=float(points.heights.max() / nominal),
        largest_measured=float(ratios.max()),
    )


def write_heights(path: Path, comparisons: Sequence[SectionComparison]) -> None:
    """Write ``compare.csv``, one row a section and origin of its measurements."""
    write_rows(path, COLUMNS, map(astuple, comparisons))


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
