"""Start values for the iterations: what has just been solved says where the next solution lies.

``Extrapolation`` continues the values of one stage polynomially in time; the degree is the one that would have
predicted the newest value best, so that it follows the smoothness of the motion by itself.
"""

from collections import deque
from collections.abc import Callable

import numpy as np

from wavetank.hamiltonian.contract import Vector


def lagrange_weights(nodes: list[float], t: float) -> Vector:
    """Return the weights w with f(t) = sum_i w_i f(nodes_i) for polynomials of degree < len(nodes)."""
    x = np.asarray(nodes)
    weights = [np.prod((t - np.delete(x, i)) / (x[i] - np.delete(x, i))) for i in range(x.size)]
    return np.asarray(weights)


class Extrapolation:
    """Polynomial extrapolation in time of one stage's values.

    Parameters
    ----------
    norm
        The norm in which predictions are judged; collective.
    most
        How many earlier values are kept; the degree is below that.
    """

    def __init__(self, norm: Callable[[Vector], float], most: int = 6):
        self._norm = norm
        self._times: deque[float] = deque(maxlen=most)
        self._values: deque[Vector] = deque(maxlen=most)
        self._dt = np.nan
        self._count = 0  # values that take part in the next prediction

    def predict(self, t: float, dt: float) -> Vector | None:
        """Return the value expected at t [s], or None if the earlier values do not lead there in steps of dt."""
        if not self._times or dt != self._dt or abs(t - self._times[-1] - dt) > 1e-6 * abs(dt):
            self._times.clear()
            self._values.clear()
            self._count, self._dt = 0, dt
            return None
        return self._combine(self._count, t)

    def _combine(self, count: int, t: float) -> Vector:
        times, values = list(self._times)[-count:], list(self._values)[-count:]
        weights = lagrange_weights(times, t)
        return np.asarray(sum(w * value for w, value in zip(weights, values, strict=True)))

    def record(self, t: float, value: Vector) -> None:
        """Add the value found at t [s] and choose how many values the next prediction uses."""
        errors = [self._norm(self._combine(count, t) - value) for count in range(1, len(self._values) + 1)]
        self._count = 1 + int(np.argmin(errors)) if errors else 1
        if self._count == len(errors):
            self._count += 1  # the longest was best: let it grow
        self._times.append(t)
        self._values.append(value.copy())
        self._count = min(self._count, len(self._values))
