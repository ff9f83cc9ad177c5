"""The numerical uncertainty of a run, from its records and those of its companion (``companion.py``).

The parts are those of ITTC 7.5-03-01-01, U² = U_I² + U_G² + U_T² + U_P², each at a confidence of 95 %:

    grid        U_G = k max |S_c - S| / (r^q - 1)      r: size of the companion's cells over that of the run's
    time step   U_T = t max |dS/dt| e_T                e_T: relative frequency error of the scheme
    parameters  U_P = t max |dS/dt| e_P                e_P: that of the vertical order
    iteration   U_I = 10 tolerance S_rms

max is the largest value within half a period on both sides, q = min(p + 1, 4), k = 1.25: in random cases and over
bars it covers 95 % of the errors (docs/accuracy.md).
The companion's time step is longer, so that S_c - S contains more than the error of the time step, which U_T estimates
by linear theory: no wave in a record is older than the run. Frequency errors are means over the waves around the mean
frequency, weighted with the energy of dS/dt. With a companion of a vertical order less, S_v, U_P is at least
0.75 max |S_v - S_c|: the order changes forms and amplitudes, too.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.ndimage import maximum_filter1d
from xarray import DataArray

from wavetank.analysis.signals import crossing_period, harmonics
from wavetank.base.arrays import Vector
from wavetank.base.errors import WavetankError
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.planning.companion import CompanionCases, grid_order
from wavetank.planning.dispersion import Mesh, UniformCells, step_errors
from wavetank.waves import airy

SAFETY = 1.25  # k
LOWER_ORDER = 2.0, 2  # ratio and order that give the grid error of a companion with an order less
ITERATION = 10.0  # error of the solves over their tolerance
VERTICAL = 0.75  # uncertainty over the difference of a companion with a vertical order less
BAND = 0.3, 1.6  # frequencies of free waves over the mean frequency
PARTS = "grid", "time step", "parameters", "iteration"
LARGE = 0.3  # largest rms of a difference or an uncertainty over that of the elevation
TIMES = 1.7  # further factor of the uncertainty of a crest's time
AMPLITUDES = 2.0  # further factor of the uncertainty of an amplitude, whose difference may vanish
SHORT = 3.0  # frequency of iteration errors over that of the waves
AT_REST = 1e-10  # elevation [m]
LOW_WAVES = 0.1  # rms of a record, over the largest one, below which its relative error does not count
FEWEST = 16  # rows of a record that has an error
FEWEST_SAMPLES = 16  # samples in a period, of which crests are interpolated
HARMONICS, LAST = 3, 0.25  # number of harmonics; part of a record from which they are computed
SMOOTH = 5  # degree of the splines between samples


class NotResolvedError(WavetankError):
    """The uncertainty of a run is unknown."""


class TooCoarseError(NotResolvedError):
    """The difference from the companion, or the uncertainty, is too large."""


class Uncertainty(NamedTuple):
    """The uncertainty of a record, in its units, shape (T,) each.

    ``height`` is that of crests by the vertical order, ``difference`` the grid part before its maximum is taken.
    """

    grid: Vector
    time_step: Vector
    parameters: Vector
    iteration: Vector
    height: Vector
    difference: Vector

    @property
    def parts(self) -> tuple[Vector, Vector, Vector, Vector]:
        """The parts of U, in the order of ``PARTS``."""
        return self[:4]

    @property
    def total(self) -> Vector:
        """U of all parts."""
        return np.asarray(np.sqrt(np.sum(np.square(self.parts), axis=0)))


class Harmonics(NamedTuple):
    """Amplitudes of the first harmonics of a record [m] with their uncertainties, and those of the phases [rad].

    Shape (``HARMONICS``,) each.
    """

    amplitude: Vector
    amplitude_uncertainty: Vector
    phase_uncertainty: Vector


class CompanionValues(NamedTuple):
    """Values of the companions at the times of the run, shape (T,) or (N, T), as the cases of ``CompanionCases``."""

    coarse: Vector
    lower: Vector | None = None

    def each(self) -> "Iterator[CompanionValues]":
        """Yield those of each of N records."""
        for n, one in enumerate(self.coarse):
            yield CompanionValues(one, *(None if values is None else values[n] for values in self[1:]))


class Estimate(NamedTuple):
    """How uncertainties follow from differences.

    Attributes
    ----------
    grid
        U_G over the difference from the companion, k / (r^q - 1).
    dt, vertical_order, scheme, tolerance
        Those of the run.
    depth, gravity
        Those of the tank [m, m/s²].
    """

    grid: float
    dt: float
    vertical_order: int
    scheme: str
    tolerance: float
    depth: float
    gravity: float

    @classmethod
    def of(cls, case: Case, companions: CompanionCases, dt: float) -> "Estimate":
        """Return the estimate for a case, its companions and the time step of the run [s]."""
        numerics, tank, coarse = case.numerics, case.tank, companions.coarse
        ratio, order = coarse.cell_size / case.cell_size, grid_order(numerics.order)
        if coarse.numerics.order < numerics.order:
            ratio, order = LOWER_ORDER
        return cls(
            grid=SAFETY / (ratio**order - 1.0),
            dt=dt,
            vertical_order=numerics.vertical_order,
            scheme=numerics.integrator,
            tolerance=numerics.tolerance,
            depth=tank.depth,
            gravity=tank.gravity,
        )

    def series(
        self, t: Vector, values: Vector, companions: CompanionValues, errors: tuple[float, float] | None = None
    ) -> Uncertainty:
        """Return the uncertainty of values at equidistant times t [s], shape (T,) each.

        ``errors`` are those of the frequency of the waves, default: of the waves in the values.
        """
        variation = values - values.mean()
        width = crossing_period(t, values) / (t[1] - t[0])
        rate = t * _around(np.gradient(values, t), width)
        if errors is None:
            errors = self.frequency_errors(t, variation)
        iteration = np.full(t.size, ITERATION * self.tolerance * np.sqrt(np.mean(variation**2)))
        difference = self.grid * (companions.coarse - values)
        grid, time_step, parameters = _around(difference, width), errors[0] * rate, errors[1] * rate
        lower = 0 * grid
        if companions.lower is not None:
            lower = VERTICAL * _around(companions.lower - companions.coarse, width)
        return Uncertainty(grid, time_step, np.maximum(parameters, lower), iteration, lower, difference)

    def several(
        self, t: Vector, values: Vector, companions: CompanionValues, errors: tuple[float, float] | None = None
    ) -> list[Uncertainty]:
        """Return the uncertainty of N records, shape (N, T), at times t [s]; see ``series``."""
        return [self.series(t, *pair, errors) for pair in zip(values, companions.each(), strict=True)]

    def harmonics(self, t: Vector, values: Vector, companions: CompanionValues, period: float) -> Harmonics:
        """Return the harmonics of regular waves of a period [s] in the last periods of a record.

        Errors of frequency change the phases only. Raises ``InputError`` for a record shorter than a period, or with
        too few samples.
        """
        start = t[-1] - max(1, int(LAST * (t[-1] - t[0]) / period)) * period - (t[1] - t[0])

        def of(record: Vector) -> NDArray[np.complex128]:
            last = DataArray(record, {"time": t}, ("time",)).sel(time=slice(start, None))
            return np.asarray(harmonics(last, 1 / period, number=HARMONICS).component.values)

        own, theirs = of(values), of(companions.coarse)
        off = np.hypot(AMPLITUDES * self.grid * np.abs(theirs - own), ITERATION * self.tolerance * np.std(values))
        if companions.lower is not None:
            off = np.hypot(off, VERTICAL * np.abs(of(companions.lower) - theirs))
        rate = np.arange(1, HARMONICS + 1) * 2 * np.pi / period
        late = np.hypot(*self.frequency_errors(t, values - values.mean())) * rate * t[-1]
        return Harmonics(np.abs(own), off, np.hypot(late, off / np.maximum(np.abs(own), AT_REST)))

    def frequency_errors(self, t: Vector, variation: Vector) -> tuple[float, float]:
        """Return the relative frequency errors of the scheme and of the vertical order for the waves of a record.

        They are zero for a record at rest.
        """
        if not variation.any():
            return 0.0, 0.0
        energy = np.abs(np.fft.rfft(variation * np.hanning(t.size), 4 * t.size)) ** 2
        omega = 2 * np.pi * np.fft.rfftfreq(4 * t.size, t[1] - t[0])
        mean = float(omega @ energy / energy.sum())
        band = (omega > BAND[0] * mean) & (omega < BAND[1] * mean)
        omega, weights = omega[band], (omega**2 * energy)[band]
        k = airy.wave_number(omega, self.depth, self.gravity)
        cells = UniformCells(1, 1.0)
        mesh = Mesh(cells=cells, vertical_order=self.vertical_order, depth=self.depth, gravity=self.gravity)
        errors = step_errors(INTEGRATORS[self.scheme](), omega * self.dt).frequency, mesh.frequency(k**2) / omega - 1.0
        scheme, vertical = (float(np.sqrt(weights @ np.fmin(np.abs(one), 1.0) ** 2 / weights.sum())) for one in errors)
        return scheme, vertical


class Crests(NamedTuple):
    """Crests of a record: times [s] and heights in the units of the record, with their uncertainties, shape (N,)."""

    time: Vector
    height: Vector
    time_uncertainty: Vector
    height_uncertainty: Vector


def crests(t: Vector, values: Vector, uncertainty: Uncertainty) -> Crests:
    """Return the largest crest between two zero up-crossings, each, and its uncertainty; none of coarse samples.

    A record without two zero up-crossings has at most one crest: its maximum, unless that is at an end. A difference d
    of the record changes the height of a crest by d and its time by the slope of d over the curvature.
    """
    variation = values - values.mean()
    ups = np.flatnonzero((variation[:-1] < 0) & (variation[1:] >= 0))
    pairs = zip(ups[:-1], ups[1:], strict=True)
    period, dt = crossing_period(t, values), t[1] - t[0]
    resolved = period >= FEWEST_SAMPLES * dt
    highest = np.array([first + np.argmax(values[first:last]) for first, last in pairs if resolved], dtype=int)
    wide = np.count_nonzero(variation > 0.5 * variation.max()) >= FEWEST_SAMPLES / 3
    if ups.size < 2 and wide and 0 < (peak := int(np.argmax(values))) < t.size - 1:
        highest = np.array([peak])
    spline = make_interp_spline(t, values, SMOOTH)
    time, height = _maxima(spline, t[highest], dt)

    def there(quantity: Vector) -> Vector:
        return np.asarray(np.interp(time, t, quantity))

    difference = uncertainty.difference
    slope, rate = (there(_around(np.gradient(one, t), period / dt)) for one in (difference, values))
    noise, phase = there(uncertainty.iteration), there(np.hypot(uncertainty.time_step, uncertainty.parameters))
    late = TIMES * slope / np.abs(spline.derivative(2)(time))
    return Crests(
        time,
        height,
        np.sqrt(late**2 + (phase**2 + (SHORT * noise) ** 2) / np.maximum(rate, 1e-300) ** 2),
        np.sqrt(there(_around(difference, 0.5 * period / dt)) ** 2 + noise**2 + there(uncertainty.height) ** 2),
    )


def crests_about(t: Vector, values: Vector, about: Vector) -> tuple[Vector, Vector]:
    """Return times and heights of the crests of a record within a quarter of a period of given times, shape (N,)."""
    spline, period = make_interp_spline(t, values, SMOOTH), crossing_period(t, values)
    within = np.clip(np.linspace(-0.25, 0.25, 101) * period + about[:, None], t[0], t[-1])
    start = within[np.arange(about.size), np.argmax(spline(within), axis=1)]
    return _maxima(spline, start, 0.005 * period)


def at_times(t: Vector, other_t: Vector, other: Vector) -> Vector:
    """Return values at other times t, by a spline."""
    return np.asarray(make_interp_spline(other_t, other, SMOOTH)(t))


def gauge_uncertainties(
    t: Vector, values: Vector, companions: CompanionValues, estimate: Estimate
) -> list[Uncertainty]:
    """Return the uncertainty of each gauge; raises ``TooCoarseError`` if it is unknown.

    Parameters
    ----------
    t, values
        Times [s], shape (T,), and elevations of the gauges [m], shape (N, T).
    companions, estimate
        Elevations of the companions, and the estimate.
    """
    if _too_large(values, companions.coarse - values):
        raise TooCoarseError("the companion run differs too much: the cells or the time step are too coarse")
    result = estimate.several(t, values, companions)
    if _too_large(values, np.array([one.total for one in result])):
        raise TooCoarseError(f"the uncertainty exceeds {LARGE:.0%} of the waves")
    return result


def _too_large(values: Vector, companions: Vector) -> bool:
    """Return whether the largest rms of companions exceeds ``LARGE`` of that of elevations, and rounding errors."""
    size, off = (float(np.sqrt(np.mean(several**2, axis=1)).max()) for several in (values, companions))
    return off > max(LARGE * size, AT_REST)


def _around(values: Vector, width: float) -> Vector:
    """Return the largest absolute value within half a width, a number of samples, on both sides."""
    return np.asarray(maximum_filter1d(np.abs(values), max(3, 2 * round(width / 2) + 1), mode="nearest"))


def _maxima(spline: object, start: Vector, step: float) -> tuple[Vector, Vector]:
    """Return times and values of maxima next to start values, by Newton's method within a step."""
    first, second = spline.derivative(1), spline.derivative(2)  # type: ignore[attr-defined]
    t = start.copy()
    for _ in range(5):
        curvature = np.minimum(second(t), -1e-300)
        t = np.clip(t - first(t) / curvature, start - step, start + step)
    return t, np.asarray(spline(t))  # type: ignore[operator]
