"""Continuous interior penalty: takes the kinks between cells out of eta and psi, where they would grow.

    (M_J + kappa S) v' = M_J v,     S = sum over facets of [[dv/dn]] [[du/dn]],     kappa = epsilon dt omega_g l³ / p⁴

for v = eta and psi, the derivatives those in physical space (water/walls/): where the mapping of a moving wall has a
kink, a smooth surface has one in the reference tank, and must keep it. l is the cell size and omega_g the frequency of
the shortest wave on it, k_g = pi p / l. Where the current u under a steep crest overtakes short waves, k > g / u²,
those have negative energy, and the kinks of elements that are only continuous couple them to the others: both grow,
whatever the time step. On a smooth field of order p kinks vanish like l^p, so that what the penalty takes vanishes like
l^(2 p). Elements of order 1 need none. Measured in docs/extremes.md: with this scaling one strength serves p = 2 to 5,
kd = 0.5 to 8, and 12 to 128 cells a wave.
"""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from wavetank.arrays import Vector
from wavetank.fem.kinks import KinkSmoothing
from wavetank.fem.mass import BandedMass
from wavetank.tank.seen import State
from wavetank.tank.smoothing import Smoother, Smoothing
from wavetank.tank.surface_flow import SurfaceVelocity
from wavetank.tank.waves import NonlinearWaves

NEEDED = 1.5  # u² k_g / g; growth was found from 2.1 on, none below
STRENGTH = 0.25  # epsilon: 0.08 to 0.8 serve; more makes waves of negative energy grow


class EdgePenalty(Smoothing):
    """The penalty for one step size, applied only while it is needed.

    Parameters
    ----------
    waves
        The water.
    flow
        Its surface, updated here.
    cell_size
        l [m].
    dt
        Step [s].
    strength
        epsilon [-].
    threshold
        Of u² k_g / g; 0 for always.
    """

    called, cure = "the edge penalty", "finer cells lose less, unless waves break"

    def __init__(
        self,
        waves: NonlinearWaves,
        flow: SurfaceVelocity,
        *,
        cell_size: float,
        dt: float,
        strength: float = STRENGTH,
        threshold: float = NEEDED,
    ):
        plane, k = waves.plane, shortest_wave_number(waves, cell_size)
        rate, n = shortest_wave_frequency(waves, cell_size), ufl.FacetNormal(plane.mesh)
        self._kappa = strength * abs(dt) * rate * cell_size**3 / plane.order**4
        kappa = fem.Constant(plane.mesh, self._kappa)
        facets = ufl.dS(domain=plane.mesh, metadata={"quadrature_degree": 2 * plane.order})

        def penalty(u: Any, v: Any) -> ufl.Form:
            one, other = (ufl.jump(waves.wall.mapping.gradient(f, waves.densities.eta), n) for f in (u, v))
            return kappa * one * other * facets

        super().__init__(waves, penalty, by_wall=True)
        self._flow = flow
        self._fast = float(np.sqrt(threshold * waves.gravity / k)) if plane.order > 1 else np.inf  # so it is needed

    def _made(self) -> Smoother:
        """Return it written out along a slice on one rank, unless the wall's shape stretches what it carries."""
        plane, mass, wall = self._waves.plane, self._waves.mass, self._waves.wall
        if not isinstance(mass, BandedMass) or plane.mesh.geometry.dim > 1 or wall.leans:
            return super()._made()
        shift = next((far for far, _ in wall.shifts), None)
        return KinkSmoothing(plane, mass, strength=self._kappa, shift=shift)

    def needed(self, state: State, t: float) -> bool:
        """Return whether the current overtakes the shortest waves by so much; never with p = 1; collective."""
        self._flow.near(state, t)
        if self._flow.largest_velocity <= self._fast:
            return False
        if self._waves.wall.moves:
            self._waves.set_time(t)
            self.update()
        return True

    def generator(self) -> Vector:
        """Return M^-1 kappa S as a dense matrix, on one rank: for small tanks only."""
        units = np.eye(self._waves.plane.owned)
        return np.array([self._waves.mass.solve(self._smoother.apply(unit)) for unit in units]).T


def shortest_wave_number(waves: NonlinearWaves, cell_size: float) -> float:
    """Return k_g = pi p / l of cells of size l [m], in 1/m."""
    return float(np.pi * waves.plane.order / cell_size)


def shortest_wave_frequency(waves: NonlinearWaves, cell_size: float) -> float:
    """Return omega_g, omega_g² = g k_g tanh(k_g d), of cells of size l [m], in rad/s."""
    k = shortest_wave_number(waves, cell_size)
    return float(np.sqrt(waves.gravity * k * np.tanh(k * waves.depth)))
