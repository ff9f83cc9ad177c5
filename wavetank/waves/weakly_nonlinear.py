"""Weakly nonlinear waves along x: bound waves of second order, and the wave numbers of third order.

Bound waves of eta = Re sum A_n exp(i theta_n), with R = omega² / g and the sign s = +-1 of sums and differences:

    eta_2 = Re sum_nm B+_nm A_n A_m exp(i (theta_n + theta_m)) + B-_nm A_n A_m* exp(i (theta_n - theta_m)),
    4 B = (D - k_n k_m + s R_n R_m) / (R_n R_m)^(1/2) + R_n + R_m,
    D = r (R_m^(1/2) (k_n² - R_n²) + s R_n^(1/2) (k_m² - R_m²) + 2 r (k_n k_m - s R_n R_m)) / (r² - K tanh K d),
    r = R_n^(1/2) + s R_m^(1/2),   K = |k_n + s k_m|.

Waves of other frequencies and the waves' own change omega at a constant k, in deep water by omega_m k_n |A_m|² min(k_n,
k_m) for two waves and half of it for a wave itself. In a finite depth the long waves of groups oppose this: the
coefficient of the nonlinear Schrodinger equation over its limit in deep water is a factor for all waves.

Sources: J. N. Sharma and R. G. Dean, "Second-order directional seas and associated wave forces", SPE J. 21, 1981, as
written by G. Z. Forristall, J. Phys. Oceanogr. 30, 2000; M. S. Longuet-Higgins and O. M. Phillips, "Phase velocity
effects in tertiary wave interactions", J. Fluid Mech. 12, 1962; C. C. Mei, *The Applied Dynamics of Ocean Surface
Waves*, 1989, section 12.2.
"""

import numpy as np
from numpy.typing import NDArray

from wavetank.waves.airy import Array, angular_frequency, group_velocity, wave_number

Complex = NDArray[np.complex128]
DEEP = 20.0  # largest k d of hyperbolic functions


def interaction(omega: float, second: Array, sign: int, *, depth: float, gravity: float) -> Array:
    """Return B [1/m] of a wave and second ones, angular frequencies [rad/s], for sums (1) or differences (-1).

    At the difference of a frequency with itself it is 0. The shape is that of ``second``.
    """
    R, S = omega**2 / gravity, np.square(second) / gravity
    k, q = wave_number(omega, depth, gravity), wave_number(second, depth, gravity)
    r, K = np.sqrt(R) + sign * np.sqrt(S), np.abs(k + sign * q)
    both = np.sqrt(S) * (k**2 - R**2) + sign * np.sqrt(R) * (q**2 - S**2) + 2 * r * (k * q - sign * R * S)
    forced = r**2 - K * np.tanh(np.minimum(K * depth, DEEP))
    D = np.divide(r * both, forced, out=np.zeros(forced.shape), where=r != 0)
    return np.where(r != 0, (D - k * q + sign * R * S) / np.sqrt(R * S) + R + S, 0.0) / 4


def bound_waves(A: Complex, first: int, step: float, *, depth: float, gravity: float) -> Complex:
    """Return the bound waves [m], shape (gauges, 2 (first + N)), at the multiples 0, 1 ... of a step [rad/s].

    The waves A [m], shape (gauges, N), are at the multiples first, first + 1 ...; eta = Re sum A exp(i n step t).
    """
    numbers = np.arange(first, first + A.shape[1], dtype=np.float64)
    result = np.zeros((A.shape[0], 2 * (first + A.shape[1])), dtype=complex)
    for n in range(numbers.size):
        sums, differences = (
            interaction(numbers[n] * step, numbers[: n + 1] * step, sign, depth=depth, gravity=gravity)
            for sign in (1, -1)
        )
        sums[:n] *= 2  # a pair is two terms of the sum, a wave with itself is one
        one = A[:, n : n + 1]
        result[:, 2 * first + n : 2 * (first + n) + 1] += sums * one * A[:, : n + 1]
        result[:, n::-1] += 2 * differences * one * A[:, : n + 1].conj()
    return result


def wave_number_shift(omega: Array, sea: Array, squares: Array, *, depth: float, gravity: float) -> Array:
    """Return the increase of k [rad/m] at N angular frequencies [rad/s], shape (gauges, N): negative in deep water.

    The sea has ``squares`` |A|² [m²], shape (gauges, M), at angular frequencies ``sea``, with random phases.
    """
    k, q = wave_number(omega, depth, gravity), wave_number(sea, depth, gravity)
    deep = k[:, None] * sea * np.minimum(k[:, None], q)
    mean = float((squares * sea).sum() / squares.sum())
    factor = cubic_coefficient(float(wave_number(mean, depth, gravity)), depth=depth, gravity=gravity)
    return np.asarray(-factor * squares @ deep.T / group_velocity(k, depth, gravity))


def cubic_coefficient(k: float, *, depth: float, gravity: float) -> float:
    """Return the cubic coefficient of the nonlinear Schrodinger equation over that in deep water; k in rad/m.

    It changes its sign at k d = 1.363.
    """
    kd = min(k * depth, DEEP)
    omega, c = float(angular_frequency(k, depth, gravity)), float(group_velocity(k, depth, gravity))
    stokes = (np.cosh(4 * kd) + 8 - 2 * np.tanh(kd) ** 2) / (8 * np.sinh(kd) ** 4)
    current = (2 * omega * np.cosh(kd) ** 2 + k * c) ** 2 / (np.sinh(2 * kd) ** 2 * k**2 * (gravity * depth - c**2))
    return float(stokes - current)
