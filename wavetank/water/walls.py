"""The wall at x = 0 and the mapping of the moving tank to the fixed reference tank.

    x = X + s(X) X_p(t),   J = dx/dX = 1 + s' X_p,   mesh velocity = s X_p',   s = max(0, 1 - X/reach)

A wall tells the energy how to differentiate in physical space and what the moving wall adds to the Hamiltonian. A fixed
wall is the identity: everything about it vanishes before compilation.
"""

from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem, mesh

from wavetank.fe.plane import Plane
from wavetank.hamiltonian.contract import Vector
from wavetank.motions import Motion


class Wall(Protocol):
    """What the water must know of the wall at x = 0.

    Attributes
    ----------
    J
        Jacobian of the mapping, in UFL.
    """

    J: Any

    @property
    def velocity(self) -> float:
        """The wall's velocity [m/s]."""

    def set_time(self, t: float) -> bool:
        """Move to where the wall stands at t [s]; return whether the mapping has changed."""

    def gradient(self, f: Any) -> Any:
        """Return the horizontal gradient in physical space, in UFL."""

    def to_reference(self, x: Vector) -> Vector:
        """Return X for physical positions x [m] at the wall's present position."""

    def to_physical(self, X: Vector) -> Vector:
        """Return x for reference positions X [m] at the wall's present position."""


class FixedWall:
    """A wall that stands still: the identity."""

    velocity = 0.0

    def __init__(self) -> None:
        self.J = ufl.as_ufl(1)

    def set_time(self, t: float) -> bool:
        """Do nothing."""
        return False

    def gradient(self, f: Any) -> Any:
        """Return the gradient in the reference tank, which is the physical one."""
        return ufl.grad(f)

    def to_reference(self, x: Vector) -> Vector:
        """Return x."""
        return x

    def to_physical(self, X: Vector) -> Vector:
        """Return X."""
        return X


class Piston:
    """A vertical wall that moves as a whole.

    Parameters
    ----------
    motion
        X_p(t) with its exact derivatives.
    reach
        Where the mapping has died out [m]; the nearest vertex is taken, so that s is exact on the mesh.
    cell_size
        Distance of the vertices [m].
    facets
        Facet tags with 1 at the paddle.
    """

    def __init__(self, motion: Motion, *, plane: Plane, reach: float, cell_size: float, facets: mesh.MeshTags):
        self.motion = motion
        self.reach = cell_size * max(1, round(reach / cell_size))
        self._dx = plane.dx
        self._paddle = ufl.ds(domain=plane.mesh, subdomain_data=facets)(1)
        self.s = fem.Function(fem.functionspace(plane.mesh, ("Lagrange", 1)))
        self.s.interpolate(lambda x: self._shape(x[0]))
        self._position = fem.Constant(plane.mesh, 0.0)
        self.speed = fem.Constant(plane.mesh, 0.0)
        self.X_p = ufl.variable(self._position)
        self.J = 1 + self.s.dx(0) * self.X_p
        self.set_time(0.0)

    def _shape(self, X: Vector) -> Vector:
        return np.maximum(0.0, 1.0 - X / self.reach)

    @property
    def position(self) -> float:
        """Where the paddle stands [m], positive into the water."""
        return float(self._position.value)

    @property
    def velocity(self) -> float:
        """Its velocity [m/s]."""
        return float(self.speed.value)

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether the mapping has changed."""
        position = self.motion.position(t)
        changed = position != self._position.value
        self._position.value, self.speed.value = position, self.motion.velocity(t)
        return bool(changed)

    def gradient(self, f: Any) -> Any:
        """Return f_X / J."""
        return ufl.grad(f) / self.J

    def flux(self, psi: Any, h: Any, wall_flux: Any) -> Any:
        """Return what goes with X_p' in the Hamiltonian: int psi d/dX (s h) dX + int h phi dzeta at the paddle."""
        return psi * (self.s * h).dx(0) * self._dx + wall_flux * self._paddle

    def to_reference(self, x: Vector) -> Vector:
        """Return X with X + s(X) X_p = x."""
        x = np.asarray(x, dtype=float)
        return np.where(x < self.reach, (x - self.position) / (1.0 - self.position / self.reach), x)

    def to_physical(self, X: Vector) -> Vector:
        """Return X + s(X) X_p."""
        return X + self._shape(np.asarray(X)) * self.position
