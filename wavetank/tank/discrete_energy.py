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

SHALLOW = 0.1  # of the mean depth: where a surface meets the bed there, the bed is the cause


class DiscreteEnergy(Water):
    """The energy of nonlinear water with its fields and matrices: what is solved for is in ``NonlinearWaves``.

    Parameters
    ----------
    plane
        The horizontal space.
    depth
        Still-water depth d [m], a number or a function of places (x, y) [m].
    gravity
        [m/s²].
    wall
        The wall that can move.
    vertical_order
        n.

    Attributes
    ----------
    depth
        The mean depth [m].
    speed
        The speed of long waves [m/s], by which surface potentials are scaled.
    bed
        The bed, with the depth at the degrees of freedom.
    h, phi
        Water column [m] and potential [m²/s] of the state evaluated last.
    densities
        Of energy and velocity, in UFL.
    hamiltonian
        H as the sum of its parts, in UFL.
    columns
        Water columns from masses, and back, for the wall at its present position.
    potential_energy
        Integrates the potential energy.
    wall_terms
        W and its derivatives.
    unit
        The translation unit of all compiled functions.
    """

    parts = (KINETIC, POTENTIAL)  # and the wall's

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
        """H as the sum of its parts, in UFL; a run does not need it."""
        energy, dx = self.densities, self.plane.dx
        return {
            KINETIC: energy.kinetic(self.phi.function, self.vertical) * dx,
            POTENTIAL: energy.potential() * dx,
            **self.wall_terms.hamiltonian,
        }

    @cached_property
    def surface(self) -> SurfaceVelocity:
        """How the surface moves, found once for all who ask of the same moment; collective."""
        return surface_of(self)

    def refuse_column(self, t: float) -> None:
        """Raise what says where the column is lowest, which is not positive; collective."""
        column = np.concatenate([self.h.owned, [np.inf]])  # a rank may own nothing
        column[np.isnan(column)] = -np.inf  # which is less than all numbers on other ranks
        least = int(np.argmin(column))
        place = (*map(float, self.plane.places[least]),) if least < self.plane.owned else (0.0, 0.0)
        still = float(np.append(self.bed.still, 0.0)[least])
        lowest, x, y, still = self.plane.comm.allreduce((float(column[least]), *place, still), op=MPI.MIN)
        if not lowest > 0.0:
            what = f"the surface reaches the bed (lowest water column {lowest:.3g} m)"
            what = what if np.isfinite(lowest) else "the surface is no longer a number"
            where = f"x = {x:.4g} m" if self.plane.mesh.topology.dim == 1 else f"x = {x:.4g} m, y = {y:.4g} m"
            what = f"t = {t:.6g} s, {where}: {what}"
            if still < SHALLOW * self.depth:
                shallow = f"still water is only {still:.3g} m deep there, and troughs must not fall dry"
                raise RunError(f"{what}: {shallow}; tank.bed.minimum_depth keeps a bed below them")
            raise BreakdownError(what)
