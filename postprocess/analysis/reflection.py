"""Incident and reflected waves by 2, 3 or n gauges along x, over one depth, by linear theory.

At each frequency the complex amplitudes at the gauges are those of a wave that comes and one that goes back, whose wave
number is that of the dispersion relation; by least squares where there are more than two gauges. Two are Y. Goda and
Y. Suzuki, Proc. 15th Int. Conf. Coastal Eng., 1976; three E. P. D. Mansard and E. R. Funke, Proc. 17th, 1980; n J. A.
Zelt and J. E. Skjelbreia, Proc. 23rd, 1992. Of regular waves the wave number may be found, too.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import signal
from scipy.optimize import minimize_scalar
from xarray import DataArray, Dataset

from wavetank.errors import InputError
from wavetank.postprocess.analysis.along import told_apart
from wavetank.postprocess.analysis.records import places, time_step
from wavetank.postprocess.analysis.spectra import ends_low, mean_period, peak_frequency, samples, spectrum
from wavetank.theory.airy import group_velocity, wave_number

WORST = 6.3  # condition at which Goda and Suzuki's two gauges end: 0.05 and 0.45 wave lengths apart
ENERGETIC = 0.02  # of the largest incident density: of less, no reflection is told


class Reflection(NamedTuple):
    """Complex amplitudes at x = 0 of the waves that come and go back, their wave number k [rad/m], what they leave.

    ``condition`` is how much more an error at the gauges can be in the amplitudes, at most 6 where gauges stand well.
    """

    incident: complex
    reflected: complex
    k: float
    rest: float
    condition: float

    @property
    def coefficient(self) -> float:
        """Reflected over incident amplitude."""
        return abs(self.reflected) / max(abs(self.incident), np.finfo(float).tiny)


def reflected(components: ArrayLike, x: ArrayLike, k: float, *, within: float = 0.0) -> Reflection:
    """Return the waves of one frequency in complex amplitudes at gauges, shape (gauges,), at x [m] of that shape.

    The wave number is k [rad/m], or the one that leaves least ``within`` this part of it: nonlinear least squares, for
    which steep waves are longer, and which needs three gauges.
    """

    def at(k: float) -> Reflection:
        (incident, back), rest, condition = told_apart(components, x, [k, -k])
        return Reflection(complex(incident), complex(back), k, rest, condition)

    if not within:
        return at(k)
    bounds = ((1 - within) * k, (1 + within) * k)
    best = minimize_scalar(lambda k: at(k).rest, bounds=bounds, method="bounded", options={"xatol": 1e-9 * k})
    return at(float(best.x))


def regular_reflection(
    component: DataArray, frequency: float, *, depth: float, gravity: float = 9.81, within: float = 0.0
) -> Reflection:
    """Return the incident and reflected wave of a harmonic, as ``harmonics`` returns it, of this frequency [Hz].

    The depth is in m; ``within`` as in ``reflected``. Raises ``InputError`` for fewer than two gauges, or three where
    the wave number is looked for.
    """
    x = places(component)
    _check(x.size, 3 if within else 2)
    return reflected(component.values, x, float(wave_number(2 * np.pi * frequency, depth, gravity)), within=within)


def reflected_spectra(eta: DataArray, *, depth: float, gravity: float = 9.81, segment: float | None = None) -> Dataset:
    """Return the spectra ``incident`` and ``reflected`` [m²/Hz] of a sea over frequency [Hz].

    By the gauges' cross spectra (Welch's, segments of ``spectrum``, in Hann windows that go along with the incident
    waves at the group velocity of their peak, lest what passes one gauge in a window and the next outside it counts as
    reflected; a single segment has none where its waves are low at either end, as a group's are). Not numbers where the
    gauges cannot tell them apart, by half wave lengths between them or because these are much longer than their row
    (``condition`` above 6.3). ``counted`` is where they can and the waves are, which is what the attributes are of:
    ``hm0_incident`` and ``hm0_reflected`` [m], ``coefficient``, their ratio, and ``told_apart``, the share of the
    variance; ``one_window`` tells of the whole record in one, whose middle counts most. Raises ``InputError`` for fewer
    than two gauges, and where no frequency of the waves can be told apart.
    """
    x, dt = places(eta), time_step(eta)
    _check(x.size, 2)
    late = _delays(eta, x, depth, gravity)
    length = eta.time.size - int(late.max())
    values = np.array([one[n : n + length] for n, one in zip(late, eta.transpose("gauge", "time").values, strict=True)])
    size = min(samples(eta, segment), length)
    whole = size == length
    window = "boxcar" if whole and ends_low(values, round(mean_period(eta) / dt)) else "hann"
    f, cross = signal.csd(values[:, None], values[None], 1 / dt, window, nperseg=size, detrend="constant")
    f, cross = f[1:], np.moveaxis(cross, -1, 0)[1:]
    turned = np.exp(2j * np.pi * dt * f[:, None] * late)
    cross = turned[:, :, None] * cross * turned[:, None].conj()
    k = wave_number(2 * np.pi * f, depth, gravity)
    # of e^(i(kx - ωt)), scipy's transform over e^(-iωt) is the conjugate of A
    waves = np.exp(-1j * k[:, None, None] * np.multiply.outer(x, [1, -1]))
    condition = np.linalg.cond(waves)
    usable = condition < WORST
    inverse = np.linalg.pinv(waves)
    told = np.einsum("fag,fgh,fah->fa", inverse.conj(), cross, inverse).real
    incident, back = np.where(usable, np.maximum(told.T, 0.0), np.nan)
    density = np.trace(cross.real, axis1=1, axis2=2) / x.size
    there = usable & (density > ENERGETIC * density.max())
    if not there.any():
        raise InputError("reflection: the gauges stand where incident and reflected waves cannot be told apart.")
    variances = {"incident": incident, "reflected": back}
    hm0 = {name: 4 * float(np.sqrt(S[there].sum() * f[0])) for name, S in variances.items()}
    at = {"frequency": ("frequency", f, {"units": "Hz"})}
    return Dataset(
        {name: ("frequency", S, {"units": "m2 Hz-1"}) for name, S in variances.items()}
        | {"condition": ("frequency", condition, {"units": "1"}), "counted": ("frequency", there)},
        at,
        {f"hm0_{name}": height for name, height in hm0.items()}
        | {
            "coefficient": hm0["reflected"] / max(hm0["incident"], np.finfo(float).tiny),
            "told_apart": float(density[there].sum() / density.sum()),
            "one_window": whole and window == "hann",
        },
    )


def _delays(eta: DataArray, x: NDArray[np.float64], depth: float, gravity: float) -> NDArray[np.intp]:
    """Return how many steps after the first gauge along x the waves' groups come to each: at most half the record."""
    peak = float(peak_frequency(spectrum(eta).mean("gauge")))
    speed = float(group_velocity(float(wave_number(2 * np.pi * peak, depth, gravity)), depth, gravity))
    steps = np.rint((x - x.min()) / (speed * time_step(eta))).astype(int)
    return np.asarray(np.minimum(steps, eta.time.size // 2), dtype=np.intp)


def _check(gauges: int, fewest: int) -> None:
    if gauges < fewest:
        needed = f"at least {fewest} are needed to tell reflected waves from incident ones"
        raise InputError(f"{gauges} gauges received; {needed}.")
