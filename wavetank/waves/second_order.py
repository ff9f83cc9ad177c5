"""Second-order wavemaker theory: the motion that makes no free waves at sums and differences of frequencies.

A paddle that moves by linear theory makes the target waves, their bound waves, and spurious free waves of second order:
the boundary condition holds at the displaced paddle, and the bound waves do not satisfy it. To second order in the
amplitudes, with phi = phi_1 + phi_2 and the paddle at f(z) (X_1 + X_2),

    phi_2,tt + g phi_2,z = G at z = 0,    G = -2 grad phi_1 . grad phi_1,t + phi_1,t / g (phi_1,ttz + g phi_1,zz),
    phi_2,x = f X_2' - X_1 (f phi_1,xx - f' phi_1,z) at x = 0.

Let B be the bound part of phi_2. It solves the first equation and is a sum over pairs of progressive and evanescent
modes (``wavemaker.py``). The free waves of frequency Omega, Omega² = g K tanh K d, are the projection of the residual
of the second equation onto cosh K (z + d). It vanishes for

    X_2' m(K) = int [X_1 (f phi_1,xx - f' phi_1,z) + B_x] cosh K (z + d) / cosh K d dz.

For a pair of modes u, v with k = k_u + k_v and G = T exp(i (k x - Omega t)) the last term is i k T / (g (k² - K²));
resonant terms of B cancel. Differences of frequencies follow from modes at -omega_v, with the wave number -k_v* and the
conjugate amplitude. The mean, Omega = 0, is determined by the volume of a closed tank. Sums over evanescent modes
converge slowly only in k_v P_v. The sum of these terms is the paddle's velocity at still water, -omega_v b_v.

Source: H. A. Schaffer, "Second-order wavemaker theory for irregular waves", Ocean Engineering 23, 1996; the projection
is written without his coefficients.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev

from wavetank.waves import airy
from wavetank.waves.airy import Array
from wavetank.waves.wavemaker import Complex, Wavemaker, modes, norm

EVANESCENT = 24  # evanescent modes of each frequency: further ones change X_2 by less than 1e-3
MANY, FEW = 60, 24  # more frequencies than MANY are interpolated from FEW, with an error of 3e-5
FEWER = 8  # evanescent modes for differences of many frequencies: the error is 1e-2 of the largest


class Strokes(NamedTuple):
    """A motion X = Re sum b exp(-i omega t).

    Attributes
    ----------
    omega
        Angular frequencies [rad/s], positive, shape (N,).
    b
        Amplitudes [m], complex, shape (N,).
    """

    omega: Array
    b: Complex


@dataclass(frozen=True, eq=False)
class _Modes:
    """The modes of frequencies: omega [rad/s] and b [m], shape (N,); k [rad/m] and P [m²/s], shape (N, modes)."""

    omega: Array
    b: Complex
    k: Complex
    P: Complex

    def of(self, which: slice) -> "_Modes":
        """Return the modes of some of the frequencies."""
        return _Modes(self.omega[which], self.b[which], self.k[which], self.P[which])

    def mirrored(self) -> "_Modes":
        """Return the modes at the negative frequencies."""
        return _Modes(-self.omega, self.b.conj(), -self.k.conj(), self.P.conj())


def second_order(
    first: Strokes, wavemaker: Wavemaker, *, depth: float, gravity: float, evanescent: int = EVANESCENT
) -> Strokes:
    """Return X_2 for a motion X_1 of N ascending frequencies.

    It has the N (N + 1) / 2 sums of frequencies, then the N (N - 1) / 2 differences, in the order of
    ``numpy.tril_indices``.
    """
    water = _Water(wavemaker, depth, gravity, evanescent)
    many = first.omega.size > MANY
    difference_water = _Water(wavemaker, depth, gravity, min(evanescent, FEWER)) if many else water
    n, m = np.tril_indices(first.omega.size)
    distinct = n > m
    total, difference = first.omega[n] + first.omega[m], (first.omega[n] - first.omega[m])[distinct]
    halved = np.where(distinct, 1.0, 0.5)  # a frequency is one pair with itself, two with another
    residuals = halved * (_interpolated(water, first.omega)[n, m] if many else water.residuals(first.omega))
    sums = residuals * first.b[n] * first.b[m]
    differences = (difference_water.residuals(first.omega, -1.0) * first.b[n] * first.b[m].conj())[distinct]
    return Strokes(
        np.concatenate([total, difference]),
        np.concatenate([water.motion(sums, total), water.motion(differences, difference)]),
    )


def _interpolated(water: "_Water", omega: Array) -> Complex:
    """Return ``_Water.residuals`` at sums of many frequencies, interpolated from few: they are smooth."""
    middle, half = 0.5 * (omega.max() + omega.min()), 0.5 * (omega.max() - omega.min())
    nodes = [chebyshev.chebpts1(count) for count in (FEW, FEW + 1)]
    first, second = (_cardinal((omega - middle) / half, one) for one in nodes)
    return np.asarray(first @ water.residuals_between(*(middle + half * one for one in nodes)) @ second.T)


def _cardinal(x: Array, nodes: Array) -> Array:
    """Return the Lagrange polynomials of Chebyshev nodes, shape (x, nodes).

    They are (2 sum_j T_j(x) T_j(node) - 1) / nodes. scipy's interpolator permutes its nodes at random, so that results
    would not be reproducible bit for bit.
    """
    at_x, at_nodes = (chebyshev.chebvander(points, nodes.size - 1) for points in (x, nodes))
    return np.asarray((2.0 * at_x @ at_nodes.T - 1.0) / nodes.size)


class _Water:
    """Interaction of pairs of modes in front of a paddle, in a depth [m], under gravity [m/s²]."""

    def __init__(self, wavemaker: Wavemaker, depth: float, gravity: float, evanescent: int):
        self._wavemaker, self._depth, self._g, self._evanescent = wavemaker, depth, gravity, evanescent

    def motion(self, residual: Complex, omega: Array) -> Complex:
        """Return the amplitudes of X_2 [m] at frequencies [rad/s] from the residuals [m²/s²], shape (N,)."""
        K = airy.wave_number(omega, self._depth, self._g)
        return np.asarray(residual / (-1j * omega * self._wavemaker.moment(K, self._depth)))

    def residuals(self, omega: Array, sign: float = 1.0) -> Complex:
        """Return the residuals that X_2 cancels, for unit amplitudes, at omega_n + sign omega_m.

        They are in the order of ``numpy.tril_indices``, and 0 at the difference of a frequency with itself.
        """
        one = self._modes(omega)
        other = one if sign > 0 else one.mirrored()
        rows = (self._of_pairs(one.of(slice(n, n + 1)), other.of(slice(n + 1))) for n in range(omega.size))
        return np.concatenate([*rows])

    def residuals_between(self, omega: Array, second: Array) -> Complex:
        """Return the residuals at the sums of N frequencies and M second frequencies, shape (N, M)."""
        one, other = self._modes(omega), self._modes(second)
        return np.stack([self._of_pairs(one.of(slice(n, n + 1)), other) for n in range(omega.size)])

    def _modes(self, omega: Array) -> _Modes:
        """Return the modes of motions of amplitude 1 m."""
        progressive = airy.wave_number(omega, self._depth, self._g)
        evanescent = modes(omega, self._depth, self._g, count=self._evanescent)
        k = np.concatenate([progressive[:, None] + 0j, 1j * evanescent], axis=1)
        P = -omega[:, None] * self._wavemaker.moment(k, self._depth) / (k * norm(k, self._depth))
        return _Modes(omega, np.ones_like(omega, dtype=np.complex128), k, P)

    def _of_pairs(self, one: _Modes, other: _Modes) -> Complex:
        """Return the residuals at the sums of one frequency and N others, shape (N,); 0 where the sum is 0."""
        total = one.omega + other.omega
        moving = total != 0.0
        K = airy.wave_number(np.where(moving, np.abs(total), 1.0), self._depth, self._g)
        displaced = one.b * self._displaced(other, K) + other.b * self._displaced(one, K)
        return np.asarray(np.where(moving, 0.5 * (self._bound(one, other, K) + displaced), 0.0))

    def _displaced(self, of: _Modes, K: Array) -> Complex:
        """Return the flux of modes through the displaced paddle."""
        return np.asarray((of.P * self._wavemaker.displaced(of.k, K[:, None], self._depth)).sum(axis=1))

    def _bound(self, u: _Modes, v: _Modes, K: Array) -> Complex:
        """Return the flux of the bound waves of the pairs (u, v) and (v, u), which have a common denominator."""
        g, total, at_top = self._g, u.omega + v.omega, self._wavemaker.mode_shape(0.0, self._depth)
        rise_u, rise_v = ((one.omega**2 / g)[:, None] for one in (u, v))  # phi_z / phi at z = 0
        of_u = v.omega[:, None] * (u.k**2 - rise_u**2) - 2.0 * total[:, None] * rise_u * rise_v
        of_v = u.omega[:, None] * (v.k**2 - rise_v**2)
        k_u, k_v = u.k[:, :, None], v.k[:, None, :]
        k, twice = k_u + k_v, 2.0 * total[:, None, None]
        iT = twice * k_u * k_v + of_u[:, :, None] + of_v[:, None, :]
        P_u = np.broadcast_to(u.P, (total.size, u.P.shape[1]))
        pairs = np.einsum("ni,nij,nj->n", P_u, k * iT / (k**2 - K[:, None, None] ** 2), v.P)
        slow_u, slow_v = (self._slow(one, other, at_top) for one, other in ((u, v), (v, u)))
        return np.asarray((pairs - slow_u - slow_v) / g)

    @staticmethod
    def _slow(u: _Modes, v: _Modes, at_top: float) -> Complex:
        """Return the partial sum over modes that converges slowly, and its remainder."""
        factor = (v.k * v.P).sum(axis=1) + v.omega * v.b * at_top
        return np.asarray(u.omega * u.P.sum(axis=1) * factor)
