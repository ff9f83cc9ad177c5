"""A segmented paddle's motion for an irregular sea of many directions: each component goes its own way.

One direction for each frequency, drawn from the spreading: so no two components stand against each other, and the sea
is alike all over. The snake's factor is cos(theta) / c (``wavetank.motion.oblique_wave``).

Source: M. D. Miles and E. R. Funke, "A comparison of methods for synthesis of directional seas", J. Offshore Mechanics
and Arctic Engineering 111, 1989.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from wavetank.motion.lines import Lines
from wavetank.motion.motion import Array, Motion, SegmentedMotion
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.wavemaker import Wavemaker

TABLED = 200  # places, at most, at which the motion is kept as a table
KEPT = 4  # sets of places
STEPS = 2001  # of a spreading


@dataclass(frozen=True, eq=False)
class DirectionalSea(SegmentedMotion):
    """A motion for any plane waves that leave the paddle.

    Attributes
    ----------
    target
        The waves, by linear theory: without a ramp or side walls.
    maker
        The paddle's shape.
    """

    target: PlaneWaves
    maker: Wavemaker
    _known: dict[bytes, Motion] = field(default_factory=dict, repr=False)

    @property
    def power_period(self) -> float:
        """That of any place [s]."""
        return self.at(np.zeros(1)).power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the sum of the components' derivatives; at few places from a table."""
        places = np.asarray(y, dtype=np.float64)
        key = places.tobytes()
        if key not in self._known:
            if len(self._known) >= KEPT:
                del self._known[next(iter(self._known))]
            lines = self.at(places)
            self._known[key] = lines.tabulated() if places.size <= TABLED else lines
        return self._known[key].derivative(t, order)

    def at(self, y: Array) -> Lines:
        """Return the motion of places y [m], shape (M,), as a sum of sines."""
        waves, k = self.target, np.hypot(self.target.k_x, self.target.k_y)
        b = 1j * waves.amplitudes * waves.k_x / k / self.maker.transfer(k, waves.depth)
        return Lines(waves.omega, b[:, None] * np.exp(1j * np.multiply.outer(waves.k_y, y)))


def drawn(density: Callable[[Array], Array], chance: Array, *, largest: float) -> Array:
    """Return directions [rad], shape (N,), of a density within the largest angle, for numbers from [0, 1)."""
    angles = np.linspace(-largest, largest, STEPS, dtype=np.float64)
    share = np.concatenate([[0.0], np.cumsum(0.5 * (density(angles[1:]) + density(angles[:-1])))])
    return np.asarray(np.interp(chance, share / share[-1], angles))
