"""The third-order scheme (23) of Gagarina et al. 2016, in the mean and the jump of its traces, its jumps smoothed.

With z = (q, p), dz/dt = f(z, t) and the traces z± = z ± d/2 about their mean z, d the jump, (23) reads

    z½ = z - d/4 + dt/4 [ f(z + d/2; t) + f(z½; t + dt/2) ]                   implicit
    z' = z  + dt/6 (f₀ + 4 f½ + f₁)                                           Simpson's rule for the mean
    d' = -d + dt/3 (f₀ - 2 f½ + f₁)                                           the jump alternates

with f₀ and f½ the two above and f₁ = f(z + d/2 + dt f½; t + dt) at the new minus trace: z' = z + dt f½ + s and
d' = 2 s - d with the smooth jump s = dt/6 (f₀ - 2 f½ + f₁). The mean is of **fourth** order (docs/integrators.md proves
it), and it is what this scheme reports. A smooth solution has the jump dt³/24 d³z/dt³; whatever else there is changes
its sign from step to step, and can grow on nonlinear motions. It is damped by a difference in time of the jump alone,
as Robert and Asselin damp the computational mode of the leapfrog scheme,

    d' <- d' - kappa/8 (d' - 3 d_n + 3 d_n-1 - d_n-2),     kappa = 0.1:

the fraction kappa of what alternates, of a smooth jump something of order dt³ more than itself; jumps carry no mass.

Damping dp/dt = -H_q - gamma p, [G16] (38), comes in by h = e^(-gamma dt/2) of momenta, 1 of coordinates, as
``damped.py`` has it of any scheme, written in p instead of P: f½ is of the middle of the step, f₀ of its beginning.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.contract import StepCosts
from wavetank.integrators.damped import Damping
from wavetank.integrators.hamiltonian import HamiltonianSystem
from wavetank.integrators.states import Map, State

KAPPA = 0.1


@dataclass(frozen=True, eq=False)
class MeanAndJumps(State):
    """The mean of the traces at t, and the jumps there and after the two steps before; pairs [q, p], shape (2, n) each.

    Attributes
    ----------
    end
        The evaluation at the minus trace as the step found it, whatever filters have made of the state since; None at
        a start.
    """

    mean: Vector
    jump: Vector
    jump_1: Vector
    jump_2: Vector
    end: Any = None

    @cached_property
    def q(self) -> Vector:
        """The mean of the coordinates."""
        q: Vector = self.mean[0]
        return q

    @cached_property
    def p(self) -> Vector:
        """The mean of the momenta."""
        p: Vector = self.mean[1]
        return p

    @property
    def q_jump(self) -> Vector:
        """The jump of the coordinates."""
        jump: Vector = self.jump[0]
        return jump

    @property
    def next_point(self) -> Vector:
        """The plus trace."""
        return self.mean + self.jump / 2

    @cached_property
    def evaluations(self) -> tuple[Any, ...]:
        """At both traces: that before the jump as the step found it, and that after it."""
        return (self.evaluation,) if self.end is None else (self.end, self.evaluation)

    def mapped(self, of: Map) -> Self:
        """Return the state with mean and plus trace mapped; the jumps of earlier steps are what they were."""
        mean, plus = of(np.array([self.mean, self.next_point]))
        return replace(self, mean=mean, jump=2 * (plus - mean), evaluation=None)


@dataclass(frozen=True)
class Simpson4:
    """Scheme (23) reported at the mean of its traces, its parasitic modes damped: fourth order, reversible up to that.

    Stable for omega dt < 1.693004, where a parasitic root leaves the unit circle. Cost of a step: one implicit stage
    and two more evaluations of the derivatives.
    """

    name: ClassVar[str] = "simpson-4"
    order: ClassVar[int] = 4
    stability_limit: ClassVar[float] = 1.6930043715
    frequency_error: ClassVar[tuple[float, int]] = (1 / 480, 4)
    nodes: ClassVar[tuple[float, ...]] = (0.0, 0.5, 1.0)
    solvable: ClassVar[float] = 1.5
    costs: ClassVar[StepCosts] = StepCosts(
        products=(0.3, 1.2),
        linear=(0.0004, 1.2e-07, 8e-09, 0, 0, 0),
        nonlinear=(0.0002, 1.4e-07, 1.2e-08, 5.3e-05, 7.4e-08, 2.5e-09),
        driven=(0.00037, 1.2e-07, 1.2e-08, 2.4e-05, 1.2e-07, 4.3e-09),
    )
    kappa: float = KAPPA

    def damped(self, damping: Damping) -> "DampedSimpson4":
        """Return it with damping of the momenta."""
        return DampedSimpson4(self.kappa, damping=damping)

    def decay(self, dt: float, size: int) -> tuple[Any, Any]:
        """Return h, what damping leaves of pairs [q, p] after half a step, and h² after a step, shape (2, size)."""
        return 1.0, 1.0

    def start(self, q: Vector, p: Vector) -> MeanAndJumps:
        """Return the state of a start without jumps."""
        z = np.array([q, p])
        return MeanAndJumps(z, 0 * z, 0 * z, 0 * z)

    def step(self, system: HamiltonianSystem, state: MeanAndJumps, t: float, dt: float) -> MeanAndJumps:
        """Return the state at t + dt; collective."""
        z, d, d_1, d_2 = state.mean, state.jump, state.jump_1, state.jump_2
        h, h_2 = self.decay(dt, z.shape[1])
        begin = state.evaluated(system, t).evaluation
        known = h * (z - d / 4 + dt / 4 * begin.flow)
        z_half = system.solve_stage("(q, p) at 1/2", known, dt / 4, t + dt / 2, begin)
        moved = 4 * h * (z_half - known)  # h dt f½
        q_minus, p_minus = h_2 * begin.z + moved
        end = system.evaluate(q_minus, p_minus, t + dt, begin)
        smooth = dt / 6 * (h_2 * begin.flow + end.flow) - moved / 3
        jump = 2 * smooth - h_2 * d
        jump = jump - self.kappa / 8 * (jump - 3 * d + 3 * d_1 - d_2)
        return MeanAndJumps(h_2 * z + moved + smooth, jump, d, d_1, end)


@dataclass(frozen=True)
class DampedSimpson4(Simpson4):
    """The same with damping of the momenta: of the same order and stability limit, however strong it is."""

    damping: Damping = field(kw_only=True)

    def decay(self, dt: float, size: int) -> tuple[Any, Any]:
        """Return what damping leaves of pairs [q, p] after half a step and after a step, shape (2, size)."""
        return self.damping.of_pairs(dt / 2, size), self.damping.of_pairs(dt, size)
