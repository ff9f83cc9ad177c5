"""Motions that are sums of many sines, and the spline that they are tabulated in.

A sum of N sines costs N sines at every stage of every step. ``Tabulated`` has it, block by block of time as they are
asked for, as the polynomials of degree 5 that take the sum's position, velocity and acceleration at both ends of
intervals h.
Of X^(6), the sixth derivative, they miss at most

    h^6 / 46080 in X,    5^(1/2) h^5 / 30000 in X',    h^4 / 1920 in X''.

Source: G. Birkhoff and A. Priver, "Hermite interpolation errors for derivatives", J. Mathematics and Physics 46, 1967.
"""

import cmath
from dataclasses import dataclass, field
from functools import cached_property
from operator import mul
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavetank.motion.motion import Array, Motion
from wavetank.motion.pieces import Pieces, hermite

Complex = NDArray[np.complex128]

MISSED = 1e-6  # of the acceleration's largest possible value, at most, by the table: of the position some 1e-10
FEW = 8  # sines that are as soon summed
BLOCK, MOST = 1024, 2**20  # intervals of a block; numbers of its table of phases
SUMMED = 16  # intervals that are tabulated while the sines are summed once
KEPT, LEAST = 2**22, 4  # numbers of the blocks that are kept, 32 MB; blocks, however large


@dataclass(frozen=True, eq=False)
class Lines(Motion):
    """X = Re sum b_j exp(-i omega_j t).

    Attributes
    ----------
    omega
        Angular frequencies [rad/s], shape (N,).
    b
        Amplitudes [m], complex, shape (N,), or (N, M) for M fixed places along a paddle.
    """

    omega: Array
    b: Complex

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the derivatives' sum; memory for an array of times is N times its size."""
        phasors = np.exp(-1j * np.multiply.outer(t, self.omega))
        return np.real((phasors * (-1j * self.omega) ** order) @ self.b)[()]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the derivatives' sums; of few sines by numbers of Python's, which take a tenth of the time."""
        if not isinstance(t, float) or self.b.ndim > 1 or self.b.size > FEW:
            return super().rates(t, y, up_to=up_to)
        ways, rates = self._numbers
        phasors = [cmath.exp(t * way) for way in ways]
        return [sum(map(mul, phasors, rate)).real for rate in rates[: up_to + 1]]

    @cached_property
    def _numbers(self) -> tuple[list[complex], list[list[complex]]]:
        """-i omega_j, and the amplitudes of X and its derivatives."""
        ways = -1j * self.omega
        return [*map(complex, ways)], [[*map(complex, ways**order * self.b)] for order in range(3)]

    @property
    def power_period(self) -> float:
        """The period of the line at which half of the velocity's power is reached, from the longest on [s]."""
        ascending = np.argsort(self.omega)
        speeds = (self.omega * np.abs(self.b.T)).reshape(-1, self.omega.size)[:, ascending]
        power = np.cumsum((speeds**2).sum(axis=0))
        return float(2 * np.pi / self.omega[ascending][np.searchsorted(power, 0.5 * power[-1])])

    @property
    def step(self) -> float:
        """The interval h [s] of its table: h^4 / 1920 of the largest X^(6) is ``MISSED`` of the largest X''."""
        size = np.abs(self.b).reshape(self.omega.size, -1).max(axis=1)
        second, sixth = (float(size @ self.omega**order) for order in (2, 6))
        return (1920 * MISSED * second / sixth) ** 0.25 if sixth > 0.0 else 1.0

    def tabulated(self) -> Motion:
        """Return the same from a table; few sines as they are."""
        return self if self.omega.size <= FEW else Tabulated(self)


@dataclass(frozen=True, eq=False)
class Tabulated(Motion):
    """A sum of sines from a table of blocks of time, of which the last few are kept.

    Attributes
    ----------
    lines
        The sum.
    """

    lines: Lines
    _blocks: dict[int, Pieces] = field(default_factory=dict, repr=False)

    @property
    def power_period(self) -> float:
        """That of the sum [s]."""
        return self.lines.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the spline's derivative."""
        if isinstance(t, float) or np.ndim(t) == 0:
            return self._block(int(t // self._span)).derivative(t, order)
        times = np.asarray(t, dtype=np.float64)
        flat = times.ravel()
        which = np.floor(flat / self._span).astype(np.int64)
        blocks = np.unique(which)
        if blocks.size > 1 and blocks.size * self._intervals > SUMMED * flat.size:  # far apart, they are as soon summed
            return self.lines.derivative(t, order)
        values = np.empty((flat.size, *self.lines.b.shape[1:]))
        for block in blocks:
            here = which == block
            values[here] = self._block(int(block)).derivative(flat[here], order)
        return values.reshape(times.shape + self.lines.b.shape[1:])[()]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the spline's derivatives."""
        if not isinstance(t, float):
            return super().rates(t, y, up_to=up_to)
        number = int(t // self._span)
        return self._block(number).rates(t)[: up_to + 1]

    @cached_property
    def _intervals(self) -> int:
        """Of a block."""
        return int(np.clip(MOST // self.lines.omega.size, 16, BLOCK))

    @cached_property
    def _span(self) -> float:
        """How long a block is [s]."""
        return self._intervals * self.lines.step

    @cached_property
    def _kept(self) -> int:
        """How many blocks are kept."""
        return max(LEAST, KEPT // (6 * self._intervals * (self.lines.b.size // self.lines.omega.size)))

    @cached_property
    def _turns(self) -> Complex:
        """exp(-i omega t) at the knots of the first block, shape (knots, N)."""
        knots = self.lines.step * np.arange(self._intervals + 1)
        return np.asarray(np.exp(-1j * np.multiply.outer(knots, self.lines.omega)))

    def _block(self, number: int) -> Pieces:
        if number not in self._blocks:
            if len(self._blocks) >= self._kept:
                del self._blocks[next(iter(self._blocks))]
            begin, omega, b = number * self._span, self.lines.omega, self.lines.b
            turned = (np.exp(-1j * omega * begin) * b.T).T
            rates = ((((-1j * omega) ** order) * turned.T).T for order in range(3))
            values = [np.real(self._turns @ rate) for rate in rates]
            self._blocks[number] = hermite(begin + self.lines.step * np.arange(self._intervals + 1), *values)
        return self._blocks[number]
