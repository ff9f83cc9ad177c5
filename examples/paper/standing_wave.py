"""Standing waves in a rectangular basin, linear to third order in their amplitude a: frequency, elevation, potential.

With kappa_x = m pi / length, kappa_y = n pi / width and s = omega t, Stokes' expansion

    eta = a eta_1 + a^2 eta_2 + a^3 eta_3,   psi = a psi_1 + a^2 psi_2 + a^3 psi_3,   omega = omega_0 + a^2 omega_2

of Zakharov's equations for the elevation and the potential at the surface

    omega eta_s = G psi,
    omega psi_s = -g eta - 1/2 |grad psi|^2 + 1/2 (G psi + grad eta . grad psi)^2 / (1 + |grad eta|^2),

with the Dirichlet-Neumann operator G (``dirichlet_neumann.py``).

Order one is eta_1 = cos(kappa_x x) cos(kappa_y y) cos s, psi_1 = -g / omega_0 cos cos sin s; the next orders are linear
problems, one for each product of cosines, and omega_2 is what keeps the third from resonance. Products of three cosines
have wave numbers up to three: a Fourier transform on eight points each way is exact. The water is at rest at s = 0,
where psi = 0, and a is the whole of eta's part with cos(kappa_x x) cos(kappa_y y) cos s. A part of psi that is the same
everywhere and grows linearly in time is left out: it moves nothing.

Sources: I. Tadjbakhsh and J. B. Keller, J. Fluid Mech. 8, 1960 (one dimension, any depth; their omega_2 is twice this
one); G. R. Verma and J. B. Keller, Phys. Fluids 5, 1962 (two dimensions).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from examples.paper.dirichlet_neumann import DirichletNeumann
from examples.paper.theories import Wave, in_depth
from wavetank.waves.airy import Array, angular_frequency

_POINTS = 8  # each way of x, y and s
_HARMONICS = 4  # 0 to 3


@dataclass(frozen=True, kw_only=True)
class ThirdOrderStandingWave(Wave):
    """A standing wave of small amplitude in a rectangle from its origin on, over [0, length] and [0, width].

    Attributes
    ----------
    amplitude
        a [m].
    length, width
        The basin's [m]; with n = 0 the width does not matter.
    depth, gravity
        Still-water depth d [m] or ``inf``, and gravity g [m/s^2].
    modes
        (m, n): the numbers of half waves along x and y.
    order
        Order of the expansion, 1 to 3; errors are of the next order.
    origin
        Where the rectangle begins (x, y) [m].
    """

    amplitude: float
    length: float
    depth: float
    gravity: float = 9.81
    width: float = 1.0
    modes: tuple[int, int] = (1, 0)
    order: int = 3
    origin: tuple[float, float] = (0.0, 0.0)

    @property
    def wave_numbers(self) -> tuple[float, float]:
        """kappa_x and kappa_y [rad/m]."""
        return self.modes[0] * np.pi / self.length, self.modes[1] * np.pi / self.width

    @property
    def linear_frequency(self) -> float:
        """omega_0 [rad/s]."""
        return float(angular_frequency(np.hypot(*self.wave_numbers), self.depth, self.gravity))

    @property
    def frequency_shift(self) -> float:
        """omega_2 [rad/s/m^2]."""
        return self._expansion.frequency_shift

    @property
    def frequency(self) -> float:
        """Angular frequency omega [rad/s]: omega_0, in order three with a^2 omega_2."""
        shift = self.amplitude**2 * self.frequency_shift if self.order == 3 else 0.0
        return self.linear_frequency + shift

    @cached_property
    def elevation_coefficients(self) -> Array:
        """E_ijl [m], shape (4, 4, 4): eta = sum E_ijl cos(i kappa_x x) cos(j kappa_y y) cos(l omega t)."""
        return _halves(self._sum(self._expansion.eta)).real

    @cached_property
    def potential_coefficients(self) -> Array:
        """P_ijl [m²/s], shape (4, 4, 4): psi = sum P_ijl cos(i kappa_x x) cos(j kappa_y y) sin(l omega t)."""
        return -_halves(self._sum(self._expansion.psi)).imag

    @cached_property
    def _still_coefficients(self) -> Array:
        """S_ijl [m²/s], shape (4, 4, 4), of the potential at z = 0 as P_ijl of that at the surface."""
        return -_halves(self._sum(self._expansion.phi)).imag

    def elevation(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the elevation [m]."""
        return self._summed(self.elevation_coefficients, x, y, np.cos(self._phases(t)))

    def surface(self, x: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return the elevation [m] and the potential at the surface [m²/s], each to the order of the expansion."""
        psi = self._summed(self.potential_coefficients, x, y, np.sin(self._phases(t)))
        return self.elevation(x, t, y=y), psi

    def potential(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the potential [m²/s]."""
        cosh, _ = self._in_depth(z)
        return self._summed(self._still_coefficients, x, y, np.sin(self._phases(t)), cosh)

    def velocity(self, x: ArrayLike, z: ArrayLike, t: ArrayLike = 0.0, *, y: ArrayLike = 0.0) -> Array:
        """Return the velocity [m/s]."""
        sines, (cosh, sinh), (k_x, k_y) = np.sin(self._phases(t)), self._in_depth(z), self._numbers()
        parts = (-k_x, cosh, (1, 0)), (-k_y, cosh, (0, 1)), (np.hypot(k_x, k_y), sinh, (0, 0))
        each = (
            self._summed(factor[..., None] * self._still_coefficients, x, y, sines, depth, sine=sine)
            for factor, depth, sine in parts
        )
        return np.stack(np.broadcast_arrays(*each), axis=-1)

    def _phases(self, t: ArrayLike) -> Array:
        return np.asarray(np.multiply.outer(t, self.frequency * np.arange(_HARMONICS)))

    def _numbers(self) -> tuple[Array, Array]:
        """Return i kappa_x and j kappa_y [rad/m], each of shape (4, 4)."""
        k_x, k_y = np.multiply.outer(self.wave_numbers, np.arange(_HARMONICS))
        return k_x[:, None] + 0 * k_y, k_y + 0 * k_x[:, None]

    def _in_depth(self, z: ArrayLike) -> tuple[Array, Array]:
        return in_depth(np.hypot(*self._numbers()), np.asarray(z)[..., None, None], self.depth)

    def _summed(
        self,
        coefficients: Array,
        x: ArrayLike,
        y: ArrayLike,
        in_time: Array,
        in_z: ArrayLike = 1.0,
        *,
        sine: tuple[int, int] = (0, 0),
    ) -> Array:
        """Return the sum of products of cosines in x and y, or sines, with what is given in time and depth."""
        harmonics = np.arange(_HARMONICS)
        in_plan = (
            (np.sin if odd else np.cos)(np.multiply.outer(np.subtract(at, first), k * harmonics))
            for at, first, k, odd in zip((x, y), self.origin, self.wave_numbers, sine, strict=True)
        )
        depth = np.broadcast_to(in_z, (*np.shape(in_z)[:-2], _HARMONICS, _HARMONICS))
        return np.asarray(np.einsum("ijl,...i,...j,...l,...ij->...", coefficients, *in_plan, in_time, depth))

    def _sum(self, terms: tuple[Array, ...]) -> Array:
        return np.asarray(sum(self.amplitude**n * term for n, term in enumerate(terms[: self.order], start=1)))

    @cached_property
    def _expansion(self) -> "_Expansion":
        return _expansion(_SurfaceExpansion(self.wave_numbers, depth=self.depth, gravity=self.gravity))


class _Expansion(NamedTuple):
    """eta_n, psi_n and the potential phi_n at z = 0, n = 1 to 3, at the points in x, y and s, and omega_2."""

    eta: tuple[Array, ...]
    psi: tuple[Array, ...]
    phi: tuple[Array, ...]
    frequency_shift: float


class _SurfaceExpansion(DirichletNeumann):
    """The linear operators on functions at the points, arrays of shape (8, 8, 8) along x, y and s."""

    def __init__(self, wave_numbers: tuple[float, float], *, depth: float, gravity: float):
        index = np.fft.fftfreq(_POINTS, 1 / _POINTS)
        i, j, self.harmonic = np.meshgrid(index, index, index, indexing="ij")
        super().__init__((wave_numbers[0] * i, wave_numbers[1] * j), depth)
        self.gravity, self.omega = gravity, float(angular_frequency(np.hypot(*wave_numbers), depth, gravity))
        angles = 2 * np.pi / _POINTS * np.arange(_POINTS)
        x, y, s = np.meshgrid(angles, angles, angles, indexing="ij")
        plan = np.cos(x * (wave_numbers[0] > 0)) * np.cos(y * (wave_numbers[1] > 0))
        self.cosine: Array = plan * np.cos(s)
        self.sine: Array = plan * np.sin(s)

    def respond(self, F: Array, R: Array) -> tuple[Array, Array]:
        """Return eta and psi with omega eta_s - G_0 psi = F, omega psi_s + g eta = R.

        The first order's own frequency and the mean are left out of eta: that is what a and d mean.
        """
        F_hat, R_hat, turning = np.fft.fftn(F), np.fft.fftn(R), 1j * self.omega * self.harmonic
        determinant = -(turning**2) - self.gravity * self.G
        own = np.isclose(determinant, 0.0, atol=1e-9 * self.omega**2)
        by_both = (self.gravity * F_hat - turning * R_hat) / np.where(own, 1.0, determinant)
        psi_hat = np.where(own, -F_hat / np.where(self.G > 0, self.G, np.inf), by_both)
        eta_hat = np.where(own, 0.0, (R_hat - turning * psi_hat) / self.gravity)
        return np.fft.ifftn(eta_hat).real, np.fft.ifftn(psi_hat).real


def _expansion(water: _SurfaceExpansion) -> _Expansion:
    g, omega = water.gravity, water.omega
    eta_1, psi_1 = water.cosine, -g / omega * water.sine
    rise_1, slopes_1 = water.G_0(psi_1), water.slopes(psi_1)
    F = water.G_1(eta_1, psi_1)
    eta_2, psi_2 = water.respond(F, 0.5 * rise_1**2 - 0.5 * (slopes_1**2).sum(axis=0))
    slopes_2 = water.slopes(psi_2)
    rise_2 = water.G_0(psi_2) + F + (water.slopes(eta_1) * slopes_1).sum(axis=0)
    F = water.G_1(eta_2, psi_1) + water.G_1(eta_1, psi_2) + water.G_2(eta_1, psi_1)
    R = rise_1 * rise_2 - (slopes_1 * slopes_2).sum(axis=0)
    resonant = (F * water.sine).sum() + omega / g * (R * water.cosine).sum()
    shift = -0.5 * resonant / (water.sine**2).sum()
    eta_3, psi_3 = water.respond(F + shift * water.sine, R + shift * g / omega * water.cosine)
    phi_2 = psi_2 - eta_1 * rise_1  # psi is Taylor's series of phi from z = 0 on
    phi_3 = psi_3 - eta_1 * water.G_0(phi_2) - eta_2 * rise_1 - 0.5 * eta_1**2 * water.apply(water.K**2, psi_1)
    return _Expansion((eta_1, eta_2, eta_3), (psi_1, psi_2, psi_3), (psi_1, phi_2, phi_3), float(shift))


def _halves(f: Array) -> NDArray[np.complex128]:
    """Return the coefficients of cosines in x, y, and of exp(i l s) with Re = cos and -Im = sin, shape (4, 4, 4)."""
    positive = (np.fft.fftn(f) / f.size)[:_HARMONICS, :_HARMONICS, :_HARMONICS]
    twice = np.where(np.arange(_HARMONICS) > 0, 2.0, 1.0)
    return np.asarray(positive * np.einsum("i,j,l->ijl", twice, twice, twice))
