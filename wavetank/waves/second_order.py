"""The paddle's motion to second order, which makes no free waves of its own at sums and differences of frequencies.

A paddle that moves by linear theory alone makes, beside the waves wanted and what is bound to them, free waves of
second order: it leaves its place of rest, and water that is bound to the waves does not move as the paddle does. To
second order in the amplitudes, with phi = phi_1 + phi_2 and the paddle at f(z) (X_1 + X_2),

    phi_2,tt + g phi_2,z = G at z = 0,    G = -2 grad phi_1 . grad phi_1,t + phi_1,t / g (phi_1,ttz + g phi_1,zz),
    phi_2,x = f X_2' - X_1 (f phi_1,xx - f' phi_1,z) at x = 0.

Let B be the bound part: it solves the first, a sum over pairs of modes (``wavemaker``) that travel or die out. What
goes out as free waves of frequency Omega, Omega² = g K tanh K d, is the projection on cosh K (z + d) of what B leaves
of the second; it vanishes for

    X_2' m(K) = int [X_1 (f phi_1,xx - f' phi_1,z) + B_x] cosh K (z + d) / cosh K d dz.

Of a pair of modes u, v with k = k_u + k_v and G = T exp(i (k x - Omega t)) the last is i k T / (g (k² - K²)): what
could be resonant in B cancels. Modes at -omega_v have the wave number -k_v* and the conjugate amplitude: they give
the differences of frequencies. The mean, Omega = 0, a closed tank holds by itself. Sums over modes that die out
converge slowly because of k_v P_v alone, whose sum is the paddle's velocity at still water, -omega_v b_v.

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

EVANESCENT = 24  # modes that die out, of each frequency: the next would change X_2 by less than 1e-3
MANY, FEW = 60, 24  # frequencies; the sums of more are interpolated from as few, within 3e-5
FEWER = 8  # modes for the differences of many, which are long: within 1e-2 of the largest


class Strokes(NamedTuple):
    """X = Re sum b exp(-i omega t).

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
        """Return those of some frequencies."""
        return _Modes(self.omega[which], self.b[which], self.k[which], self.P[which])

    def mirrored(self) -> "_Modes":
        """Return the same at the negative frequencies."""
        return _Modes(-self.omega, self.b.conj(), -self.k.conj(), self.P.conj())


def second_order(
    first: Strokes, wavemaker: Wavemaker, *, depth: float, gravity: float, evanescent: int = EVANESCENT
) -> Strokes:
    """Return X_2 of a motion X_1 of frequencies in ascending order: its sums of frequencies, then its differences.

    N (N + 1) / 2 of the one and N (N - 1) / 2 of the other, in the order of ``numpy.tril_indices``.
    """
    water = _Water(wavemaker, depth, gravity, evanescent)
    many = first.omega.size > MANY
    difference_water = _Water(wavemaker, depth, gravity, min(evanescent, FEWER)) if many else water
    n, m = np.tril_indices(first.omega.size)
    distinct = n > m
    total, difference = first.omega[n] + first.omega[m], (first.omega[n] - first.omega[m])[distinct]
    halved = np.where(distinct, 1.0, 0.5)  # with itself it is one pair, two with another
    residuals = halved * (_interpolated(water, first.omega)[n, m] if many else water.residuals(first.omega))
    sums = residuals * first.b[n] * first.b[m]
    differences = (difference_water.residuals(first.omega, -1.0) * first.b[n] * first.b[m].conj())[distinct]
    return Strokes(
        np.concatenate([total, difference]),
        np.concatenate([water.motion(sums, total), water.motion(differences, difference)]),
    )


def _interpolated(water: "_Water", omega: Array) -> Complex:
    """Return ``_Water.residuals`` of the sums of many frequencies, interpolated from few, as they are smooth."""
    middle, half = 0.5 * (omega.max() + omega.min()), 0.5 * (omega.max() - omega.min())
    nodes = [chebyshev.chebpts1(count) for count in (FEW, FEW + 1)]
    first, second = (_cardinal((omega - middle) / half, one) for one in nodes)
    return np.asarray(first @ water.residuals_between(*(middle + half * one for one in nodes)) @ second.T)


def _cardinal(x: Array, nodes: Array) -> Array:
    """Return the polynomials that are 1 at one of Chebyshev's nodes and 0 at the others, shape (x, nodes).

    They are (2 sum_j T_j(x) T_j(node) - 1) / nodes: always the same, where scipy's interpolator shuffles its nodes.
    """
    at_x, at_nodes = (chebyshev.chebvander(points, nodes.size - 1) for points in (x, nodes))
    return np.asarray((2.0 * at_x @ at_nodes.T - 1.0) / nodes.size)


class _Water:
    """Pairs of modes in a depth [m], before a paddle, under gravity [m/s²]."""

    def __init__(self, wavemaker: Wavemaker, depth: float, gravity: float, evanescent: int):
        self._wavemaker, self._depth, self._g, self._evanescent = wavemaker, depth, gravity, evanescent

    def motion(self, residual: Complex, omega: Array) -> Complex:
        """Return b of X_2 [m] of frequencies [rad/s] from their residuals [m²/s²], all of shape (N,)."""
        K = airy.wave_number(omega, self._depth, self._g)
        return np.asarray(residual / (-1j * omega * self._wavemaker.moment(K, self._depth)))

    def residuals(self, omega: Array, sign: float = 1.0) -> Complex:
        """Return the residuals that X_2 cancels, of b = 1, at omega_n + sign omega_m, in the order of tril_indices.

        Of the differences of a frequency with itself there is none.
        """
        one = self._modes(omega)
        other = one if sign > 0 else one.mirrored()
        rows = (self._of_pairs(one.of(slice(n, n + 1)), other.of(slice(n + 1))) for n in range(omega.size))
        return np.concatenate([*rows])

    def residuals_between(self, omega: Array, second: Array) -> Complex:
        """Return the same at the sums of frequencies and second ones, shape (N, M)."""
        one, other = self._modes(omega), self._modes(second)
        return np.stack([self._of_pairs(one.of(slice(n, n + 1)), other) for n in range(omega.size)])

    def _modes(self, omega: Array) -> _Modes:
        """Return the modes of motions of 1 m."""
        travelling = airy.wave_number(omega, self._depth, self._g)
        dying = modes(omega, self._depth, self._g, count=self._evanescent)
        k = np.concatenate([travelling[:, None] + 0j, 1j * dying], axis=1)
        P = -omega[:, None] * self._wavemaker.moment(k, self._depth) / (k * norm(k, self._depth))
        return _Modes(omega, np.ones_like(omega, dtype=np.complex128), k, P)

    def _of_pairs(self, one: _Modes, other: _Modes) -> Complex:
        """Return the residuals at the sums of one frequency and others, shape (N,); 0 where the sum is 0."""
        total = one.omega + other.omega
        moving = total != 0.0
        K = airy.wave_number(np.where(moving, np.abs(total), 1.0), self._depth, self._g)
        displaced = one.b * self._displaced(other, K) + other.b * self._displaced(one, K)
        return np.asarray(np.where(moving, 0.5 * (self._bound(one, other, K) + displaced), 0.0))

    def _displaced(self, of: _Modes, K: Array) -> Complex:
        """Return the flux of modes through the displaced paddle."""
        return np.asarray((of.P * self._wavemaker.displaced(of.k, K[:, None], self._depth)).sum(axis=1))

    def _bound(self, u: _Modes, v: _Modes, K: Array) -> Complex:
        """Return the flux of the bound waves of pairs u, v and v, u; the sums of their T have one denominator."""
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
        """Return the sum over modes that converges slowly, and its end."""
        factor = (v.k * v.P).sum(axis=1) + v.omega * v.b * at_top
        return np.asarray(u.omega * u.P.sum(axis=1) * factor)
