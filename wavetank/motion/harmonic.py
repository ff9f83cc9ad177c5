"""Motions as sums of harmonics, generated for linear waves by the transfer function of the paddle.

For waves eta = Re sum A_j exp(i (k_x x + k_y y - omega_j t)) a paddle of mode shape f(z) has the motion

    X = Re sum i A_j k_x / (k c(k)) exp(i (k_y y - omega_j t)),

where c(k) is its transfer function, wave height over stroke (``wavetank.waves.wavemaker``). A uniform paddle makes
waves along x, k_y = 0. A segmented paddle makes oblique waves by the snake principle: each segment follows its
neighbour with a delay. The factor k_x / k = cos(theta) is the component of the velocity normal to the paddle.
Second-order generation adds the motion that suppresses free waves at sums and differences of frequencies
(``wavetank.waves.second_order``).

A sum of N sines is expensive at every stage of every step. ``HarmonicSum.tabulated`` evaluates it, in blocks of time,
by polynomials of degree 5 through position, velocity and acceleration at both ends of intervals h. With the sixth
derivative X^(6), their errors are at most

    h^6 / 46080 in X,    5^(1/2) h^5 / 30000 in X',    h^4 / 1920 in X''.

Sources: R. A. Dalrymple and M. Greenberg, "Directional wavemakers", in Physical Modelling in Coastal Engineering, 1985;
M. D. Miles and E. R. Funke, "A comparison of methods for synthesis of directional seas", J. Offshore Mechanics and
Arctic Engineering 111, 1989; G. Birkhoff and A. Priver, "Hermite interpolation errors for derivatives", J. Mathematics
and Physics 46, 1967.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavetank.motion.motion import Array, Motion
from wavetank.motion.recorded import hermite
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.second_order import Strokes, second_order
from wavetank.waves.wavemaker import Wavemaker

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Complex = NDArray[np.complex128]

TABLE_ERROR = 1e-6  # error of the table's acceleration over its largest possible value; of the position about 1e-10
FEW = 8  # number of sines up to which direct summation is as fast
BLOCK, TABLE_SIZE = 1024, 2**20  # intervals of a block; size of its table of phases
SUMMED = 16  # intervals whose tabulation costs as much as one direct summation
CACHED_NUMBERS, MIN_BLOCKS = 2**22, 4  # numbers in the cache of blocks (32 MB), and least number of blocks


@dataclass(frozen=True, eq=False)
class HarmonicSum:
    """A motion X = Re sum b_j exp(-i omega_j t).

    Attributes
    ----------
    omega
        Angular frequencies [rad/s], shape (N,).
    b
        Amplitudes [m], complex, shape (N,), or (N, M) for M positions along a paddle.
    """

    omega: Array
    b: Complex

    @property
    def power_period(self) -> float:
        """The period that halves the power of the velocity, counted from the longest period [s]."""
        ascending = np.argsort(self.omega)
        speeds = (self.omega * np.abs(self.b.T)).reshape(-1, self.omega.size)[:, ascending]
        power = np.cumsum((speeds**2).sum(axis=0))
        return float(2 * np.pi / self.omega[ascending][np.searchsorted(power, 0.5 * power[-1])])

    @property
    def step(self) -> float:
        """The interval h [s] of its table: h^4 / 1920 of the largest X^(6) is ``TABLE_ERROR`` of the largest X''."""
        size = np.abs(self.b).reshape(self.omega.size, -1).max(axis=1)
        second, sixth = (float(size @ self.omega**order) for order in (2, 6))
        return (1920 * TABLE_ERROR * second / sixth) ** 0.25 if sixth > 0.0 else 1.0

    def rates(self, t: Array, y: Any = None) -> Array:
        """Return X, X' and X'' at times [s], shape (T,): shape (3, T), or (3, T, M); the memory is proportional to N T.

        The order of summation, and with it the bits, do not depend on the number of times.
        """
        phasors = np.exp(-1j * np.multiply.outer(t, self.omega))
        orders = ((-1j * self.omega) ** order for order in range(3))
        if self.b.ndim == 1:
            return np.array([np.real((phasors * order * self.b).sum(axis=-1)) for order in orders])
        each = [[np.real(one @ self.b) for one in phasors * order] for order in orders]
        return np.array(each).reshape(3, t.size, self.b.shape[1])

    def motion(self) -> Motion:
        """Return the motion that sums all terms at each time."""
        return Motion(self.rates, power_period=self.power_period)

    def tabulated(self) -> Motion:
        """Return the motion from a table of blocks of time, the last of which are cached; few terms are summed."""
        if self.omega.size <= FEW:
            return self.motion()
        places = self.b.shape[1:]
        intervals = int(np.clip(TABLE_SIZE // self.omega.size, 16, BLOCK))
        knots = self.step * np.arange(intervals + 1)  # of the first block [s]
        phases = np.exp(-1j * np.multiply.outer(knots, self.omega))
        orders = [(-1j * self.omega) ** order for order in range(3)]

        @lru_cache(max(MIN_BLOCKS, CACHED_NUMBERS // (6 * intervals * (self.b.size // self.omega.size))))
        def block(number: int) -> "PPoly":
            begin = number * knots[-1]
            phased = np.exp(-1j * self.omega * begin) * self.b.T
            return hermite(begin + knots, *(np.real(phases @ (order * phased).T) for order in orders))

        def rates(t: Array, y: Any) -> Array:
            numbers = np.floor(t / knots[-1]).astype(np.int64)
            blocks = np.unique(numbers)
            if (
                blocks.size > 1 and blocks.size * knots.size > SUMMED * t.size
            ):  # times far apart: direct summation is as fast
                return self.rates(t)
            values = np.empty((3, t.size, *places))
            for number in blocks.tolist():
                here = numbers == number
                for order in range(3):
                    values[order, here] = block(number)(t[here], order)
            return values

        return Motion(rates, power_period=self.power_period)


# ---------------------------------------------------------------- motions for waves
SAME = 1e-9  # relative difference below which frequencies are equal
MAX_TABLED_PLACES = 200  # largest number of places with a table; at more, the motion is summed
MAX_CACHED_SETS = 4  # sets of places in the cache


def first_order_motion(waves: PlaneWaves, wavemaker: Wavemaker) -> HarmonicSum:
    """Return the motion of each wave, at y = 0."""
    k = np.hypot(waves.k_x, waves.k_y)
    return HarmonicSum(waves.omega, 1j * waves.amplitudes * (waves.k_x / k) / wavemaker.transfer(k, waves.depth))


def second_order_motion(waves: PlaneWaves, wavemaker: Wavemaker) -> HarmonicSum:
    """Return the motion for waves along x to second order; terms of equal frequencies are added."""
    first = first_order_motion(waves, wavemaker)
    ascending = np.argsort(first.omega)
    strokes = Strokes(first.omega[ascending], first.b[ascending])
    more = second_order(strokes, wavemaker, depth=waves.depth, gravity=waves.gravity)
    omega, b = np.concatenate([strokes.omega, more.omega]), np.concatenate([strokes.b, more.b])
    order = np.argsort(omega)
    starts = np.flatnonzero(np.diff(omega[order], prepend=-np.inf) > SAME * omega.max())
    return HarmonicSum(omega[order][starts], np.add.reduceat(b[order], starts))


def along_paddle(waves: PlaneWaves, wavemaker: Wavemaker, y: Array) -> HarmonicSum:
    """Return the motion of a segmented paddle at positions y [m], shape (M,), with one term for each frequency."""
    b = first_order_motion(waves, wavemaker).b
    omega, line = np.unique(waves.omega, return_inverse=True)
    order = np.argsort(line, kind="stable")
    each = np.split(order, np.flatnonzero(np.diff(line[order])) + 1)
    rows = [b[one] @ np.exp(1j * np.multiply.outer(waves.k_y[one], y)) for one in each]
    return HarmonicSum(omega, np.array(rows))


def snake_motion(waves: PlaneWaves, wavemaker: Wavemaker, power_period: float | None = None) -> Motion:
    """Return the motion of a segmented paddle for plane waves of any directions, without a ramp or side walls.

    It is evaluated from a table for few positions, and summed otherwise. The period that halves the power of its
    velocity [s] is by default that of all waves added incoherently.
    """

    @lru_cache(MAX_CACHED_SETS)
    def at(places: bytes) -> Motion:
        lines = along_paddle(waves, wavemaker, np.frombuffer(places))
        return lines.tabulated() if lines.b.shape[1] <= MAX_TABLED_PLACES else lines.motion()

    period = first_order_motion(waves, wavemaker).power_period if power_period is None else power_period
    return Motion(lambda t, y: at(np.asarray(y, dtype=np.float64).tobytes()).rates(t), power_period=period)
