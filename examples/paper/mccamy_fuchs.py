"""Regular waves of small amplitude around a vertical circular cylinder on a flat bed: linear diffraction.

Incident eta = Re(a exp(i (k r cos(theta) - omega t))), travelling to theta = 0. With eta = Re(a F exp(-i omega t)),

    F = exp(i k r cos(theta)) - sum e_m i^m J_m'(k R) / H_m'(k R) H_m(k r) cos(m theta),   e_0 = 1, e_m = 2,

with the cylinder radius R and H_m = J_m + i Y_m. On the cylinder, by the Wronskian J H' - J' H = 2 i / (pi k R),

    F = sum e_m i^m 2 i / (pi k R H_m'(k R)) cos(m theta).

The potential is psi = Re(-i g / omega a F exp(-i omega t)). Depth enters through k alone.

Comparison with a closed basin. A standing wave between two end walls, cos(k x) with an integer number of half waves, is
a solution of the basin without the cylinder. Only the waves scattered by the cylinder travel to the walls and return,
2 (b - R) at sqrt(g d) at most. cos(k xi + delta) is the sum of two waves in opposite directions. Its harmonic at
(r, theta) is ``standing``. From a run's values at theta and pi - theta ``travelling`` gives F. The best choice is
delta = pi / 4: the centre of the cylinder is an eighth of a wave from a crest, close to the middle of the basin.
Procedure: start from the standing wave at rest without the effect of the cylinder, wait two periods T, and take
2 / T int eta exp(i omega t) dt over the third.

For k R = k d = 1 the modal sum of an annulus, exact in time, gives the difference between result and F with walls at a
distance b, relative to a. It is 0.6 % in the second period and 0.06 % in the third. The effect of the walls in the
third period is 0.06 % for b = 2.5 wave lengths, 0.7 % for 2.0, 10 % for 1.5. Hence 5 by 5 wave lengths, or half of
that, cut along the plane of symmetry, theta = 0 and pi. The diffracted wave as initial state needs no waiting time but
is wrong at the walls from the start: 0.1 % over the first period at 2 wave lengths, 6 % over the second at 2.5.

Sources: R. C. MacCamy and R. A. Fuchs, "Wave forces on piles: a diffraction theory", Beach Erosion Board, Technical
Memorandum 69, 1954; T. H. Havelock, Proc. R. Soc. A 175, 1940 (deep water).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from examples.paper.theories import Wave, in_depth
from wavetank.waves.airy import Array, angular_frequency, relative_depth

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class CylinderDiffraction(Wave):
    """Regular waves to theta = 0, the x axis, and their scattering by a vertical circular cylinder at x = y = 0.

    Attributes
    ----------
    k
        Wave number [rad/m].
    radius
        R [m].
    a
        Amplitude of the incident waves [m].
    depth, gravity
        Still-water depth d [m] or ``inf``, and gravity g [m/s²].
    """

    k: float
    radius: float
    a: float = 1.0
    depth: float = np.inf
    gravity: float = 9.81

    @property
    def ka(self) -> float:
        """The product k R."""
        return self.k * self.radius

    @property
    def _orders(self) -> NDArray[np.int64]:
        """0, 1, ... to where J_m'(k R) has fallen below round-off."""
        return np.arange(int(self.ka + 8.0 * self.ka ** (1 / 3)) + 14)

    def _weights(self) -> Complex:
        """e_m i^m, shape (orders,)."""
        return np.asarray(np.where(self._orders > 0, 2.0, 1.0) * 1j**self._orders)

    @property
    def _scattered(self) -> Complex:
        """Coefficients of H_m(k r) cos(m theta) in the scattered part of F, shape (orders,)."""
        return np.asarray(
            self._weights() * scipy.special.jvp(self._orders, self.ka) / scipy.special.h1vp(self._orders, self.ka)
        )

    def amplitude(self, r: ArrayLike, theta: ArrayLike) -> Complex:
        """Return F, the complex elevation over a, at r [m], from R on, and theta [rad], of one shape."""
        r, theta = np.asarray(r, dtype=np.float64), np.asarray(theta, dtype=np.float64)
        m, kr = self._orders, self.k * r[..., None]
        scattered = self._scattered * scipy.special.hankel1(m, kr) * np.cos(m * theta[..., None])
        return np.asarray(np.exp(1j * self.k * r * np.cos(theta)) - scattered.sum(axis=-1))

    def slope(self, r: ArrayLike, theta: ArrayLike) -> Complex:
        """Return the gradient of F along x and y [1/m], in a last axis of 2, at places as in ``amplitude``."""
        r, theta = np.asarray(r, dtype=np.float64), np.asarray(theta, dtype=np.float64)
        m, kr, turn = self._orders, self.k * r[..., None], self._orders * theta[..., None]
        outwards = -(self._scattered * self.k * scipy.special.h1vp(m, kr) * np.cos(turn)).sum(axis=-1)
        around = (self._scattered * scipy.special.hankel1(m, kr) * m * np.sin(turn)).sum(axis=-1) / r
        incident = 1j * self.k * np.exp(1j * self.k * r * np.cos(theta))
        along = incident + outwards * np.cos(theta) - around * np.sin(theta)
        return np.stack([along, outwards * np.sin(theta) + around * np.cos(theta)], axis=-1)

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]."""
        return np.asarray((self.amplitude(*_polar(x, y)) * self._phasor(t)).real)

    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential [m²/s]."""
        cosh, _ = in_depth(np.asarray(self.k), np.asarray(z), self.depth)
        return np.asarray((self.amplitude(*_polar(x, y)) * self._potential(t)).real * cosh)

    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity [m/s]."""
        (r, theta), phasor = _polar(x, y), self._potential(t)
        cosh, sinh = in_depth(np.asarray(self.k), np.asarray(z), self.depth)
        along, across = np.moveaxis(self.slope(r, theta), -1, 0)
        upwards = self.k * sinh * (self.amplitude(r, theta) * phasor).real
        parts = ((along * phasor).real * cosh, (across * phasor).real * cosh, upwards)
        return np.stack(np.broadcast_arrays(*parts), axis=-1)

    @property
    def _omega(self) -> float:
        return float(angular_frequency(self.k, self.depth, self.gravity))

    def _phasor(self, t: ArrayLike) -> Complex:
        return np.asarray(self.a * np.exp(-1j * np.multiply(self._omega, t)))

    def _potential(self, t: ArrayLike) -> Complex:
        return np.asarray(-1j * self.gravity / self._omega * self._phasor(t))

    def run_up(self, theta: ArrayLike) -> Array:
        """Return |F| on the cylinder at theta [rad], any shape: theta = pi faces the waves."""
        m = self._orders
        terms = (
            self._weights()
            / scipy.special.h1vp(m, self.ka)
            * np.cos(m * np.asarray(theta, dtype=np.float64)[..., None])
        )
        return np.asarray(np.abs(2.0 / (np.pi * self.ka) * terms.sum(axis=-1)))

    def standing(self, r: ArrayLike, theta: ArrayLike, *, phase: float) -> Complex:
        """Return F for incident eta = a cos(k r cos(theta) + phase) cos(omega t); phase [rad], else as before."""
        there, back = self.amplitude(r, theta), self.amplitude(r, np.pi - np.asarray(theta))
        return np.asarray(0.5 * (np.exp(1j * phase) * there + np.exp(-1j * phase) * back))

    def force(self, depth: float) -> float:
        """Return the horizontal force's amplitude over rho g a [m²], 4 tanh(k d) / (k^2 |H_1'(k R)|); depth [m]."""
        return float(4.0 * np.tanh(relative_depth(self.k, depth)) / (self.k**2 * abs(scipy.special.h1vp(1, self.ka))))


def _polar(x: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
    """Return r [m] and theta [rad] of places x, y [m], of the shape that both go to."""
    return np.hypot(x, y), np.arctan2(y, x)


def travelling(standing: Complex, mirrored: Complex, *, phase: float) -> Complex:
    """Return F of travelling waves from that of a standing one.

    Parameters
    ----------
    standing, mirrored
        Complex elevations over a of ``CylinderDiffraction.standing`` at theta and at pi - theta, of one shape.
    phase
        That of the standing wave [rad]; where sin(2 phase) is 0, a crest or a node at the centre, half is missing.
    """
    turn = np.exp(1j * phase)
    return np.asarray((turn * standing - turn.conjugate() * mirrored) / (1j * np.sin(2.0 * phase)))
