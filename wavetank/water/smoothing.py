"""Implicit smoothing of the water's state: symmetric, exactly mass-conserving, its energy counted."""

from collections.abc import Callable
from typing import Any

import numpy as np
import ufl

from wavetank.fe.mass import HorizontalMatrix
from wavetank.hamiltonian.contract import Vector
from wavetank.water.waves import NonlinearWaves


class Smoothing:
    """v' = (M + N)^-1 M v for the column h and the surface potential psi, N symmetric with zero row sums.

    Parameters
    ----------
    waves
        The water.
    form
        The bilinear form of N in UFL, given trial and test function.

    Attributes
    ----------
    energy_taken
        So far [m^4/s²].
    """

    def __init__(self, waves: NonlinearWaves, form: Callable[[Any, Any], ufl.Form]):
        plane = waves.plane
        self._waves, self._mass = waves, HorizontalMatrix(plane, lambda u, v: u * v * plane.dx)
        self._form = HorizontalMatrix(plane, form)
        self._implicit = HorizontalMatrix(plane, lambda u, v: u * v * plane.dx + form(u, v))
        self.energy_taken = 0.0

    def update(self) -> None:
        """Assemble N for the present values of what its form depends on; collective."""
        self._form.update()
        self._implicit.update()

    def _smoothed(self, v: Vector) -> Vector:
        return self._implicit.solve(self._mass.apply(v))

    def coordinate(self, q: Vector) -> Vector:
        """Return Q - N h': its sum, the mass, is that of Q; collective."""
        return np.asarray(q - self._form.apply(self._smoothed(self._waves.mass.solve(q))))

    def momentum(self, p: Vector) -> Vector:
        """Return psi'; collective."""
        return self._smoothed(p)

    def account(self, before: float, after: float) -> None:
        """Add what has been taken."""
        self.energy_taken += before - after
