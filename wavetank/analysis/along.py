"""Waves along a tank, told apart by their wave numbers: A(x) = Σ a_j e^(i k_j x) by least squares over gauges.

A is the complex amplitude of one frequency, of a wave a cos(k x - ω t + ε) a e^(i (k x + ε)); one that goes back has a
negative wave number.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Complex = NDArray[np.complex128]
Array = NDArray[np.float64]


class Along(NamedTuple):
    """Waves told apart.

    Attributes
    ----------
    amplitudes
        a_j, shape (waves,), as those of A.
    rest
        Root mean square of what they leave of A, a number.
    condition
        How much more an error of A can be in the amplitudes: the condition number of the least squares.
    """

    amplitudes: Complex
    rest: float
    condition: float


def told_apart(components: ArrayLike, x: ArrayLike, wave_numbers: ArrayLike) -> Along:
    """Return the waves of some wave numbers [rad/m] in components A of shape (gauges,) at x [m] of that shape."""
    A, places, numbers = np.asarray(components, dtype=complex), np.asarray(x, float), np.asarray(wave_numbers, float)
    waves = np.exp(1j * np.outer(places, numbers))
    amplitudes = np.linalg.lstsq(waves, A, rcond=None)[0]
    rest = np.sqrt(np.mean(np.abs(A - waves @ amplitudes) ** 2))
    return Along(amplitudes, float(rest), float(np.linalg.cond(waves)))
