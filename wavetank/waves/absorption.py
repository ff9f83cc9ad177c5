"""Linear theory of absorbing paddles: elevation and force at the paddle, and the filter of least reflection.

A paddle moves at the velocity U exp(i omega t). With the wave numbers of ``wavemaker.py`` (k_0 of the progressive wave,
k_j = -i kappa_j of evanescent modes), the elevation at its face and the force f of the water on it, over the density,
are

    eta = Z U,    Z = omega/g sum_j m(k_j) / (k_j N(k_j)),
    f = -(r + i omega mu) U,    r = omega m(k_0)² / (k_0 N(k_0)),    mu = sum_j m(kappa_j)² / (kappa_j N(kappa_j)),

Re Z = c / omega and r belong to the progressive wave. An incident wave of amplitude a has elevation 2a at a fixed wall.
The controller moves the paddle at U = -F(i omega) e in addition to the prescribed motion. Its input e is the elevation
at the face minus that of the prescribed motion. The wave of the additional motion is part of e:

    e = 2a + Z U  =>  U = -2a F / (1 + F Z).

The fixed wall reflects a. The additional motion radiates Re Z U. Their sum over a is the reflection coefficient:

    R = 1 + Re Z U / a = (1 - F Z*) / (1 + F Z).

(Without that wave, e = 2a, the coefficient would be 1 - 2 F Re Z.) R = 0 for F = 1 / Z*. That filter is not causal; a
causal one approximates it in a band. |R| <= 1 at all frequencies if and only if Re F >= 0. Then the paddle adds no
energy to the waves of any tank, whatever the tank reflects. A paddle on a spring and a damper has R = (b - r + i X) /
(b + r + i X), X = omega (M + mu) - k / omega, M, b and k over the density.

Sources: H. A. Schaffer and K. P. Jakobsen, "Non-linear wave generation and active absorption in wave flumes", Proc.
Long Waves Symposium, Thessaloniki, 2003, who fit F likewise; J. Falnes, "Ocean Waves and Oscillating Systems", 2002,
chapters 3 and 6. The condition Re F >= 0 is ours.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from wavetank.waves.airy import Array, angular_frequency, wave_number
from wavetank.waves.wavemaker import Wavemaker, modes, norm

Complex = NDArray[np.complex128]

MODES = 100  # evanescent modes
WAVES = 40  # frequencies of the band at which the reflection is minimised
ALL = np.geomspace(0.005, 20.0, 160)  # k d over that of the band's ends, where |R| <= 1
FASTEST, DAMPED = 5.0, (0.5, 10.0)  # limits of w_i over the highest frequency and of z_i; a delay of a step is harmless
STARTS = np.array(  # initial values of two fits, three sections each, as in ``built``; the better result is used
    [
        [[-0.9, 0.2, 2.0, 0.0], [0.9, -0.6, 1.0, 0.0], [1.9, -0.6, 4.0, 0.0]],
        [[-0.9, 0.2, 2.0, 0.0], [0.9, -0.2, 2.0, 0.0], [1.3, -0.2, 2.0, 0.0]],
    ]
)
FITS = ((4, 30.0), (8, 30.0), (16, 300.0))  # successive fits: exponents of the mean of |R|, weights of Re F < 0
INSIDE = 1e-6  # distance of initial values from the bounds


def face(wavemaker: Wavemaker, omega: Array, depth: float, gravity: float) -> Complex:
    """Return Z(i omega) [s], shape (N,), at angular frequencies > 0 [rad/s], shape (N,)."""
    k = np.asarray(wave_number(omega, depth, gravity))
    kappa, moments, norms = _evanescent(wavemaker, omega, depth, gravity)
    wave = wavemaker.transfer(k, depth) / omega
    return np.asarray(wave + 1j * omega / gravity * (moments / (kappa * norms)).sum(axis=1))


def radiation(wavemaker: Wavemaker, omega: Array, depth: float, gravity: float) -> tuple[Array, Array]:
    """Return damping r [m²/s] and added mass mu [m²], shape (N,) each, over the density, per metre of width."""
    k = np.asarray(wave_number(omega, depth, gravity))
    kappa, moments, norms = _evanescent(wavemaker, omega, depth, gravity)
    damping = omega * wavemaker.moment(k, depth) ** 2 / (k * norm(k, depth))
    return np.asarray(damping), np.asarray((moments**2 / (kappa * norms)).sum(axis=1))


def sudden_mass(wavemaker: Wavemaker, depth: float) -> float:
    """Return the added mass at infinite frequency [m²], over the density, per metre of width."""
    kappa = (np.arange(MODES) + 0.5) * np.pi / depth
    x, weights = np.polynomial.legendre.leggauss(4 * MODES)
    z = 0.5 * depth * (x - 1.0)
    moments = (0.5 * depth * weights * wavemaker.mode_shape(z, depth)) @ np.cos(np.outer(z + depth, kappa))
    return float((moments**2 / kappa).sum() * 2.0 / depth)


def _evanescent(wavemaker: Wavemaker, omega: Array, depth: float, gravity: float) -> tuple[Array, Array, Array]:
    """Return kappa_j, m and N of the evanescent modes, shape (N, MODES) each."""
    kappa = modes(np.asarray(omega), depth, gravity, count=MODES)
    return kappa, np.real(wavemaker.moment(1j * kappa, depth)), np.real(norm(1j * kappa, depth))


@dataclass(frozen=True)
class PassiveFilter:
    """The filter F(s) = gain sum_i (c_i y + e_i) / (y² + 2 z_i y + 1), y = s / w_i; F(0) = 0 prevents drift.

    Attributes
    ----------
    gain
        Gain [1/s].
    sections
        w_i [rad/s], z_i, c_i and e_i of each section, shape (n, 4).
    """

    gain: float
    sections: Array

    def __call__(self, s: Any) -> Any:
        """Return F [1/s] at s [1/s]; the shapes are equal."""
        total: Any = 0.0
        for w, z, c, e in self.sections:
            y = s / w
            total = total + self.gain * (c * y + e) / (y**2 + 2.0 * z * y + 1.0)
        return total

    def reflection(self, at_face: Complex, omega: Array) -> Complex:
        """Return R at frequencies omega [rad/s], shape (N,); ``at_face`` is Z at these frequencies."""
        F = self(1j * omega)
        return np.asarray((1.0 - F * at_face.conj()) / (1.0 + F * at_face))

    def over_s(self) -> tuple[Array, Array]:
        """Return the polynomials of F(s) / s, numerator and denominator, in falling powers of s."""
        below = np.ones(1)
        for w, z, _, _ in self.sections:
            below = np.polymul(below, [1.0 / w**2, 2.0 * z / w, 1.0])
        above = np.zeros(1)
        for w, z, c, e in self.sections:
            quotient, _ = np.polydiv(below, [1.0 / w**2, 2.0 * z / w, 1.0])
            above = np.polyadd(above, self.gain * np.polymul([c / w, e], quotient))
        return above[:-1] / below[0], below / below[0]

    @classmethod
    @lru_cache(maxsize=16)
    def fitted(
        cls, wavemaker: Wavemaker, *, depth: float, gravity: float, shortest: float, longest: float
    ) -> "PassiveFilter":
        """Return the filter whose largest reflection between two periods [s] is least."""
        ends = 2 * np.pi / np.array([longest, shortest])
        low, high = depth * np.asarray(wave_number(ends, depth, gravity))
        kd, wide = np.geomspace(low, high, WAVES), np.geomspace(ALL[0] * low, ALL[-1] * high, len(ALL))
        omega, omega_wide = (np.asarray(angular_frequency(one / depth, depth, gravity)) for one in (kd, wide))
        at_face, middle = face(wavemaker, omega, depth, gravity), float(np.sqrt(ends.prod()))
        gain = float(1.0 / np.abs(at_face).mean())

        def built(x: Array) -> PassiveFilter:
            w, z, c, e = x.reshape(-1, 4).T
            e = np.append(e[:-1], -e[:-1].sum())
            return cls(gain, np.column_stack([middle * np.exp(w), np.exp(z), c, e]))

        def sent(x: Array) -> Array:
            return np.asarray(np.abs(built(x).reflection(at_face, omega)))

        def misses(x: Array, exponent: int, most: float, weight: float) -> Array:
            active = np.minimum(built(x)(1j * omega_wide).real / gain, 0.0)
            return np.concatenate([(sent(x) / most) ** (exponent / 2) / np.sqrt(WAVES), weight * active])

        width = np.log(FASTEST * ends[1] / middle)
        bounds = np.array([[-width, np.log(DAMPED[0]), -np.inf, -np.inf], [width, np.log(DAMPED[1]), np.inf, np.inf]])
        bounds = np.tile(bounds, STARTS.shape[1])
        result = []
        for start in STARTS:
            x = np.clip(start.ravel(), bounds[0] + INSIDE, bounds[1] - INSIDE)
            for exponent, weight in FITS:
                most = float(sent(x).max())
                given = exponent, most, weight
                x = scipy.optimize.least_squares(misses, x, args=given, bounds=bounds, max_nfev=60).x
            result.append((float(sent(x).max()), x))
        return built(min(result, key=lambda one: one[0])[1])
