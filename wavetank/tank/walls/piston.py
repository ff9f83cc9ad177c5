"""A vertical wall that moves as a piston, or as many side by side, and what it adds to the Hamiltonian.

    W = F(X_p'),     F(v) = - int s v R a . grad psi dX + int v h f (phi - psi) dzeta at the paddle

with the shape f(z) of the paddle and R = int f dz over the column, of a vertical wall f = 1 and R = h. By parts this is
int psi a . grad(s v R) dX + int v h f phi dzeta, written so that psi = phi = 1 gives zero whatever the quadrature.
H(Q, psi, t) depends on time through X_p, X_p' and the depth under points that the wall moves, so at fixed (Q, psi)

    dH/dt = d/dt (K + V)  -  int a . grad(s X_p') R mu dX  +  F(X_p''),     mu = M_J^-1 H_h     (ours)

the first with X_p and d going on as they move now, the second because h moves at fixed Q = h + a . grad(s X_p) R.

On any mesh and number of ranks derivatives of W and the power are assembled forms. Along a slice on one rank they are C
code, made of the same densities (``fem/kernels/layers.c``).
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from wavetank.arrays import Vector
from wavetank.fem.cells import Cells
from wavetank.fem.codegen import Buffer, Unit, source
from wavetank.fem.density import Density, Statements
from wavetank.fem.forms import ScalarForm, VectorForm, taylor_coefficients
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import Field, LayeredField, Plane
from wavetank.fem.slice import WallStruct
from wavetank.fem.vertical import VerticalBasis, gauss_legendre
from wavetank.motion import Motion
from wavetank.motion.kinematics import PaddleKinematics
from wavetank.motion.motion import blending, largest_stroke
from wavetank.tank.bed import Bed
from wavetank.tank.energy import Part, WaterEnergy
from wavetank.tank.walls.contract import Heights, PaddlePositions
from wavetank.tank.walls.mapping import Shift
from wavetank.tank.walls.place_mapping import PlaceMapping
from wavetank.tank.walls.shape import UPRIGHT, Shape
from wavetank.tank.walls.side import Side
from wavetank.tank.walls.travel import Travel


class Piston:
    """A vertical wall that moves into the water and back.

    Parameters
    ----------
    motion
        X_p(t), or X_p(y, t), with its exact derivatives.
    reach
        Where the mapping has died out [m]; of the vertices up to there the farthest is taken, so that s is
        smooth within cells on meshes with a row of vertices there.
    side
        Where the wall is.
    shape
        f(z); by default it is vertical.
    """

    part = Part("wall", "∫ ψ ∇·(ẋ h) dX + Ẋ_p ∫ h φ dζ at the paddle,  ẋ = s Ẋ_p")
    description = "x = X + s(X) X_p, F = ∂x/∂X, J = det F: a vertical wall moves"
    moves = True
    leans = False

    def __init__(self, motion: Motion, *, plane: Plane, reach: float, side: Side, shape: Shape = UPRIGHT):
        self.side, self._plane, self.shape = side, plane, shape
        vertices = fem.functionspace(plane.mesh, ("Lagrange", 1)).tabulate_dof_coordinates()
        self.reach = self._last(side.distances(plane.chart.places(vertices)), reach)
        self._places = PlaceMapping(side, self.reach)
        s = plane.function("s")
        s.set(self._blending(side.distances(plane.places)))
        self.displaced_dofs = np.flatnonzero(s.owned)
        self.motion, self.travel = motion, Travel(motion, plane=plane, side=side, s=s)
        self.velocities, self.rates = self.travel.velocities, self.travel.moves[None]
        self.axis = ufl.as_vector([float(side.sign * part) for part in side.normal[: plane.mesh.geometry.dim]])
        self.cells = self._displaced_cells(s)
        self.displaced_measure = plane.over(self.cells)
        self.mapping = self.after(0.0)
        self.set_time(0.0)

    def _facets(self) -> ufl.Measure:
        """Return the measure over the paddle."""
        return ufl.ds(domain=self._plane.mesh, subdomain_data=self.side.facets)(1)

    @property
    def node(self) -> int:
        """Where it stands: the degree of freedom, along a slice on one rank."""
        return int(self._plane.at(self.side.facets)[0])

    @property
    def paddles(self) -> tuple["Piston"]:
        """Itself."""
        return (self,)

    def _displaced_cells(self, s: Field) -> NDArray[np.int32]:
        """Return this rank's cells, ghosts among them, in which s is not zero."""
        return np.flatnonzero((s.rows[self._plane.V.dofmap.list, 0] != 0.0).any(axis=1)).astype(np.int32)

    def _last(self, distances: Vector, reach: float) -> float:
        """Return the largest of the distances up to a reach, or the smallest there is beyond it; collective."""
        tolerance = 1e-6 * self._plane.cell_size
        within = float(distances[distances < reach + tolerance].max(initial=0.0))
        beyond = float(distances[distances >= reach + tolerance].min(initial=np.inf))
        within = self._plane.comm.allreduce(within, op=MPI.MAX)
        return within if within > tolerance else float(self._plane.comm.allreduce(beyond, op=MPI.MIN))

    def _blending(self, distances: Vector) -> Vector:
        return blending(np.asarray(distances / self.reach))

    @property
    def largest_stroke(self) -> float:
        """How far it can go into the water before the mapping folds [m]."""
        return largest_stroke(self.reach)

    @property
    def kinematics(self) -> PaddleKinematics:
        """See ``Paddle``."""
        return self.travel.kinematics

    @property
    def displaced(self) -> float:
        """See ``Wall``."""
        return self.travel.displaced

    @property
    def shifts(self) -> Sequence[tuple[Vector, Shape]]:
        """See ``Wall``."""
        return [(self.travel.position.x.array, self.shape)]

    def at_surface(self, eta: Vector, still: Vector | float) -> Vector:
        """See ``Wall``."""
        far, fast = self.travel.at_nodes
        return np.array([far, fast, fast * (still + eta), 0 * far])

    @property
    def nearest(self) -> Vector:
        """See ``Wall``."""
        return np.ones((1, self._plane.owned))

    def set_time(self, t: float) -> bool:
        """Move to where the paddle stands at t [s]; return whether the mapping has changed."""
        return self.travel.set_time(t)

    def after(self, dt: Any) -> Shift:
        """Return the mapping when the paddle has gone on for dt [s], as it moves now; dt in UFL."""
        return Shift(self.axis, [(self.travel.position + dt * self.travel.speed, self.shape)])

    @property
    def speeding(self) -> Shift:
        """How the mapping goes on, a second further."""
        return Shift(self.axis, [(self.travel.speed, self.shape)])

    def distances(self, plane: Plane) -> Vector:
        """Return how far the degrees of freedom are from the paddle at rest [m], shape (owned,)."""
        return self.side.distances(plane.places)

    def columns(self, energy: WaterEnergy, mass: MassMatrix, unit: Unit) -> Any:
        """Return the mass matrix."""
        return mass

    def terms(
        self, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, vertical: VerticalBasis, unit: Unit
    ) -> "PistonTerms":
        """Return what the paddle adds to the Hamiltonian."""
        if self._plane.mesh.topology.dim == 1 and self._plane.comm.size == 1:
            return CompiledTerms(self, energy, phi, bed=bed, plane=self._plane, vertical=vertical, unit=unit)
        return PistonTerms(self, energy, phi, bed=bed, plane=self._plane, vertical=vertical)

    def flux(self, psi: Any, energy: WaterEnergy) -> Any:
        """Return the density of F over the cells for s v = 1 m/s, in UFL: of W in the water beside the paddle."""
        return -self.shape.column(energy.h, energy.d) * ufl.inner(self.axis, ufl.grad(psi))

    def flux_form(self, energy: WaterEnergy, phi: LayeredField, vertical: VerticalBasis) -> Callable[[Any], Any]:
        """Return F of s v [m/s] along the axis, a form of that field; at the paddle s = 1."""
        in_water = self.flux(phi.function[vertical.n], energy)
        at_wall = energy.wall_flux(phi.function, vertical, self.shape.value, degree=self.shape.degree)
        into, on_paddle = -ufl.inner(ufl.FacetNormal(self._plane.mesh), self.axis), self._facets()
        return lambda speed: speed * in_water * self.displaced_measure + into * speed * at_wall * on_paddle

    def reaches(self, places: Vector) -> NDArray[np.bool_]:
        """See ``Wall``."""
        return np.asarray(self.side.distances(places) < self.reach)

    @property
    def paddle_positions(self) -> PaddlePositions:
        """See ``Wall``."""
        return (self.travel.timed_position,)

    def paddle_displacements(self, places: Vector, paddle_positions: PaddlePositions | None = None) -> Vector:
        """See ``Wall``: X_p."""
        ((t, rigid_position),) = paddle_positions or self.paddle_positions
        if rigid_position is not None:
            return np.full((1, len(places)), rigid_position)
        return self.travel.positions(t, self.side.along(places))[None]

    def to_reference(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return X with X + a f s(X) X_p = x, places of shape (N, 2) [m]."""
        return self._places.to_reference(places, self._shaped_displacement(places, z, displacements))

    def to_physical(self, places: Vector, z: Heights = 0.0, displacements: Vector | None = None) -> Vector:
        """Return X + a f s(X) X_p, places of shape (N, 2) [m]."""
        return self._places.to_physical(places, self._shaped_displacement(places, z, displacements))

    def _shaped_displacement(self, places: Vector, z: Heights, displacements: Vector | None) -> Vector:
        """Return f X_p at the y of places [m]."""
        displacement = (self.paddle_displacements(places) if displacements is None else displacements)[0]
        return np.asarray(self.shape.at(np.asarray(z)) * displacement) if self.leans else displacement

    def mesh_velocities(self, places: Vector) -> Vector:
        """Return a s X_p' at reference places [m/s], shape (N, 2)."""
        speeds = self._blending(self.side.distances(places)) * self.travel.speeds(self.side.along(places))
        return np.asarray(np.outer(speeds, self.side.normal))


def later(wall: Piston, energy: WaterEnergy, bed: Bed, dt: Any) -> WaterEnergy:
    """Return the energy when the wall has gone on at its velocity for dt [s], in UFL."""
    return replace(energy, mapping=wall.after(dt), d=bed.d + dt * bed.rate)


def by_stretching(wall: Piston, energy: WaterEnergy, mu: Any) -> Any:
    """Return the density of dH/dt at fixed (Q, psi) by columns, which the wall stretches; mu = M_J^-1 H_h."""
    R = wall.shape.column(energy.h, energy.d)
    return -wall.speeding.stretching(lambda shape: R) * mu


class PistonTerms:
    """What a moving piston adds to the Hamiltonian; see the formulae of ``piston.py``."""

    along: tuple[WallStruct, ...] | None = None

    def __init__(
        self, wall: Piston, energy: WaterEnergy, phi: LayeredField, *, bed: Bed, plane: Plane, vertical: VerticalBasis
    ):
        self._wall, self._bed, self._components = wall, bed, phi.owned.shape[1]
        flux = wall.flux_form(energy, phi, vertical)
        work = flux(wall.travel.speed)
        self.hamiltonian = {wall.part: work}
        self._set_up(work, flux, energy, phi, plane=plane, vertical=vertical)
        self._rated = np.nan  # the time of what power depends on [s]

    def _set_up(
        self, work: Any, flux: Any, energy: WaterEnergy, phi: LayeredField, *, plane: Plane, vertical: VerticalBasis
    ) -> None:
        """Compile the forms."""
        self._by_potential = VectorForm(ufl.derivative(work, phi.function))
        self._by_column = VectorForm(ufl.derivative(work, energy.h))
        self._value = ScalarForm(work, plane.comm)
        self._mu = plane.function("mu")

        def density(dt: Any) -> Any:
            after = later(self._wall, energy, self._bed, dt)
            return after.kinetic(phi.function, vertical) + after.potential()

        _, rate = taylor_coefficients(density, 1, plane.mesh)
        rate += by_stretching(self._wall, energy, self._mu.function)
        self._power = ScalarForm(rate * self._wall.displaced_measure + flux(self._wall.travel.acceleration), plane.comm)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1); collective. The array is reused by the next call."""
        return self._by_potential.assemble().reshape(-1, self._components)

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,); collective. The array is reused by the next call."""
        return self._by_column.assemble()

    def energy(self) -> float:
        """Return W; collective."""
        return self._value.assemble()

    def power(self, mu: Vector) -> float:
        """Return dH/dt at fixed (Q, psi), velocity and acceleration as they are, for M_J^-1 H_h; collective."""
        self._wall.travel.show_acceleration()
        self._mu.set(mu)
        return self._power.assemble()

    def partial_rates(self, mu: Vector) -> tuple[float, float]:
        """Return the same without acceleration, and its derivative by the acceleration; collective."""
        values = list[float]()
        for acceleration in (0.0, 1.0):
            self._wall.travel.accelerate(acceleration)
            values.append(self.power(mu))
        return values[0], values[1] - values[0]

    def slopes(self, mu: Callable[[], Vector]) -> list[tuple[float, float]]:
        """Return dH/dX_p and dH/dX_p' at fixed (Q, psi), positive into the water; collective."""
        by_column = mu()
        self._rated = np.nan  # what the rate depends on is to be found again
        with self._wall.travel.going(1.0):
            self._bed.follow_on(self._wall)
            return [self.partial_rates(by_column)]

    def explicit_rate(self, mu: Callable[[], Vector]) -> float:
        """Return dH/dt at fixed (Q, psi); collective."""
        by_column = mu()
        self.follow()
        return self.power(by_column)

    def follow(self) -> None:
        """Take over the rate of the bed's depth as the wall moves; collective."""
        if self._rated != self._wall.travel.t:
            self._rated = self._wall.travel.t
            self._bed.follow_on(self._wall)


class CompiledTerms(PistonTerms):
    """The same along a slice on one rank.

    Parameters
    ----------
    unit
        The translation unit that its functions belong to.
    """

    def __init__(
        self,
        wall: Piston,
        energy: WaterEnergy,
        phi: LayeredField,
        *,
        bed: Bed,
        plane: Plane,
        vertical: VerticalBasis,
        unit: Unit,
    ):
        self._unit = unit
        super().__init__(wall, energy, phi, bed=bed, plane=plane, vertical=vertical)

    def _set_up(
        self, work: Any, flux: Any, energy: WaterEnergy, phi: LayeredField, *, plane: Plane, vertical: VerticalBasis
    ) -> None:
        wall, self._phi, self._h = self._wall, phi.rows, energy.h.x.array
        self.prefix = "near" if wall.side.sign > 0.0 else "far"
        u, w, psi, mu = (fem.Function(plane.V) for _ in range(4))
        zeta, dt, rate, by_cells, by_levels = (fem.Constant(plane.mesh, 0.0) for _ in range(5))
        blending = wall.travel.blending
        parts = (
            rate * (later(wall, energy, self._bed, dt).column(u, w, zeta) + dt * by_stretching(wall, energy, mu))
            + by_cells * blending * wall.flux(psi, energy)
            + by_levels * wall.side.sign * blending * energy.wall_layer(u, wall.shape.value, zeta)
        )
        names = {u: "u", w: "w", psi: "psi", zeta: "zeta", dt: "dt"}
        names |= {rate: "rate", by_cells: "by_cells", by_levels: "by_levels"}
        density = Density(parts, plane, inputs=names, first=energy.h)
        cells = Cells(plane, plane.degree, only=wall.cells)
        levels, weights = gauss_legendre(vertical.n + 1 + wall.shape.degree // 2)
        sizes = {
            "NUMBERS": vertical.n + 1,
            "LEVELS": len(vertical.zeta),
            "ENDS": len(levels),
            "FIELDS": density.fields,
            "MU": density.index(mu),
            "MOST": vertical.n + 1 + density.fields,
        }
        instance = self._unit.add(
            self.prefix,
            source("cells.c") + source("layers.c", "wall"),
            exports=("by_potential", "by_column", "power"),
            sizes={**cells.sizes, **sizes},
            density=density,
            made={"RATE": _rate, "FLUX": _flux, "END": _end},
            points=cells.points,
        )
        dofs = np.unique(plane.V.dofmap.list[wall.cells])
        water = {"zeta": vertical.zeta, "weights": vertical.weights, "P": vertical.values, "dP": vertical.slopes}
        at_wall = {"zeta": levels, "weights": weights, "P": vertical.at(levels)}
        self.by_potential_rows, self._by_column_rows = np.zeros_like(self._phi), np.zeros_like(self._h)
        self.struct = instance.struct(
            "Wall",
            cells=instance.struct("Cells", **cells.parts),
            layers=instance.struct("Layers", **water, constants=density.constants()),
            end=instance.struct("Layers", **at_wall),
            node=wall.node,
            count=len(dofs),
            dofs=dofs,
            fields=density.values,
            rows=np.zeros((plane.size, density.fields)),
            moves=wall.travel.moves,
            blending=wall.travel.blending.x.array,
            position=wall.travel.position.x.array,
            speed=wall.travel.speed.x.array,
            **dict(zip(("at_still_water", "slope", "mean"), wall.shape.at_still_water, strict=True)),
            by_potential=self.by_potential_rows,
            by_column=self._by_column_rows,
        )
        self._rates, n = np.zeros(2), Buffer(plane.size)
        self._set_by_potential = instance.function("by_potential", self.struct, self._h)
        self._set_by_column = instance.function("by_column", self.struct, self._h, self._phi)
        self._find_power = instance.function("power", self.struct, self._h, self._phi, n, self._rates)

    @property
    def along(self) -> tuple[WallStruct, ...] | None:  # type: ignore[override]
        """The compiled terms of each paddle, along a slice on one rank."""
        return (self,)

    def vector(self) -> Vector:
        """Return dW/dphi, shape (owned, n+1). The array is reused by the next call."""
        self._set_by_potential()
        rows: Vector = self.by_potential_rows
        return rows

    def by_column(self) -> Vector:
        """Return dW/dh, shape (owned,). The array is reused by the next call."""
        self._set_by_column()
        rows: Vector = self._by_column_rows
        return rows

    def energy(self) -> float:
        """Return W, which is linear in the potential."""
        return float(np.vdot(self.vector(), self._phi))

    def power(self, mu: Vector) -> float:
        """Return dH/dt at fixed (Q, psi), velocity and acceleration as they are, for M_J^-1 H_h."""
        rate, by_acceleration = self.partial_rates(mu)
        return rate + float(self._wall.travel.accelerations) * by_acceleration

    def partial_rates(self, mu: Vector) -> tuple[float, float]:
        """Return the same without acceleration, and its derivative by the acceleration."""
        self._find_power(mu)
        rate, by_acceleration = map(float, self._rates)
        return rate, by_acceleration


def _rate(e: Any) -> Statements:
    from wavetank.fem.pointwise import named

    return {"value": e.diff(named("rate"), named("dt")).subs(named("dt"), 0)}


def _flux(e: Any) -> Statements:
    from wavetank.fem.pointwise import named

    flux, slope = e.diff(named("by_cells")), named("psi", 0)
    return {"value": flux, "by_psi_0": flux.diff(slope), "by_h": flux.diff(named("f0"))}


def _end(e: Any) -> Statements:
    from wavetank.fem.pointwise import named

    flux = e.diff(named("by_levels"))
    return {"value": flux, "by_value": flux.diff(named("u")), "by_h": flux.diff(named("f0"))}
