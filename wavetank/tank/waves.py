"""Nonlinear water waves in a tank as a Hamiltonian system (docs/method.md, section 1).

    L = int psi d_t Q dX - H(Q, psi, t)     (Miles' principle, of the form (1) of Gagarina et al. 2016)

with the column mass Q = M_J h as coordinate, which is ours, and the surface potential psi as momentum, so that
Hamilton's equations (4) are dQ/dt = H_psi and dpsi/dt = -M_J^-1 H_h. At the interior potential of a state every
derivative is a partial derivative of the one discrete functional K(phi, h) + V(h) + W(phi, h; t), because phi makes it
stationary.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import isnan, sqrt
from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from wavetank.arrays import Vector, read_only, summed
from wavetank.errors import BreakdownError, ConvergenceError, RunError
from wavetank.fem.along import Minimum
from wavetank.fem.codegen import Instance, Struct, Unit
from wavetank.fem.combination import Combination
from wavetank.fem.mass import BandedMass, MassMatrix, mass_matrix
from wavetank.fem.plane import Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.fem.whole import Solution, Whole
from wavetank.integrators.hamiltonian import BetweenTwo, Near, Stage
from wavetank.integrators.stage_solver import AndersonStageSolver, IteratedStages, Led, Together
from wavetank.state import Held
from wavetank.tank.bed import Depth, bed_of
from wavetank.tank.carried_waves import CarriedWaves, Surface, surface_points
from wavetank.tank.energy import KINETIC, POTENTIAL, Energies, Part, WaterEnergy
from wavetank.tank.potential import InteriorPotential, Minimiser, interior_of
from wavetank.tank.seen import Block, State, see, see_from
from wavetank.tank.still_water import StillWaterWaves, largest_frequency, scales
from wavetank.tank.surface_flow import SurfaceVelocity, surface_functions, surface_of
from wavetank.tank.walls import Wall, one_time
from wavetank.tank.walls.shaped import ShapedColumns

SHALLOW = 0.1  # of the mean depth: where a surface meets the bed there, the bed is the cause


@dataclass(frozen=True)
class Tolerances:
    """Relative tolerances of the solves within a step.

    Attributes
    ----------
    stage
        Of an implicit stage: root mean square error relative to that of the waves, elevation and potential.
    interior
        Of an interior potential: residual in the energy norm, relative to the right-hand side.
    """

    stage: float = 1e-9
    interior: float = 1e-10


Pair = tuple[Vector, Vector]  # column masses and surface potential


class _Elevation(NamedTuple):
    """The elevation that goes with column masses q at t [s]."""

    q: Vector
    t: float
    eta: Vector


def _lasting(q: Vector, p: Vector) -> tuple[Vector | None, Vector | None]:
    """Return arrays by which a state will be known, if nobody can write into them."""
    return (None, None) if q.flags.writeable or p.flags.writeable else (q, p)


class _Together(Together):
    """What is done of stages as one, along a slice on one rank, where all is as usual."""

    def __init__(self, waves: "NonlinearWaves", inverse: CarriedWaves):
        self._waves, self._inverse = waves, inverse

    def begin_stage(self, stage: Stage, near: Near, among: Combination, *, wrong: float) -> Vector | None:
        """See ``Together``."""
        whole, inverse = self._waves._whole, self._inverse.along(stage)
        if whole is None or inverse is None:
            return None
        return whole.begin_stage(near, weight=stage.weight, wrong=wrong, inverse=inverse, among=among)

    def attempt(self, stage: Stage, known: Vector, z: Vector, mixing: Combination) -> Led | None:
        """See ``Together``."""
        whole, inverse = self._waves._whole, self._inverse.along(stage)
        if whole is None or inverse is None or self._waves.potential.renews:
            return None
        self._waves.set_time(stage.t)
        tried = whole.attempt(z, known, self._waves.bed.still, weight=stage.weight, inverse=inverse, mixing=mixing)
        if tried is None:
            return None
        result, led = tried
        self._waves._take_over(result, stage.t)
        return led


class NonlinearWaves:
    """The tank with its water: a ``HamiltonianSystem`` with q = Q and p = psi.

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
    tolerances
        Of the solves.

    Attributes
    ----------
    depth
        The mean depth [m].
    bed
        The bed, with the depth at the degrees of freedom.
    densities
        Of energy and velocity, in UFL.
    hamiltonian
        H as the sum of its parts, in UFL.
    columns
        Water columns from masses, and back, for the wall as it stands.
    phi, level
        The potential of the point last evaluated and the mean of psi there, which it leaves out [m²/s]: what a
        potential is counted from drifts without end (Bernoulli), and would take the solves' accuracy with it.
    """

    parts = (KINETIC, POTENTIAL)  # and the wall's
    damping: Vector | None = None

    def __init__(
        self,
        plane: Plane,
        *,
        depth: float | Depth,
        wall: Wall,
        vertical_order: int,
        gravity: float = 9.81,
        tolerances: Tolerances | None = None,
    ):
        tolerances = tolerances or Tolerances()
        self.plane, self.wall, self.gravity = plane, wall, gravity
        self.bed = bed_of(depth, plane)
        self.bed.follow(wall)
        self.depth = self.bed.depth
        self.vertical = VerticalBasis(vertical_order)
        self.h = plane.function("water column")
        self.phi = plane.layered_function(vertical_order + 1, "potential")
        self.h.function.x.array[:] = self.depth
        g = fem.Constant(plane.mesh, gravity)
        self.densities = energy = WaterEnergy(h=self.h.function, d=self.bed.d, gravity=g, mapping=wall.mapping)
        self.unit = Unit(plane.comm)
        self.mass = mass_matrix(plane, wall.mapping.J(energy.eta), self.unit)
        self.columns = wall.columns(energy, self.mass, self.unit)
        self._potential = MassMatrix(
            plane, energy.potential(), unit=self.unit, prefix="potential", functions=("total",)
        )
        self._leaning = self.columns if isinstance(self.columns, ShapedColumns) else None
        self.operator, self.layer, minimum = interior_of(
            energy.column, plane, self.vertical, column=self.h, tolerance=tolerances.interior, unit=self.unit
        )
        self._rows = np.zeros((3 if wall.moves else 2, plane.owned))
        self._row = self._rows.reshape(-1)
        self.potential = InteriorPotential(minimum, self.phi, inputs=len(self._rows), plane=plane, unit=self.unit)
        self._compile(energy)
        self._point: Vector = np.full((5, plane.owned), np.nan)  # last evaluated, as of ``Solution``
        self._t = np.nan
        self._array: Vector | None = None  # that as it was given, where nobody can have written into it since
        self._glances = False  # whether how the surface moves is found with potentials
        self._told: Sequence[float] | None = None  # that, of the point last evaluated
        self._stands = 0.0  # when the wall stands as it does
        self._made = 0.0, self.h.owned.copy()  # when it stood, and the water column, as the preconditioner has it
        self.level, self._speed = 0.0, float(np.sqrt(gravity * self.depth))  # the latter of long waves [m/s]
        self._of_wall = self._rows[2:]
        self._per_speed = np.full_like(self._of_wall, self.depth / self._speed)
        self._kinetic = 0.0
        self._has_H_q = False  # which is found when it is asked for
        self._square: float | None = None  # of eta and psi [m²], likewise
        self._elevation = _Elevation(self._point[0], self._t, self._point[0])  # last asked for elsewhere
        self._pair: tuple[Vector | None, Vector | None] = None, None  # the point last evaluated, as ``_array``
        self._energies: Energies | None = None  # of the point last evaluated, found when they are asked for
        self._whole = self._compiled(minimum)
        self._seeing = self._whole
        with self.bed.levelled():
            self.still = self.layer.assemble()
        self._several = len(wall.paddles) > 1
        self._set_up_stages(tolerances)

    # ------------------------------------------------------------------------------------------ forms
    def _compile(self, energy: WaterEnergy) -> None:
        self._wall_terms = self.wall.terms(energy, self.phi, bed=self.bed, vertical=self.vertical, unit=self.unit)

    @cached_property
    def hamiltonian(self) -> dict[Part, ufl.Form]:
        """H as the sum of its parts, in UFL; a run does not need it."""
        energy, dx = self.densities, self.plane.dx
        return {
            KINETIC: energy.kinetic(self.phi.function, self.vertical) * dx,
            POTENTIAL: energy.potential() * dx,
            **self._wall_terms.hamiltonian,
        }

    def _potential_energy(self) -> float:
        """Return the potential energy of the column as it is; collective."""
        return summed(self.plane.comm, self._potential.total())

    # ------------------------------------------------------------------------------------------ the state's flow
    def evaluate(self, q: Vector, p: Vector, t: float) -> None:
        """Find water column and potential of a state, unless it is the one last evaluated; collective."""
        if not self.knows(q, p, t):
            self._find(q, p, t)
        self._pair = _lasting(q, p)

    def _find(self, q: Vector, p: Vector, t: float) -> None:
        """Find them; collective."""
        if self._found(q, p, t):
            return
        wall = self._begin(q, p, t)
        if self.potential.renews:
            self._made = self._stands, self.h.owned.copy()
            for paddle in self.wall.paddles:
                paddle.motion.keep(self._stands, type(self).__name__)
        try:
            flow = self.potential.solve(wall, self._inputs())
        except ConvergenceError as error:
            raise ConvergenceError(f"t = {t:.6g} s: {error}") from None
        self._kinetic = 0.5 * self.potential.minimiser.kinetic
        self._know(np.stack([flow + wall[:, -1], *2 * [np.zeros_like(q)], q, p]), t)

    def _found(self, q: Vector, p: Vector, t: float) -> bool:
        """Find the same, where that is compiled as a whole, and all is as usual; return whether it was."""
        if self._whole is None or self.potential.renews:
            return False
        self.set_time(t)
        result = self._whole.find(q, p, self.bed.still)
        if result is not None:
            self._take_over(result, t)
            self._told = result.surface if self._glances else None
        return result is not None

    def _take_over(self, found: Solution, t: float) -> None:
        """Know what has been found as a whole."""
        self.potential.took(found.iterations)
        self.level, self._kinetic = found.level, 0.5 * found.kinetic
        self._know(found.rows, t)
        self._has_H_q, self._square = True, found.square

    def _compiled(self, minimum: Minimiser) -> Whole | None:
        """Return what finds potentials as a whole, along a slice on one rank, or None."""
        walls = self._wall_terms.along
        surface_points(self.plane, self.wall, self.unit)  # adds their functions to the unit
        if not isinstance(minimum, Minimum) or not isinstance(self.mass, BandedMass) or walls is None:
            return None
        surface_functions(self.plane, self.wall, self.unit)
        return Whole(
            self.plane,
            self.unit,
            mass=self.mass,
            potential=self._potential,
            operator=self.operator,
            minimum=minimum,
            recall=self.potential.recall,
            column=self.h,
            phi=self.phi,
            walls=walls,
            carried=np.unique(self.plane.V.dofmap.list[self.plane.around(self.wall.carries)]),
            leaning=self._leaning,
            inputs=self._rows,
            celerity=self._speed,
        )

    def _begin(self, q: Vector, p: Vector, t: float, column: Vector | None = None) -> Vector:
        """Set all but the interior potential of a state; return the wall's vector, shape (owned, n+1); collective.

        Its column, where it is known, is not found anew.
        """
        self.set_time(t)
        self.h.set(self.columns.solve(q) if column is None else column)
        if self.wall.leans:
            self.mass.update()
        self._check_column(t)
        self.level = self.plane.sum(p) / self.plane.size
        if not np.isfinite(self.level):
            raise BreakdownError(f"t = {t:.6g} s: the surface's potential is no longer a number")
        self.phi.owned[:, -1] = p - self.level
        self.phi.fetch()
        self.operator.update()
        return self._wall_terms.vector()

    def _know(self, point: Vector, t: float) -> None:
        """Keep that the potential is that of a point, with its derivatives, but for H_q."""
        self._point, self._has_H_q, self._square, self._t = point, False, None, t
        self._array = self._told = self._energies = None
        self._pair = None, None

    def knows(self, q: Vector, p: Vector, t: float) -> bool:
        """Return whether that state is the one last evaluated; collective."""
        if not one_time(t, self._t):
            return False
        if q is self._pair[0] and p is self._pair[1]:
            return True
        q_last, p_last = self._point[3:]
        return self._all(q.tobytes() == q_last.tobytes() and p.tobytes() == p_last.tobytes())

    def _all(self, known: bool) -> bool:
        """Return whether it is so on all ranks; collective."""
        return summed(self.plane.comm, float(not known)) == 0

    def set_time(self, t: float) -> None:
        """Move the wall to where it stands at t [s], and with it the mass matrix and the bed; collective."""
        if t != self._t and not one_time(t, self._t):
            self._stand(t)

    def _stand(self, t: float) -> None:
        """Move the wall; collective."""
        self._t, self._stands = np.nan, t  # what was evaluated last belongs to another time
        if self.wall.set_time(t):
            self.mass.update()
            self.bed.follow(self.wall)
        np.multiply(self._per_speed, self.wall.velocities, out=self._of_wall)

    def _inputs(self) -> Vector:
        """Return what the potential depends on but where the wall stands [m]: first eta, and psi in metres.

        The next call reuses the array.
        """
        np.subtract(self.h.owned, self.bed.still, out=self._rows[0])
        np.divide(self.phi.owned[:, -1], self._speed, out=self._rows[1])
        return self._row

    def last_surface(self) -> Surface | None:
        """Return the surface of the point last evaluated, unless the wall has moved since."""
        if isnan(self._t):
            return None
        eta, point = self._rows[0], self._point
        return Surface(eta, point[4], point[0], self.wall.at_surface(eta, self.bed.still))

    def size(self) -> float:
        """Return how far from rest the point last evaluated is: the root mean square of eta and psi [m]; collective."""
        if self._square is None:
            away = self._row[: 2 * self.plane.owned]
            self._square = summed(self.plane.comm, float(away @ away))
        return sqrt(self._square / (2 * self.plane.size))

    def _check_column(self, t: float) -> None:
        if not self._all(np.minimum.reduce(self.h.owned, initial=np.inf) > 0.0):
            self._refuse_column(t)

    def _refuse_column(self, t: float) -> None:
        """Raise what says where the column is lowest, which is not positive; collective."""
        column = np.concatenate([self.h.owned, [np.inf]])  # a rank may own nothing
        column[np.isnan(column)] = -np.inf  # which is less than all numbers on other ranks
        least = int(np.argmin(column))
        place = (*map(float, self.plane.places[least]),) if least < self.plane.owned else (0.0, 0.0)
        still = float(np.append(np.zeros(self.plane.owned) + self.bed.still, 0.0)[least])
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

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dpsi = dQ/dt, shape (owned,), to be read: it is remembered; collective."""
        self.evaluate(q, p, t)
        return read_only(self._point[0])

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dQ = -dpsi/dt = M_J^-1 dH/dh, shape (owned,), likewise; collective."""
        return read_only(self._evaluated(q, p, t)[2])

    def _set_H_q(self, H_q: Vector) -> None:
        self._point[1:3] = -H_q, H_q
        self._has_H_q = True

    def flow(self, z: Vector, t: float) -> Vector:
        """Return dz/dt of z = [Q, psi], one behind the other, shape (2 owned,); collective."""
        last, known = self._point[3:], one_time(t, self._t)
        if not (known and (z is self._array or self._all(z.tobytes() == last.tobytes()))):
            q, p = z.reshape(2, -1)
            self._find(q, p, t)
        self._remember(z)
        return self._derived()[:2].reshape(-1)

    def _remember(self, z: Vector) -> None:
        """Know the point last evaluated by its array, too, if nobody can write into that."""
        self._array = None if z.flags.writeable else z

    def _evaluated(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return what is known of a point, as a ``Solution`` has it, shape (5, owned); collective."""
        self.evaluate(q, p, t)
        return self._derived()

    def _derived(self) -> Vector:
        """Return the same of the point last evaluated; collective."""
        if not self._has_H_q:
            derivative = self.operator.derivative(self.phi.rows)  # the operator has all but the wall's
            self._set_H_q(self.mass.solve(derivative + self._wall_terms.by_column()))
        return self._point

    def energies(self, q: Vector, p: Vector, t: float) -> Energies:
        """Return kinetic and potential energy and the wall's term [m^4/s²]; collective."""
        self.evaluate(q, p, t)
        if self._energies is None:
            self._energies = Energies(self._kinetic, self._potential_energy(), self._wall_terms.energy())
        return self._energies

    def damp(self, rate: Vector) -> None:
        """Tell what a damping of the momenta takes, of rate [1/s], shape (owned,), with what is seen of moments."""
        self.damping = rate
        if self._whole is not None:
            self._whole.damp(rate)

    def see(self, state: State, t: float, into: Block, row: int) -> None:
        """See a state at t [s] from the last of its known points, which is evaluated then: into a row; collective."""
        whole, result = self._seeing, None
        if whole is not None and isinstance(state, BetweenTwo) and not self.potential.renews and self._at_end(state, t):
            next_point = state.points[-1]
            result = whole.look(state.mean, next_point, self._point, self.bed.still, self.gravity, into, row)
        if result is not None:
            self._take_over(result, t)
            self._remember(next_point)
        else:
            see(self, state, t, into, row)
        if self._several:
            into.velocities[row] = self.wall.velocities

    def _at_end(self, state: BetweenTwo, t: float) -> bool:
        """Return whether the point last evaluated is that where the step to a state has ended."""
        return state.points[0] is self._array and (t == self._t or one_time(t, self._t))

    def see_from(self, at: Pair, state: State, t: float, into: Block, row: int) -> None:
        """See a state at t [s] from a point near it, into a row; collective."""
        if self._seeing is None:
            see_from(self, at, state, t, into, row)
        else:
            point, surface = self._evaluated(*at, t), (state.q, state.p)
            self._seeing.see(surface, point, self.bed.still, self._kinetic, self.gravity, into, row)
        if at[0] is state.q and (jump := state.q_jump) is not None:
            into.rise[row] = 0.5 * self.mass.solve(jump)  # which no point beside the state tells

    def energy_near(self, state: State, t: float) -> float | None:
        """Return H from where the step to a state has ended, if that is the point last evaluated; see ``Seeing``."""
        if self._seeing is None or not isinstance(state, BetweenTwo) or not self._at_end(state, t):
            return None
        return self._seeing.energy_near(state.mean, self._derived(), self._kinetic)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H(Q, psi, t), the wall's terms included; collective."""
        parts = self.energies(q, p, t)
        return parts.total + parts.wall

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the degrees of freedom of all ranks; collective."""
        return summed(self.plane.comm, float(a @ b))

    def slopes(self, q: Vector, p: Vector, t: float) -> list[tuple[float, float]]:
        """Return dH/dX_p [m^3/s²] and dH/dX_p' [m^3/s] of each paddle at fixed (Q, psi); collective."""
        self.evaluate(q, p, t)
        return self._wall_terms.slopes(lambda: self.H_q(q, p, t))

    def explicit_rate(self, q: Vector, p: Vector, t: float) -> float:
        """Return dH/dt at fixed (Q, psi) [m^4/s³]: what the moving wall does; collective."""
        if self._seeing is None:
            return self._wall_terms.explicit_rate(lambda: self.H_q(q, p, t))
        return self._seeing.push(self._evaluated(q, p, t), self.bed.still)

    # ------------------------------------------------------------------------------------------ states
    def state(self, eta: Vector, psi: Vector, t: float = 0.0) -> tuple[Vector, Vector]:
        """Return (Q, psi) for elevation [m] and surface potential [m²/s] at the degrees of freedom; collective."""
        self.set_time(t)
        return self.columns.apply(self.bed.still + eta), np.array(psi, dtype=float)

    @property
    def slice_functions(self) -> Instance | None:
        """The compiled functions of a slice on one rank; None elsewhere."""
        return self._whole.instance if self._whole is not None else None

    def ask(self, lines: Struct | None) -> None:
        """Let the surface be looked at where its point is found, along a slice on one rank; by what was asked last."""
        if self._whole is not None:
            self._whole.ask(lines)
            self._glances = lines is not None

    def told(self, state: State, t: float) -> Sequence[float] | None:
        """Return the surface's largest velocity [m/s] and slope where the step to a state has ended; collective.

        If that point, at t [s], was looked at where it was found; None else.
        """
        if isinstance(state, BetweenTwo):
            return self._told if self._at_end(state, t) else None
        if self._glances:
            self.evaluate(*state.known[0], t)  # as is done anyway
            return self._told
        return None

    def ended(self, state: State, t: float) -> tuple[Vector, Vector] | None:
        """Return elevation and surface potential where the step to a state has ended [m, m²/s], shape (owned,) each.

        If that point, at t [s], was looked at where it was found, and is the last: the next one is written over it.
        """
        known = self._told is not None and isinstance(state, BetweenTwo) and self._at_end(state, t)
        return (self._rows[0], self._point[4]) if known else None

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,); collective."""
        self.set_time(t)
        last = self._elevation
        if one_time(t, last.t) and self._all(q.tobytes() == last.q.tobytes()):
            return last.eta.copy()
        if self.knows(q, p, t):
            return np.asarray(self.h.owned - self.bed.still)
        self._elevation = last = _Elevation(q.copy(), t, self.columns.solve(q) - self.bed.still)
        return last.eta.copy()

    def total_mass(self, q: Vector) -> float:
        """Return the water's volume, of a slice per width [m³, m²]; collective."""
        return self.plane.sum(q)

    # ------------------------------------------------------------------------------------------ what is remembered
    def held(self) -> Held:
        """Return the point last evaluated, its potential and derivatives, where the wall stands, what solves remember.

        The elevation last asked for, too: beside a wall that leans it depends, by round-off, on what was there before.
        """
        return {
            "q": self._point[3],
            "p": self._point[4],
            "t": self._t,
            "stands": self._stands,
            "column": self.h.owned.copy(),
            "interior": self.phi.owned[:, :-1].T.copy(),
            "H_p": self._point[0],
            "H_q": self._point[2] if self._has_H_q else None,
            "kinetic": self._kinetic,
            "elevation": self._elevation._asdict(),
            "preconditioner": {"stands": self._made[0], "column": self._made[1]},
            "potential": self.potential.held(),
        }

    def take(self, held: Held) -> None:
        """Take back what has been held; collective."""
        self._made = held["preconditioner"]["stands"], held["preconditioner"]["column"]
        self._stand(self._made[0])
        self.h.set(self._made[1])
        self.operator.update()
        self.potential.take(held["potential"])
        self.h.set(held["column"])
        self._stand(held["stands"])
        if self.wall.leans:
            self.mass.update()
        if not np.isnan(held["t"]):  # else the wall has moved since
            self._t = self._stands
            self._begin(held["q"], held["p"], held["t"], held["column"])
            self._inputs()
            self.phi.owned[:, :-1] = held["interior"].T
            self.phi.fetch()
            none = np.zeros_like(held["q"])
            self._know(np.stack([held["H_p"], none, none, held["q"], held["p"]]), held["t"])
            self._kinetic = held["kinetic"]
            if held["H_q"] is not None:
                self._set_H_q(held["H_q"])
        self._elevation = _Elevation(**held["elevation"])

    # ------------------------------------------------------------------------------------------ stages and frequencies
    def _set_up_stages(self, tolerances: Tolerances) -> None:
        column, speed = scales(self)
        solver = partial(
            AndersonStageSolver,
            self.plane.comm,
            tolerance=tolerances.stage,
            size=self.size,
            floor=self.depth,
        )
        coordinate, momentum = solver(column), solver(speed)
        inverse = CarriedWaves(self, StillWaterWaves(self))
        pair = solver(np.stack([column, speed]), precondition=inverse, together=_Together(self, inverse))
        self.stages = IteratedStages(coordinate, momentum, pair)

    @cached_property
    def largest_frequency(self) -> float:
        """The largest angular frequency the mesh carries on still water [rad/s], by Lanczos iteration; collective."""
        return largest_frequency(self)

    @cached_property
    def surface(self) -> SurfaceVelocity:
        """How the surface moves, found once for all who ask of the same moment; collective."""
        return surface_of(self)
