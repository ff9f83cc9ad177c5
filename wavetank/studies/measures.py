"""Errors of a run against an exact solution or another run.

    surface error   rms(eta - eta_ref) over x and all snapshots, over the amplitude (exact) or over rms(eta_ref)
    gauge error     rms(eta - eta_ref) over time and all common gauges, over rms(eta_ref); also below a frequency only
    phase error     angle by which the wave leads the exact one in the last snapshot
    crest error     relative error of the crest height in the last snapshot

Snapshots are interpolated in x, and those of a reference run also in t, by splines of degree 5. A basin has the gauge
error only. Exact solutions are waves of permanent form and linear standing waves; the phase of a snapshot is that of a
complex amplitude C exp(-i omega t).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.optimize import minimize_scalar

from wavetank.analysis.compare import matched
from wavetank.base.errors import InputError
from wavetank.case import Case, LinearWater, StandingWave, StreamFunctionWave
from wavetank.output.directory import RunDirectory
from wavetank.waves.airy import Array, angular_frequency

SURFACE_ERROR, GAUGE_ERROR = "surface error [-]", "gauge error [-]"
PHASE_ERROR, CREST_ERROR = "phase error [rad]", "crest error [-]"
MAX_LINEAR_HARMONIC = 1e-4  # k a coth^3(k d) up to which a wave is linear: about its relative second harmonic
POSITIONS_PER_POINT = 4  # compared positions per point of a snapshot

Reference = Callable[[RunDirectory], dict[str, float]]  # names of the errors of a run


# ---------------------------------------------------------------- snapshots
class Snapshot(NamedTuple):
    """The surface at a time [s]: eta [m] and psi [m²/s] at midpoints x [m] of equal parts, and eta(x) as a spline."""

    t: float
    x: Array
    eta: Array
    psi: Array
    shape: BSpline


def _ring_length(run: RunDirectory) -> float | None:
    """Return the length [m] of a ring, the period of its surface; None for other tanks."""
    tank = run.manifest["case"]["tank"]
    return float(tank["length"]) if tank["type"] == "ring" else None


def _snapshots(run: RunDirectory) -> Iterator[Snapshot]:
    """Yield the snapshots at equally spaced positions; in a ring along the circumference."""
    surface, period = run.snapshots(), _ring_length(run)
    each = (surface[name].values for name in ("time", "x", "elevation", "surface_potential"))
    for t, x, eta, psi in zip(*each, strict=True):
        shape = _spline(x, np.column_stack([eta, psi]), period=period)
        length = x[-1] - x[0] if period is None else period
        places = x[0] + length * (np.arange(POSITIONS_PER_POINT * x.size) + 0.5) / (POSITIONS_PER_POINT * x.size)
        eta, psi = shape(places).T
        yield Snapshot(float(t), places, eta, psi, shape)


def _spline(at: Array, values: Array, *, period: float | None = None) -> BSpline:
    """Return the spline of degree 5, lower for few points, of values of shape (N, ...)."""
    if period is not None:
        at, values = np.append(at, at[0] + period), np.concatenate([values, values[:1]])
    degree = max(k for k in (1, 3, 5) if k < at.size)
    return make_interp_spline(at, values, k=degree, bc_type=None if period is None else "periodic")


def _highest(one: Snapshot) -> float:
    """Return the highest elevation [m] of a snapshot."""
    top, part = one.x[np.argmax(one.eta)], one.x[1] - one.x[0]
    bounds = (max(one.x[0], top - part), min(one.x[-1], top + part))
    optimum = minimize_scalar(lambda x: -one.shape(x)[0], bounds=bounds, method="bounded", options={"xatol": 1e-8})
    return max(-float(optimum.fun), float(one.eta.max()))


# ---------------------------------------------------------------- exact solutions
class ExactSolution(NamedTuple):
    """An exact wave: eta(x, t), its amplitude [m], the complex amplitude of eta and psi at x, and its frequency.

    A wave of permanent form has a crest [m]; that of a standing wave varies, so that its error is the amplitude's.
    """

    elevation: Callable[[Array, float], Array]
    amplitude: float
    carrier: Callable[[Array, Array, Array], complex]
    frequency: float  # rad/s
    crest: float | None = None


def exact_solution(case: Case) -> ExactSolution:
    """Return the exact solution of a case; raises ``InputError`` if there is none."""
    tank, initial = case.tank, case.initial
    for paddle in case.paddles:
        what = f"{paddle.key}.type = {paddle.wall.type!r}"
        raise InputError(f"reference exact: {what} received; the walls must be fixed.")
    if isinstance(initial, StreamFunctionWave) and not isinstance(case.water, LinearWater):
        wave, k = initial.wave(tank), 2 * np.pi * initial.waves / tank.length
        crest, trough = wave.elevation([0.0, np.pi / k])

        def first_harmonic(x: Array, eta: Array, psi: Array) -> complex:
            return complex(2 * np.mean(eta * np.exp(-1j * k * x)))

        return ExactSolution(wave.elevation, float(crest - trough) / 2, first_harmonic, k * wave.speed, float(crest))
    if not isinstance(initial, StandingWave):
        allowed = "standing-wave, low or in linear water, and stream-function in nonlinear water"
        raise InputError(f"reference exact: initial.type = {initial.type!r} received; exact are {allowed}.")
    k = np.pi * initial.mode / tank.length
    highest = MAX_LINEAR_HARMONIC / k * np.tanh(k * tank.depth) ** 3
    if initial.wave_amplitude > highest and not isinstance(case.water, LinearWater):
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


def exact_reference(case: Case) -> Reference:
    """Return surface, phase and crest error against the exact solution; raise ``InputError`` if the case has none.

    The phase is continuous over the snapshots and may exceed pi.
    """
    exact = exact_solution(case)

    def errors(run: RunDirectory) -> dict[str, float]:
        squares, ahead = [], []
        for now in _snapshots(run):
            squares.append(np.mean((now.eta - exact.elevation(now.x, now.t)) ** 2))
            carrier = exact.carrier(now.x, now.eta, now.psi)
            ahead.append(-np.angle(carrier * np.exp(1j * exact.frequency * now.t)))
        height, expected = (abs(carrier), exact.amplitude) if exact.crest is None else (_highest(now), exact.crest)
        return {
            SURFACE_ERROR: float(np.sqrt(np.mean(squares))) / exact.amplitude,
            PHASE_ERROR: float(np.unwrap(ahead)[-1]),
            CREST_ERROR: height / expected - 1.0,
        }

    return errors


# ---------------------------------------------------------------- another run
def run_reference(reference: RunDirectory, *, below: float | None = None) -> Reference:
    """Return the surface error and, with common gauges, the gauge error against another run, at common times.

    The gauge error may be that below a frequency [Hz]. Raises ``InputError`` if the reference has no snapshots; in a
    basin, if it has no gauges.
    """
    basin = reference.manifest["case"]["tank"]["type"] == "basin"
    gauges, surface = reference.gauges, None if basin else reference.snapshots()
    if surface is not None:
        if surface.time.size < 2:
            number = surface.time.size
            raise InputError(f"{reference.path}: {number} snapshots of the surface; a reference needs at least 2.")
        in_time = _spline(surface.time.values, np.stack([surface.x, surface.elevation], axis=-1))

    def errors(run: RunDirectory) -> dict[str, float]:
        result, period = {}, _ring_length(run)
        if surface is not None:
            end, pairs = float(surface.time[-1]), []
            for now in _snapshots(run):
                if now.t <= end * (1 + 1e-9):
                    x, eta = in_time(min(now.t, end)).T
                    pairs.append((now.eta, _spline(x, eta, period=period)(now.x)))
            result[SURFACE_ERROR] = _relative_error(pairs)
        with suppress(InputError):  # no common gauge
            pairs = []
            for one, other in matched(run.gauges, gauges):
                both = one.sel(time=slice(None, other.time[-1]))
                t = both.time.values
                values = np.array([both.values, _spline(other.time.values, other.values)(t)])
                eta, expected = values if below is None else _low_pass(below, t, values)
                pairs.append((eta, expected))
            result[GAUGE_ERROR if below is None else f"gauge error below {below:g} Hz [-]"] = _relative_error(pairs)
        return result

    return errors


def _relative_error(pairs: Sequence[tuple[Array, Array]]) -> float:
    """Return the rms of the differences of pairs (eta, eta_ref), over that of eta_ref."""
    error = np.mean([np.mean((eta - reference) ** 2) for eta, reference in pairs])
    size = np.mean([np.mean(reference**2) for _, reference in pairs])
    return float(np.sqrt(error / max(size, np.finfo(float).tiny)))


def _low_pass(frequency: float, t: Array, records: Array) -> Array:
    """Return the part of records, shape (M, N), below a frequency [Hz]."""
    spectra = np.fft.rfft(records)
    spectra[:, np.fft.rfftfreq(t.size, (t[-1] - t[0]) / (t.size - 1)) >= frequency] = 0.0
    return np.fft.irfft(spectra, t.size)
