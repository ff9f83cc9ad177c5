"""Velocity, acceleration and pressure in the water: gradients of potentials, and Bernoulli's sum.

Density divided out, with phi_t the rate of the potential at fixed points in space,

    velocity = grad phi,   local acceleration = grad phi_t,   pressure = -(B + g z),   B = phi_t + 1/2 |grad phi|^2,

and the acceleration of a particle is grad B, for the flow has no vorticity. Of the rate phi' at places of the reference
tank, which are carried with the velocity c,

    phi_t = phi' - c . grad phi.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.tank.rates import MovingWater
from wavetank.tank.velocity import Velocity


class Layers(NamedTuple):
    """What the water does at the levels, of all degrees of freedom that this rank sees.

    Attributes
    ----------
    velocity
        Along, across and upwards [m/s], shape (levels, rows, 3).
    rate, head
        phi_t and B [m²/s²], shape (levels, rows).
    """

    velocity: Vector
    rate: Vector
    head: Vector


class Kinematics:
    """What water does near some cells, at the Gauss nodes of its columns.

    Parameters
    ----------
    cells
        This rank's cells, all that lie around those where it is asked for; two rings for accelerations.
    """

    def __init__(self, water: MovingWater, cells: NDArray[np.int32]):
        self.water, plane, components = water, water.plane, water.vertical.n + 1
        self.levels = water.vertical.zeta
        self._velocity = Velocity(water, cells=cells)
        self._potentials = [plane.layered_function(components, name) for name in ("phi_t", "B")]
        self._gradients = [Velocity(water, potential=one, cells=cells) for one in self._potentials]
        self._to_modes = np.linalg.inv(water.vertical.at(self.levels))

    def be_in(self, cells: NDArray[np.int32]) -> None:
        """Look at other cells; collective."""
        for one in (self._velocity, *self._gradients):
            one.be_in(cells)

    def weights(self, zeta: Vector) -> Vector:
        """Return what values at the levels count at heights zeta, shape (N, levels)."""
        return self.water.vertical.at(zeta) @ self._to_modes

    @property
    def velocity(self) -> Vector:
        """The water's velocity along, across and upwards [m/s], shape (levels, rows, 3); collective."""
        return self._at_levels(self._velocity)

    def layers(self) -> Layers:
        """Return what pressure is made of, and keep it for ``accelerations``; collective."""
        water, velocity = self.water, self.velocity
        phi_rate = water.vertical.at(self.levels) @ water.phi_rate.rows.T + water.level_rate
        rate = phi_rate - (water.carried * velocity).sum(axis=-1)
        layers = Layers(velocity, rate, rate + water.head(velocity))
        for field, values in zip(self._potentials, (layers.rate, layers.head), strict=True):
            field.rows[:] = (self._to_modes @ values).T
        return layers

    def accelerations(self) -> tuple[Vector, Vector]:
        """Return the local acceleration and the particles' [m/s²], each as the velocity; collective."""
        local, total = map(self._at_levels, self._gradients)
        return local, total

    def _at_levels(self, gradient: Velocity) -> Vector:
        return np.array([gradient.at(zeta).copy() for zeta in self.levels])
