"""The compared schemes, each with the representation of its state as a plain vector."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from examples.paper.composition import SuzukiVerlet
from examples.paper.discontinuous_verlet import DiscontinuousVerlet, DiscontinuousVerletAdjoint, JumpInP, JumpInQ
from examples.paper.lobatto import P2N3Q4Lob
from examples.paper.midpoint import ModifiedMidpoint
from examples.paper.symplectic_euler import SymplecticEuler, SymplecticEulerAdjoint
from examples.paper.watched import watched
from wavetank.base.arrays import Vector
from wavetank.integrators import (
    GaussLegendre4,
    Point,
    Simpson4,
    StormerVerlet,
    StormerVerletAdjoint,
    ThirdOrder,
    Traces,
)
from wavetank.integrators.contract import HamiltonianSystem, Integrator, rows
from wavetank.integrators.simpson import MeanAndJumps


@dataclass(frozen=True)
class Scheme:
    """An integrator on one degree of freedom, its state a vector z of shape (width,).

    Attributes
    ----------
    label
        Name in pictures and tables.
    integrator
        The integrator.
    width
        Numbers in a state.
    state
        Makes a state of that many arrays of shape (1,).
    form
        The two-form that a step preserves, shape (width, width): M' form M = form for the step's derivative M.
    reverse
        Turns time round: z -> reverse z, shape (width, width).
    traces
        Where q⁻, q⁺, p⁻ and p⁺ stand in z.
    """

    label: str
    integrator: Integrator[Any]
    width: int
    state: Callable[..., Any]
    form: NDArray[Any]
    reverse: NDArray[Any]
    traces: tuple[int, int, int, int]

    def start(self, q: float, p: float) -> Vector:
        """Return the vector of a smooth start, shape (width,)."""
        return self.vector(self.integrator.start(*point(q, p)))

    def vector(self, state: Any) -> Vector:
        """Return a state as a vector, shape (width,)."""
        return rows(state).ravel()[: self.width]

    def step(self, system: HamiltonianSystem, z: Vector, t: float, dt: float) -> Vector:
        """Return the vector of the state at t + dt."""
        return self.vector(self.integrator.step(system, self.state(*z[:, None]), t, dt))


def point(q: float, p: float) -> tuple[Vector, Vector]:
    """Return coordinates and momenta of one degree of freedom, shape (1,) each."""
    return np.array([q]), np.array([p])


def path(scheme: Scheme, system: HamiltonianSystem, *, q: float, p: float, dt: float, steps: int) -> Vector:
    """Return the vectors at a smooth start and after each step, shape (steps + 1, width)."""

    def vector(state: Any, step: int) -> Vector:
        return scheme.vector(state)

    return np.array(watched(system, scheme.integrator, vector, start=point(q, p), dt=dt, steps=steps))


def trajectory(scheme: Scheme, system: HamiltonianSystem, *, q: float, p: float, dt: float, steps: int) -> Vector:
    """Return t, q and p at the start and after each step, shape (3, steps + 1)."""

    def row(state: Any, step: int) -> tuple[float, float, float]:
        return step * dt, state.q[0], state.p[0]

    return np.array(watched(system, scheme.integrator, row, start=point(q, p), dt=dt, steps=steps)).T


def largest_error(scheme: Scheme, system: Any, *, q: float, p: float, dt: float, duration: float) -> float:
    """Return the largest distance in the (q, p) plane from the system's exact solution, at the ends of steps."""
    t, *computed = trajectory(scheme, system, q=q, p=p, dt=dt, steps=round(duration / dt))
    exact = np.array([system.exact(q, p, time) for time in t]).T
    return float(np.hypot(*(np.array(computed) - exact)).max())


def amplification(scheme: Scheme, system: HamiltonianSystem, dt: float) -> Vector:
    """Return M with z' = M z for a linear system, the scheme run on unit vectors, shape (width, width)."""
    return np.array([scheme.step(system, unit, 0.0, dt) for unit in np.eye(scheme.width)]).T


def two_form(width: int, *terms: tuple[int, int, float]) -> NDArray[Any]:
    """Return the sum of weight dz_i ^ dz_j over terms (i, j, weight), shape (width, width)."""
    form = np.zeros((width, width))
    for i, j, weight in terms:
        form[i, j], form[j, i] = weight, -weight
    return form


def continuous(label: str, integrator: Integrator[Any]) -> Scheme:
    """Return a scheme whose state is (q, p); it keeps dq ^ dp."""
    return Scheme(label, integrator, 2, Point, two_form(2, (0, 1, 1.0)), np.diag([1.0, -1.0]), (0, 0, 1, 1))


def third_order(alpha: float = 0.5) -> Scheme:
    """Return (20), its state (q⁻, q⁺, p⁻, p⁺); it keeps beta dq⁻ ^ dp⁺ + alpha dq⁺ ^ dp⁻.

    That form is (37) for alpha = 1/2. Turning time round the traces change places.
    """
    label = "third order (23)" if alpha == 0.5 else f"third order (20), alpha = {alpha}"
    form = two_form(4, (0, 3, 1 - alpha), (1, 2, alpha))
    reverse = np.array([[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, -1], [0, 0, -1, 0]], dtype=float)
    return Scheme(label, ThirdOrder(alpha), 4, Traces, form, reverse, (0, 1, 2, 3))


def simpson(integrator: Simpson4 | None = None) -> Scheme:
    """Return (23) in mean and jump, its jumps damped, its state (q, p) and three jumps of both, the newest first.

    Without damping it keeps dq ^ dp - 1/4 d(jump of q) ^ d(jump of p), which is (37).
    """

    def state(*values: Vector) -> MeanAndJumps:
        return MeanAndJumps(np.reshape(values, (4, 2, 1)))

    form, reverse = two_form(8, (0, 1, 1.0), (2, 3, -0.25)), np.diag([1.0, -1.0, -1.0, 1.0] + 4 * [0.0])
    scheme = integrator or Simpson4()
    label = "Simpson 4" if scheme.kappa else "Simpson 4, jumps not damped"
    return Scheme(label, scheme, 8, state, form, reverse, (0, 0, 1, 1))


def discontinuous(alpha: float) -> Scheme:
    """Return (14) with its jump, its state (q⁻, q⁺, p); it keeps (beta dq⁻ + alpha dq⁺) ^ dp."""

    def state(q_minus: Vector, q_plus: Vector, p: Vector) -> JumpInQ:
        return JumpInQ(q_minus, q_plus, p, alpha)

    form, reverse = two_form(3, (0, 2, 1 - alpha), (1, 2, alpha)), np.diag([1.0, 1.0, -1.0])[[1, 0, 2]]
    label = f"(14) with its jump, alpha = {alpha:g}"
    return Scheme(label, DiscontinuousVerlet(alpha), 3, state, form, reverse, (0, 1, 2, 2))


def discontinuous_adjoint(alpha: float) -> Scheme:
    """Return (15)-(16) with its jump, its state (q, p⁻, p⁺); it keeps dq ^ (alpha dp⁻ + beta dp⁺)."""

    def state(q: Vector, p_minus: Vector, p_plus: Vector) -> JumpInP:
        return JumpInP(q, p_minus, p_plus, alpha)

    form, reverse = two_form(3, (0, 1, alpha), (0, 2, 1 - alpha)), np.diag([1.0, -1.0, -1.0])[[0, 2, 1]]
    label = f"(15)-(16) with its jump, alpha = {alpha:g}"
    return Scheme(label, DiscontinuousVerletAdjoint(alpha), 3, state, form, reverse, (0, 0, 1, 2))


def all_schemes() -> list[Scheme]:
    """Return the schemes in the order in which the paper has them, then those of other sources."""
    return [
        continuous("symplectic Euler", SymplecticEuler()),
        continuous("symplectic Euler, adjoint", SymplecticEulerAdjoint()),
        continuous("modified midpoint", ModifiedMidpoint()),
        continuous("Störmer-Verlet (14)", StormerVerlet()),
        continuous("Störmer-Verlet, adjoint (15)-(16)", StormerVerletAdjoint()),
        third_order(),
        continuous("P2N3Q4Lob", P2N3Q4Lob()),
        continuous("Gauss-Legendre 4", GaussLegendre4()),
        continuous("Suzuki-Verlet", SuzukiVerlet()),
    ]
