"""Directions: the fan in which waves meet, and how much of them comes from where."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from wavetank.motion.motion import Array


@dataclass(frozen=True)
class Fan:
    """Equally spaced directions theta_m, |theta_m| <= largest, with shares that go with cos^2s(theta / 2).

    With s = 0 all have the same share. Source: M. S. Longuet-Higgins, D. E. Cartwright and N. D. Smith, "Observations
    of the directional spectrum of sea waves using the motions of a floating buoy", Ocean Wave Spectra, 1963.

    Attributes
    ----------
    largest
        The angle of the outermost directions from the x axis [rad], less than pi / 2.
    count
        How many; with one, it is theta = 0.
    exponent
        s.
    """

    largest: float
    count: int
    exponent: float = 0.0

    @cached_property
    def angles(self) -> Array:
        """theta_m [rad], shape (count,), ascending, positive towards y."""
        if self.count == 1:
            return np.zeros(1)
        return np.linspace(-self.largest, self.largest, self.count, dtype=np.float64)

    @cached_property
    def shares(self) -> Array:
        """D_m, shape (count,), of sum 1."""
        density = np.cos(self.angles / 2.0) ** (2.0 * self.exponent)
        return np.asarray(density / density.sum())
