"""A motion by a function of a user's."""

from typing import Any

import numpy as np

from wavetank.errors import InputError
from wavetank.motion.motion import Array, Motion
from wavetank.values.python_file import PythonFunction

NEAR = 1e-4  # s: times that far apart are close against any wave's period
TRUE = 1e-3  # of the largest: derivatives that are farther from differences are refused


class Programmed(Motion):
    """X by a function of times t [s] and an order: X itself [m], or its derivative in time of order 1 or 2."""

    def __init__(self, function: PythonFunction):
        self._function = function

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the function's value; raises ``InputError`` if it cannot be had."""
        values = self._function.at({"t": np.asarray(t, dtype=np.float64)}, order)
        return values if values.ndim else float(values)

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where a derivative is not that of the order below it, by differences at times [s]."""
        for order in (1, 2):
            below, above = (self.derivative(times + step, order - 1) for step in (-NEAR, NEAR))
            given, differences = self.derivative(times, order), (above - below) / (2 * NEAR)
            off = np.abs(given - differences)
            if (off > TRUE * np.abs(differences).max() + 1e-9).any():
                worst = int(off.argmax())
                allowed = f"by differences of order {order - 1} it must be {differences[worst]:.6g}"
                when = f"t = {times[worst]:.6g} s"
                raise InputError(f"its derivative of order {order} at {when} is {given[worst]:.6g}; {allowed}.")
