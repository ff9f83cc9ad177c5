"""The aims of a calibration: misfit between runs and the target of a case, and the next waves.

A setting is an array of numbers that determine the generated waves; the mean of two settings is a setting.

Calibration of a crest corrects amplitude, position and time of the waves until the highest crest is the target.
Unknowns and results are three numbers each: ln of the height, position over wave length, time over period. Broyden's
method starts from the Jacobian of waves that do not interact, the identity.

Calibration of a record corrects amplitude and phase of each component until the record of the tank, m(t), is the target
w(t). Linear theory predicts the record u(t) of the generated waves at the target's position. In bands of frequency the
transfer function of the tank is G = <M U*> / <U U*>, and the coherence is c = |<M U*>|² / (<M M*> <U U*>). The
correction is c / G times the difference W - M: bound harmonics, which the record contains, are not generated again by
the paddle. G is computed from the odd part of two runs with opposite phases, which excludes second harmonics and all
other even orders. If the target is a set of components, m is reduced to these.

The phases of steep waves change by several radians between paddle and record. Potential flow is reversible as long as
no wave breaks: the tank, with the reversed record w(T - t) as the motion of its paddle, has at the same distance the
reversed elevation that the paddle must generate. Its Fourier components are the first setting.

Sources: C. G. Broyden, "A class of methods for solving nonlinear simultaneous equations", Math. Comp. 19, 1965; J. R.
Chaplin, "On frequency-focusing unidirectional waves", Int. J. Offshore and Polar Eng. 6, 1996; S. Schmittner, S.
Kosleck, J. Hennig, "A phase-amplitude iteration scheme for the optimization of deterministic wave sequences", OMAE
2009; E. Buldakov, D. Stagonas, R. Simons, "Extreme wave groups in a wave flume: controlled generation and breaking
onset", Coastal Eng. 128, 2017 (runs with opposite phases).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.signal.windows import tukey
from xarray import DataArray, Dataset

from wavetank.analysis.compare import rms
from wavetank.base.case_model import CaseError, Problem, about
from wavetank.case import LinearWater
from wavetank.case.elevation_file import ElevationFile
from wavetank.case.initial import STEEPEST
from wavetank.case.model import Case
from wavetank.case.output import ComponentsTarget, CrestTarget, RecordTarget, Target
from wavetank.case.paddle import FocusedMotion, MadeWaves, SurfaceMotion
from wavetank.case.wall import PaddleWall
from wavetank.output.directory import RunDirectory
from wavetank.waves import airy
from wavetank.waves.airy import Array, wave_number
from wavetank.waves.measured import TargetElevation, target_elevation
from wavetank.waves.plane_waves import PlaneWaves, waves_along

Setting = NDArray[Any]


class CrestPosition(NamedTuple):
    """The maximum of a crest: height [m], position [m], time [s]."""

    height: float
    x: float
    t: float


@dataclass(frozen=True, eq=False)
class AttemptResult:
    """The result of the runs of an attempt.

    Attributes
    ----------
    crest
        Highest elevation of the calibrated crest or record, with its position and time.
    misfit
        Misfit over the tolerance; the target is reached at 1 or less.
    record
        Elevation [m] over time [s] at the target.
    nrms
        Root mean square difference from a target record over that of the record; nan for a crest.
    odd
        Odd part of the record, from two runs with opposite phases; None for one run.
    """

    crest: CrestPosition
    misfit: float
    record: DataArray
    nrms: float = np.nan
    odd: Array | None = None


def record_of(t: ArrayLike, eta: ArrayLike) -> DataArray:
    """Return the record of elevations [m] at times [s], both of shape (N,)."""
    return DataArray(eta, {"time": t}, ("time",))


NO_RESULT = AttemptResult(CrestPosition(np.nan, np.nan, np.nan), np.inf, record_of([], []))


@dataclass(frozen=True, eq=False)
class Attempt:
    """A setting and the result of its runs.

    Attributes
    ----------
    number, runs
        Number of the attempt, and number of runs including its own.
    numerics
        ``"cheap"`` or ``"the case's"``.
    setting
        Setting of the waves.
    run
        Run directory; of several runs the first.
    cpu
        CPU time of all its runs [s].
    broke
        Number of waves in them that broke and were damped.
    result
        ``NO_RESULT`` if a run is not complete.
    cause
        Cause of an incomplete run; empty if all are complete.
    """

    number: int
    runs: int
    numerics: str
    setting: Setting
    run: Path
    cpu: float
    broke: int = 0
    result: AttemptResult = NO_RESULT
    cause: str = ""


class Scale(NamedTuple):
    """Energy-weighted mean period [s] and wave length [m]."""

    period: float
    length: float


def scale(waves: PlaneWaves) -> Scale:
    """Return mean period and length of waves."""
    energy = np.abs(waves.amplitudes) ** 2
    omega, k = (float(energy @ values / energy.sum()) for values in (waves.omega, waves.k_x))
    return Scale(2 * np.pi / omega, 2 * np.pi / k)


def gauge_at(run: RunDirectory, x: float) -> DataArray:
    """Return the record of the gauge nearest to x [m]."""
    gauges = run.gauges
    return gauges[int(np.abs(gauges.x.values - x).argmin())].dropna("time")


SEARCH_RANGE = 1.5  # wave lengths and periods around the target within which the highest crest is searched
POINTS_PER_WAVE = 60  # points in a wave length
FIT_RANGE = 1 / 3  # wave lengths on each side of a crest over which it is fitted
SAME_CREST = 0.6  # periods around the path of a crest within which there is no other crest
MIN_FIT_POINTS = 6  # least number of points of a fit
SNAPSHOT_REFINEMENT = 4  # refinement of the times of snapshots for the search of a crest
MAX_FITS, MAX_SHIFT = 20, 1e-5  # number of fits, and change of position in wave lengths at which they end
MAX_STEPS = np.array([0.3, 0.5, 0.5])  # largest changes of the setting
CREST_REDUCTION = np.array([-0.2, 0.0, 0.0])  # change of the setting of a crest for lower waves


class CrestAim:
    """The aim of a crest of given height, position and time.

    Parameters
    ----------
    target
        The crest.
    waves
        Waves of the case's motion, which a setting scales and shifts.
    """

    def __init__(self, target: CrestTarget, waves: PlaneWaves):
        self.x, self.start, self.wanted = target.x, np.zeros(3), record_of([target.time], [target.height])
        self.reversed, self.note = None, ""
        self._target, self._waves, self._scale = target, waves, scale(waves)

    def waves(self, setting: Setting) -> PlaneWaves:
        """Return the waves of a setting: amplitudes times a factor, shifted downstream and in time."""
        log_factor, downstream, later = setting
        dx, dt = downstream * self._scale.length, later * self._scale.period
        factor = np.exp(log_factor - 1j * (self._waves.k_x * dx - self._waves.omega * dt))
        return replace(self._waves, amplitudes=factor * self._waves.amplitudes)

    def phases(self, attempts: Sequence[Attempt]) -> tuple[float, ...]:
        """Return the phases [deg] that are added to all waves, one for each run."""
        return (0.0,)

    def evaluate(self, runs: Sequence[RunDirectory]) -> AttemptResult:
        """Return the highest crest around the target; of equal crests, within the tolerance, the nearest."""
        (run,) = runs
        surface, target, reach = run.snapshots(), self._target, SEARCH_RANGE * self._scale.length
        around = np.abs(surface.time.values - target.time) < SEARCH_RANGE * self._scale.period
        if np.count_nonzero(around) > 3:
            surface = surface.isel(time=around)
        tops = crests(surface, target.x - reach, target.x + reach, sizes=self._scale)
        alike = [top for top in tops if top.height > (1 - target.tolerance) * tops[0].height]
        crest = min(alike, key=lambda top: float(np.abs(self._missed(top)[1:]).sum()))
        misfit = float((np.abs(self._missed(crest)) / [1.0, 2.0, 2.0]).max() / target.tolerance)
        return AttemptResult(crest, misfit, gauge_at(run, self.x))

    def _missed(self, crest: CrestPosition) -> Array:
        target, sizes = self._target, self._scale
        dx, dt = (crest.x - target.x) / sizes.length, (crest.t - target.time) / sizes.period
        return np.array([np.log(crest.height / target.height), dx, dt])

    def next_setting(self, attempts: Sequence[Attempt]) -> Setting:
        """Return Broyden's next setting, a step from the best attempt with the numerics of the newest."""
        best, slopes = attempts[0], np.eye(3)
        for one in attempts:
            if one is not best and one.numerics == best.numerics:
                step = one.setting - best.setting
                change = self._missed(one.result.crest) - self._missed(best.result.crest)
                slopes += np.outer(change - slopes @ step, step) / (step @ step)
            if one.numerics != best.numerics or one.result.misfit < best.result.misfit:
                best = one
        step = -np.linalg.solve(slopes, self._missed(best.result.crest))
        return np.asarray(best.setting + step / max(1.0, np.abs(step / MAX_STEPS).max()))

    def lowered(self, setting: Setting) -> Setting:
        """Return the setting of waves that are a fifth lower."""
        return np.asarray(setting + CREST_REDUCTION)


def crests(surface: Dataset, first: float, last: float, *, sizes: Scale) -> list[CrestPosition]:
    """Return the highest crest between two positions [m], and the highest of the others.

    The height of a crest along its path, a third of a wave length to either side, is fitted by exp(-x²). The fit is
    repeated around its maximum until the position converges: on coarse cells ripples of the cell length disturb the
    highest sample.
    """
    t = surface.time.values
    first, last = max(first, float(surface.x[:, 0].max())), min(last, float(surface.x[:, -1].min()))
    places = np.linspace(first, last, max(8, int(POINTS_PER_WAVE * (last - first) / sizes.length)), dtype=np.float64)
    eta, result = _elevation(surface, places), list[CrestPosition]()
    remaining = np.ones((t.size, places.size), dtype=bool)
    while len(result) < 2 and remaining.any():
        row, column = divmod(int(np.argmax(np.where(remaining, eta, -np.inf))), places.size)
        guess = top = CrestPosition(float(eta[row, column]), float(places[column]), float(t[row]))
        for _ in range(MAX_FITS):
            before, top = top, _fitted(surface, top, first, last, sizes=sizes)
            if abs(top.x - before.x) < MAX_SHIFT * sizes.length:
                break
        result.append(top)
        arrival = guess.t + (places - guess.x) * sizes.period / sizes.length
        remaining &= np.abs(t[:, None] - arrival) > SAME_CREST * sizes.period
    return sorted(result, reverse=True)


def _fitted(surface: Dataset, top: CrestPosition, first: float, last: float, *, sizes: Scale) -> CrestPosition:
    """Return the maximum of a crest by a fit to its path around a guess; the guess if no fit has a maximum."""
    _, x, t = top
    part = surface.isel(time=np.abs(surface.time.values - t) < SAME_CREST * sizes.period)
    path = np.linspace(-FIT_RANGE, FIT_RANGE, 2 * int(FIT_RANGE * POINTS_PER_WAVE) + 1)
    path = path[(x + path * sizes.length >= first) & (x + path * sizes.length <= last)]
    heights, times = _highest(part.time.values, _elevation(part, x + path * sizes.length))
    weights = (1 - (path / FIT_RANGE) ** 2) * (heights > 0.0)
    if np.count_nonzero(weights) < MIN_FIT_POINTS:
        return top
    bend, slope, at_guess = np.polyfit(path, np.log(np.where(heights > 0.0, heights, 1.0)), 2, w=weights)
    if bend >= 0.0:
        return top
    shift = float(np.clip(-slope / (2 * bend), -FIT_RANGE, FIT_RANGE))
    arrival = np.polyfit(path, times, 1, w=weights)
    height = np.exp(at_guess + shift * (slope + shift * bend))
    place = float(np.clip(x + shift * sizes.length, first, last))
    return CrestPosition(float(height), place, float(np.polyval(arrival, shift)))


def _elevation(surface: Dataset, places: Array) -> Array:
    """Return elevations [m] at positions [m], shape (snapshots, positions), by splines in x."""
    return np.array(
        [CubicSpline(x, one)(places) for x, one in zip(surface.x.values, surface.elevation.values, strict=True)]
    )


def _highest(t: Array, eta: Array) -> tuple[Array, Array]:
    """Return the highest value of each column of eta, shape (M, N) at times t [s], and its time, by splines in t."""
    fine, columns = np.linspace(t[0], t[-1], SNAPSHOT_REFINEMENT * t.size), np.arange(eta.shape[1])
    spline = CubicSpline(t, eta)(fine)
    row = np.clip(spline.argmax(axis=0), 1, fine.size - 2)
    before, now, after = (spline[row + step, columns] for step in (-1, 0, 1))
    bend = before - 2 * now + after
    steps = np.clip(np.divide(before - after, 2 * bend, out=np.zeros_like(now), where=bend < 0.0), -1.0, 1.0)
    return now + steps * (after - before) / 4, fine[row] + steps * (fine[1] - fine[0])


BAND = 0.08  # standard deviation of a band over the mean frequency, at least the resolution of the record
MIN_BAND_ENERGY = 1e-4  # energy over that of the largest band below which the transfer function is uncertain
MIN_TRANSFER = 0.5  # transfer function below which corrections are reduced
RELAXATION = 0.5  # factor of the correction of a record after an attempt that is not the best
LEAST_PART = 0.25  # least such factor
DAMPING = 0.2  # damping of the mixing of records over the size of the effects
REDUCTION = 0.8  # factor of the setting of a record for lower waves
RECORD_REFINEMENT = 8  # refinement of the times of a record for the search of a crest
CREST, TROUGH = 0.0, 180.0  # phases of the two runs [deg]
TAPER = 2.0  # taper at either end of a record, in mean periods
BLOCK = 1000  # times that are evaluated together
PADDING = 4

Complex = NDArray[np.complex128]


class Lines:
    """Fourier amplitudes of a record at given frequencies, and the record with these amplitudes.

    A_j = 2 w_j int r eta exp(i omega_j t) dt, with a window r. The weight w_j is the distance of the frequencies, at
    most the resolution 1 / L of a record of length L.

    Parameters
    ----------
    t
        Times [s], shape (N,), equally spaced.
    omega
        Angular frequencies [rad/s], shape (M,), in any order.
    period
        Mean period of the waves [s].
    """

    def __init__(self, t: Array, omega: Array, *, period: float):
        self.omega = omega
        self._phase_factors, window = np.exp(-1j * np.outer(t, omega)), eased(t, period)
        step, order = (t[-1] - t[0]) / (t.size - 1), np.argsort(omega)
        weights = np.full(omega.size, 1.0 / (step * float(window @ window)))
        if omega.size > 1:
            weights[order] = np.minimum(weights[order], np.gradient(omega[order]) / (2 * np.pi))
        self._weights, self._window = 2.0 * step * weights, window

    def of(self, eta: Array) -> Complex:
        """Return A [m], shape (M,), of elevations [m] of shape (N,)."""
        return np.asarray(self._weights * ((self._window * eta) @ self._phase_factors.conj()))

    def part(self, eta: Array) -> Array:
        """Return the part of elevations [m], shape (N,), at these frequencies."""
        return np.asarray((self._phase_factors @ self.of(eta)).real)


class Reversal(NamedTuple):
    """The reversal of time, t becomes end - t, of a record and of its waves.

    Attributes
    ----------
    t
        Times [s] from 0 to the end of the record, shape (N,).
    end
        Time [s] that becomes 0.
    band
        Lowest and highest frequency of the record [Hz].
    generated
        Whether a component of the record in this band is generated, shape (M,).
    """

    t: Array
    end: float
    band: tuple[float, float]
    generated: NDArray[np.bool_]

    def setting(self, record: DataArray) -> Setting:
        """Return the amplitudes [m] of the generated components of a record that is reversed."""
        eta = CubicSpline(record.time, record)(self.end - self.t)
        result = target_elevation(self.t, eta, band=self.band)
        return np.asarray(result.amplitudes * np.exp(-1j * result.phases))[self.generated]


class RecordAim:
    """The aim of an elevation over time at a position.

    Parameters
    ----------
    x
        The position [m].
    wanted
        The target record, at equally spaced times.
    waves
        The first waves to generate; a setting is their amplitudes.
    tolerance
        Largest nrms.
    linear
        Whether the record is that of linear waves alone.
    judged
        Angular frequencies [rad/s] of the misfit; default: those of the waves.
    reversal
        Reversal of time, for first waves from a run with the reversed target; default: none.
    note
        The frequencies of the target, for the user.
    """

    def __init__(
        self,
        x: float,
        wanted: DataArray,
        waves: PlaneWaves,
        *,
        tolerance: float,
        linear: bool,
        judged: Array | None = None,
        reversal: Reversal | None = None,
        note: str = "",
    ):
        self.x, self.start, self.wanted, self._waves = x, waves.amplitudes, wanted, waves
        self.note, self._reversal = note, reversal
        self._tolerance, self._linear = tolerance, linear
        period = scale(waves).period
        self._t, self._eta = wanted.time.values, wanted.values
        self._lines = Lines(self._t, waves.omega, period=period)
        self._judged = self._lines if judged is None else Lines(self._t, judged, period=period)

    def waves(self, setting: Setting) -> PlaneWaves:
        """Return the waves of a setting."""
        return replace(self._waves, amplitudes=setting)

    @property
    def reversed(self) -> Setting | None:
        """The setting of waves that have the reversed target at the paddle; None without a reversal."""
        if self._reversal is None:
            return None
        delay = self._waves.k_x * self.x - self._waves.omega * self._reversal.end
        return np.asarray((self.start * np.exp(1j * delay)).conj())

    def start_after(self, run: RunDirectory) -> Setting:
        """Return the first setting, by a run of the waves with the reversed target.

        Waves that do not arrive within the target by linear theory are excluded, for example reflected ones.
        """
        assert self._reversal is not None
        waves = self.waves(self._reversal.setting(gauge_at(run, self.x)))
        return np.asarray(self._lines.of(waves.elevation(self.x, self._t)) * np.exp(-1j * waves.k_x * self.x))

    def late(self) -> tuple[float, float]:
        """Return the part of the target that cannot arrive from a paddle that starts at t = 0, by linear theory.

        Its rms over that of the target, and its mean frequency [Hz].
        """
        missing = self._eta - started(self._waves, self.x, self._t)
        energy = np.abs(self._judged.of(missing)) ** 2
        return self._misfit(missing), float(energy @ self._judged.omega / energy.sum() / (2 * np.pi))

    def _misfit(self, missing: Array) -> float:
        """Return the rms difference [m] from the target over its rms, at the frequencies of the misfit."""
        return rms(self._judged.part(missing)) / rms(self._judged.part(self._eta))

    def phases(self, attempts: Sequence[Attempt]) -> tuple[float, ...]:
        """Return the phases [deg] that are added to all waves, one for each run; two for the first attempt."""
        return (CREST, TROUGH) if self._linear or not attempts else (CREST,)

    def evaluate(self, runs: Sequence[RunDirectory]) -> AttemptResult:
        """Return the record at the target's times and its misfit."""
        splines = [CubicSpline(gauge.time, gauge) for gauge in (gauge_at(run, self.x) for run in runs)]
        crest, *trough = (spline(self._t) for spline in splines)
        odd = (crest - trough[0]) / 2 if trough else None
        eta = odd if self._linear and odd is not None else crest
        nrms = self._misfit(self._eta - eta)
        fine = np.linspace(self._t[0], self._t[-1], RECORD_REFINEMENT * self._t.size)
        top = float(fine[splines[0](fine).argmax()])
        highest = CrestPosition(float(splines[0](top)), self.x, top)
        return AttemptResult(highest, nrms / self._tolerance, record_of(self._t, eta), nrms=nrms, odd=odd)

    def next_setting(self, attempts: Sequence[Attempt]) -> Setting:
        """Return the best setting with its correction, mixed with the others.

        The correction is halved for each attempt that was not better than all before, to a quarter at least.
        """
        inverse = self._inverse(attempts) * np.exp(-1j * self._waves.k_x * self.x)
        same = [one for one in attempts if one.numerics == attempts[-1].numerics]
        misfits = [one.result.misfit for one in same]
        worse = np.count_nonzero(misfits > np.minimum.accumulate(misfits))
        same.append(same.pop(int(np.argmin(misfits))))
        missing = [self._lines.of(self._eta - one.result.record.values) for one in same]
        settings, part = np.array([one.setting for one in same]), max(RELAXATION**worse, LEAST_PART)
        return mixed(settings, np.array(missing), part * inverse, damping=DAMPING * (1 - part))

    def _inverse(self, attempts: Sequence[Attempt]) -> Complex:
        """Return coherence over transfer function, in bands, from the settings and their changes."""
        odd = [(one, one.result.odd) for one in attempts if one.result.odd is not None]
        linear = [self._lines.of(self.waves(one.setting).elevation(self.x, self._t)) for one, _ in odd]
        measured = [self._lines.of(eta) for _, eta in odd]
        U, M = (np.concatenate([each[-1:], np.diff(each, axis=0)]) for each in (linear, measured))
        band = self._band(linear[-1])
        UU, MM, MU = (band @ each.sum(axis=0) for each in (np.abs(U) ** 2, np.abs(M) ** 2, M * U.conj()))
        little = MIN_BAND_ENERGY * UU.max()
        transfer = np.abs(MU) / (UU + little)
        return np.asarray(MU.conj() / (MM + little) * np.minimum(1.0, transfer / MIN_TRANSFER) ** 2)

    def _band(self, linear: Complex) -> Array:
        """Return the weights of frequencies in the bands around frequencies, shape (M, M)."""
        omega, energy = self._waves.omega, np.abs(linear) ** 2
        width = max(BAND * float(energy @ omega / energy.sum()), 2 * np.pi / float(np.ptp(self._t)))
        return np.asarray(np.exp(-0.5 * (np.subtract.outer(omega, omega) / width) ** 2))

    def lowered(self, setting: Setting) -> Setting:
        """Return the setting of waves that are a fifth lower."""
        return np.asarray(REDUCTION * setting)


def mixed(settings: Complex, missing: Complex, inverse: ArrayLike = 1.0, *, damping: float = 0.0) -> Complex:
    """Return the last setting with its correction by Anderson mixing.

    Source: D. G. Anderson, "Iterative procedures for nonlinear integral equations", J. ACM 12, 1965.

    Parameters
    ----------
    settings, missing
        Settings, and differences of the target from their results, shape (attempts, N).
    inverse
        Correction of a setting over the difference, shape (N,).
    damping
        Damping of the weights over the size of their effects.
    """
    changes, effects = (one[-1] - one[:-1] for one in (settings, missing))
    stacked = np.concatenate([effects.real, effects.imag], axis=1).T
    now = np.concatenate([missing[-1].real, missing[-1].imag])
    damped = damping * np.diag(np.linalg.norm(stacked, axis=0))
    system = np.concatenate([stacked, damped]), np.append(now, np.zeros(len(effects)))
    weights = np.linalg.lstsq(*system, rcond=None)[0] if len(effects) else np.zeros(0)
    return np.asarray(settings[-1] - weights @ changes + inverse * (missing[-1] - weights @ effects))


def started(waves: PlaneWaves, x: float, t: Array) -> Array:
    """Return the elevation [m] at x [m] of waves that a paddle at x = 0 generates from t = 0, by linear theory.

    The times t [s], shape (N,), are equally spaced, >= 0, and resolve the waves.
    """
    dt = (t[-1] - t[0]) / (t.size - 1)
    times = np.append(t[0] - dt * np.arange(int(t[0] / dt), 0, -1), t)
    parts = np.array_split(times, 1 + times.size // BLOCK)
    at_paddle = np.concatenate([waves.elevation(0.0, part) for part in parts])
    padded = PADDING * times.size  # without periodic copies of the slowest waves
    omega = 2 * np.pi * np.fft.rfftfreq(padded, dt)
    phase_factors = np.exp(-1j * x * np.append(0.0, wave_number(omega[1:], waves.depth, waves.gravity)))
    eta = np.fft.irfft(phase_factors * np.fft.rfft(at_paddle, padded), padded)
    return np.asarray(eta[times.size - t.size : times.size])


def eased(t: Array, period: float) -> Array:
    """Return a window that tapers both ends of a record at times t [s] of waves of a mean period [s]."""
    return np.asarray(tukey(t.size, min(0.5, 2 * TAPER * period / float(np.ptp(t)))))


Aim = CrestAim | RecordAim

PADDLE = "must be a paddle without segments: calibration changes its motion, not that of a far wall"
OWN = "must generate the waves: calibration changes wall.motion only, not far_wall.motion"
SLICE = "must be a slice: the target is a position along it"
MADE = "regular, bichromatic, irregular, focused, components or surface"
MIN_ROWS = 16  # least number of rows of a record
PER_PERIOD = 8  # samples in the shortest period
MAX_MATRIX = 10**7  # largest number of times by frequencies; twice that if the shortest period requires it
MAX_FREQUENCIES = 4000
MAX_UNREACHED = 0.15  # rms of waves that cannot arrive over that of a record; 0.02 to 0.09 in generated records


def aim_of(case: Case) -> Aim:
    """Return the aim of a case: its ``target``, default: the waves of its motion by linear theory.

    Raises ``CaseError`` if it has neither, or if its waves cannot reach the target.
    """
    if case.tank.type != "slice":
        raise CaseError([Problem(("tank", "type"), case.tank.type, SLICE)])
    if not isinstance(case.wall, PaddleWall):
        raise CaseError([Problem(("wall", "type"), case.wall.type, PADDLE)])
    if case.far_wall.moves and not case.motion().moves:
        raise CaseError([Problem(("wall", "motion", "type"), case.wall.motion.type, OWN)])
    match implied_target(case) if case.target is None else case.target:
        case CrestTarget() as target:
            return _crest(target, case)
        case ComponentsTarget() as target:
            return _components(target, case)
        case RecordTarget() as target:
            return _record(target, case)


def implied_target(case: Case) -> Target:
    """Return the target of a case without one: the crest of focused waves or the record of a surface."""
    motion = case.wall.motion
    if isinstance(motion, FocusedMotion) and motion.phase == 0.0:
        return CrestTarget(height=motion.linear_crest, x=motion.focus_x, time=motion.focus_time)
    if isinstance(motion, SurfaceMotion):
        return RecordTarget(x=motion.x, **{name: getattr(motion, name) for name in ElevationFile.model_fields})
    allowed = "is missing: only a focused crest and a motion of type surface imply a target"
    raise CaseError([Problem(("target",), None, allowed)])


def _generated(case: Case) -> PlaneWaves:
    motion = case.wall.motion
    if not isinstance(motion, MadeWaves):
        raise CaseError([Problem(("wall", "motion", "type"), getattr(motion, "type", None), f"must be {MADE}")])
    return motion.target(case.tank)


def _crest(target: CrestTarget, case: Case) -> Aim:
    """Return the aim of a crest; raise ``CaseError`` above the height of the highest waves."""
    waves = _generated(case)
    length, depth = scale(waves).length, case.tank.depth
    highest = STEEPEST * length * float(np.tanh(2 * np.pi * depth / length))
    free = not isinstance(case.water, LinearWater) and target.x + length < case.tank.length  # no reflection at the wall
    if free and target.height > highest:
        of = f"the height from trough to crest of the highest waves {length:.3g} m long, here (Miche)"
        raise CaseError([Problem(("target", "height"), target.height, f"must be at most {highest:.3g} m, {of}")])
    return CrestAim(target, waves)


def _components(target: ComponentsTarget, case: Case) -> Aim:
    waves = _generated(case)
    t = _times(0.0, case.run.duration, waves.omega)
    wanted = record_of(t, waves.elevation(target.x, t))
    aim = RecordAim(target.x, wanted, waves, tolerance=target.tolerance, linear=True)
    return _checked_arrival(aim, case, target.tolerance)


def _record(target: RecordTarget, case: Case) -> Aim:
    """Return the aim of a record; its first waves are those of linear theory that can arrive in time."""
    t, eta = _target_window(target, case)
    with about("target", "file"):
        times, result = _record_waves(t, eta, band=(target.lowest_frequency, target.highest_frequency))
    tank, where = case.tank, {"x": target.x, "time": result.begin}
    k = airy.wave_number(2 * np.pi * result.frequencies, tank.depth, tank.gravity)
    arrived = target.x / airy.group_velocity(k, tank.depth, tank.gravity) < (middle := _median_time(t, eta))
    if not arrived.any():
        allowed = f"has its waves at {middle:.4g} s, before any can arrive; target.delay shifts them"
        raise CaseError([Problem(("target", "file"), target.file, allowed)])
    of = (values[arrived] for values in (result.frequencies, result.amplitudes, result.phases))
    waves = waves_along(*of, depth=tank.depth, gravity=tank.gravity, **where)
    judged = 2 * np.pi * result.frequencies
    fewest = min(t.size, int(MAX_MATRIX / judged.size))
    even = _times(t[0], t[-1], judged, fewest=fewest)
    wanted = record_of(even, CubicSpline(t, eta)(even))
    ends = float(result.frequencies[0]), float(result.frequencies[-1])
    nonlinear = not isinstance(case.water, LinearWater)
    aim = RecordAim(
        target.x,
        wanted,
        waves,
        tolerance=target.tolerance,
        linear=False,
        judged=judged,
        reversal=Reversal(times, case.run.duration, ends, arrived) if nonlinear else None,
        note=f"target: {target.generated_band(result)}",
    )
    return _checked_arrival(aim, case, max(target.tolerance, MAX_UNREACHED))


def _checked_arrival(aim: RecordAim, case: Case, most: float) -> Aim:
    """Return an aim; raise ``CaseError`` if more than a part ``most`` of its rms cannot arrive in time."""
    part, frequency = aim.late()
    if part > most:
        k = float(airy.wave_number(2 * np.pi * frequency, case.tank.depth, case.tank.gravity))
        arrival = aim.x / float(airy.group_velocity(k, case.tank.depth, case.tank.gravity))
        what = f"{100 * part:.2g} % (rms) of the target cannot arrive in time, allowed are {100 * most:.2g} %"
        when = f"waves of {frequency:.3g} Hz from a paddle that starts at t = 0 arrive at t = {arrival:.4g} s"
        raise CaseError([Problem(("target", "x"), aim.x, f"{what}: {when}")])
    return aim


def _target_window(target: RecordTarget, case: Case) -> tuple[Array, Array]:
    """Return the times [s] and elevations [m] of a record from its start to its end."""
    t, eta = target.record("target")
    start, end = (default if text is None else text for text, default in ((target.start, 0.0), (target.end, np.inf)))
    inside = (t >= max(start, 0.0)) & (t <= min(end, case.run.duration))
    if np.count_nonzero(inside) < MIN_ROWS:
        received = f"{np.count_nonzero(inside)} rows between start and end, from {t[0]:g} to {t[-1]:g} s"
        raise CaseError([Problem(("target", "file"), target.file, f"has {received}; at least {MIN_ROWS} are needed")])
    return t[inside], eta[inside]


def _record_waves(t: Array, eta: Array, *, band: tuple[float | None, float | None]) -> tuple[Array, TargetElevation]:
    """Return the waves of a record with still water from t = 0 on before it, and the times [s] of both.

    The still water prevents that a periodic copy precedes the record.
    """
    lull = np.arange(0.0, t[0], float(np.diff(t).mean()))[:-1]
    period = 1 / target_elevation(t, eta, band=band).mean_frequency
    times, waving = np.append(lull, t), (eta - eta.mean()) * eased(t, period)
    return times, target_elevation(times, np.append(0 * lull, waving), band=band)


def _median_time(t: Array, eta: Array) -> float:
    """Return the time [s] at which half of a record's energy has arrived."""
    energy = np.cumsum((eta - eta.mean()) ** 2)
    return float(t[np.searchsorted(energy, energy[-1] / 2)])


def _times(start: float, end: float, omega: Array, *, fewest: int = 2) -> Array:
    """Return equally spaced times [s], ``PER_PERIOD`` in the shortest period; raise ``CaseError`` for too many."""
    number = max(fewest, int((end - start) * omega.max() / (2 * np.pi) * PER_PERIOD) + 2)
    if number * omega.size > 2 * MAX_MATRIX or omega.size > MAX_FREQUENCIES:
        received = f"{number} times and {omega.size} frequencies received"
        allowed = (
            f"is too long: {received}; allowed are {MAX_FREQUENCIES} frequencies, and {2 * MAX_MATRIX:.0e} of both"
        )
        raise CaseError([Problem(("target",), None, f"{allowed}, fewer by a shorter record or run, or components")])
    return np.linspace(start, end, number, dtype=np.float64)
