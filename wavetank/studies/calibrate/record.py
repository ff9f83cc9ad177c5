"""A record as a target: waves are corrected, each frequency with its phase, until the tank's record is the wanted one.

Of the waves that the paddle is told to make, linear theory expects a record u(t) at the place; the tank has m(t), and
w(t) is wanted. In bands of frequency the tank's transfer is G = <M U*> / <U U*>, with its phase, and its coherence is
c = |<M U*>|² / (<M M*> <U U*>); of what is missing, W - M, c / G is added. So bound harmonics, which the tank makes by
itself and the record has, are not made again. G is that of what is odd in two runs, one with all phases turned by 180
degrees: second harmonics, and whatever else is even, are taken out. Where the components alone are wanted, so is m.

Sources: J. R. Chaplin, "On frequency-focusing unidirectional waves", Int. J. Offshore and Polar Eng. 6, 1996; S.
Schmittner, S. Kosleck, J. Hennig, "A phase-amplitude iteration scheme for the optimization of deterministic wave
sequences", OMAE 2009; E. Buldakov, D. Stagonas, R. Simons, "Extreme wave groups in a wave flume: controlled generation
and breaking onset", Coastal Eng. 128, 2017, for runs with turned phases.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from wavetank.analysis.compare import rms
from wavetank.output.directory import RunDirectory
from wavetank.studies.calibrate.aim import Aim, Elevation, Found, Setting, Tried, at
from wavetank.studies.calibrate.waves import Complex, Lines, scale, started
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wave import Array

BAND = 0.08  # of the mean frequency, at least that of the record: standard deviation of a band
LITTLE = 1e-4  # of the largest band's energy: where there is less, little is known
HARDLY = 0.5  # of a transfer: what hardly arrives is hardly corrected
LOWER = 0.8
FINER = 8  # times at which a crest is looked for, by those of the record
TURNED = 2  # attempts at a whole record with turned phases, too
CREST, TROUGH = 0.0, 180.0


class Late(NamedTuple):
    """Waves of a target that cannot arrive in time: rms over that of the target, and mean frequency [Hz]."""

    part: float
    frequency: float


class RecordAim(Aim):
    """An elevation over time at a place.

    Parameters
    ----------
    wanted
        At equally spaced times.
    waves
        Those that the paddle is told to make at first.
    tolerance
        Of the nrms.
    linear
        Whether the wanted elevation is that of linear waves alone.
    judged
        Angular frequencies [rad/s] that a record is judged by; default: those of the waves.
    """

    def __init__(
        self,
        x: float,
        wanted: Elevation,
        waves: PlaneWaves,
        *,
        tolerance: float,
        linear: bool,
        judged: Array | None = None,
    ):
        self.x, self.start, self._wanted, self._waves = x, waves.amplitudes, wanted, waves
        self._tolerance, self._linear = tolerance, linear
        period = scale(waves).period
        self._lines = Lines(wanted.t, waves.omega, period=period)
        self._judge = self._lines if judged is None else Lines(wanted.t, judged, period=period)

    @property
    def wanted(self) -> Elevation:
        """The record."""
        return self._wanted

    def waves(self, setting: Setting) -> PlaneWaves:
        """Return waves of other amplitudes."""
        return replace(self._waves, amplitudes=setting)

    def late(self) -> Late:
        """Return what is missing of the target where its waves start at the paddle at t = 0, by linear theory."""
        missing = self._wanted.eta - started(self._waves, self.x, self._wanted.t)
        energy = np.abs(self._judge.of(missing)) ** 2
        part = rms(self._judge.kept(missing)) / rms(self._judge.kept(self._wanted.eta))
        return Late(part, float(energy @ self._judge.omega / energy.sum() / (2 * np.pi)))

    def phases(self, tried: Sequence[Tried]) -> tuple[float, ...]:
        """Return both, as long as the tank's transfer, or what is linear, is to be known."""
        return (CREST, TROUGH) if self._linear or len(tried) < TURNED else (CREST,)

    def found(self, runs: Sequence[RunDirectory]) -> Found:
        """Return what the tank has at the wanted times, and how much of the waves' frequencies is missing."""
        t, wanted = self._wanted
        splines = [CubicSpline(*at(run, self.x)) for run in runs]
        crest, *trough = (spline(t) for spline in splines)
        odd = (crest - trough[0]) / 2 if trough else None
        eta = odd if self._linear and odd is not None else crest
        nrms = rms(self._judge.kept(wanted - eta)) / rms(self._judge.kept(wanted))
        fine = np.linspace(t[0], t[-1], FINER * t.size)
        top = fine[splines[0](fine).argmax()]
        height, misfit = float(splines[0](top)), nrms / self._tolerance
        return Found(height, self.x, float(top), misfit, Elevation(t, eta), nrms=nrms, odd=odd)

    def corrected(self, tried: Sequence[Tried]) -> Setting:
        """Return the newest setting with what it misses, as far as those before do not tell better."""
        inverse = self._inverse(tried) * np.exp(-1j * self._waves.k_x * self.x)
        same = [one for one in tried if one.numerics == tried[-1].numerics]
        settings = np.array([one.setting for one in same])
        missing = np.array([inverse * self._lines.of(self._wanted.eta - one.found.elevation.eta) for one in same])
        return mixed(settings, missing)

    def _inverse(self, tried: Sequence[Tried]) -> Complex:
        """Return coherence over transfer, in bands, from what the paddle was told and from how that was changed."""
        pairs = [(self._told(one.setting), self._lines.of(odd)) for one in tried if (odd := one.found.odd) is not None]
        told, come = zip(*pairs, strict=True)
        U, M = (np.concatenate([each[-1:], np.diff(each, axis=0)]) for each in (told, come))
        band = self._band(told[-1])
        UU, MM, MU = (band @ each.sum(axis=0) for each in (np.abs(U) ** 2, np.abs(M) ** 2, M * U.conj()))
        little = LITTLE * UU.max()
        transfer = np.abs(MU) / (UU + little)
        return np.asarray(MU.conj() / (MM + little) * np.minimum(1.0, transfer / HARDLY) ** 2)

    def _told(self, setting: Setting) -> Complex:
        """Return what linear theory expects of a setting in the record."""
        return self._lines.of(self.waves(setting).elevation(self.x, self._wanted.t))

    def _band(self, told: Complex) -> Array:
        """Return by how much each frequency counts for each other."""
        omega, energy = self._waves.omega, np.abs(told) ** 2
        width = max(BAND * float(energy @ omega / energy.sum()), 2 * np.pi / float(np.ptp(self._wanted.t)))
        return np.asarray(np.exp(-0.5 * (np.subtract.outer(omega, omega) / width) ** 2))

    def gentler(self, setting: Setting) -> Setting:
        """Return waves a fifth lower."""
        return np.asarray(LOWER * setting)


def mixed(settings: Complex, missing: Complex) -> Complex:
    """Return the newest setting with what is missing, by Anderson's mixing.

    Both of shape (attempts, N). Of the changes of the settings so far that combination is taken, too, that would have
    made least of what is missing now.

    Source: D. G. Anderson, "Iterative procedures for nonlinear integral equations", J. ACM 12, 1965.
    """
    changes, effects = np.diff(settings, axis=0), np.diff(missing, axis=0)
    stacked = np.concatenate([effects.real, effects.imag], axis=1).T
    now = np.concatenate([missing[-1].real, missing[-1].imag])
    shares = np.linalg.lstsq(stacked, now, rcond=None)[0] if len(effects) else np.zeros(0)
    return np.asarray(settings[-1] + missing[-1] - shares @ (changes + effects))
