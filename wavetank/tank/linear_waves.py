"""Linear water waves in a tank: the Hamiltonian of ``waves.py`` to second order about still water.

    H = K(phi) + V(h) + X_p' F(phi),     F = d int phi dzeta at the paddle (of two paddles the sum of both)

with the water's energy at h = d, so that nothing of it is written twice and no term with a slope is left. What remains
couples the vertical modes no more: with the interior potential phi_I of least K + X_p' F,

    H_psi = G psi + X_p' w,   H_Q = g eta,   H = 1/2 psi G psi + X_p' w psi - 1/2 c X_p'^2 + V
    G = A_nn - A_nI A_II^-1 A_In,   w = w_n - A_nI A_II^-1 w_I,   c = w_I A_II^-1 w_I

where A is the operator of K on still water and (w_I, w_n) = dF/dphi; of two paddles c is a matrix. On the flat bed of a
slice A_II is factored once for the whole run; H separates, so the stages of Störmer-Verlet are explicit, and the
coupled stage of (23) is one direct solve. In a basin, or on a bed that varies, A_II is assembled once and solved by
conjugate gradients.

The wall stays at x = 0 and lets water through: in linear theory the volume of water grows by d X_p(t), which is what
the paddle takes of the tank beyond. Apart from that flux mass is conserved to round-off.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy
import ufl
from dolfinx import fem

from wavetank.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.forms import ScalarForm, VectorForm
from wavetank.fem.mass import mass_matrix
from wavetank.fem.modes import Layer
from wavetank.fem.plane import Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.integrators.affine_stages import DirectStage
from wavetank.integrators.stage_solver import AndersonStageSolver, StageCounters
from wavetank.state import Held, Stateful, restore_all, states_of
from wavetank.tank.bed import Depth, FlatBed, bed_of
from wavetank.tank.energy import POTENTIAL, Energies, Part, WaterEnergy
from wavetank.tank.potential import InteriorPotential, Minimiser, SolveCounters, interior_of
from wavetank.tank.seen import Block, State, see, see_from
from wavetank.tank.still_water import StillWaterWaves, largest_frequency, scales
from wavetank.tank.walls import LinearWall
from wavetank.tank.walls.contract import LinearOpening

COUPLED_TOLERANCE = 1e-12  # of stages that are solved together; all others are solved exactly


class LinearWaves:
    """The tank with its water, linearised about still water: a ``HamiltonianSystem`` with q = Q = M h and p = psi.

    Parameters
    ----------
    plane
        The horizontal space.
    depth
        Still-water depth d [m], a number or a function of places (x, y) [m].
    wall
        The wall at x = 0.
    vertical_order
        n.
    gravity
        [m/s²].
    tolerance
        Relative tolerance of what is solved iteratively.
    """

    damping: Vector | None = None
    parts = (  # and the wall's
        Part("kinetic", "½ ∫∫ d |v|² dζ dX,  v = (∇φ + (1 - ζ)∇d φ_ζ/d, φ_ζ/d)"),
        POTENTIAL,
    )

    def __init__(
        self,
        plane: Plane,
        *,
        depth: float | Depth,
        wall: LinearWall,
        vertical_order: int,
        gravity: float = 9.81,
        tolerance: float = 1e-12,
    ):
        self.plane, self.wall, self.gravity = plane, wall, gravity
        self.bed = bed_of(depth, plane)
        self.depth = self.bed.depth
        self.vertical = VerticalBasis(vertical_order)
        self.h = plane.function("water column")
        self.h.set(np.zeros(plane.owned) + self.bed.still)
        d, g = self.bed.d, fem.Constant(plane.mesh, gravity)
        self._gravity_energy = ScalarForm(
            WaterEnergy(h=self.h.function, d=d, gravity=g, mapping=wall.mapping).potential() * plane.dx, plane.comm
        )
        still = WaterEnergy(h=d, d=d, gravity=g, mapping=wall.mapping)
        self.unit = Unit(plane.comm)
        self.mass = mass_matrix(plane, wall.mapping.J(0.0), self.unit)
        self.layer: Layer
        self.potential, self.layer, self.still = self._interior(still, tolerance)
        direct = isinstance(self.potential, DirectPotential)
        self.stages = LinearStages.of(self, tolerance=COUPLED_TOLERANCE if direct else tolerance, direct=direct)
        self._motions = [paddle.motion for paddle in wall.paddles]
        self._inflow, self._recoil = self._responses([self.flux(paddle, still) for paddle in wall.paddles])
        self._q: Vector = np.full(plane.owned, np.nan)
        self._p: Vector = self._q
        self._G_psi: Vector = self._q

    def _interior(self, still: WaterEnergy, tolerance: float) -> tuple["StillPotential", Layer, Any]:
        """Return the interior potential, the layer over the depth, and its averages for the mean depth."""
        plane, vertical = self.plane, self.vertical
        if plane.mesh.topology.dim == 1 and isinstance(self.bed, FlatBed):
            matrices = LayerMatrices(still.layer, plane)
            return DirectPotential(matrices, vertical), matrices, matrices.assemble()
        operator, layer, minimum = interior_of(
            still.layer, plane, vertical, column=self.h, tolerance=0.1 * tolerance, unit=self.unit
        )
        with self.bed.levelled():
            averages = layer.assemble()
        operator.update()
        return IterativePotential(minimum, plane=plane, components=vertical.n + 1), layer, averages

    def flux(self, paddle: LinearOpening, still: WaterEnergy) -> Vector:
        """Return dF/dphi of a paddle for the energy of still water, shape (owned, n+1)."""
        components, shape = self.vertical.n + 1, paddle.shape
        phi = self.plane.layered_function(components, "potential").function
        interior = still.wall_flux(phi, self.vertical, shape.share, degree=shape.degree)
        flux = interior + shape.column(still.h, still.d) * phi[self.vertical.n]
        return VectorForm(ufl.derivative(flux * paddle.opening, phi)).assemble().reshape(-1, components).copy()

    def _responses(self, fluxes: Sequence[Vector]) -> tuple[Vector, Vector]:
        """Return w, shape (paddles, owned), and c, shape (paddles, paddles), for the dF/dphi of each; collective."""
        inflow, recoil = np.zeros((len(fluxes), self.plane.owned)), np.zeros((len(fluxes), len(fluxes)))
        for n, flux in enumerate(fluxes):
            inflow[n], recoil[n, n] = self.potential.response(flux)
            for m in range(n):
                _, both = self.potential.response(flux + fluxes[m])
                recoil[n, m] = recoil[m, n] = 0.5 * (both - recoil[n, n] - recoil[m, m])
        return inflow, recoil

    def _rates(self, t: float, order: int) -> Vector:
        """Return a derivative of the paddles' motions, shape (paddles,)."""
        return np.array([motion.derivative(t, order) for motion in self._motions], dtype=np.float64)

    # ------------------------------------------------------------------------------------------ the state's flow
    def set_time(self, t: float) -> None:
        """Nothing moves: at any time the wall stands where it does."""

    def evaluate(self, q: Vector, p: Vector, t: float) -> None:
        """Set the water column h of a state and find G psi, each unless it is the one last found; collective."""
        self._set_column(q)
        self._set_potential(p)

    def _agree(self, known: bool) -> bool:
        return bool(self.plane.comm.allreduce(int(not known)) == 0)

    def _set_column(self, q: Vector) -> None:
        if not self._agree(np.array_equal(q, self._q)):
            self.h.set(self.mass.solve(q))
            self._q = q.copy()

    def _set_potential(self, p: Vector) -> None:
        if not self.knows(self._q, p, 0.0):
            self._G_psi = self.potential.dirichlet_neumann(p)
            self._p = p.copy()

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dpsi = dQ/dt, shape (owned,); collective."""
        self._set_potential(p)
        return np.asarray(self._G_psi + self._rates(t, 1) @ self._inflow)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dQ = -dpsi/dt = g eta, shape (owned,); collective."""
        return self.gravity * self.elevation(q, p, t)

    def energies(self, q: Vector, p: Vector, t: float) -> Energies:
        """Return kinetic and potential energy and the wall's term [m^4/s²]; collective."""
        self.evaluate(q, p, t)
        speeds = self._rates(t, 1)
        kinetic = 0.5 * self.plane.sum(p * self._G_psi) + 0.5 * float(speeds @ self._recoil @ speeds)
        return Energies(kinetic, self._gravity_energy.assemble(), float(speeds @ self._through_walls(p, speeds)))

    def _through_walls(self, p: Vector, speeds: Vector) -> Vector:
        """Return F of each paddle at the interior potential [m^4/s], shape (paddles,); collective."""
        return np.array([self.plane.sum(w * p) for w in self._inflow], dtype=np.float64) - self._recoil @ speeds

    def damp(self, rate: Vector) -> None:
        """Tell what a damping of the momenta takes, of rate [1/s], shape (owned,), with what is seen of moments."""
        self.damping = rate

    def see(self, state: State, t: float, into: Block, row: int) -> None:
        """See a state at t [s] from the last of its known points, into a row; collective."""
        see(self, state, t, into, row)

    def see_from(self, at: tuple[Vector, Vector], state: State, t: float, into: Block, row: int) -> None:
        """See a state at t [s] from a point near it, into a row; collective."""
        see_from(self, at, state, t, into, row)

    def knows(self, q: Vector, p: Vector, t: float) -> bool:
        """Return whether G psi of a point is known; collective."""
        return self._agree(np.array_equal(p, self._p))

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H(Q, psi, t), the wall's term included; collective."""
        parts = self.energies(q, p, t)
        return parts.total + parts.wall

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the degrees of freedom of all ranks; collective."""
        return self.plane.sum(a * b)

    def slopes(self, q: Vector, p: Vector, t: float) -> list[tuple[float, float]]:
        """Return dH/dX_p = 0 and dH/dX_p' = F [m^3/s] of each paddle at fixed (Q, psi); collective."""
        return [(0.0, float(F)) for F in self._through_walls(p, self._rates(t, 1))]

    def explicit_rate(self, q: Vector, p: Vector, t: float) -> float:
        """Return dH/dt at fixed (Q, psi), X_p'' F [m^4/s³]: what the paddle does; collective."""
        return float(self._rates(t, 2) @ self._through_walls(p, self._rates(t, 1)))

    # ------------------------------------------------------------------------------------------ states
    def state(self, eta: Vector, psi: Vector, t: float = 0.0) -> tuple[Vector, Vector]:
        """Return (Q, psi) for elevation [m] and surface potential [m²/s] at the degrees of freedom; collective."""
        return self.mass.apply(self.bed.still + eta), np.array(psi, dtype=float)

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,); collective."""
        self._set_column(q)
        return np.asarray(self.h.owned - self.bed.still)

    def size(self) -> float:
        """Return how far from rest the point last evaluated is: the root mean square of eta and psi [m]; collective."""
        eta, psi = self.h.owned - self.bed.still, self._p / np.sqrt(self.gravity * self.depth)
        return float(np.sqrt(self.plane.sum(eta**2 + psi**2) / (2 * self.plane.size)))

    def total_mass(self, q: Vector) -> float:
        """Return the water's volume beyond the paddle's rest position [m³, m²], which follows X_p; collective."""
        return self.plane.sum(q)

    @cached_property
    def largest_frequency(self) -> float:
        """The largest angular frequency the mesh carries [rad/s], by Lanczos iteration; collective."""
        return largest_frequency(self)

    def held(self) -> Held:
        """Return what was evaluated last, and what solves remember."""
        return {"q": self._q, "p": self._p, "G psi": self._G_psi, "potential": self.potential.held()}

    def take(self, held: Held) -> None:
        """Take back what has been held; collective."""
        self._set_column(held["q"])
        self._p, self._G_psi = held["p"], held["G psi"]
        self.potential.take(held["potential"])


class StillPotential(Stateful, Protocol):
    """The interior potential on still water, of least K + X_p' F.

    Attributes
    ----------
    counters
        What its solves cost.
    """

    counters: SolveCounters

    def dirichlet_neumann(self, psi: Vector) -> Vector:
        """Return G psi, shape (owned,); collective."""

    def response(self, flux: Vector) -> tuple[Vector, float]:
        """Return w, shape (owned,), and c of the module's formulae for dF/dphi, shape (owned, n+1); collective."""


class IterativePotential:
    """The interior potential by conjugate gradients: in basins, and where the bed's slope couples the modes."""

    def __init__(self, minimum: Minimiser, *, plane: Plane, components: int):
        self._plane = plane
        self._phi = plane.layered_function(components, "potential")
        self._potential = InteriorPotential(minimum, self._phi, inputs=1, plane=plane)
        self.counters = self._potential.counters
        self._no_flux = np.zeros((1, components))

    def _solve(self, psi: Vector, flux: Vector, inputs: Vector | None) -> Vector:
        """Return (A phi)_n at the interior potential, shape (owned,); collective."""
        self._phi.owned[:, -1] = psi
        self._phi.function.x.scatter_forward()
        return self._potential.solve(flux, inputs)

    def dirichlet_neumann(self, psi: Vector) -> Vector:
        """Return G psi, shape (owned,); collective."""
        return self._solve(psi, self._no_flux, psi)

    def response(self, flux: Vector) -> tuple[Vector, float]:
        """Return w, shape (owned,), and c of the module's formulae for dF/dphi, shape (owned, n+1); collective."""
        through = self._solve(np.zeros(self._plane.owned), flux, None)
        return flux[:, -1] + through, -self._plane.sum(flux[:, :-1] * self._phi.owned[:, :-1])

    def held(self) -> Held:
        """Return what the solver remembers."""
        return self._potential.held()

    def take(self, held: Held) -> None:
        """Take back what has been held; collective."""
        self._potential.take(held)


class DirectPotential:
    """The interior potential by a direct solve, in the basis of vertical modes of ``fem/vertical.py``.

    There A_In = b (x) S_u and A_nn = S_u with the horizontal stiffness S_u and b_i = int P_i dzeta, so that

        (S_u + Lambda_i S_w) phi_i = -b_i S_u psi - w_i,     (A phi)_n = S_u (psi + sum_i b_i phi_i).
    """

    def __init__(self, matrices: LayerMatrices, vertical: VerticalBasis):
        self.counters = SolveCounters(factorisations=1)
        self._plane = plane = matrices.plane
        self._b = vertical.moment(0, vertical.values, vertical.values)[:-1, -1]
        self._solver, still = matrices.modes(vertical.eigenvalues), matrices.assemble()
        self._solver.take(still)
        self._field = plane.function("surface potential")
        size = (plane.owned, self._field.rows.shape[0])
        self._S_u = scipy.sparse.csr_matrix((still[0], matrices.columns, matrices.row_pointers), shape=size)

    def _stiffness(self, values: Vector) -> Vector:
        self._field.set(values)
        return np.asarray(self._S_u @ self._field.rows[:, 0])

    def _interior(self, right: Vector) -> Vector:
        self.counters.solves += 1
        self.counters.iterations += 1
        return self._solver.solve(right)

    def dirichlet_neumann(self, psi: Vector) -> Vector:
        """Return G psi, shape (owned,); collective."""
        interior = self._interior(np.multiply.outer(self._stiffness(psi), self._b))
        return self._stiffness(psi - interior @ self._b)

    def response(self, flux: Vector) -> tuple[Vector, float]:
        """Return w, shape (owned,), and c of the module's formulae for dF/dphi, shape (owned, n+1); collective."""
        interior = self._interior(np.ascontiguousarray(flux[:, :-1]))
        return flux[:, -1] - self._stiffness(interior @ self._b), self._plane.sum(flux[:, :-1] * interior)

    def held(self) -> Held:
        """Return what solves have cost."""
        return asdict(self.counters)

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        vars(self.counters).update(held)


@dataclass(frozen=True)
class LinearStages:
    """The stage solvers of linear waves; see ``wavetank.integrators.hamiltonian.Stages``.

    Attributes
    ----------
    iterative
        That of pairs, one or several that depend on each other; of one in ``pair`` where that is not direct.
    """

    coordinate: DirectStage
    momentum: DirectStage
    pair: DirectStage | AndersonStageSolver
    iterative: AndersonStageSolver

    @classmethod
    def of(cls, waves: LinearWaves, *, tolerance: float, direct: bool) -> "LinearStages":
        """Return the solvers of waves: of one stage explicit, or direct where the inverse is; of the others iterative.

        ``tolerance`` is that of the latter.
        """
        inverse, sizes = StillWaterWaves(waves), np.stack(scales(waves))
        iterative = AndersonStageSolver(
            waves.plane.comm, sizes, tolerance=tolerance, size=waves.size, floor=waves.depth, precondition=inverse
        )
        return cls(DirectStage(), DirectStage(), DirectStage(inverse) if direct else iterative, iterative)

    def coupled(self, pairs: int) -> AndersonStageSolver:
        """Return the solver for that many pairs at once, as Gauss-Legendre's scheme has them; made when first asked."""
        return self.iterative.coupled(pairs)

    @property
    def counters(self) -> StageCounters:
        """What all of them have cost so far."""
        return sum((solver.counters for solver in self._solvers.values()), StageCounters())

    @property
    def _solvers(self) -> dict[str, DirectStage | AndersonStageSolver]:
        """All of them, by their names, once each."""
        return {name: one for name, one in vars(self).items() if name != "pair" or one is not self.iterative}

    def held(self) -> Held:
        """Return what all of them remember."""
        return states_of(self._solvers)

    def take(self, held: Held) -> None:
        """Take back what has been held."""
        restore_all(self._solvers, held)
