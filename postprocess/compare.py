"""Gauges against measurements, or against another computation.

Per gauge, over the times both have, with the reference's times as the base:

    nrms        rms(computed - reference) / rms(reference)
    nrms_fitted the same after one gain and one time shift, computed(t - shift) * gain, fitted by least squares
"""

import csv
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from wavetank.errors import InputError
from wavetank.series import GaugeSeries

LARGEST_SHIFT = 1.0  # s

COLUMNS = (
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
)


@dataclass(frozen=True)
class GaugeComparison:
    """How a computed record compares with a reference at one gauge; fields as in ``COLUMNS``."""

    gauge: str
    x: float
    nrms: float
    nrms_fitted: float
    gain: float
    shift: float
    correlation: float
    crest_computed: float
    t_crest_computed: float
    crest_reference: float
    t_crest_reference: float


def compare(computed: Sequence[GaugeSeries], reference: Sequence[GaugeSeries]) -> list[GaugeComparison]:
    """Return a comparison for each gauge that both have, within 1 mm of x; raises ``InputError`` if there is none."""
    pairs = [(one, other) for other in reference for one in computed if abs(one.x - other.x) < 1e-3]
    if not pairs:
        have, want = (", ".join(f"{series.x:g}" for series in group) for group in (computed, reference))
        raise InputError(f"no gauge in common: the run has x = {have or 'none'} m, the reference x = {want or 'none'} m.")
    return [compare_gauge(one, other) for one, other in pairs]


def compare_gauge(computed: GaugeSeries, reference: GaugeSeries) -> GaugeComparison:
    """Return the comparison at one gauge; raises ``InputError`` if the records do not overlap in time."""
    if computed.t.size < 4:
        raise InputError(f"gauge {computed.name}: {computed.t.size} rows computed; at least 4 are needed to compare.")
    common = (reference.t >= computed.t[0]) & (reference.t <= computed.t[-1])
    t, eta = reference.t[common], reference.eta[common]
    if t.size < 4 or not np.any(eta):
        raise InputError(f"gauge {computed.name}: the records do not overlap in time, or the reference is zero there.")
    spline = CubicSpline(computed.t, computed.eta)
    size = np.sqrt(np.mean(eta**2))
    shift, gain, misfit = _fit(spline, computed, t, eta)
    fine = np.linspace(t[0], t[-1], 8 * t.size)
    crest = int(np.argmax(spline(fine)))
    peak = int(np.argmax(eta))
    return GaugeComparison(
        reference.name,
        reference.x,
        float(np.sqrt(np.mean((spline(t) - eta) ** 2)) / size),
        misfit / float(size),
        gain,
        shift,
        float(np.corrcoef(spline(t), eta)[0, 1]),
        float(spline(fine[crest])),
        float(fine[crest]),
        float(eta[peak]),
        float(t[peak]),
    )


def _fit(
    spline: CubicSpline, computed: GaugeSeries, t: NDArray[np.float64], eta: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Return shift [s], gain and rms misfit [m] of the best gain * computed(t - shift)."""

    def misfit(shift: float) -> tuple[float, float]:
        moved = spline(np.clip(t - shift, computed.t[0], computed.t[-1]))
        gain = float(moved @ eta / max(moved @ moved, np.finfo(float).tiny))
        return float(np.sqrt(np.mean((gain * moved - eta) ** 2))), gain

    scan = np.linspace(-LARGEST_SHIFT, LARGEST_SHIFT, 201)
    best = scan[int(np.argmin([misfit(shift)[0] for shift in scan]))]
    step = scan[1] - scan[0]
    shift = float(
        minimize_scalar(
            lambda s: misfit(s)[0], bounds=(best - step, best + step), method="bounded", options={"xatol": 1e-6}
        ).x
    )
    value, gain = misfit(shift)
    return shift, gain, value


def write_comparison(path: Path, comparisons: Sequence[GaugeComparison]) -> None:
    """Write ``compare.csv``, one row a gauge."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(COLUMNS)
        for comparison in comparisons:
            writer.writerow(f"{v:.6g}" if isinstance(v, float) else v for v in astuple(comparison))


def comparison_table(comparisons: Sequence[GaugeComparison]) -> Table:
    """Return the comparison as a table for the terminal."""
    table = Table("gauge", "x [m]", "nrms", "fitted", "gain", "shift [s]", "correlation", "crest [m]", "reference [m]")
    for one in comparisons:
        numbers = (one.nrms, one.nrms_fitted, one.gain, one.shift, one.correlation)
        crests = (f"{one.crest_computed:.4f}", f"{one.crest_reference:.4f}")
        table.add_row(one.gauge, f"{one.x:g}", *(f"{number:.3f}" for number in numbers), *crests)
    return table
