"""Validation of computed records by measured ones: the comparison error and its uncertainty.

Of values D of an experiment and S of a simulation, ITTC 7.5-03-01-01 (2017):

    E = D - S                   (5)
    U_V^2 = U_D^2 + U_SN^2

ASME V&V 20 (2009) adds the uncertainty u_input of the input of the simulation, here of the record that drives the
paddle. S is validated at the level U_V if |E| <= U_V; otherwise the model or the record has an error that no stated
uncertainty explains. If U_V exceeds ``LARGEST`` of the measured value there is no conclusion. All are expanded
uncertainties at a confidence of 95 %. Of records, E and the uncertainties are root mean squares over the compared
times, relative to that of D.

Waves have at least three gauges and the same height and period within 5 % at all of them by IMO MSC.1/Circ.1200 (2006),
annex, 4.4.4, for model tests in regular waves.
"""

from collections.abc import Mapping, Sequence
from math import inf, nan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from xarray import DataArray, Dataset

from wavetank.analysis.signals import with_units
from wavetank.analysis.statistics import MIN_WAVES, zero_crossing_waves
from wavetank.base.errors import InputError
from wavetank.waves.airy import wave_number

Array = NDArray[np.float64]

PARTS = NUMERICAL, MEASURED, INPUT = "U_SN", "U_D", "u_input"  # parts of U_V
LARGEST = 0.3  # largest U_V over the measured value at which there is a conclusion
BAND = 4.0  # largest frequency of waves over the mean frequency of a record
TOLERANCE = 0.05  # largest deviation of heights and periods of regular waves in model tests
FEWEST_PLACES = 3  # least number of gauges in regular waves


def slopes(t: Array, eta: Array, *, depth: float, gravity: float) -> tuple[Array, Array]:
    """Return d eta / dt [m/s] and d eta / dx [-] of waves towards +x by linear theory, shape (N,).

    The record eta [m] at times t [s], shape (N,), is continued symmetrically at its ends. Frequencies above ``BAND``
    times the mean one are noise.
    """
    even = np.linspace(t[0], t[-1], t.size)
    values = CubicSpline(t, eta)(even)
    spectrum = np.fft.rfft(np.concatenate([values, values[::-1]]) - values.mean())
    omega = 2 * np.pi * np.fft.rfftfreq(2 * t.size, even[1] - even[0])
    power = np.abs(spectrum) ** 2
    waves = (omega > 0) & (omega * power.sum() <= BAND * (omega @ power))
    k = np.zeros_like(omega)
    k[waves] = wave_number(omega[waves], depth, gravity)
    in_time, in_space = (np.fft.irfft(1j * rate * waves * spectrum, 2 * t.size)[: t.size] for rate in (omega, -k))
    return CubicSpline(even, in_time)(t), CubicSpline(even, in_space)(t)


def root_sum_of_squares(parts: Sequence[Array]) -> Array:
    """Return the root of the sum of squares of arrays of one shape."""
    return np.asarray(np.sqrt(np.sum(np.square(parts), axis=0)))


def record_uncertainty(t: Array, eta: Array, stated: Mapping[str, float], *, depth: float, gravity: float) -> Array:
    """Return U_D [m] of a measured record eta [m] at times t [s], shape (N,).

    ``stated`` has the uncertainties of gain [-], clock [s], place [m] and noise [m] that are stated.
    """
    in_time, in_space = slopes(t, eta, depth=depth, gravity=gravity)
    effects = {"gain": eta, "clock": in_time, "place": in_space, "noise": np.ones_like(eta)}
    return root_sum_of_squares([size * effects[name] for name, size in stated.items()])


class Validation(NamedTuple):
    """The comparison error E of a quantity and the parts of U_V that are stated, relative to the measured one.

    ``unstated`` names what these parts do not contain.
    """

    E: float
    parts: Mapping[str, float]
    unstated: Sequence[str] = ()

    @property
    def U_V(self) -> float:
        """The uncertainty of E by the stated parts; not a number without any."""
        return float(np.sqrt(sum(part**2 for part in self.parts.values()))) if self.parts else nan

    @property
    def conclusion(self) -> str:
        """Whether E is within U_V, and what U_V does not contain; empty without any part."""
        if not self.parts:
            return ""
        if not {NUMERICAL, MEASURED} & {*self.parts}:
            return f"no conclusion without {NUMERICAL} and {MEASURED}"
        if self.U_V > LARGEST:
            return f"U_V = {100 * self.U_V:.0f} %: too large for a conclusion"
        missing = [*(name for name in PARTS if name not in self.parts), *self.unstated]
        without = f" without {', '.join(missing)}" if missing else ""
        if abs(self.E) <= self.U_V:
            return f"validated at {self.U_V:.1%}{without}"
        ratio = abs(self.E) / self.U_V if self.U_V else inf
        return f"|E| = {ratio:.{0 if ratio >= 10 else 1}f} U_V{without or ': model or record is wrong'}"


# ---------------------------------------------------------------- regular waves of model tests
def regular_waves(gauges: Sequence[DataArray], *, start: float | None = None) -> Dataset:
    """Return mean ``height`` [m] and ``period`` [s] of regular waves over gauge, after ``start`` [s].

    ``height_deviation`` and ``period_deviation`` are relative to the means over all gauges; ``uniform`` is whether both
    are within ``TOLERANCE``. Raises ``InputError`` for fewer than three complete waves at a gauge.
    """
    means = []
    for eta in gauges:
        waves = zero_crossing_waves(eta.sel(time=slice(start, None)))
        if waves.sizes["begin"] < MIN_WAVES:
            count = waves.sizes["begin"]
            raise InputError(f"gauge {eta.gauge.item()}: {count} complete waves; at least {MIN_WAVES} are needed.")
        means.append((float(waves.height.mean()), float(waves.period.mean())))
    height, period = np.transpose(means)
    deviations = [values / values.mean() - 1 for values in (height, period)]
    quantities = {
        "height": height,
        "height_deviation": deviations[0],
        "period": period,
        "period_deviation": deviations[1],
        "uniform": (np.abs(deviations) <= TOLERANCE).all(axis=0),
    }
    names = [eta.gauge.item() for eta in gauges]
    return with_units(Dataset({name: ("gauge", values) for name, values in quantities.items()}, {"gauge": names}))


def agreeing(computed: Dataset, measured: Dataset) -> DataArray:
    """Return whether height and period of computed regular waves are within 5 % of the measured ones, over gauge."""
    errors = [computed[name].values / measured[name].values - 1 for name in ("height", "period")]
    return DataArray((np.abs(errors) <= TOLERANCE).all(axis=0), {"gauge": computed.gauge}, ("gauge",))
