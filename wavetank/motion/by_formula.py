"""A motion by a formula of t."""

from typing import Any

import numpy as np

from wavetank.motion.motion import Array, Motion
from wavetank.values.formula import Formula


class ByFormula(Motion):
    """X(t) as given, with its derivatives by the chain rule."""

    def __init__(self, formula: Formula):
        self._formula = formula

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the formula's derivative; raises ``InputError`` where it is not finite."""
        return self._formula.derivative(order, t)[()]

    def rates(self, t: Any, y: Any = None, *, up_to: int = 2) -> list[Any]:
        """Return the formula's derivatives, found as one; raises ``InputError`` where one is not finite."""
        return [values[()] for values in self._formula.derivatives(t, *range(up_to + 1))]

    def check(self, times: Array) -> None:
        """Raise ``InputError`` where the formula or a derivative is not finite, at times [s] or at first."""
        self.rates(np.append(0.0, times))
