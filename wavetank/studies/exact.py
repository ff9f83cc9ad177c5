"""Exact solutions that computed surfaces are judged by: waves of permanent form, and linear standing waves.

Each has a carrier: a complex number C e^(-i omega t), found from a snapshot, whose angle is the phase.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from wavetank.case import LinearWater, Scene, StandingWave, StreamFunctionWave
from wavetank.errors import InputError
from wavetank.waves.conformal import SteadyWave
from wavetank.waves.standing_wave import ThirdOrderStandingWave
from wavetank.waves.wave import Array, Wave

LINEAR = 1e-4  # k a coth^3(k d) up to which a wave counts as linear: about its second harmonic, relative


class ExactSolution(Protocol):
    """A wave known for all times."""

    @property
    def wave(self) -> Wave:
        """What it is at all places and times."""

    @property
    def amplitude(self) -> float:
        """Half its height [m]."""

    def carrier(self, x: Array, eta: Array, psi: Array) -> complex:
        """Return C e^(-i omega t) [m] from eta [m] and psi [m²/s] at midpoints x of equal parts, shape (N,)."""

    def exact_carrier(self, t: float) -> complex:
        """Return what ``carrier`` is on the exact solution at time t [s]."""

    def crest_error(self, highest: float, carrier: complex) -> float:
        """Return the relative error of the crest, given the highest elevation [m] and the carrier of a snapshot."""


@dataclass(frozen=True)
class LinearStandingWave:
    """eta = a cos(k x) cos(omega t), psi = -g a / omega cos(k x) sin(omega t); omega² = g k tanh(k d).

    Its crest comes and goes, so that the crest's error is that of the carrier's size.
    """

    wave: ThirdOrderStandingWave

    @property
    def amplitude(self) -> float:
        """A [m]."""
        return self.wave.amplitude

    def carrier(self, x: Array, eta: Array, psi: Array) -> complex:
        """Return a e^(-i omega t)."""
        height = eta + 1j * self.wave.frequency / self.wave.gravity * psi
        return complex(2 * np.mean(height * np.cos(self.wave.wave_numbers[0] * x)))

    def exact_carrier(self, t: float) -> complex:
        """Return a e^(-i omega t)."""
        return complex(self.amplitude * np.exp(-1j * self.wave.frequency * t))

    def crest_error(self, highest: float, carrier: complex) -> float:
        """Return the relative error of the amplitude."""
        return abs(carrier) / self.amplitude - 1.0


@dataclass(frozen=True)
class TravellingWave:
    """eta(x - c t) of permanent form; the carrier is its first harmonic."""

    wave: SteadyWave
    amplitude: float
    k: float

    def carrier(self, x: Array, eta: Array, psi: Array) -> complex:
        """Return the first harmonic."""
        return complex(2 * np.mean(eta * np.exp(-1j * self.k * x)))

    def exact_carrier(self, t: float) -> complex:
        """Return the first harmonic, without its size, which no error rests on."""
        return complex(np.exp(-1j * self.k * self.wave.speed * t))

    def crest_error(self, highest: float, carrier: complex) -> float:
        """Return the relative error of the highest elevation."""
        return highest / float(self.wave.elevation(0.0)) - 1.0


def exact_solution(scene: Scene) -> ExactSolution:
    """Return the exact solution of a scene; raises ``InputError`` if none is known."""
    tank, initial = scene.tank, scene.initial
    for seen in scene.paddles:
        raise InputError(f"reference exact: {seen.key}.type = {seen.wall.type!r} received; the walls must be fixed.")
    if isinstance(initial, StreamFunctionWave) and not isinstance(scene.water, LinearWater):
        wave, k = initial.wave(tank), 2 * np.pi * initial.waves / tank.length
        crest, trough = wave.elevation([0.0, np.pi / k])
        return TravellingWave(wave, float(crest - trough) / 2, k)
    if not isinstance(initial, StandingWave):
        allowed = "standing-wave, low or in linear water, and stream-function in nonlinear water"
        raise InputError(f"reference exact: initial.type = {initial.type!r} received; exact are {allowed}.")
    k = np.pi * initial.mode / tank.length
    highest = LINEAR / k * np.tanh(k * tank.depth) ** 3
    if initial.wave_amplitude > highest and not isinstance(scene.water, LinearWater):
        raise InputError(
            f"reference exact: initial.wave_amplitude = {initial.wave_amplitude:g} received; it must be at most "
            f"{highest:.2g} m, up to which a standing wave is linear, or water.type must be 'linear'."
        )
    return LinearStandingWave(initial.wave(tank))
