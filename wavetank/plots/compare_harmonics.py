"""Harmonics of regular waves, computed against measured: amplitudes and phases, gauge by gauge."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from math import isnan, nan
from pathlib import Path

import numpy as np
from rich.box import SIMPLE
from rich.table import Table

from wavetank.analysis.signals import elevation, harmonics
from wavetank.output.tables import GaugeSeries
from wavetank.plots.compare import matched, write_rows
from wavetank.plots.style import BLUE, GREEN, VERMILION, picture

NUMBER = 3  # harmonics compared
COLUMNS = ("gauge", "x [m]", "harmonic", "computed [m]", "reference [m]", "error", "ahead [rad]")
TOLD = 0.01  # of the first harmonic in the reference: of less no error is told, nor a phase


@dataclass(frozen=True)
class HarmonicComparison:
    """A harmonic at one gauge; fields as in ``COLUMNS``: by what phase the computed wave is ahead, in (-pi, pi]."""

    gauge: str
    x: float
    harmonic: int
    computed: float
    reference: float
    error: float
    ahead: float


def compare_harmonics(
    computed: Sequence[GaugeSeries], reference: Sequence[GaugeSeries], *, period: float, start: float | None = None
) -> list[HarmonicComparison]:
    """Return the first three harmonics of a period [s] at each gauge that both have, over the times that both have.

    From ``start`` [s] on, where that is told: before, waves may not be established. Raises ``InputError`` as
    ``harmonics`` does, and where there are no gauges or times in common.
    """
    found = []
    for one, other in matched(computed, reference):
        both = elevation([other, one]).sel(time=slice(start, None))
        ours, theirs = harmonics(both, 1 / period, number=NUMBER).component.values[::-1]
        for n, (a, b) in enumerate(zip(ours, theirs, strict=True), start=1):
            there = abs(b) > TOLD * abs(theirs[0])
            error, ahead = (abs(a) / abs(b) - 1, float(np.angle(b / a))) if there and a else (nan, nan)
            found.append(HarmonicComparison(other.name, other.x, n, float(abs(a)), float(abs(b)), float(error), ahead))
    return found


def write_harmonics(path: Path, found: Sequence[HarmonicComparison]) -> None:
    """Write ``compare-harmonics.csv``, one row a gauge and harmonic."""
    write_rows(path, COLUMNS, map(astuple, found))


def harmonics_figure(path: Path, found: Sequence[HarmonicComparison]) -> None:
    """Draw the amplitudes along the tank, or gauge by gauge where not all places are known."""
    places = {one.gauge: one.x for one in found}
    known = bool(np.isfinite([*places.values()]).all())
    at = places if known else {gauge: float(n) for n, gauge in enumerate(places)}
    with picture(path, 9, 4.6) as figure:
        axes = figure.add_subplot()
        for harmonic, colour in enumerate((BLUE, VERMILION, GREEN), start=1):
            ones = sorted((one for one in found if one.harmonic == harmonic), key=lambda one: at[one.gauge])
            x = [at[one.gauge] for one in ones]
            theirs, ours = [1e3 * one.reference for one in ones], [1e3 * one.computed for one in ones]
            axes.plot(x, theirs, "o", ms=8, mfc="none", color=colour, label=f"reference, harmonic {harmonic}")
            axes.plot(x, ours, ".-", color=colour, label=f"computed, harmonic {harmonic}")
        axes.set(xlabel="x [m]" if known else "gauge", ylabel="amplitude [mm]", ylim=(0, None))
        if not known:
            axes.set_xticks([*at.values()], [*at])
        figure.legend(ncols=3, loc="outside lower center")


def harmonics_table(found: Sequence[HarmonicComparison]) -> Table:
    """Return the harmonics as a table for the terminal, amplitudes in mm."""
    names = ("gauge", "x [m]", "harmonic", "computed [mm]", "reference", "error", "ahead [rad]")
    table = Table(*names, box=SIMPLE, padding=0)
    for one in found:
        told = ("", "") if isnan(one.error) else (f"{100 * one.error:+.1f} %", f"{one.ahead:+.3f}")
        sizes = (f"{1e3 * one.computed:.4g}", f"{1e3 * one.reference:.4g}")
        table.add_row(one.gauge, f"{one.x:g}", f"{one.harmonic}", *sizes, *told)
    return table
