"""Linear water waves in a tank: the Hamiltonian of ``waves.py`` to second order about still water.

    H = K(phi) + V(h) + X_p' F(phi),     F = d int phi dzeta at the paddle (for two paddles the sum of both)

with the energy of the water at h = d, which is not stated again, without terms that have a slope. In this
limit the vertical modes decouple: with the interior potential phi_I of least K + X_p' F,

    H_psi = G psi + X_p' w,   H_Q = g eta,   H = 1/2 psi G psi + X_p' w psi - 1/2 c X_p'^2 + V
    G = A_nn - A_nI A_II^-1 A_In,   w = w_n - A_nI A_II^-1 w_I,   c = w_I A_II^-1 w_I

where A is the operator of K on still water and (w_I, w_n) = dF/dphi; for two paddles c is a matrix. On the flat bed of
a slice A_II is factorised once for the complete run; H separates, so the stages of Störmer-Verlet are explicit, and the
coupled stage of (23) is one direct solve. In a basin, or on a bed that varies, A_II is assembled once and solved by
conjugate gradients.

The wall stays at x = 0 and is permeable: in linear theory the volume of water increases by d X_p(t), the
volume that the paddle displaces beyond the tank. Apart from that flux, mass is conserved to round-off.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
import ufl
from dolfinx import fem

from wavetank.base.arrays import Vector, summed
from wavetank.fem.along import SliceOperator
from wavetank.fem.codegen import Unit
from wavetank.fem.decoupled import LayerMatrices
from wavetank.fem.forms import VectorForm
from wavetank.fem.layers import LayerOperator
from wavetank.fem.mass import mass_matrix
from wavetank.fem.plane import Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.integrators.contract import Weights, pair
from wavetank.integrators.stages import StageHistories, StageSolver, StagesState
from wavetank.tank.bed import Depth, FlatBed, bed_of
from wavetank.tank.energy import POTENTIAL, Part, WaterEnergy
from wavetank.tank.evaluation import Water, WaterEvaluation, distance_from_rest
from wavetank.tank.potential import InteriorPotential, InteriorState, SolveCounters, interior_of
from wavetank.tank.still_water import StillWaterWaves, largest_frequency, scales
from wavetank.tank.walls import Wall

COUPLED_TOLERANCE = 1e-12  # tolerance of coupled stages; all others are solved exactly


class LinearWaves(Water):
    """The tank with its water, linearised about still water: a ``HamiltonianSystem`` with q = Q = M h and p = psi.

    Parameters
    ----------
    plane
        Horizontal space.
    depth
        Still-water depth d [m], a number or a function of positions (x, y) [m].
    wall
        Wall at x = 0.
    vertical_order
        n.
    gravity
        g [m/s²].
    tolerance
        Relative tolerance of iterative solves.
    """

    parts = (  # without that of the wall
        Part("kinetic", "½ ∫∫ d |v|² dζ dX,  v = (∇φ + (1 - ζ)∇d φ_ζ/d, φ_ζ/d)"),
        POTENTIAL,
    )

    def __init__(
        self,
        plane: Plane,
        *,
        depth: float | Depth,
        wall: Wall,
        vertical_order: int,
        gravity: float = 9.81,
        tolerance: float = 1e-12,
    ):
        self.plane, self.wall, self.gravity = plane, wall, gravity
        self.bed = bed_of(depth, plane)
        self.depth = self.bed.depth
        self.vertical = VerticalBasis(vertical_order)
        d, g = self.bed.d, fem.Constant(plane.mesh, gravity)
        still = WaterEnergy(h=d, d=d, gravity=g, mapping=wall.mapping)
        self.unit = Unit(plane.comm)
        self.mass = mass_matrix(plane, wall.mapping.J(0.0), self.unit)
        self.layer, self._make_potential, operator = self._interior(still, 0.1 * tolerance)
        self.history = self.new_history("steps")  # before the first call of its compiled functions
        with self.bed.levelled():
            self.still = self.layer.assemble()
        if operator is not None:
            operator.update()
        self._tolerance = tolerance
        self._inflow, self._recoil = self._responses([self.flux(paddle, still) for paddle in wall.paddles])

    @property
    def potential(self) -> "IterativePotential | DirectPotential":
        """Interior solver of the steps."""
        return self.history.interior  # type: ignore[no-any-return]

    @property
    def stages(self) -> StageHistories:
        """History of the stages of the steps."""
        stages: StageHistories = self.history.stages
        return stages

    @property
    def _is_direct(self) -> bool:
        """Whether the interior and stages of pairs are solved directly."""
        return self.plane.mesh.topology.dim == 1 and isinstance(self.bed, FlatBed)

    def new_history(self, owner: str) -> "LinearHistory":
        """Return an empty history of solves; collective."""
        nothing = np.full(self.plane.owned, np.nan)
        return LinearHistory(self._make_potential(), nothing, nothing)

    def _interior(
        self, still: WaterEnergy, tolerance: float
    ) -> tuple[Any, Callable[[], "IterativePotential | DirectPotential"], LayerOperator | SliceOperator | None]:
        """Return the layer over the depth, the factory of solvers for the interior, and its operator or None."""
        plane, vertical = self.plane, self.vertical
        if self._is_direct:
            matrices = LayerMatrices(still.layer, plane)
            return matrices, DirectPotential(matrices, vertical).with_new_counters, None
        column = plane.function("water column")
        column.set(self.bed.still)
        operator, layer, minimum = interior_of(
            still.layer, plane, vertical, column=column, tolerance=tolerance, unit=self.unit
        )
        return layer, lambda: IterativePotential(minimum(), plane=plane, components=vertical.n + 1), operator

    def flux(self, paddle: Any, still: WaterEnergy) -> Vector:
        """Return dF/dphi of a paddle for the energy of still water, shape (owned, n+1)."""
        components, shape = self.vertical.n + 1, paddle.shape
        phi = self.plane.layered_function(components, "potential").function
        interior = still.wall_flux(phi, self.vertical, shape.value, degree=shape.degree)
        flux = interior + shape.column(still.h, still.d) * phi[self.vertical.n]
        through = flux * paddle.side.surface(self.plane.mesh)
        return VectorForm(ufl.derivative(through, phi)).assemble().reshape(-1, components).copy()

    def _responses(self, fluxes: Sequence[Vector]) -> tuple[Vector, Vector]:
        """Return w, shape (paddles, owned), and c, shape (paddles, paddles), for dF/dphi of each paddle; collective."""
        inflow, recoil = np.zeros((len(fluxes), self.plane.owned)), np.zeros((len(fluxes), len(fluxes)))
        for n, flux in enumerate(fluxes):
            inflow[n], recoil[n, n] = self.potential.response(flux)
            for m in range(n):
                _, both = self.potential.response(flux + fluxes[m])
                recoil[n, m] = recoil[m, n] = 0.5 * (both - recoil[n, n] - recoil[m, m])
        return inflow, recoil

    def _rates(self, t: float, order: int) -> Vector:
        """Return a time derivative of the paddles' motions, shape (paddles,)."""
        return np.array([paddle.kinematics.at(t)[order] for paddle in self.wall.paddles], dtype=np.float64)

    # ------------------------------------------------------------------------------------------ evaluations
    def set_time(self, t: float) -> None:
        """Do nothing: linear walls do not move."""

    def evaluate(
        self,
        q: Vector,
        p: Vector,
        t: float,
        guess: WaterEvaluation | None = None,
        *,
        history: "LinearHistory | None" = None,
    ) -> WaterEvaluation:
        """Return the evaluation at (q, p, t); collective."""
        eta, G_psi, speeds = self.elevation(q, p, t), self._G_psi(p, history or self.history), self._rates(t, 1)
        through = np.array([self.plane.sum(w * p) for w in self._inflow], dtype=np.float64) - self._recoil @ speeds
        kinetic = 0.5 * self.plane.sum(p * G_psi) + 0.5 * float(speeds @ self._recoil @ speeds)
        potential, wall = 0.5 * self.gravity * self.inner(eta, self.mass.apply(eta)), float(speeds @ through)
        return WaterEvaluation(
            t,
            np.array([q, p]),
            np.array([G_psi + speeds @ self._inflow, -self.gravity * eta]),
            kinetic + potential + wall,
            eta,
            kinetic,
            potential,
            wall,
            float(self._rates(t, 2) @ through),
            [(0.0, float(F)) for F in through],
        )

    def _G_psi(self, p: Vector, history: "LinearHistory") -> Vector:
        """Return G psi, cached for the last psi of the history; collective."""
        same = np.array_equal(p, history.psi)
        if summed(self.plane.comm, float(not same)) > 0.0:
            history.psi, history.G_psi = p.copy(), history.interior.dirichlet_neumann(p)
        return history.G_psi

    # ------------------------------------------------------------------------------------------ states
    def state(self, eta: Vector, psi: Vector, t: float = 0.0) -> tuple[Vector, Vector]:
        """Return (Q, psi) for elevation [m] and surface potential [m²/s] at the degrees of freedom; collective."""
        return self.mass.apply(self.bed.still + eta), np.array(psi, dtype=float)

    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,); collective."""
        return np.asarray(self.mass.solve(q) - self.bed.still)

    def elevation_change(self, at: WaterEvaluation, dq: Vector) -> Vector:
        """Return the change of eta for a change of the masses [m]; collective."""
        return self.mass.solve(dq)

    @cached_property
    def largest_frequency(self) -> float:
        """Largest angular frequency of the mesh [rad/s], by Lanczos iteration; collective."""
        return largest_frequency(self)

    def restore(self, history: "LinearHistory", state: "LinearState") -> None:
        """Replace a history by its state; collective."""
        history.interior.state = state.interior
        history.psi, history.G_psi = state.psi, state.G_psi
        history.stages.restore(state.stages, self.stage_solver.points)

    # ------------------------------------------------------------------------------------------ stages
    @cached_property
    def stage_solver(self) -> StageSolver:  # type: ignore[override]
        """See ``StagedSystem``."""
        tolerance = COUPLED_TOLERANCE if self._is_direct else self._tolerance
        return StageSolver(self.plane.comm, np.array(scales(self)), tolerance=tolerance, floor=self.depth)

    @cached_property
    def _inverse(self) -> StillWaterWaves:
        return StillWaterWaves(self)

    def solve_stage(
        self,
        name: str,
        c: Vector,
        a: Weights,
        t: float,
        guess: WaterEvaluation | None = None,
        *,
        history: "LinearHistory | None" = None,
    ) -> Vector:
        """Return z = c + a f(z, t), shape (2, owned), by one evaluation if it is explicit or direct; collective."""
        history = history or self.history
        if not isinstance(a, tuple) and not self._is_direct:
            return super().solve_stage(name, c, a, t, guess, history=history)
        history.stages.counters.solves += 1
        history.stages.counters.evaluations += 1
        a_q, a_p = pair(a)
        q, p = start = c if guess is None or isinstance(a, tuple) else guess.z
        dq = self._dq(p, t, history) if a_q else 0.0
        dp = -self.gravity * self.elevation(q, p, t) if a_p else 0.0
        image = c + np.array([a_q * dq * np.ones_like(q), a_p * dp * np.ones_like(p)])
        return image if isinstance(a, tuple) else start - self._inverse(a, start - image)

    def begin_stage(self, weight: float | None, t: float, guess: Any) -> None:
        """Do nothing; see ``StagedSystem``."""

    def precondition(self, weight: float, residual: Vector) -> Vector:
        """See ``StagedSystem``."""
        return self._inverse(weight, residual)

    def flow(self, z: Vector, t: float, history: "LinearHistory") -> tuple[Vector, float]:
        """See ``StagedSystem``."""
        q, p = z
        eta, speed = self.elevation(q, p, t), np.sqrt(self.gravity * self.depth)
        flow = np.array([self._dq(p, t, history), -self.gravity * eta])
        return flow, distance_from_rest(eta, p / speed, self.plane)

    def _dq(self, p: Vector, t: float, history: "LinearHistory") -> Vector:
        """Return dH/dpsi, shape (owned,); collective."""
        return np.asarray(self._G_psi(p, history) + self._rates(t, 1) @ self._inflow)


@dataclass(frozen=True, eq=False)
class LinearState:
    """State of a ``LinearHistory``."""

    interior: InteriorState | SolveCounters
    psi: Vector
    G_psi: Vector
    stages: StagesState


@dataclass(eq=False)
class LinearHistory:
    """History of the solves of linear waves; see ``SolverHistory``.

    Attributes
    ----------
    psi, G_psi
        Last surface potential and G psi, shape (owned,).
    """

    interior: "IterativePotential | DirectPotential"
    psi: Vector
    G_psi: Vector
    stages: StageHistories = field(default_factory=StageHistories)

    @property
    def state(self) -> LinearState:
        """The history as plain data; ``LinearWaves.restore`` replaces it."""
        return LinearState(self.interior.state, self.psi, self.G_psi, self.stages.state)


class IterativePotential(InteriorPotential):
    """The interior potential by conjugate gradients, in basins or on beds whose slope couples the modes."""

    def __init__(self, minimum: Any, *, plane: Plane, components: int):
        phi = plane.layered_function(components, "potential")
        super().__init__(minimum, phi, inputs=1, plane=plane, unit=Unit(plane.comm))

    def _surface_flow(self, psi: Vector, flux: Vector, inputs: Vector | None) -> Vector:
        """Return (A phi)_n at the interior potential, shape (owned,); collective."""
        self._phi.owned[:, -1] = psi
        self._phi.function.x.scatter_forward()
        return self.solve(flux, inputs)

    def dirichlet_neumann(self, psi: Vector) -> Vector:
        """Return G psi, shape (owned,); collective."""
        return self._surface_flow(psi, np.zeros((1, self._phi.owned.shape[1])), psi)

    def response(self, flux: Vector) -> tuple[Vector, float]:
        """Return w, shape (owned,), and c for dF/dphi, shape (owned, n+1); see the module; collective."""
        through = self._surface_flow(np.zeros(self._plane.owned), flux, None)
        return flux[:, -1] + through, -self._plane.sum(flux[:, :-1] * self._phi.owned[:, :-1])


class DirectPotential:
    """The interior potential by a direct solve, in the basis of vertical modes of ``fem/vertical.py``.

    In this basis A_In = b (x) S_u and A_nn = S_u with the horizontal stiffness S_u and b_i = int P_i dzeta, so that

        (S_u + Lambda_i S_w) phi_i = -b_i S_u psi - w_i,     (A phi)_n = S_u (psi + sum_i b_i phi_i).
    """

    def __init__(self, matrices: LayerMatrices, vertical: VerticalBasis):
        self.counters = SolveCounters(factorisations=1)
        self._plane = plane = matrices.plane
        self._b = vertical.means
        self._solver, still = matrices.modes(vertical.eigenvalues), matrices.assemble()
        self._solver.take(still)
        self._field = plane.function("surface potential")
        size = (plane.owned, self._field.rows.shape[0])
        self._S_u = scipy.sparse.csr_matrix((still[0], matrices.columns, matrices.row_pointers), shape=size)

    def with_new_counters(self) -> "DirectPotential":
        """Return the same solver with other counters."""
        other = copy(self)
        other.counters = SolveCounters(factorisations=1)
        return other

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
        """Return w, shape (owned,), and c for dF/dphi, shape (owned, n+1); see the module; collective."""
        interior = self._interior(np.ascontiguousarray(flux[:, :-1]))
        return flux[:, -1] - self._stiffness(interior @ self._b), self._plane.sum(flux[:, :-1] * interior)

    @property
    def state(self) -> SolveCounters:
        """Counters of the solves."""
        return replace(self.counters)

    @state.setter
    def state(self, state: SolveCounters) -> None:
        self.counters = replace(state)
