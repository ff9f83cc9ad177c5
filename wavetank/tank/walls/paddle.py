"""A moving wall: mode shape f(z), motion X_p(t) and side.

Its mapping is x = X + s(X) f(z) X_p (``mapping.py``); ``terms.py`` has its part of the Hamiltonian.
"""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.fem.plane import Plane
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.motion.motion import blending, largest_stroke
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.mesh_motion import MeshMotion
from wavetank.tank.walls.shape import UPRIGHT, Polynomial
from wavetank.tank.walls.side import Side

DESCRIPTIONS = {  # description of the part of the Hamiltonian, and of the mapping
    "fixed": (Part("wall", "", "nothing moves there"), "x = X, F = J = 1: no wall moves"),
    "linear": (
        Part("wall", "Ẋ_p d ∫ f φ dζ at the paddle"),
        "x = X, F = J = 1: the wall of linear waves does not move",
    ),
    "upright": (
        Part("wall", "∫ ψ ∇·(ẋ h) dX + Ẋ_p ∫ h φ dζ at the paddle,  ẋ = s Ẋ_p"),
        "x = X + s(X) X_p, F = ∂x/∂X, J = det F: a vertical wall moves",
    ),
    "leaning": (
        Part("wall", "∫ ψ ∇·(s G) dX + Ẋ_p ∫ h f φ dζ at the paddle,  G = Ẋ_p ∫ f dz"),
        "x = X + s(X) f(z) X_p, F = ∂x/∂X, J = det F: a wall of the shape f moves",
    ),
}


class LinearPaddle:
    """A paddle of linear waves: a permeable wall at its rest position, with a flux equal to the displaced volume.

    Parameters
    ----------
    motion
        X_p(t) with its exact derivatives.
    side
        Side of the wall.
    shape
        f(z); default: vertical.
    """

    moves = leans = False
    largest_stroke = np.inf

    def __init__(self, motion: Motion, *, side: Side, shape: Polynomial = UPRIGHT):
        self.motion, self.side, self.shape = motion, side, shape
        self.kinematics = PaddleKinematics(motion)


class Paddle:
    """A paddle of nonlinear waves, with a mapping. Within the reach of a leaning paddle the bed is flat.

    Parameters
    ----------
    motion
        X_p(t), or X_p(y, t), with its exact derivatives.
    reach
        Distance at which the mapping becomes the identity [m]. The largest distance of a vertex up to it is used, so
        that s is smooth within cells on meshes with a row of vertices there.
    side
        Side of the wall.
    shape
        f(z); default: vertical.

    Attributes
    ----------
    leans
        Whether its position depends on the height.
    mesh_motion
        s X_p, s X_p', s X_p''.
    axis
        Unit vector normal to the paddle, in the direction of x, in UFL.
    cells, displaced_dofs
        Displaced cells of this rank, including ghosts, and displaced owned degrees of freedom.
    displaced_measure
        Measure over these cells.
    mapping
        Mapping to the reference tank.
    """

    moves = True

    def __init__(self, motion: Motion, *, plane: Plane, reach: float, side: Side, shape: Polynomial = UPRIGHT):
        self.motion, self.plane, self.side, self.shape = motion, plane, side, shape
        self.leans = shape is not UPRIGHT
        vertices = fem.functionspace(plane.mesh, ("Lagrange", 1)).tabulate_dof_coordinates()
        self.reach = self._last(side.distances(plane.chart.places(vertices)), reach)
        s = plane.function("s")
        s.set(self.blending(plane.places))
        self.displaced_dofs = np.flatnonzero(s.owned)
        self.cells = np.flatnonzero((s.rows[plane.V.dofmap.list, 0] != 0.0).any(axis=1)).astype(np.int32)
        self.displaced_measure = plane.over(self.cells)
        self.mesh_motion = MeshMotion(motion, plane=plane, side=side, s=s)
        self.axis = ufl.as_vector([float(side.sign * part) for part in side.normal[: plane.mesh.geometry.dim]])
        self.mapping = self.after(0.0)
        self.mesh_motion.set_time(0.0)

    def _last(self, distances: Vector, reach: float) -> float:
        """Return the largest distance within a reach, or else the smallest distance beyond it; collective."""
        tolerance = 1e-6 * self.plane.cell_size
        within = float(distances[distances < reach + tolerance].max(initial=0.0))
        beyond = float(distances[distances >= reach + tolerance].min(initial=np.inf))
        within = self.plane.comm.allreduce(within, op=MPI.MAX)
        return within if within > tolerance else float(self.plane.comm.allreduce(beyond, op=MPI.MIN))

    def blending(self, places: Vector) -> Vector:
        """Return s at reference positions [m], shape (N,)."""
        return blending(np.asarray(self.side.distances(places) / self.reach))

    @property
    def node(self) -> int:
        """Degree of freedom at the paddle, along a slice on one rank."""
        return int(self.plane.at(self.side.facets)[0])

    @property
    def largest_stroke(self) -> float:
        """Largest displacement into the water before the mapping folds [m]."""
        return largest_stroke(self.reach)

    @property
    def kinematics(self) -> PaddleKinematics:
        """X_p, X_p' and X_p'' at the times of steps."""
        return self.mesh_motion.kinematics

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """Return the contributions to ``Wall.at_surface``."""
        far, fast = self.mesh_motion.position.owned, self.mesh_motion.speed.owned
        f, slope, mean = self.shape.at_still_water
        f_surface = f + slope * eta
        flux = mean * still + 0.5 * (f + f_surface) * eta
        return np.array([far * f_surface, fast * f_surface, fast * flux, far * slope])

    def after(self, dt: Any) -> Shift:
        """Return the mapping after a motion for dt [s] at the current velocity; dt in UFL."""
        position, speed = self.mesh_motion.position.function, self.mesh_motion.speed.function
        return Shift(self.axis, [(position + dt * speed, self.shape)])

    def stretching(self, energy: WaterEnergy, mu: Any) -> Any:
        """Return the density of dH/dt at fixed (Q, psi) by the stretching of columns; mu = M_J^-1 H_h."""
        moved = Shift(self.axis, [(self.mesh_motion.speed.function, self.shape)])
        return -moved.stretching(lambda shape: shape.column(energy.h, energy.d)) * mu

    def flux(self, psi: Any, energy: WaterEnergy) -> Any:
        """Return the density of F over the cells for s v = 1 m/s, in UFL: the part of W beside the paddle."""
        return -self.shape.column(energy.h, energy.d) * ufl.inner(self.axis, ufl.grad(psi))
