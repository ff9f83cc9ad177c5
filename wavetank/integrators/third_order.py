"""The third-order scheme (20) of Gagarina et al. 2016: quadratics in time, Simpson's rule (18), beta = 1 - alpha.

    q½  = (1 - 3/2 beta)  q⁺ + 3/2 beta  q⁻ + dt/4 [ H_p(p⁺, q⁺; t) + H_p(p½, q½; t + dt/2) ]     implicit,
    p½  = (1 - 3/2 alpha) p⁺ + 3/2 alpha p⁻ - dt/4 [ H_q(p⁺, q⁺; t) + H_q(p½, q½; t + dt/2) ]     coupled
    q⁻' = q⁺ + dt H_p(p½, q½; t + dt/2)
    p⁻' = p⁺ - dt H_q(p½, q½; t + dt/2)
    alpha q⁺' = 2/3 q½ - 1/6 q⁺ + (alpha - 1/2) q⁻' + dt/6 H_p(p⁻', q⁻'; t + dt)
    beta  p⁺' = 2/3 p½ - 1/6 p⁺ + (beta  - 1/2) p⁻' - dt/6 H_q(p⁻', q⁻'; t + dt)

The state is the pair of traces at t; the scheme reports the plus trace. With alpha = 1/2, which is (23), it is stable
for small steps: any other weight multiplies a jump by more than one. After a start without jumps, (23) excites its two
parasitic modes (28), (31) very little.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, StepCosts, Traces


@dataclass(frozen=True)
class ThirdOrder:
    """Scheme (20) of the paper, reported at the plus trace, with undamped jumps (``simpson.py`` damps them).

    With alpha = 1/2, (23), it is of third order, fourth in frequency, symplectic on the traces, reversible.

    Stable for omega dt < 4 cos(pi/9) - 2 = 1.75877. Cost of a step: one implicit stage and two further evaluations of
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
        weights = np.array([[beta], [alpha]])  # weights of q and p
        minus, plus = np.array([state.q_minus, state.p_minus]), np.array([state.q_plus, state.p_plus])
        begin = state.evaluated(system, t).evaluation
        known = (1 - 3 / 2 * weights) * plus + 3 / 2 * weights * minus + dt / 4 * begin.flow
        half = system.solve_stage("(q, p) at 1/2", known, dt / 4, t + dt / 2, begin)
        f_half = system.evaluate(half[0], half[1], t + dt / 2, begin).flow
        half = known + dt / 4 * f_half  # conserves the linear invariants of the flow, e.g. mass, exactly
        new = plus + dt * f_half
        f_1 = system.evaluate(new[0], new[1], t + dt, begin).flow
        scaled = 2 / 3 * half - 1 / 6 * plus + (weights[::-1] - 1 / 2) * new + dt / 6 * f_1
        plus = 1 / weights[::-1] * scaled
        return Traces(new[0], plus[0], new[1], plus[1])
