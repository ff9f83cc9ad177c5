"""What the wall adds to the Hamiltonian, and the power it puts in.

    W = X_p' F(phi, h),     F = int psi d/dX (s h) dX + int h phi dzeta at the paddle

H(Q, psi, t) depends on time through X_p and X_p' alone, so at fixed (Q, psi)

    dH/dt = X_p' dH/dX_p + X_p'' F,     dH/dX_p = (K + V)_{X_p} - int s' h mu dX,     mu = M_J^-1 H_h,

the last term because h = M_J^-1 Q moves with J.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
import ufl

from wavetank.fe.forms import ScalarForm, VectorForm
from wavetank.fe.plane import LayeredField, Plane
from wavetank.fe.vertical import VerticalBasis
from wavetank.hamiltonian.contract import Vector
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

    def explicit_rate(self, mu: Callable[[], Vector], t: float) -> float:
        """Return dH/dt at fixed (Q, psi), ``mu`` giving M_J^-1 H_h; collective."""


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

    def explicit_rate(self, mu: Callable[[], Vector], t: float) -> float:
        """Return zero."""
        return 0.0


class PistonForms:
    """The terms of a moving piston; see the module's formulae."""

    def __init__(self, wall: Piston, energy: WaterEnergy, phi: LayeredField, *, plane: Plane, vertical: VerticalBasis):
        self._wall, self._components = wall, vertical.n + 1
        flux = wall.flux(phi.function[vertical.n], energy.h, energy.wall_flux(phi.function, vertical))
        density = energy.kinetic(phi.function, vertical) + energy.potential()
        self._mu = plane.function("mu")
        self.hamiltonian = [wall.speed * flux]
        self._vector = VectorForm(ufl.derivative(self.hamiltonian[0], phi.function))
        self._flux = ScalarForm(flux, plane.comm)
        stretch = -wall.s.dx(0) * energy.h * self._mu.function
        self._force = ScalarForm((ufl.diff(density, wall.X_p) + stretch) * plane.dx, plane.comm)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1); collective."""
        return self._vector.assemble().reshape(-1, self._components)

    def energy(self) -> float:
        """Return W; collective."""
        return self._wall.velocity * self._flux.assemble()

    def explicit_rate(self, mu: Callable[[], Vector], t: float) -> float:
        """Return X_p' dH/dX_p + X_p'' F; collective."""
        self._mu.set(mu())
        return self._wall.velocity * self._force.assemble() + self._wall.motion.acceleration(t) * self._flux.assemble()


def wall_forms(
    wall: Wall, energy: WaterEnergy, phi: LayeredField, *, plane: Plane, vertical: VerticalBasis
) -> WallForms:
    """Return the forms that belong to a wall."""
    if isinstance(wall, Piston):
        return PistonForms(wall, energy, phi, plane=plane, vertical=vertical)
    return StandingWallForms(vertical)
