"""What the wall adds to the Hamiltonian, and the power it puts in.

    W = F(X_p'),     F(v) = int psi a . grad(s v h) dX + int v h phi dzeta at the paddle

H(Q, psi, t) depends on time through X_p, X_p' and the depth under points that the wall moves, so at fixed (Q, psi)

    dH/dt = d/dt (K + V)  -  int dJ/dt h mu dX  +  F(X_p''),     mu = M_J^-1 H_h,

the first with X_p and d going on as they move now, the second because h = M_J^-1 Q moves with J.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
import ufl

from wavetank.arrays import Vector
from wavetank.fe.forms import ScalarForm, VectorForm, taylor_coefficient
from wavetank.fe.plane import LayeredField, Plane
from wavetank.fe.vertical import VerticalBasis
from wavetank.water.bed import Bed
from wavetank.water.energy import WaterEnergy
from wavetank.water.walls import Piston, Wall


class WallForms(Protocol):
    """What the water asks of its wall.

    Attributes
    ----------
    hamiltonian
        The wall's term in the Hamiltonian as a list of forms, empty where there is none.
    """

    hamiltonian: list[ufl.Form]

    def vector(self) -> Vector:
        """Return dW/dphi, broadcastable to shape (owned, n+1); collective."""

    def energy(self) -> float:
        """Return W; collective."""

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); ``mu`` evaluates that point and gives M_J^-1 H_h there; collective."""


class StandingWallForms:
    """A wall that stands still adds nothing."""

    def __init__(self, vertical: VerticalBasis):
        self.hamiltonian: list[ufl.Form] = []
        self._zero = np.zeros((1, vertical.n + 1))

    def vector(self) -> Vector:
        """Return zero."""
        return self._zero

    def energy(self) -> float:
        """Return zero."""
        return 0.0

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return zero."""
        return 0.0


class PistonForms:
    """The terms of a moving piston; see the module's formulae."""

    def __init__(
        self, wall: Piston, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, plane: Plane, vertical: VerticalBasis
    ):
        self._wall, self._bed, self._plane, self._components = wall, bed, plane, vertical.n + 1
        parts = {
            "psi": phi.function[vertical.n],
            "h": energy.h,
            "wall_flux": energy.wall_flux(phi.function, vertical),
        }
        self.hamiltonian = [wall.flux(wall.travel.speed, **parts)]
        self._vector = VectorForm(ufl.derivative(self.hamiltonian[0], phi.function))
        self._energy = ScalarForm(self.hamiltonian[0], plane.comm)
        self._flux = ScalarForm(wall.flux(wall.travel.acceleration, **parts), plane.comm)

        def density(dt: Any) -> Any:
            later = replace(energy, wall=wall.after(dt), d=bed.d + dt * bed.rate)
            return later.kinetic(phi.function, vertical) + later.potential()

        self._mu = plane.function("mu")
        moved = taylor_coefficient(density, 1, plane.mesh) - wall.stretching * energy.h * self._mu.function
        self._power = ScalarForm(moved * plane.dx, plane.comm)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1); collective."""
        return self._vector.assemble().reshape(-1, self._components)

    def energy(self) -> float:
        """Return W; collective."""
        return self._energy.assemble()

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); collective."""
        self._mu.set(mu())
        places = self._plane.places
        self._bed.set_velocities(self._wall.to_physical(places), self._wall.mesh_velocities(places))
        return self._power.assemble() + self._flux.assemble()


def wall_forms(
    wall: Wall, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, plane: Plane, vertical: VerticalBasis
) -> WallForms:
    """Return the forms that belong to a wall."""
    if isinstance(wall, Piston):
        return PistonForms(wall, energy, phi, bed=bed, plane=plane, vertical=vertical)
    return StandingWallForms(vertical)
