"""The discrete energy of nonlinear water in a tank (docs/method.md, section 1): H = K(phi, h) + V(h) + W(phi, h; t)."""

from functools import cached_property
from math import sqrt

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from wavetank.base.errors import BreakdownError, RunError
from wavetank.fem.codegen import Unit
from wavetank.fem.mass import MassMatrix, mass_matrix
from wavetank.fem.plane import Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.tank.bed import Depth, bed_of
from wavetank.tank.energy import KINETIC, POTENTIAL, Part, WaterEnergy
from wavetank.tank.evaluation import Water
from wavetank.tank.surface_flow import SurfaceVelocity, surface_of
from wavetank.tank.walls import Wall

SHALLOW = 0.1  # still-water depth below which the bed is the cause of a dry column, relative to the mean depth


class DiscreteEnergy(Water):
    """The energy of nonlinear water with its fields and matrices, without solvers (``NonlinearWaves`` has them).

    Parameters
    ----------
    plane
        Horizontal space.
    depth
        Still-water depth d [m], a number or a function of positions (x, y) [m].
    gravity
        g [m/s²].
    wall
        Wall that can move.
    vertical_order
        n.

    Attributes
    ----------
    depth
        Mean depth [m].
    speed
        Speed of long waves [m/s], the scale of surface potentials.
    bed
        The bed, with the depth at the degrees of freedom.
    h, phi
        Water column [m] and potential [m²/s] of the last evaluated state.
    densities
        Densities of energy and velocity, in UFL.
    hamiltonian
        H as the sum of its parts, in UFL.
    columns
        Maps from masses to water columns, and back, for the current position of the wall.
    potential_energy
        Integral of the potential energy.
    wall_terms
        W and its derivatives.
    unit
        Translation unit of all compiled functions.
    """

    parts = (KINETIC, POTENTIAL)  # without that of the wall

    def __init__(self, plane: Plane, *, depth: float | Depth, wall: Wall, vertical_order: int, gravity: float):
        self.plane, self.wall, self.gravity = plane, wall, gravity
        self.bed = bed_of(depth, plane)
        self.bed.follow(wall)
        self.depth, self.speed = self.bed.depth, sqrt(gravity * self.bed.depth)
        self.vertical = VerticalBasis(vertical_order)
        self.h = plane.function("water column")
        self.phi = plane.layered_function(vertical_order + 1, "potential")
        self.h.function.x.array[:] = self.depth
        g = fem.Constant(plane.mesh, gravity)
        self.densities = energy = WaterEnergy(h=self.h.function, d=self.bed.d, gravity=g, mapping=wall.mapping)
        self.unit = unit = Unit(plane.comm)
        self.mass = mass_matrix(plane, wall.mapping.J(energy.eta), unit)
        self.columns = wall.columns(self)
        self.potential_energy = MassMatrix(
            plane, energy.potential(), unit=unit, prefix="potential", functions=("total",)
        )
        self.wall_terms = wall.terms(self)

    @cached_property
    def hamiltonian(self) -> dict[Part, ufl.Form]:
        """H as the sum of its parts, in UFL; a run does not use it."""
        energy, dx = self.densities, self.plane.dx
        return {
            KINETIC: energy.kinetic(self.phi.function, self.vertical) * dx,
            POTENTIAL: energy.potential() * dx,
            **self.wall_terms.hamiltonian,
        }

    @cached_property
    def surface(self) -> SurfaceVelocity:
        """Flow at the surface, shared by all users and computed once for each time; collective."""
        return surface_of(self)

    def check_column(self, t: float) -> None:
        """Raise the error for a water column that is not positive, with its position; collective."""
        column = np.concatenate([self.h.owned, [np.inf]])  # a rank may own no degrees of freedom
        column[np.isnan(column)] = -np.inf  # less than all values on other ranks
        least = int(np.argmin(column))
        place = (*map(float, self.plane.places[least]),) if least < self.plane.owned else (0.0, 0.0)
        still = float(np.append(self.bed.still, 0.0)[least])
        lowest, x, y, still = self.plane.comm.allreduce((float(column[least]), *place, still), op=MPI.MIN)
        if not lowest > 0.0:
            what = f"the surface reaches the bed (lowest water column {lowest:.3g} m)"
            what = what if np.isfinite(lowest) else "the surface is not finite"
            where = f"x = {x:.4g} m" if self.plane.mesh.topology.dim == 1 else f"x = {x:.4g} m, y = {y:.4g} m"
            what = f"t = {t:.6g} s, {where}: {what}"
            if still < SHALLOW * self.depth:
                shallow = f"still water is only {still:.3g} m deep there, and troughs must not be dry"
                raise RunError(f"{what}: {shallow}; tank.bed.minimum_depth limits the bed")
            raise BreakdownError(what)
