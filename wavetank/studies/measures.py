"""Error measures of a run, against an exact solution or against another run.

    surface error   rms(eta - eta_ref) over x and all snapshots, over the amplitude (exact) or over rms(eta_ref)
    gauge error     rms(eta - eta_ref) over time and all gauges in common, over rms(eta_ref), or below a frequency alone
    phase error     angle by which the wave is ahead of the exact one in the last snapshot
    crest error     relative error of the crest's height in the last snapshot

Snapshots are interpolated in x, and those of a reference run also in t, by splines of degree 5. A basin has the gauge
error only.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import minimize_scalar

from wavetank.analysis.compare import matched
from wavetank.case import Scene
from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import Surface
from wavetank.studies.exact import ExactSolution, exact_solution
from wavetank.waves.wave import Array

SURFACE, GAUGES, PHASE, CREST = "surface error [-]", "gauge error [-]", "phase error [rad]", "crest error [-]"
FINER = 4  # places at which snapshots are compared, by their points
Errors = dict[str, float]


class Reference(Protocol):
    """What runs are judged by."""

    def errors(self, run: RunDirectory) -> Errors:
        """Return the errors of a finished run by the names above."""


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
        found = minimize_scalar(lambda x: -self.shape(x)[0], bounds=bounds, method="bounded", options={"xatol": 1e-8})
        return max(-float(found.fun), float(self.eta.max()))


def _is_basin(run: RunDirectory) -> bool:
    """Return whether a run has two horizontal dimensions."""
    return bool(run.manifest["scene"]["tank"]["type"] == "basin")


def _period(run: RunDirectory) -> float | None:
    """Return a ring's length [m], None for other tanks."""
    tank = run.manifest["scene"]["tank"]
    return float(tank["length"]) if tank["type"] == "ring" else None


def snapshots(surface: Surface, *, period: float | None) -> Iterator[Snapshot]:
    """Yield the snapshots at equally spaced places; in a ring of a period [m], all around."""
    for t, x, eta, psi in zip(surface.t, surface.x, surface.eta, surface.psi, strict=True):
        shape = _interpolant(x, np.column_stack([eta, psi]), period=period)
        begin, length = x[0], x[-1] - x[0] if period is None else period
        places = begin + length * (np.arange(FINER * x.size) + 0.5) / (FINER * x.size)
        values = shape(places)
        yield Snapshot(float(t), places, values[:, 0], values[:, 1], shape)


class ExactReference:
    """Judges by the exact solution of a scene; raises ``InputError`` if none is known."""

    def __init__(self, scene: Scene):
        self._solution: ExactSolution = exact_solution(scene)

    def errors(self, run: RunDirectory) -> Errors:
        """Return surface, phase and crest error; a phase is followed from snapshot to snapshot, beyond pi, too."""
        exact, squares, ahead = self._solution, [], []
        for now in snapshots(run.snapshots(), period=_period(run)):
            squares.append(np.mean((now.eta - exact.wave.elevation(now.x, now.t)) ** 2))
            carrier = exact.carrier(now.x, now.eta, now.psi)
            ahead.append(-np.angle(carrier / exact.exact_carrier(now.t)))
        return {
            SURFACE: float(np.sqrt(np.mean(squares))) / exact.amplitude,
            PHASE: float(np.unwrap(ahead)[-1]),
            CREST: exact.crest_error(now.highest(), carrier),
        }


class RunReference:
    """Judges by another run of the same tank, gauges by their waves below a frequency [Hz], if one is given.

    Raises ``InputError`` if that has no snapshots; of a basin, if it has no gauges.
    """

    def __init__(self, path: Path, *, below: float | None = None):
        self._run, self._below = RunDirectory(path), below
        if _is_basin(self._run):
            self._run.gauge_series()
            return
        surface = self._run.snapshots()
        if surface.t.size < 2:
            raise InputError(f"{path}: {surface.t.size} snapshots of the surface; a reference needs at least 2.")
        self._end = float(surface.t[-1])
        self._in_time = _interpolant(surface.t, np.stack([surface.x, surface.eta], axis=-1))

    def check(self, scene: Scene) -> None:
        """Raise ``InputError`` if a scene's tank is another one."""
        if self._run.manifest["scene"]["tank"] != scene.model_dump(mode="json")["tank"]:
            raise InputError(f"reference {self._run.path}: is a run in another tank; the tank must be the case's.")

    def errors(self, run: RunDirectory) -> Errors:
        """Return the surface error and, where gauges are in common, the gauge error, over the times both have."""
        errors = {} if _is_basin(run) else {SURFACE: self._surface_error(run)}
        with suppress(InputError):  # no gauge in common, then
            name = GAUGES if self._below is None else f"gauge error below {self._below:g} Hz [-]"
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
        for one, other in matched(run.gauge_series(), self._run.gauge_series()):
            there = one.t <= other.t[-1]
            both = np.array([one.eta[there], _interpolant(other.t, other.eta)(one.t[there])])
            eta, reference = both if self._below is None else _below(self._below, one.t[there], both)
            pairs.append((eta, reference))
        return pairs


def _below(frequency: float, t: Array, records: Array) -> Array:
    """Return what records, shape (M, N), have below a frequency [Hz]."""
    spectra = np.fft.rfft(records)
    spectra[:, np.fft.rfftfreq(t.size, (t[-1] - t[0]) / (t.size - 1)) >= frequency] = 0.0
    return np.fft.irfft(spectra, t.size)
