"""Responses: scalar results of a run, and formulae of these, such as ``hm0@5 / hm0@1``."""

import re
from collections.abc import Callable, Sequence
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from xarray import DataArray, Dataset

from wavetank.analysis.record import WaveRecord, read_record
from wavetank.analysis.results import reflection_coefficient
from wavetank.analysis.signals import MAX_HARMONICS, chosen, groupiness, harmonics, sea_state, spectrum, waving
from wavetank.analysis.statistics import height_statistics, zero_crossing_waves
from wavetank.base.errors import InputError, choice
from wavetank.base.formula import CONSTANTS, FUNCTIONS, Formula
from wavetank.case import Case
from wavetank.output.directory import SURFACE, RunDirectory

CREST, CREST_PLACE, CREST_TIME = "highest crest [m]", "crest's place x [m]", "crest's time [s]"
TROUGH = "deepest trough [m]"
DEFAULT_RESPONSES = {CREST: "crest", CREST_PLACE: "crest_x", CREST_TIME: "crest_t", TROUGH: "trough"}
NAMED_EXPRESSION = re.compile(r"\s*([^=<>!@]+?)\s*=(?!=)(.+)")
REFERENCE = re.compile(r"(?<![\w.@'])([a-zA-Z][a-zA-Z0-9_]*)(?:@(?:'([^']+)'|([\w.]+)))?(?![\w(])")


# ---------------------------------------------------------------- quantities
class RunResults:
    """Results of a run from a time [s] on, each computed at its first use."""

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
        """The snapshots of a slice or ring; raises ``InputError`` if none is after the start."""
        return self._late(self._run.snapshots(), "snapshot of the surface")

    def _late(self, data: Dataset, kind: str) -> Dataset:
        """Return records from the start on; raises ``InputError`` if there are none."""
        late = data.sel(time=slice(self._start, None))
        if not late.time.size:
            start = -np.inf if self._start is None else self._start
            raise InputError(f"{self._run.path}: has no {kind} from {start:g} s on.")
        return late

    @property
    def highest(self) -> dict[str, float]:
        """The ``height`` [m] of the highest elevation, its ``x`` [m] and ``t`` [s], of all snapshots.

        In a basin, whose snapshots are in other files, of all steps.
        """
        crest: dict[str, float] = self._run.manifest.get("highest_crest", {})
        if crest and self._start is None and not (self._run.path / SURFACE).exists():
            return crest
        top = self.surface.isel(self.surface.elevation.argmax(...))
        return {"height": float(top.elevation), "x": float(top.x), "t": float(top.time)}

    def gauge(self, name: str) -> DataArray:
        """Return the record at a gauge."""
        return waving(chosen(self.record.eta, [name])[0])

    def largest_change(self, name: str, wall: str) -> float:
        """Return the largest change of a force or moment on a wall since the start [N or N m, per metre]."""
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


class Quantity(NamedTuple):
    """A scalar result: its unit, and its value for the results of a run and the name of a gauge or load, if any."""

    unit: str
    of: Callable[[RunResults, str], float]


def _of_sea(name: str) -> Quantity:
    return Quantity("m" if name == "hm0" else "s", lambda results, gauge: float(results.state(gauge)[name]))


def _of_waves(name: str) -> Quantity:
    return Quantity("m" if name.startswith("h") else "s", lambda results, gauge: results.statistics(gauge)[name])


def _of_harmonic(n: int) -> Quantity:
    return Quantity("m", lambda results, gauge: results.amplitude(gauge, n))


QUANTITIES = {
    "crest": Quantity("m", lambda results, _: results.highest["height"]),
    "crest_x": Quantity("m", lambda results, _: results.highest["x"]),
    "crest_t": Quantity("s", lambda results, _: results.highest["t"]),
    "trough": Quantity("m", lambda results, _: float(results.surface.elevation.min())),
    "run_up": Quantity("m", lambda results, _: float(results.surface.elevation[:, -1].max())),
    "reflection": Quantity("-", lambda results, _: reflection_coefficient(results.record)),
    "crest@GAUGE": Quantity("m", lambda results, gauge: float(results.gauge(gauge).max())),
    "trough@GAUGE": Quantity("m", lambda results, gauge: float(results.gauge(gauge).min())),
    "groupiness@GAUGE": Quantity("-", lambda results, gauge: float(groupiness(results.gauge(gauge)))),
    **{f"{name}@GAUGE": _of_sea(name) for name in ("hm0", "tp", "tm01", "tm02", "tm_10")},
    **{f"{name}@GAUGE": _of_waves(name) for name in ("h_mean", "h_1_3", "h_1_10", "h_max", "t_mean", "t_1_3")},
    **{f"a{n}@GAUGE": _of_harmonic(n) for n in range(1, MAX_HARMONICS + 1)},
    "force@LOAD": Quantity("N, of a slice N/m", lambda results, wall: results.largest_change("force", wall)),
    "moment@LOAD": Quantity("N m, of a slice N m/m", lambda results, wall: results.largest_change("moment", wall)),
}


# ---------------------------------------------------------------- formulae
class Response(NamedTuple):
    """A column of a study: its label, a formula, and the quantities that are its variables.

    Quantities are keys of ``QUANTITIES``, each with the name of its gauge or load, if any.
    """

    label: str
    formula: Formula
    quantities: list[tuple[str, str]]

    def check(self, case: Case) -> None:
        """Raise ``InputError`` for a gauge or load that a case does not have."""
        names = {"GAUGE": [gauge.name for gauge in case.all_gauges], "LOAD": [load.called for load in case.loads]}
        for key, name in self.quantities:
            kind = key.partition("@")[2]
            if kind and name not in names[kind]:
                existing = ", ".join(names[kind]) or "none"
                raise InputError(f"response {self.label}: there is no {kind.lower()} {name!r}; there are {existing}.")

    def of(self, results: RunResults) -> float:
        """Return the response of a run; raises ``InputError`` if the run does not contain it."""
        return float(self.formula(*(np.float64(QUANTITIES[key].of(results, name)) for key, name in self.quantities)))


def parse_response(text: str, label: str = "") -> Response:
    """Return the response of ``[NAME=]EXPRESSION``, an expression of quantities such as ``hm0@5 / hm0@1``.

    A gauge name with other characters than letters, digits, points and _ is quoted. Raises ``InputError`` for other
    texts.
    """
    named = NAMED_EXPRESSION.fullmatch(text)
    expression = (named[2] if named else text).strip()
    quantities = list[tuple[str, str]]()

    def variable(match: re.Match[str]) -> str:
        name, place = match[1], match[2] or match[3] or ""
        if not place and (name in FUNCTIONS or name in CONSTANTS):
            return match[0]
        keys = [f"{name}@GAUGE", f"{name}@LOAD"] if place else [name]
        key = next((key for key in keys if key in QUANTITIES), None)
        if key is None:
            allowed = [key for key in QUANTITIES if key.partition("@")[0] == name]
            why = f"; it is {allowed[0]}" if allowed else choice(name, list(QUANTITIES))
            raise InputError(f"response {expression!r}: {match[0]!r} is no quantity{why}.")
        quantities.append((key, place))
        return f"quantity{len(quantities)}"

    formula = REFERENCE.sub(variable, expression)
    if not quantities:
        raise InputError(f"response {text!r} received; allowed are formulae of {', '.join(QUANTITIES)}.")
    unit = f" [{QUANTITIES[quantities[0][0]].unit}]" if formula == "quantity1" else ""
    variables = [f"quantity{n}" for n in range(1, len(quantities) + 1)]
    return Response(
        label or (named[1] if named else expression) + unit, Formula(formula, variables=variables), quantities
    )


def usual_responses(case: Case) -> list[Response]:
    """Return the highest elevation of all snapshots with its position and time and, except in a basin, the lowest."""
    labels = [label for label in DEFAULT_RESPONSES if label != TROUGH or case.tank.type != "basin"]
    return [parse_response(DEFAULT_RESPONSES[label], label) for label in labels]


def evaluate_responses(
    run: RunDirectory, requested: Sequence[Response], *, start: float | None = None
) -> tuple[dict[str, float], list[str]]:
    """Return the responses of a run from a time [s] on by labels, and the reasons for those that are not a number."""
    results, values, causes = RunResults(run, start=start), dict[str, float](), list[str]()
    for one in requested:
        try:
            values[one.label] = one.of(results)
        except InputError as error:
            values[one.label] = np.nan
            causes.append(f"{one.label}: {error}")
    return values, causes
