"""Scalar results of a run, by name: of the run, at a gauge, or on a wall."""

from collections.abc import Callable
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from xarray import DataArray, Dataset

from wavetank.analysis.record import WaveRecord, read_record
from wavetank.analysis.results import reflection_coefficient
from wavetank.analysis.signals import NUMBER, chosen, groupiness, harmonics, sea_state, spectrum, waving
from wavetank.analysis.statistics import height_statistics, zero_crossing_waves
from wavetank.errors import InputError
from wavetank.output.directory import SURFACE, RunDirectory


class RunResults:
    """Results of a run from a time [s] on, each computed when it is first needed."""

    def __init__(self, run: RunDirectory, *, start: float | None = None):
        self._run, self._start = run, start
        self.state = cache(lambda gauge: sea_state(spectrum(self.gauge(gauge))))
        self.statistics = cache(lambda gauge: height_statistics(zero_crossing_waves(self.gauge(gauge))))

    @cached_property
    def record(self) -> WaveRecord:
        """The gauges' record."""
        return read_record(str(self._run.path), start=self._start)

    @cached_property
    def surface(self) -> Dataset:
        """The snapshots of a slice or ring; raises ``InputError`` where none is late enough."""
        return self._late(self._run.snapshots(), "snapshot of the surface")

    def _late(self, data: Dataset, kind: str) -> Dataset:
        """Return records from the start on; raises ``InputError`` where there are none."""
        late = data.sel(time=slice(self._start, None))
        if not late.time.size:
            start = -np.inf if self._start is None else self._start
            raise InputError(f"{self._run.path}: has no {kind} from {start:g} s on.")
        return late

    @property
    def highest(self) -> tuple[float, float, float]:
        """The highest elevation of all snapshots [m], its place x [m] and time [s]; of a basin, of all steps."""
        crest = self._run.manifest.get("highest_crest")
        if crest and self._start is None and not (self._run.path / SURFACE).exists():
            return crest["height"], crest["x"], crest["t"]
        top = self.surface.isel(self.surface.elevation.argmax(...))
        return float(top.elevation), float(top.x), float(top.time)

    def gauge(self, name: str) -> DataArray:
        """Return the record at a gauge."""
        return waving(chosen(self.record.eta, [name])[0])

    def largest_change(self, name: str, wall: str) -> float:
        """Return the largest change of a force or moment on a wall since the start [N or N m, a metre]."""
        loads = self._run.loads
        if wall not in loads.wall.values:
            walls = ", ".join(map(str, loads.wall.values))
            raise InputError(f"{self._run.path}: has no load {wall!r}; it has {walls}.")
        components = loads.sel(wall=wall)[[key for key in loads if str(key).startswith(name)]]
        change = self._late(components - components.isel(time=0), "row of loads").to_array()
        return float(np.sqrt((change**2).sum("variable")).max())

    def amplitude(self, gauge: str, harmonic: int) -> float:
        """Return the amplitude [m] of a harmonic of the waves at a gauge."""
        result = harmonics(self.gauge(gauge), self.record.frequency, number=harmonic)
        return float(np.abs(result.component[harmonic - 1]))


class OfRun(NamedTuple):
    """A scalar result of a run, and its unit."""

    unit: str
    of: Callable[[RunResults], float]


class AtGauge(NamedTuple):
    """A scalar result at a gauge, or on a wall, and its unit."""

    unit: str
    of: Callable[[RunResults, str], float]


def _of_sea(name: str) -> Callable[[RunResults, str], float]:
    return lambda results, gauge: float(results.state(gauge)[name])


def _of_waves(name: str) -> Callable[[RunResults, str], float]:
    return lambda results, gauge: results.statistics(gauge)[name]


def _of_harmonic(n: int) -> Callable[[RunResults, str], float]:
    return lambda results, gauge: results.amplitude(gauge, n)


OF_RUN = {
    "crest": OfRun("m", lambda results: results.highest[0]),
    "crest_x": OfRun("m", lambda results: results.highest[1]),
    "crest_t": OfRun("s", lambda results: results.highest[2]),
    "trough": OfRun("m", lambda results: float(results.surface.elevation.min())),
    "run_up": OfRun("m", lambda results: float(results.surface.elevation[:, -1].max())),
    "reflection": OfRun("-", lambda results: reflection_coefficient(results.record)),
}
AT_WALL = {
    "force": AtGauge("N, of a slice N/m", lambda results, wall: results.largest_change("force", wall)),
    "moment": AtGauge("N m, of a slice N m/m", lambda results, wall: results.largest_change("moment", wall)),
}
AT_GAUGE = {
    "crest": AtGauge("m", lambda results, gauge: float(results.gauge(gauge).max())),
    "trough": AtGauge("m", lambda results, gauge: float(results.gauge(gauge).min())),
    "groupiness": AtGauge("-", lambda results, gauge: float(groupiness(results.gauge(gauge)))),
    **{name: AtGauge("m" if name == "hm0" else "s", _of_sea(name)) for name in ("hm0", "tp", "tm01", "tm02", "tm_10")},
    **{name: AtGauge("m", _of_waves(name)) for name in ("h_mean", "h_1_3", "h_1_10", "h_max")},
    **{name: AtGauge("s", _of_waves(name)) for name in ("t_mean", "t_1_3")},
    **{f"a{n}": AtGauge("m", _of_harmonic(n)) for n in range(1, NUMBER + 1)},
}
