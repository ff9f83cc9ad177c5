"""Scalar results of a run, by name: of the run, at a gauge, or on a wall."""

from collections.abc import Callable
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from xarray import DataArray, Dataset

from wavetank.analysis.record import Record, read_record
from wavetank.analysis.results import reflection_coefficient
from wavetank.analysis.signals import NUMBER, chosen, groupiness, harmonics, sea_state, spectrum, waving
from wavetank.analysis.statistics import height_statistics, zero_crossing_waves
from wavetank.errors import InputError
from wavetank.output.directory import SURFACE, RunDirectory


class Findings:
    """What is found in a run from a time [s] on, each when it is first asked for."""

    def __init__(self, run: RunDirectory, *, start: float | None = None):
        self._run, self._start = run, start
        self.state, self.statistics = cache(self._state), cache(self._statistics)

    @cached_property
    def record(self) -> Record:
        """The gauges' record."""
        return read_record(str(self._run.path), start=self._start)

    @cached_property
    def surface(self) -> Dataset:
        """The snapshots of a slice or ring; raises ``InputError`` where none is late enough."""
        surface = self._run.snapshots().sel(time=slice(self._start, None))
        if not surface.time.size:
            start = -np.inf if self._start is None else self._start
            raise InputError(f"{self._run.path}: has no snapshot of the surface from {start:g} s on.")
        return surface

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
        """Return how far a force or moment on a wall is from that at the start at the most [N or N m, a metre]."""
        loads = self._run.loads
        if wall not in loads.wall.values:
            others = ", ".join(map(str, loads.wall.values))
            raise InputError(f"{self._run.path}: has no load {wall!r}; it has {others}.")
        there = loads.sel(wall=wall)
        change = (there - there.isel(time=0))[[key for key in there if str(key).startswith(name)]].to_array()
        late = loads.time.values >= (-np.inf if self._start is None else self._start)
        if not late.any():
            raise InputError(f"{self._run.path}: has no row of loads from {self._start:g} s on.")
        return float(np.sqrt((change.values**2).sum(axis=0))[late].max())

    def _state(self, gauge: str) -> Dataset:
        return sea_state(spectrum(self.gauge(gauge)))

    def _statistics(self, gauge: str) -> dict[str, float]:
        return height_statistics(zero_crossing_waves(self.gauge(gauge)))

    def amplitude(self, gauge: str, harmonic: int) -> float:
        """Return the amplitude [m] of a harmonic of the waves at a gauge."""
        result = harmonics(self.gauge(gauge), self.record.frequency, number=harmonic)
        return float(np.abs(result.component[harmonic - 1]))


class OfRun(NamedTuple):
    """A number of a run as a whole, and its unit."""

    unit: str
    of: Callable[[Findings], float]


class AtGauge(NamedTuple):
    """A number of the record at a gauge, or on a wall, and its unit."""

    unit: str
    of: Callable[[Findings, str], float]


def _of_sea(name: str) -> Callable[[Findings, str], float]:
    return lambda result, gauge: float(result.state(gauge)[name])


def _of_waves(name: str) -> Callable[[Findings, str], float]:
    return lambda result, gauge: result.statistics(gauge)[name]


def _of_harmonic(n: int) -> Callable[[Findings, str], float]:
    return lambda result, gauge: result.amplitude(gauge, n)


OF_RUN = {
    "crest": OfRun("m", lambda found: found.highest[0]),
    "crest_x": OfRun("m", lambda found: found.highest[1]),
    "crest_t": OfRun("s", lambda found: found.highest[2]),
    "trough": OfRun("m", lambda found: float(found.surface.elevation.min())),
    "run_up": OfRun("m", lambda found: float(found.surface.elevation[:, -1].max())),
    "reflection": OfRun("-", lambda found: reflection_coefficient(found.record)),
}
AT_WALL = {
    "force": AtGauge("N, of a slice N/m", lambda found, wall: found.largest_change("force", wall)),
    "moment": AtGauge("N m, of a slice N m/m", lambda found, wall: found.largest_change("moment", wall)),
}
AT_GAUGE = {
    "crest": AtGauge("m", lambda found, gauge: float(found.gauge(gauge).max())),
    "trough": AtGauge("m", lambda found, gauge: float(found.gauge(gauge).min())),
    "groupiness": AtGauge("-", lambda found, gauge: float(groupiness(found.gauge(gauge)))),
    **{name: AtGauge("m" if name == "hm0" else "s", _of_sea(name)) for name in ("hm0", "tp", "tm01", "tm02", "tm_10")},
    **{name: AtGauge("m", _of_waves(name)) for name in ("h_mean", "h_1_3", "h_1_10", "h_max")},
    **{name: AtGauge("s", _of_waves(name)) for name in ("t_mean", "t_1_3")},
    **{f"a{n}": AtGauge("m", _of_harmonic(n)) for n in range(1, NUMBER + 1)},
}
