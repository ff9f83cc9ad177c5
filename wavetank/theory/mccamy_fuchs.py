"""Regular waves of small amplitude around a vertical circular cylinder that stands on a flat bed: linear diffraction.

Incident eta = Re(a exp(i (k r cos(theta) - omega t))), travelling to theta = 0. With eta = Re(a F exp(-i omega t)),

    F = exp(i k r cos(theta)) - sum e_m i^m J_m'(k R) / H_m'(k R) H_m(k r) cos(m theta),   e_0 = 1, e_m = 2,

R being the cylinder's radius and H_m = J_m + i Y_m. On the cylinder, by the Wronskian J H' - J' H = 2 i / (pi k R),

    F = sum e_m i^m 2 i / (pi k R H_m'(k R)) cos(m theta).

The potential is psi = Re(-i g / omega a F exp(-i omega t)). Depth enters through k alone.

How to hold a closed basin against it. A wave that stands between two end walls, cos(k x) with whole half waves, is a
solution of the basin without the cylinder, side walls or not; only what the cylinder scatters has to go to the walls
and back, 2 (b - R) at no more than sqrt(g d). As cos(k xi + delta) is the sum of two waves that travel either way, its
harmonic at (r, theta) is ``standing``; a run gives it at theta and at pi - theta, and from these ``travelling`` gives
F, best with delta = pi / 4: the cylinder's centre stands an eighth of a wave from a crest, in the middle of the basin
but for that. Begin from the standing wave at rest as if the cylinder were not there; wait two periods T; take
2 / T int eta exp(i omega t) dt over the third.

For k R = k d = 1 the modal sum of an annulus, exact in time, says how far the result is from F when the walls are b
away, as a share of a: it has settled to 0.6 % in the second period and to 0.06 % in the third, and the walls are unfelt
(0.06 %) in the third at b = 2.5 wave lengths; they err by 0.7 % at 2.0, 10 % at 1.5. Hence 5 by 5 wave lengths, or half
of that, cut along the plane of symmetry, theta = 0 and pi. The diffracted wave itself as the start needs no waiting but
is wrong at the walls from the first moment on: over the first period it errs by 0.1 % at 2 wave lengths, over the
second by 6 % at 2.5.

Sources: R. C. MacCamy and R. A. Fuchs, "Wave forces on piles: a diffraction theory", Beach Erosion Board, Technical
Memorandum 69, 1954; T. H. Havelock, Proc. R. Soc. A 175, 1940 (deep water).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import h1vp, hankel1, jvp

from wavetank.theory.airy import relative_depth
from wavetank.theory.wave import Array

Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class CylinderDiffraction:
    """A vertical circular cylinder in regular waves that travel to theta = 0.

    Attributes
    ----------
    k
        Wave number [rad/m].
    radius
        R [m].
    """

    k: float
    radius: float

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

    def amplitude(self, r: ArrayLike, theta: ArrayLike) -> Complex:
        """Return F, the complex elevation over a, at r [m], from R on, and theta [rad], of one shape."""
        r, theta = np.asarray(r, dtype=np.float64), np.asarray(theta, dtype=np.float64)
        m, kr = self._orders, self.k * r[..., None]
        scattered = self._weights() * jvp(m, self.ka) / h1vp(m, self.ka) * hankel1(m, kr) * np.cos(m * theta[..., None])
        return np.asarray(np.exp(1j * self.k * r * np.cos(theta)) - scattered.sum(axis=-1))

    def run_up(self, theta: ArrayLike) -> Array:
        """Return |F| on the cylinder at theta [rad], any shape: theta = pi faces the waves."""
        m = self._orders
        terms = self._weights() / h1vp(m, self.ka) * np.cos(m * np.asarray(theta, dtype=np.float64)[..., None])
        return np.asarray(np.abs(2.0 / (np.pi * self.ka) * terms.sum(axis=-1)))

    def standing(self, r: ArrayLike, theta: ArrayLike, *, phase: float) -> Complex:
        """Return F for incident eta = a cos(k r cos(theta) + phase) cos(omega t); phase [rad], else as before."""
        there, back = self.amplitude(r, theta), self.amplitude(r, np.pi - np.asarray(theta))
        return np.asarray(0.5 * (np.exp(1j * phase) * there + np.exp(-1j * phase) * back))

    def force(self, depth: float) -> float:
        """Return the horizontal force's amplitude over rho g a [m²], 4 tanh(k d) / (k^2 |H_1'(k R)|); depth [m]."""
        return float(4.0 * np.tanh(relative_depth(self.k, depth)) / (self.k**2 * abs(h1vp(1, self.ka))))


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
