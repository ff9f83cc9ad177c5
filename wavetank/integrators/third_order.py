"""The third-order scheme (23) of Gagarina et al. 2016: quadratics in time, Simpson's rule (18), weights 1/2.

    q½  = 3/4 q⁻ + 1/4 q⁺ + dt/4 [ H_p(p⁺, q⁺; t) + H_p(p½, q½; t + dt/2) ]     implicit,
    p½  = 3/4 p⁻ + 1/4 p⁺ - dt/4 [ H_q(p⁺, q⁺; t) + H_q(p½, q½; t + dt/2) ]     together
    q⁻' = q⁺ + dt H_p(p½, q½; t + dt/2)
    p⁻' = p⁺ - dt H_q(p½, q½; t + dt/2)
    q⁺' = 4/3 q½ - 1/3 q⁺ + dt/3 H_p(p⁻', q⁻'; t + dt)
    p⁺' = 4/3 p½ - 1/3 p⁺ - dt/3 H_q(p⁻', q⁻'; t + dt)

The state is the pair of traces at t; its result is the plus trace. Started without jumps the scheme carries none of its
two parasitic modes (28), (31).
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from wavetank.hamiltonian.contract import HamiltonianSystem, Stage, Vector


class Traces(NamedTuple):
    """The traces of q and p before and after the jump at t."""

    q_minus: Vector
    q_plus: Vector
    p_minus: Vector
    p_plus: Vector

    @property
    def q(self) -> Vector:
        """The coordinates the scheme reports."""
        return self.q_plus

    @property
    def p(self) -> Vector:
        """The momenta the scheme reports."""
        return self.p_plus


@dataclass(frozen=True)
class ThirdOrder:
    """Scheme (23). Third order, fourth in frequency, symplectic on the traces, stable for omega dt <= 1.7597.

    Cost of a step: one implicit stage and two more evaluations of the derivatives.
    """

    name: ClassVar[str] = "third-order"
    order: ClassVar[int] = 3
    stability_limit: ClassVar[float] = 1.7597
    frequency_error: ClassVar[tuple[float, int]] = (1 / 480, 4)
    nodes: ClassVar[tuple[float, ...]] = (0.0, 0.5, 1.0)

    def start(self, q: Vector, p: Vector) -> Traces:
        """Return the state of a start without jumps."""
        return Traces(q, q, p, p)

    def step(self, system: HamiltonianSystem, state: Traces, t: float, dt: float) -> Traces:
        """Return the state at t + dt; collective."""
        q_minus, q_plus, p_minus, p_plus = state
        dq, dp = flow(system, q_plus, p_plus, t)
        q_known = 3 / 4 * q_minus + 1 / 4 * q_plus + dt / 4 * dq
        p_known = 3 / 4 * p_minus + 1 / 4 * p_plus + dt / 4 * dp

        def residual(z: Vector) -> Vector:
            q, p = np.split(z, 2)
            dq_half, dp_half = flow(system, q, p, t + dt / 2)
            return np.concatenate([q - q_known - dt / 4 * dq_half, p - p_known - dt / 4 * dp_half])

        start = np.concatenate([q_plus + dt / 2 * dq, p_plus + dt / 2 * dp])
        half = system.stages.pair.solve(Stage("(q, p) at 1/2", t + dt / 2, dt, dt / 4), residual, start)
        q_half, p_half = np.split(half, 2)
        dq, dp = flow(system, q_half, p_half, t + dt / 2)
        q_half, p_half = q_known + dt / 4 * dq, p_known + dt / 4 * dp  # keeps what the flow keeps, e.g. mass, exactly
        q_minus_new, p_minus_new = q_plus + dt * dq, p_plus + dt * dp
        dq, dp = flow(system, q_minus_new, p_minus_new, t + dt)
        return Traces(
            q_minus_new,
            4 / 3 * q_half - 1 / 3 * q_plus + dt / 3 * dq,
            p_minus_new,
            4 / 3 * p_half - 1 / 3 * p_plus + dt / 3 * dp,
        )


def flow(system: HamiltonianSystem, q: Vector, p: Vector, t: float) -> tuple[Vector, Vector]:
    """Return (dq/dt, dp/dt) at one point."""
    return system.H_p(q, p, t), -system.H_q(q, p, t)
