"""Waves that the water at the surface carries along: what a stage of steep ones needs beyond linear waves.

With V and B the horizontal and vertical velocity of the water at the surface, small disturbances eta and
chi = psi - B eta of a state obey, but for a small change of gravity,

    d eta/dt = G chi - d(V eta)/dx,     d chi/dt = -g eta - V d chi/dx

(Alinhac's good unknown; Lannes, J. Amer. Math. Soc. 18, 2005). G is near that of still water, and a stage's derivative
nearly that of linear waves on still water times 1 + a (V d/dx), which is inverted by its series.
"""

from typing import NamedTuple, Protocol

import numpy as np

from wavetank.arrays import Vector
from wavetank.fe.surface_points import SurfacePoints
from wavetank.hamiltonian.contract import Stage
from wavetank.hamiltonian.stage_solver import Preconditioner
from wavetank.water.still_water import WavesOverStillWater

TERMS = 2  # of the series
LARGEST = 0.5  # of a V k with the wave number k = pi p / l of the mesh, for which the series still serves


class Surface(NamedTuple):
    """The surface of a state: elevation [m], potential [m²/s] and dQ/dt, shape (owned,) each."""

    eta: Vector
    psi: Vector
    rate: Vector


class Waves(WavesOverStillWater, Protocol):
    """What is asked of waves beyond their space and matrices."""

    def seen(self) -> Surface | None:
        """Return the surface of the point last evaluated, if that is known."""


class CarriedWaves:
    """Approximate inverse of the coupled implicit stage of nonlinear waves along a slice or ring.

    Parameters
    ----------
    still
        That of linear waves on still water.
    """

    def __init__(self, waves: Waves, still: Preconditioner):
        self._waves, self._still, self._points = waves, still, SurfacePoints(waves.plane)
        self._shortest = waves.plane.cell_size / (np.pi * waves.plane.order)
        self._t = np.nan  # of the stage for which the velocities were found
        self._V: Vector = np.zeros(0)  # at the points
        self._B: Vector = np.zeros(waves.plane.owned)
        self._known = False  # both

    def __call__(self, stage: Stage, residual: Vector) -> Vector:
        """Return the preconditioned residual, shape (2 owned,); collective."""
        if stage.t != self._t:
            self._t = stage.t
            self._look(LARGEST * self._shortest / abs(stage.weight))
        if not self._known:
            return self._still(stage, residual)
        mass, a = self._waves.mass, stage.weight
        q, psi = residual.reshape(2, -1)
        q, chi = self._still(stage, np.concatenate([q, psi - self._B * mass.solve(q)])).reshape(2, -1)
        first = q, chi
        for _ in range(TERMS):
            q, chi = first[0] + a * self._out_of(q), first[1] - a * self._along(chi)
        return np.concatenate([q, chi + self._B * mass.solve(q)])

    def _look(self, most: float) -> None:
        """Find the velocities at the surface of the point last evaluated, cut off at so much [m/s]; collective."""
        surface = self._waves.seen()
        self._known = surface is not None
        if surface is None:
            return
        at, solve = self._points, self._waves.mass.solve
        slope, psi_x, rate = at.slopes(surface.eta), at.slopes(surface.psi), at.values(solve(surface.rate))
        B = (rate + slope * psi_x) / (1 + slope**2)
        self._V, self._B = (np.clip(one, -most, most) for one in (psi_x - B * slope, solve(at.integral(B))))

    def _out_of(self, q: Vector) -> Vector:
        """Return int V eta dv/dx for the masses of eta; collective."""
        return self._points.carried(self._V, self._waves.mass.solve(q), along=False)

    def _along(self, chi: Vector) -> Vector:
        """Return V dchi/dx; collective."""
        return self._waves.mass.solve(self._points.carried(self._V, chi, along=True))
