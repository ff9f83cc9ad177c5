"""A measured motion: one cubic spline through a record of positions or of velocities, or one of degree 5 through both.

The record that a run keeps of its paddle has positions, velocities and accelerations: the spline takes all of them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from wavetank.errors import InputError
from wavetank.motion.motion import Array, Motion
from wavetank.motion.pieces import Pieces, hermite

ROWS = 8  # of a record whose noise is known
DEGREE, PIECES = 5, 2.5  # of a spline of least squares; of it in the period of the fastest that it takes


@dataclass(frozen=True, eq=False)
class Recorded(Motion):
    """X(t) from one spline; before the record starts the paddle stands still where the record starts.

    Build it with ``of_positions``, ``of_velocities`` or ``of_states``. Asking for times beyond the record raises
    ``InputError``.

    Attributes
    ----------
    spline
        X(t) [m] as piecewise polynomials; its breakpoints are the record's times.
    measured
        Whether its rows have noise.
    """

    spline: Pieces
    measured: bool = True

    @classmethod
    def of_positions(cls, t: Array, X: Array, *, highest: float | None = None) -> "Recorded":
        """Return the cubic spline through positions X [m] at times t [s], ascending, shapes (N,), N >= 4.

        What is faster than the ``highest`` frequency [Hz] is left out. Raises ``InputError`` where rows are too few.
        """
        return cls(_pieces(_through(t, X, highest)))

    @classmethod
    def of_velocities(cls, t: Array, velocity: Array, *, highest: float | None = None) -> "Recorded":
        """Return the integral, zero at t[0], of the cubic spline through velocities [m/s] at t [s], shapes (N,).

        What is faster than the ``highest`` frequency [Hz] is left out. Raises ``InputError`` where rows are too few.
        """
        return cls(_pieces(_through(t, velocity, highest).antiderivative()))

    @classmethod
    def of_states(cls, t: Array, X: Array, velocity: Array, acceleration: Array) -> "Recorded":
        """Return the motion that has positions [m], velocities and accelerations at t [s], all of shape (N,)."""
        return cls(hermite(t, X, velocity, acceleration), measured=False)

    @property
    def start(self) -> float:
        """When the record starts [s]."""
        return float(self.spline.x[0])

    @property
    def duration(self) -> float:
        """When the record ends [s]."""
        return float(self.spline.x[-1])

    @property
    def interval(self) -> float | None:
        """The mean time between two rows of the record [s], if it was measured."""
        return float(np.mean(np.diff(self.spline.x))) if self.measured else None

    @property
    def noise(self) -> tuple[float, float] | None:
        """The share of the acceleration's variance above half the rows' Nyquist frequency, and that frequency [Hz].

        None if the record was not measured, or has fewer than eight rows.
        """
        step = self.interval
        if step is None or self.spline.x.size < ROWS:
            return None
        t = np.arange(self.start, self.duration, step)
        power = np.abs(np.fft.rfft(self.spline.derivative(t, 2) * np.hanning(t.size))) ** 2
        fast = float(power[power.size // 2 :].sum())
        return fast / max(float(power.sum()), np.finfo(float).tiny), 0.25 / step

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the spline's derivative; raise ``InputError`` beyond the record."""
        self._check(t)
        if isinstance(t, float) and t >= self.start:
            return self.spline.derivative(t, order)
        value = self.spline.derivative(np.maximum(t, self.start), order)
        return value if order == 0 else value * np.greater_equal(t, self.start)

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the spline's derivatives; raise ``InputError`` beyond the record."""
        if not isinstance(t, float) or t < self.start:
            return super().rates(t, y, up_to=up_to)
        self._check(t)
        return self.spline.rates(t)[: up_to + 1]

    def _check(self, t: Any) -> None:
        # The last of many steps may end a rounding error late; the spline is smooth enough to go on that far.
        last = t if isinstance(t, float) else np.max(t)
        if last > self.duration + 1e-9 * max(1.0, abs(self.duration)):
            raise InputError(f"paddle motion: t = {last:g} s asked for; the record ends at {self.duration:g} s.")


def _pieces(spline: "scipy.interpolate.PPoly") -> Pieces:
    return Pieces(spline.c, spline.x)


def _through(t: Array, values: Array, highest: float | None) -> "scipy.interpolate.PPoly":
    """Return the cubic spline through values; up to a frequency [Hz] the one of degree 5 of least squares."""
    if highest is None:
        return scipy.interpolate.CubicSpline(t, values)
    begin, end = float(t[0]), float(t[-1])
    pieces = max(1, int(np.ceil(PIECES * highest * (end - begin))))
    if pieces + DEGREE > t.size / 2:
        most = (t.size / 2 - DEGREE) / (PIECES * (end - begin))
        raise InputError(f"{highest:g} Hz received; must be at most {most:.3g} Hz, a fifth of the rows of a second")
    knots = np.linspace(begin, end, pieces + 1, dtype=np.float64)
    knots = np.concatenate([[begin] * DEGREE, knots, [end] * DEGREE])
    rows = (np.ascontiguousarray(one) for one in (t, values))
    found = scipy.interpolate.PPoly.from_spline(scipy.interpolate.make_lsq_spline(*rows, knots, k=DEGREE))
    inside = slice(DEGREE, -DEGREE)  # its first and last knots are several
    return scipy.interpolate.PPoly(found.c[:, inside], found.x[inside])
