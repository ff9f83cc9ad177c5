"""The third-order scheme (20) of Gagarina et al. 2016: quadratics in time, Simpson's rule (18), beta = 1 - alpha.

    q½  = (1 - 3/2 beta)  q⁺ + 3/2 beta  q⁻ + dt/4 [ H_p(p⁺, q⁺; t) + H_p(p½, q½; t + dt/2) ]     implicit,
    p½  = (1 - 3/2 alpha) p⁺ + 3/2 alpha p⁻ - dt/4 [ H_q(p⁺, q⁺; t) + H_q(p½, q½; t + dt/2) ]     together
    q⁻' = q⁺ + dt H_p(p½, q½; t + dt/2)
    p⁻' = p⁺ - dt H_q(p½, q½; t + dt/2)
    alpha q⁺' = 2/3 q½ - 1/6 q⁺ + (alpha - 1/2) q⁻' + dt/6 H_p(p⁻', q⁻'; t + dt)
    beta  p⁺' = 2/3 p½ - 1/6 p⁺ + (beta  - 1/2) p⁻' - dt/6 H_q(p⁻', q⁻'; t + dt)

The state is the pair of traces at t; its result is the plus trace. With alpha = 1/2, which is (23), it is stable
for small steps: any other weight multiplies a jump by more than one. Started without jumps (23) carries next to
nothing of its two parasitic modes (28), (31).
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.contract import StepCosts
from wavetank.integrators.flow import flow
from wavetank.integrators.hamiltonian import HamiltonianSystem, Near, Stage
from wavetank.integrators.states import Traces


@dataclass(frozen=True)
class ThirdOrder:
    """Scheme (20), the paper's own: reported at the plus trace, its jumps undamped (``simpson.py`` does otherwise).

    With alpha = 1/2, (23), it is of third order, fourth in frequency, symplectic on the traces, reversible.

    Stable for omega dt < 4 cos(pi/9) - 2 = 1.75877. Cost of a step: one implicit stage and two more evaluations of
    the derivatives.
    """

    name: ClassVar[str] = "third-order"
    order: ClassVar[int] = 3
    stability_limit: ClassVar[float] = 4 * np.cos(np.pi / 9) - 2
    frequency_error: ClassVar[tuple[float, int]] = (1 / 480, 4)
    nodes: ClassVar[tuple[float, ...]] = (0.0, 0.5, 1.0)
    solvable: ClassVar[float] = 1.5
    costs: ClassVar[StepCosts] = StepCosts(
        products=(0.3, 1.2),
        linear=(0.00034, 1.9e-07, 9e-09, 0, 0, 0),
        nonlinear=(0.0002, 9.6e-08, 1.5e-08, 3.1e-05, 2e-07, 2.1e-09),
        driven=(0.00036, 1.4e-07, 1.6e-08, 1.2e-05, 2.8e-07, 4.6e-10),
    )
    alpha: float = 0.5

    def start(self, q: Vector, p: Vector) -> Traces:
        """Return the state of a start without jumps."""
        return Traces(q, q, p, p)

    def step(self, system: HamiltonianSystem, state: Traces, t: float, dt: float) -> Traces:
        """Return the state at t + dt; collective."""
        alpha, beta = self.alpha, 1 - self.alpha
        q_minus, q_plus, p_minus, p_plus = state
        dq, dp = flow(system, q_plus, p_plus, t)
        q_known = (1 - 3 / 2 * beta) * q_plus + 3 / 2 * beta * q_minus + dt / 4 * dq
        p_known = (1 - 3 / 2 * alpha) * p_plus + 3 / 2 * alpha * p_minus + dt / 4 * dp

        def residual(z: Vector) -> Vector:
            q, p = z.reshape(2, -1)
            dq_half, dp_half = flow(system, q, p, t + dt / 2)
            return np.concatenate([q - q_known - dt / 4 * dq_half, p - p_known - dt / 4 * dp_half])

        stage, plus, slope = Stage("(q, p) at 1/2", t + dt / 2, dt, dt / 4), [q_plus, p_plus], [dq, dp]
        near = Near(*map(np.concatenate, ([q_known, p_known], plus, slope)))
        half = system.stages.pair.solve(stage, residual, near.z + dt / 2 * near.slope, near=near)
        q_half, p_half = half.reshape(2, -1)
        dq, dp = flow(system, q_half, p_half, t + dt / 2)
        q_half, p_half = q_known + dt / 4 * dq, p_known + dt / 4 * dp  # keeps what the flow keeps, e.g. mass, exactly
        q_minus_new, p_minus_new = q_plus + dt * dq, p_plus + dt * dp
        dq, dp = flow(system, q_minus_new, p_minus_new, t + dt)
        alpha_q_plus = 2 / 3 * q_half - 1 / 6 * q_plus + (alpha - 1 / 2) * q_minus_new + dt / 6 * dq
        beta_p_plus = 2 / 3 * p_half - 1 / 6 * p_plus + (beta - 1 / 2) * p_minus_new + dt / 6 * dp
        return Traces(q_minus_new, 1 / alpha * alpha_q_plus, p_minus_new, 1 / beta * beta_p_plus)
