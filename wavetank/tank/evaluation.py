"""The evaluation of the tank at a state: one interior solve, with the derivatives and energies that follow from it."""

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from wavetank.base.arrays import Vector, read_only, summed
from wavetank.fem.mass import MassMatrix
from wavetank.fem.plane import Plane
from wavetank.fem.vertical import VerticalBasis
from wavetank.integrators.contract import Evaluation, State
from wavetank.integrators.stages import StagedSystem
from wavetank.tank.bed import Bed
from wavetank.tank.block import POWER, Block, Parts
from wavetank.tank.energy import Energies


@dataclass(frozen=True, slots=True, eq=False)
class WaterEvaluation(Evaluation):
    """The evaluation of the tank at (q, p, t): column masses and surface potential [m²/s].

    Attributes
    ----------
    eta
        Elevation at the degrees of freedom of this rank [m], shape (owned,).
    kinetic, potential, wall
        Parts of H, per unit of density [m^5/s²], in a slice per width [m^4/s²].
    power
        dH/dt at fixed (q, p): the power of moving walls.
    slopes
        dH/dX_p [m^4/s²] and dH/dX_p' [m^4/s] of each paddle at fixed (q, p); None unless requested.
    interior
        Potential at the degrees of freedom of this rank, relative to the mean at the surface [m²/s], shape (owned,
        n+1);
        None unless requested.
    """

    eta: Vector
    kinetic: float
    potential: float
    wall: float
    power: float
    slopes: list[tuple[float, float]] | None = None
    interior: Vector | None = None


class Water(StagedSystem):
    """Linear or nonlinear waves in a tank: a ``HamiltonianSystem``. All methods are collective.

    Attributes
    ----------
    plane, vertical
        Horizontal and vertical space.
    bed, depth, gravity
        The bed, its mean depth [m], and g [m/s²].
    wall
        Wall that can move: a ``Wall``.
    mass
        M_J.
    layer, still
        The layer averaged over the depth, and its averages for the mean depth.
    damping
        Damping rate of the momenta [1/s], shape (owned,); None without damping.
    t
        Time of the current position of the wall [s].
    """

    plane: Plane
    vertical: VerticalBasis
    bed: Bed
    depth: float
    gravity: float
    wall: Any
    mass: MassMatrix
    layer: Any
    still: Any
    damping: Vector | None = None
    t: float = 0.0
    evaluation_type: type[WaterEvaluation] = WaterEvaluation

    @abstractmethod
    def evaluate(self, q: Vector, p: Vector, t: float, guess: Any = None, *, history: Any = None) -> WaterEvaluation:
        """Return the evaluation at (q, p, t); ``guess`` and ``history`` affect cost and round-off only."""

    @abstractmethod
    def state(self, eta: Vector, psi: Vector, t: float = 0.0) -> tuple[Vector, Vector]:
        """Return (q, p) for elevation [m] and surface potential [m²/s] at the degrees of freedom."""

    @abstractmethod
    def elevation(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return eta at the owned degrees of freedom [m], shape (owned,)."""

    @abstractmethod
    def elevation_change(self, at: WaterEvaluation, dq: Vector) -> Vector:
        """Return the change of eta for a change of the masses at an evaluation, to first order [m], shape (owned,)."""

    @abstractmethod
    def set_time(self, t: float) -> None:
        """Move the wall to its position at t [s], and update the mass matrix and the bed."""

    @abstractmethod
    def new_history(self, owner: str) -> Any:
        """Return an empty history of solves for a caller of evaluations."""

    def tabulate(self, times: Vector) -> None:
        """Evaluate the motions of paddles at times of the next steps [s], shape (T,)."""
        for paddle in self.wall.paddles:
            paddle.kinematics.tabulate(times)

    @cached_property
    def aside(self) -> Any:
        """The history of solves for all methods below, which do not affect the steps."""
        return self.new_history("aside")

    def write_row(self, state: State, t: float, into: Block, row: int) -> Parts:
        """Write a reported state at t [s] into a row of a block; return this rank's parts of its sums; collective.

        Elevation and energies are first-order expansions about the last evaluation of the state. Power, and the power
        of damping, are the means of the values at the first and the last evaluation.
        """
        if state.evaluation is None:
            state = state.evaluated(self, t)
        after, before, q, p = state.evaluation, state.end or state.evaluation, state.q, state.p
        dq, (flow_q, flow_p) = q - after.z[0], after.flow
        into.q[row], into.psi[row] = q, p
        if summed(self.plane.comm, float(dq @ dq)) > 0.0:
            change = self.elevation_change(after, dq)
            into.eta[row], into.rise[row] = after.eta + change, -change
        else:
            into.eta[row], jump = after.eta, state.q_jump
            into.rise[row] = 0.0 if jump is None else 0.5 * self.elevation_change(after, jump)
        if self.t != after.t:
            self.set_time(after.t)
        into.rates[row], into.velocities[row] = self.wall.rates, self.wall.velocities
        power = 0.5 * (before.power + after.power)
        into.numbers[row, : POWER + 1] = after.kinetic, after.potential, after.wall, 0.0, power
        energy = float(flow_q @ (p - after.z[1])) - float(flow_p @ dq)
        damped = 0.0 if self.damping is None else 0.5 * float((before.dq + flow_q) @ (self.damping * p))
        return energy, self.gravity * float(after.eta @ dq), damped

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dq, shape (owned,), read-only."""
        return read_only(-self.evaluate(q, p, t, history=self.aside).dp)

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return dH/dp, shape (owned,), read-only."""
        return read_only(self.evaluate(q, p, t, history=self.aside).dq)

    def energies(self, q: Vector, p: Vector, t: float) -> Energies:
        """Return kinetic and potential energy and the wall's term."""
        at = self.evaluate(q, p, t, history=self.aside)
        return Energies(at.kinetic, at.potential, at.wall)

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return H(q, p, t), including the wall's terms."""
        return self.evaluate(q, p, t, history=self.aside).energy

    def inner(self, a: Vector, b: Vector) -> float:
        """Return the sum of a b over the degrees of freedom of all ranks."""
        return summed(self.plane.comm, float(a @ b))

    def total_mass(self, q: Vector) -> float:
        """Return the volume of the water, for linear waves beyond the paddle's rest position [m³, m²]."""
        return self.plane.sum(q)

    def damp(self, rate: Vector) -> None:
        """Set the damping rate of the momenta [1/s], shape (owned,), whose power ``write_row`` reports."""
        self.damping = rate


def distance_from_rest(eta: Vector, psi: Vector, plane: Plane) -> float:
    """Return the root mean square of elevation and scaled surface potential [m]; collective."""
    square = summed(plane.comm, float(eta @ eta) + float(psi @ psi))
    return float(np.sqrt(square / (2 * plane.size)))
