"""Advection preconditioner: waves on the current of the water at the surface, for stages of steep waves.

With V and B the horizontal and vertical velocity of the water at the surface, small disturbances eta and
chi = psi - B eta of a state obey, apart from a small change of gravity,

    d eta/dt = G chi - div(V eta),     d chi/dt = -g eta - V . grad chi

(Alinhac's good unknown; Lannes, J. Amer. Math. Soc. 18, 2005). G is near that of still water. The derivative of a stage
is nearly that of linear waves on still water times 1 + a V . grad, whose approximate inverse is 1 - a V . grad.

Beside a moving wall, x = X + xi at the surface, the velocity relative to the reference tank is c = F^-1 (V - x_t) with
F = dx/dX, and d Q'/dt = |F| G chi - div(c Q'), d chi/dt = .. - c . grad chi for disturbances Q' = J eta at fixed X. The
rise of the surface at a fixed x, times |F|, is dQ/dt - div(s X_p' R): the compression of columns is no rise of the
surface. Beside a leaning wall, where xi depends on eta, B increases by V d(xi)/dz. All of this requires a few digits
only, so the inverse of mass matrices is approximate. Along a slice on one rank the preconditioner is one compiled call
(``slice.c``).
"""

from typing import Any, NamedTuple

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.fem.along import AveragedModes
from wavetank.fem.codegen import Buffer, Function, Struct, Unit
from wavetank.fem.plane import Plane
from wavetank.fem.surface_points import SurfacePoints
from wavetank.tank.evaluation import WaterEvaluation
from wavetank.tank.still_water import APPROXIMATE, StillWaterWaves
from wavetank.tank.walls import Wall

LEAST, LARGEST = 0.03, 0.5  # smallest relevant and largest allowed a V k, k = pi p / l of the mesh


class Compiled(NamedTuple):
    """The compiled preconditioner for a weight along a slice on one rank: the ``Advection`` of ``slice.c``."""

    struct: Struct
    precondition: Function
    set_velocity: Function


def surface_points(plane: Plane, wall: Wall, unit: Unit) -> SurfacePoints:
    """Return the quadrature points of the velocities at the surface beside a wall; collective."""
    axis = None
    if wall.moves:
        side = wall.paddles[0].side
        axis = side.sign * side.normal[: plane.mesh.geometry.dim]
    return SurfacePoints(plane, axis, unit=unit)


class AdvectionPreconditioner:
    """Advection preconditioner: approximate inverse of the coupled implicit stage of nonlinear waves.

    Parameters
    ----------
    waves
        ``NonlinearWaves``.
    still
        Preconditioner of linear waves on still water.

    Attributes
    ----------
    compiled
        Compiled preconditioner of each weight [s], along a slice on one rank; None elsewhere.
    """

    def __init__(self, waves: Any, still: StillWaterWaves):
        self._waves, self._still, self._points = waves, still, surface_points(waves.plane, waves.wall, waves.unit)
        self._shortest = waves.plane.cell_size / (np.pi * waves.plane.order)
        self._B: Vector = np.zeros(waves.plane.owned)
        self._has_velocity = False  # whether the velocities at the surface are relevant
        self.compiled: dict[float, Compiled | None] = {}

    def __call__(self, weight: float, residual: Vector) -> Vector:
        """Return the preconditioned residual of a stage of a weight [s], shape (2, owned); collective."""
        compiled = self.compiled.get(weight)
        if compiled is not None:
            result = np.empty_like(residual)
            compiled.precondition(weight, residual, result)
            return result
        if not self._has_velocity:
            return self._still(weight, residual)
        mass, at, solve, (q, psi) = self._waves.mass, self._points, self._divided_by_mass, residual
        eta, chi = self._still.surface(weight, q, psi - self._B * solve(q))
        advected = weight * at.advection(eta, along=False)
        chi -= weight * solve(at.advection(chi, along=True))
        smoothed = self._still.with_mass_of(q, mass.apply(eta) + advected)
        return np.array([smoothed, chi + self._B * (eta + solve(advected))])

    def set_velocity(self, weight: float, at: WaterEvaluation | None) -> None:
        """Set the velocities at the surface from an evaluation, for stages of a weight [s]; collective.

        The wall, and outside slices the mass matrix, must be those of the evaluation.
        """
        if weight not in self.compiled:
            self.compiled[weight] = self._along(weight)
        compiled = self.compiled[weight]
        if compiled is None:
            self._has_velocity = at is not None and self._set_surface_velocity(at, self._cutoff(weight))
        elif at is None:
            compiled.struct.c.carried = False
        else:
            compiled.set_velocity.call(at.z, at.flow, at.eta, self._waves.bed.still)

    def _cutoff(self, weight: float) -> float:
        """Return the largest velocity at the surface in use [m/s]."""
        return float(LARGEST * self._shortest / abs(weight))

    def _along(self, weight: float) -> Compiled | None:
        waves, (modes, mode_weights) = self._waves, self._still.solver(weight)
        solver = waves.slice_solver
        if solver is None or not isinstance(modes, AveragedModes):
            return None
        instance = solver.instance
        fields, dofs, still = self._points.fields, waves.plane.size, self._still
        struct = instance.struct(
            "Advection",
            dofs=dofs,
            fields=fields,
            tank=solver.struct,
            gravity=waves.gravity,
            of_metre=still.of_metre,
            mass=waves.mass.struct,
            still=(still.mass or waves.mass).struct,
            vertical=self._B,
            uniform=still.uniform,
            room=np.empty((fields, dofs)),
            **modes.compiled(mode_weights),
            **self._points.compiled,
        )
        n, z, cutoff = Buffer(dofs), Buffer(2 * dofs), self._cutoff(weight)
        return Compiled(
            struct,
            instance.function("precondition", struct, float, z, z),
            instance.function("set_velocity", struct, cutoff, LEAST / LARGEST * cutoff, z, z, n, n),
        )

    def _divided_by_mass(self, right: Vector) -> Vector:
        """Return the approximate solution of a system with the mass matrix; collective."""
        result: Vector = self._waves.mass.solve(right, within=APPROXIMATE)
        return result

    def _set_surface_velocity(self, at: WaterEvaluation, cutoff: float) -> bool:
        """Set the limited velocities at the surface from an evaluation [m/s]; return whether they are relevant.

        Collective.
        """
        walls = self._waves.wall.at_surface(at.eta, self._waves.bed.still)
        vertical, fastest = self._points.move([at.eta, at.p, self._divided_by_mass(at.dq), *walls], most=cutoff)
        if not fastest * LARGEST > LEAST * cutoff:
            return False
        self._B[:] = np.minimum(np.maximum(self._divided_by_mass(vertical), -cutoff), cutoff)
        return True
