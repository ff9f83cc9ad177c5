"""Motions by the waves that they make, through the transfer function of the paddle (``wavetank.waves.wavemaker``).

Of waves eta = Re sum A_j exp(i (k_j x - omega_j t)) the motion is X = Re sum i A_j / c_j exp(-i omega_j t).
Second-order generation adds what keeps the paddle from making free waves at sums and differences of their
frequencies (``wavetank.waves.second_order``).
"""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavetank.motion.lines import Lines
from wavetank.motion.motion import Motion
from wavetank.waves.plane_waves import PlaneWaves
from wavetank.waves.second_order import Strokes, second_order
from wavetank.waves.wavemaker import Wavemaker

SAME = 1e-9  # relative: frequencies that differ by less are one line


class WaveMotion(Motion):
    """A motion that makes waves by linear theory.

    Attributes
    ----------
    maker
        The paddle's shape.
    """

    maker: Wavemaker

    @property
    @abstractmethod
    def target(self) -> PlaneWaves:
        """The waves to be made, all along x, by linear theory: without a ramp and without evanescent modes."""

    @cached_property
    def lines(self) -> Lines:
        """The motion as a sum of sines."""
        waves = self.target
        return Lines(waves.omega, 1j * waves.amplitudes / self.maker.transfer(waves.k_x, waves.depth))

    @cached_property
    def second_order_lines(self) -> Lines:
        """The motion with what second-order generation adds, as a sum of sines; equal frequencies are gathered."""
        waves, first = self.target, self.lines
        ascending = np.argsort(first.omega)
        strokes = Strokes(first.omega[ascending], first.b[ascending])
        more = second_order(strokes, self.maker, depth=waves.depth, gravity=waves.gravity)
        omega, b = np.concatenate([strokes.omega, more.omega]), np.concatenate([strokes.b, more.b])
        order = np.argsort(omega)
        starts = np.flatnonzero(np.diff(omega[order], prepend=-np.inf) > SAME * omega.max())
        return Lines(omega[order][starts], np.add.reduceat(b[order], starts))

    @property
    def power_period(self) -> float:
        """That of the sum [s]."""
        return self.lines.power_period

    def derivative(self, t: Any, order: int, y: Any = None) -> Any:
        """Return the sum of the components' derivatives; memory for an array of times is components times its size."""
        return self.lines.derivative(t, order)


@dataclass(frozen=True, eq=False)
class Sea(WaveMotion):
    """A motion for any waves along x.

    Attributes
    ----------
    waves
        The waves.
    maker
        The paddle's shape.
    """

    waves: PlaneWaves
    maker: Wavemaker

    @property
    def target(self) -> PlaneWaves:
        """The waves."""
        return self.waves
