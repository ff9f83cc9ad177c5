"""The numerical uncertainty of a run, from its records and those of its companion (``companion.py``).

The parts are those of ITTC 7.5-03-01-01, U² = U_I² + U_G² + U_T² + U_P², each at a confidence of 95 %:

    grid        U_G = k max |S_c - S| / (r^q - 1)      r: size of the companion's cells over that of the run's
    time step   U_T = t max |dS/dt| e_T                e_T: relative frequency error of the scheme
    parameters  U_P = t max |dS/dt| e_P                e_P: that of the vertical order
    iteration   U_I = 10 tolerance S_rms

max is the largest value within half a period on both sides. The order q of the grid error is p, at most 4. Products of
waves are represented with order p + 1, but harmonics resonate with branches of the mesh: the observed order of p = 3
varies between 2 and 6, that of p = 4 and 5 is about 4 (docs/accuracy.md).
The companion's time step is longer, so that S_c - S contains up to fifteen times the error of the time step, which U_T
estimates by linear theory: no wave in a record is older than the run. Frequency errors are means over the waves around
the mean frequency, weighted with the energy of dS/dt. With a companion of a vertical order less, S_v, U_P is at least
1.5 max |S_v - S_c|: the order changes forms and amplitudes, too.

k = 1.5 was chosen so that the uncertainty exceeds 95 % of the errors in 70 random cases; 3 for the second companion.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.ndimage import maximum_filter1d

from wavetank.analysis.signals import crossing_period
from wavetank.base.arrays import Vector
from wavetank.base.errors import WavetankError
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.planning.dispersion import Mesh, UniformCells, step_errors
from wavetank.waves import airy

SAFETIES = 1.5, 3.0  # k of the first companion, and of the second
ORDER = 4  # largest order of the grid error
LOWER_ORDER = 1 / 3  # grid error over the difference of a companion with an order less
ITERATION = 10.0  # error of the solves over their tolerance
VERTICAL = 1.5  # uncertainty over the difference of a companion with a vertical order less
BAND = 0.3, 1.6  # frequencies of free waves over the mean frequency
PARTS = "grid", "time step", "parameters", "iteration"
LARGE = 0.3  # largest rms of a difference or an uncertainty over that of the elevation
TIMES = 1.7  # further factor of the uncertainty of a crest's time
SHORT = 3.0  # frequency of iteration errors over that of the waves
AT_REST = 1e-10  # elevation [m]
FEWEST_SAMPLES = 16  # samples in a period, of which crests are interpolated
SMOOTH = 5  # degree of the splines between samples


class NotResolvedError(WavetankError):
    """The uncertainty of a run is unknown."""


class TooCoarseError(NotResolvedError):
    """The difference from the companion, or the uncertainty, is too large."""


class Uncertainty(NamedTuple):
    """The uncertainty of a record, in its units, shape (T,) each.

    ``height`` is that of crests by the vertical order.
    """

    grid: Vector
    time_step: Vector
    parameters: Vector
    iteration: Vector
    height: Vector

    @property
    def parts(self) -> tuple[Vector, Vector, Vector, Vector]:
        """The parts of U, in the order of ``PARTS``."""
        return self[:4]

    @property
    def total(self) -> Vector:
        """U of all parts."""
        return np.asarray(np.sqrt(np.sum(np.square(self.parts), axis=0)))


class Estimate(NamedTuple):
    """How uncertainties follow from differences.

    Attributes
    ----------
    grid
        Uncertainty over the difference of both records.
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
    def of(cls, case: Case, coarse: Case, dt: float, *, safety: float = SAFETIES[0]) -> "Estimate":
        """Return the estimate for a case, its companion, the time step of the run [s] and a safety factor."""
        numerics, tank = case.numerics, case.tank
        ratio, order = coarse.cell_size / case.cell_size, min(numerics.order, ORDER)
        part = LOWER_ORDER if coarse.numerics.order < numerics.order else 1.0 / (ratio**order - 1.0)
        return cls(
            grid=safety * part,
            dt=dt,
            vertical_order=numerics.vertical_order,
            scheme=numerics.integrator,
            tolerance=numerics.tolerance,
            depth=tank.depth,
            gravity=tank.gravity,
        )

    def series(
        self,
        t: Vector,
        values: Vector,
        difference: Vector,
        errors: tuple[float, float] | None = None,
        vertical: Vector | None = None,
    ) -> Uncertainty:
        """Return the uncertainty of values at equidistant times t [s], shape (T,) each.

        ``difference`` is that of the companion's values, ``errors`` those of the frequency of the waves, default: of
        the waves in the values. ``vertical`` is the difference of a companion with a vertical order less.
        """
        variation = values - values.mean()
        width = crossing_period(t, values) / (t[1] - t[0])
        rate = t * _around(np.gradient(values, t), width)
        if errors is None:
            errors = self.frequency_errors(t, variation)
        iteration = np.full(t.size, ITERATION * self.tolerance * np.sqrt(np.mean(variation**2)))
        grid, time_step, parameters = self.grid * _around(difference, width), errors[0] * rate, errors[1] * rate
        if vertical is None:
            return Uncertainty(grid, time_step, parameters, iteration, 0 * grid)
        lower = VERTICAL * _around(vertical, width)
        return Uncertainty(grid, time_step, np.maximum(parameters, lower), iteration, lower)

    def several(
        self,
        t: Vector,
        values: Vector,
        coarse: Vector,
        lower: Vector | None,
        errors: tuple[float, float] | None = None,
    ) -> list[Uncertainty]:
        """Return the uncertainty of several records at times t [s]; see ``series`` and ``gauge_uncertainties``."""
        vertical = [None] * len(values) if lower is None else lower - coarse
        records = zip(values, coarse - values, vertical, strict=True)
        return [self.series(t, own, difference, errors, order) for own, difference, order in records]

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


def crests(t: Vector, values: Vector, other: Vector, grid: float, uncertainty: Uncertainty) -> Crests:
    """Return the largest crest between two zero up-crossings, each, and its uncertainty; none of coarse samples.

    A difference d of the record changes the height of a crest by d and its time by the slope of d over the curvature.
    ``other`` are the companion's values at the same times, ``grid`` is that of ``Estimate``.
    """
    variation = values - values.mean()
    ups = np.flatnonzero((variation[:-1] < 0) & (variation[1:] >= 0))
    pairs = zip(ups[:-1], ups[1:], strict=True)
    period, dt = crossing_period(t, values), t[1] - t[0]
    resolved = period >= FEWEST_SAMPLES * dt
    highest = np.array([first + np.argmax(values[first:last]) for first, last in pairs if resolved], dtype=int)
    spline = make_interp_spline(t, values, SMOOTH)
    time, height = _maxima(spline, t[highest], dt)

    def there(quantity: Vector) -> Vector:
        return np.asarray(np.interp(time, t, quantity))

    difference = grid * (other - values)
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
    t: Vector, values: Vector, coarse: Vector, lower: Vector | None, estimate: Estimate
) -> list[Uncertainty]:
    """Return the uncertainty of each gauge; raises ``TooCoarseError`` if it is unknown.

    Parameters
    ----------
    t, values
        Times [s], shape (T,), and elevations of the gauges [m], shape (N, T).
    coarse, lower
        Elevations of the companion, and of that with a vertical order less or None, at the same times.
    estimate
        The estimate.
    """
    if _too_large(values, coarse - values):
        raise TooCoarseError("the companion run differs too much: the cells or the time step are too coarse")
    result = estimate.several(t, values, coarse, lower)
    if _too_large(values, np.array([one.total for one in result])):
        raise TooCoarseError(f"the uncertainty exceeds {LARGE:.0%} of the waves")
    return result


def _too_large(values: Vector, others: Vector) -> bool:
    """Return whether the largest rms of others exceeds ``LARGE`` of that of elevations, and rounding errors."""
    size, off = (float(np.sqrt(np.mean(several**2, axis=1)).max()) for several in (values, others))
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
