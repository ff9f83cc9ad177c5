"""Measures of a run: errors against an exact solution or another run, and responses of the water.

    surface error   rms(eta - eta_ref) over x and all snapshots, over the amplitude (exact) or over rms(eta_ref)
    gauge error     rms(eta - eta_ref) over time and all gauges in common, over rms(eta_ref), or below a frequency alone
    phase error     angle by which the wave is ahead of the exact one in the last snapshot
    crest error     relative error of the crest's height in the last snapshot

Snapshots are interpolated in x, and those of a reference run also in t, by splines of degree 5. A basin has the gauge
error only. Exact solutions are waves of permanent form and linear standing waves; the phase of a snapshot is that of a
complex amplitude C exp(-i omega t).
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import minimize_scalar
from xarray import Dataset

from wavetank.analysis.compare import matched
from wavetank.analysis.quantities import AT_GAUGE, AT_WALL, OF_RUN, RunResults
from wavetank.case import Case, LinearWater, StandingWave, StreamFunctionWave
from wavetank.errors import InputError, choice
from wavetank.output.directory import RunDirectory
from wavetank.values.formula import CONSTANTS, FUNCTIONS, Formula
from wavetank.waves.airy import Array, angular_frequency

LINEAR = 1e-4  # k a coth^3(k d) up to which a wave counts as linear: about its second harmonic, relative


class ExactSolution(NamedTuple):
    """An exact wave: eta(x, t), its amplitude [m], and the complex amplitude of eta and psi at x with its frequency.

    A wave of permanent form has a crest [m]; a standing wave's comes and goes, so that its error is the carrier's.
    """

    elevation: Callable[[Array, float], Array]
    amplitude: float
    carrier: Callable[[Array, Array, Array], complex]
    frequency: float  # rad/s
    crest: float | None = None


def exact_solution(scene: Case) -> ExactSolution:
    """Return the exact solution of a scene; raises ``InputError`` if there is none."""
    tank, initial = scene.tank, scene.initial
    for paddle in scene.paddles:
        what = f"{paddle.key}.type = {paddle.wall.type!r}"
        raise InputError(f"reference exact: {what} received; the walls must be fixed.")
    if isinstance(initial, StreamFunctionWave) and not isinstance(scene.water, LinearWater):
        wave, k = initial.wave(tank), 2 * np.pi * initial.waves / tank.length
        crest, trough = wave.elevation([0.0, np.pi / k])

        def first_harmonic(x: Array, eta: Array, psi: Array) -> complex:
            return complex(2 * np.mean(eta * np.exp(-1j * k * x)))

        return ExactSolution(wave.elevation, float(crest - trough) / 2, first_harmonic, k * wave.speed, float(crest))
    if not isinstance(initial, StandingWave):
        allowed = "standing-wave, low or in linear water, and stream-function in nonlinear water"
        raise InputError(f"reference exact: initial.type = {initial.type!r} received; exact are {allowed}.")
    k = np.pi * initial.mode / tank.length
    highest = LINEAR / k * np.tanh(k * tank.depth) ** 3
    if initial.wave_amplitude > highest and not isinstance(scene.water, LinearWater):
        raise InputError(
            f"reference exact: initial.wave_amplitude = {initial.wave_amplitude:g} received; it must be at most "
            f"{highest:.2g} m, up to which a standing wave is linear, or water.type must be 'linear'."
        )
    amplitude, omega = initial.wave_amplitude, float(angular_frequency(k, tank.depth, tank.gravity))

    def elevation(x: Array, t: float) -> Array:
        return np.asarray(amplitude * np.cos(k * x) * np.cos(omega * t))

    def carrier(x: Array, eta: Array, psi: Array) -> complex:
        return complex(2 * np.mean((eta + 1j * omega / tank.gravity * psi) * np.cos(k * x)))

    return ExactSolution(elevation, amplitude, carrier, omega)


SURFACE_ERROR, GAUGE_ERROR = "surface error [-]", "gauge error [-]"
PHASE_ERROR, CREST_ERROR = "phase error [rad]", "crest error [-]"
FINER = 4  # places at which snapshots are compared, by their points
Errors = dict[str, float]


def _interpolant(at: Array, values: Array, *, period: float | None = None) -> BSpline:
    """Return the spline of degree 5, or less through few points, of values of shape (N, ...)."""
    if period is not None:
        at, values = np.append(at, at[0] + period), np.concatenate([values, values[:1]])
    degree = max(k for k in (1, 3, 5) if k < at.size)
    return make_interp_spline(at, values, k=degree, bc_type=None if period is None else "periodic")


def _relative(pairs: Sequence[tuple[Array, Array]]) -> float:
    """Return the root mean square of the differences of pairs (eta, eta_ref), over that of eta_ref."""
    error = np.mean([np.mean((eta - reference) ** 2) for eta, reference in pairs])
    size = np.mean([np.mean(reference**2) for _, reference in pairs])
    return float(np.sqrt(error / max(size, np.finfo(float).tiny)))


class Snapshot(NamedTuple):
    """The surface at a time [s], at midpoints x [m] of equal parts: eta [m] and psi [m²/s]; and eta(x) as a spline."""

    t: float
    x: Array
    eta: Array
    psi: Array
    shape: BSpline

    def highest(self) -> float:
        """Return the highest elevation [m]."""
        top, part = self.x[np.argmax(self.eta)], self.x[1] - self.x[0]
        bounds = (max(self.x[0], top - part), min(self.x[-1], top + part))
        optimum = minimize_scalar(lambda x: -self.shape(x)[0], bounds=bounds, method="bounded", options={"xatol": 1e-8})
        return max(-float(optimum.fun), float(self.eta.max()))


def _is_basin(run: RunDirectory) -> bool:
    """Return whether a run has two horizontal dimensions."""
    return bool(run.manifest["scene"]["tank"]["type"] == "basin")


def _period(run: RunDirectory) -> float | None:
    """Return a ring's length [m], None for other tanks."""
    tank = run.manifest["scene"]["tank"]
    return float(tank["length"]) if tank["type"] == "ring" else None


def snapshots(surface: Dataset, *, period: float | None) -> Iterator[Snapshot]:
    """Yield the snapshots at equally spaced places; in a ring of a period [m], all around."""
    each = (surface[name].values for name in ("time", "x", "elevation", "surface_potential"))
    for t, x, eta, psi in zip(*each, strict=True):
        shape = _interpolant(x, np.column_stack([eta, psi]), period=period)
        begin, length = x[0], x[-1] - x[0] if period is None else period
        places = begin + length * (np.arange(FINER * x.size) + 0.5) / (FINER * x.size)
        values = shape(places)
        yield Snapshot(float(t), places, values[:, 0], values[:, 1], shape)


class ExactReference:
    """Errors against the exact solution of a scene; raises ``InputError`` if there is none."""

    def __init__(self, scene: Case):
        self._solution = exact_solution(scene)

    def errors(self, run: RunDirectory) -> Errors:
        """Return surface, phase and crest error; a phase is followed from snapshot to snapshot, beyond pi, too."""
        exact, squares, ahead = self._solution, [], []
        for now in snapshots(run.snapshots(), period=_period(run)):
            squares.append(np.mean((now.eta - exact.elevation(now.x, now.t)) ** 2))
            carrier = exact.carrier(now.x, now.eta, now.psi)
            ahead.append(-np.angle(carrier * np.exp(1j * exact.frequency * now.t)))
        height, expected = (abs(carrier), exact.amplitude) if exact.crest is None else (now.highest(), exact.crest)
        return {
            SURFACE_ERROR: float(np.sqrt(np.mean(squares))) / exact.amplitude,
            PHASE_ERROR: float(np.unwrap(ahead)[-1]),
            CREST_ERROR: height / expected - 1.0,
        }


class RunReference:
    """Errors against another run of the same tank, of gauges below a frequency [Hz] if one is given.

    Raises ``InputError`` if that has no snapshots; of a basin, if it has no gauges.
    """

    def __init__(self, path: Path, *, below: float | None = None):
        self._run, self._below = RunDirectory(path), below
        if _is_basin(self._run):
            _ = self._run.gauges
            return
        surface = self._run.snapshots()
        if surface.time.size < 2:
            raise InputError(f"{path}: {surface.time.size} snapshots of the surface; a reference needs at least 2.")
        self._end = float(surface.time[-1])
        self._in_time = _interpolant(surface.time.values, np.stack([surface.x, surface.elevation], axis=-1))

    def check(self, scene: Case) -> None:
        """Raise ``InputError`` if a scene's tank is another one."""
        if self._run.manifest["scene"]["tank"] != scene.model_dump(mode="json")["tank"]:
            raise InputError(f"reference {self._run.path}: is a run in another tank; the tank must be the case's.")

    def errors(self, run: RunDirectory) -> Errors:
        """Return the surface error and, where gauges are in common, the gauge error, over the times both have."""
        errors = {} if _is_basin(run) else {SURFACE_ERROR: self._surface_error(run)}
        with suppress(InputError):  # no gauge in common, then
            name = GAUGE_ERROR if self._below is None else f"gauge error below {self._below:g} Hz [-]"
            errors[name] = _relative(self._gauges(run))
        return errors

    def _surface_error(self, run: RunDirectory) -> float:
        period, pairs = _period(run), []
        for now in snapshots(run.snapshots(), period=period):
            if now.t <= self._end * (1 + 1e-9):
                x, eta = self._in_time(min(now.t, self._end)).T
                pairs.append((now.eta, _interpolant(x, eta, period=period)(now.x)))
        return _relative(pairs)

    def _gauges(self, run: RunDirectory) -> list[tuple[Array, Array]]:
        """Return (eta, eta_ref) of each gauge in common."""
        pairs = []
        for one, other in matched(run.gauges, self._run.gauges):
            both = one.sel(time=slice(None, other.time[-1]))
            t = both.time.values
            values = np.array([both.values, _interpolant(other.time.values, other.values)(t)])
            eta, reference = values if self._below is None else _below(self._below, t, values)
            pairs.append((eta, reference))
        return pairs


Reference = ExactReference | RunReference


def _below(frequency: float, t: Array, records: Array) -> Array:
    """Return what records, shape (M, N), have below a frequency [Hz]."""
    spectra = np.fft.rfft(records)
    spectra[:, np.fft.rfftfreq(t.size, (t[-1] - t[0]) / (t.size - 1)) >= frequency] = 0.0
    return np.fft.irfft(spectra, t.size)


CREST, CREST_PLACE, CREST_TIME = "highest crest [m]", "crest's place x [m]", "crest's time [s]"
TROUGH = "deepest trough [m]"
USUAL = {CREST: "crest", CREST_PLACE: "crest_x", CREST_TIME: "crest_t", TROUGH: "trough"}
Responses = dict[str, float]
AT = AT_GAUGE | AT_WALL  # of quantities that belong to something

NAMED = re.compile(r"\s*([^=<>!@]+?)\s*=(?!=)(.+)")
QUANTITY = re.compile(r"(?<![\w.@'])([a-zA-Z][a-zA-Z0-9_]*)(?:@(?:'([^']+)'|([\w.]+)))?(?![\w(])")


@dataclass(frozen=True)
class Quantity:
    """A number of a run: what is meant by a name, and, where it is one at a gauge or on a wall, by that's."""

    name: str
    gauge: str | None = None

    @property
    def unit(self) -> str:
        """Its unit."""
        return (OF_RUN if self.gauge is None else AT)[self.name].unit

    def of(self, results: RunResults) -> float:
        """Return its value; raises ``InputError`` if the run does not contain it."""
        return OF_RUN[self.name].of(results) if self.gauge is None else AT[self.name].of(results, self.gauge)


class Response:
    """A column of a study: ``[NAME=]EXPRESSION``, an expression of quantities such as ``hm0@5 / hm0@1``.

    A quantity is a name, or ``NAME@GAUGE``; a gauge's name that is not letters, digits, points and _ is quoted. Raises
    ``InputError`` for what cannot be understood.
    """

    def __init__(self, text: str, label: str = ""):
        named = NAMED.fullmatch(text)
        expression = (named[2] if named else text).strip()
        self.quantities: list[Quantity] = []
        formula = QUANTITY.sub(self._variable, expression)
        if not self.quantities:
            raise InputError(f"response {text!r} received; {_allowed()}")
        self._names = [f"quantity{n}" for n in range(len(self.quantities))]
        self._formula = Formula(formula, variables=self._names)
        alone = formula == self._names[0]
        self.label = label or (named[1] if named else expression) + (f" [{self.quantities[0].unit}]" if alone else "")

    def _variable(self, match: re.Match[str]) -> str:
        name, gauge = match[1], match[2] or match[3]
        if gauge is None and (name in FUNCTIONS or name in CONSTANTS):
            return match[0]
        allowed = OF_RUN if gauge is None else AT
        if name not in allowed:
            why = choice(name, sorted(allowed))
            for kind, where in ((AT_GAUGE, "gauge"), (AT_WALL, "load")):
                why = f"; it is one of a {where}, {name}@{where.upper()}" if name in kind else why
            raise InputError(f"response {match.string.strip()!r}: {match[0]!r} is no quantity{why}.")
        self.quantities.append(Quantity(name, gauge))
        return f"quantity{len(self.quantities) - 1}"

    def check(self, scene: Case) -> None:
        """Raise ``InputError`` for a gauge or load that a scene does not have."""
        gauges, loads = [gauge.name for gauge in scene.all_gauges], [load.called for load in scene.loads]
        for quantity in self.quantities:
            kind, have = ("load", loads) if quantity.name in AT_WALL else ("gauge", gauges)
            if quantity.gauge is not None and quantity.gauge not in have:
                existing = ", ".join(have) or "none"
                raise InputError(f"response {self.label}: there is no {kind} {quantity.gauge!r}; there are {existing}.")

    def of(self, results: RunResults) -> float:
        """Return the response of a run; raises ``InputError`` if the run does not contain it."""
        return float(self._formula(*(np.float64(quantity.of(results)) for quantity in self.quantities)))


def _allowed() -> str:
    at = f"with @GAUGE {', '.join(AT_GAUGE)}, with @LOAD {', '.join(AT_WALL)}"
    return f"allowed are formulae of {', '.join(OF_RUN)}, and {at}."


def usual_responses(scene: Case) -> list[Response]:
    """Return the highest elevation of all snapshots, where and when it stood, and but for a basin the lowest."""
    labels = [label for label in USUAL if label != TROUGH or scene.tank.type != "basin"]
    return [Response(USUAL[label], label) for label in labels]


def responses(
    run: RunDirectory, requested: Sequence[Response], *, start: float | None = None
) -> tuple[Responses, list[str]]:
    """Return a run's responses from a time [s] on by their labels, and why some are not a number, a sentence each."""
    results, values, causes = RunResults(run, start=start), Responses(), list[str]()
    for one in requested:
        try:
            values[one.label] = one.of(results)
        except InputError as error:
            values[one.label] = np.nan
            causes.append(f"{one.label}: {error}")
    return values, causes


def responded(rows: Iterable[Responses]) -> list[str]:
    """Return the responses that any run has."""
    return list(dict.fromkeys(name for one in rows for name, value in one.items() if not np.isnan(value)))
