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

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators.contract import Evaluated, Map, StepCosts
from wavetank.integrators.damped import Damping
from wavetank.integrators.flow import flow_of
from wavetank.integrators.hamiltonian import BetweenTwo, HamiltonianSystem, Near, Stage

KAPPA = 0.1


class Pairs(NamedTuple):
    """Pairs (q, p), shape (2, n) each: the mean of the traces at t; their jumps there and after the two steps before.

    Attributes
    ----------
    minus
        The minus trace as the step found it, whatever filters have made of the state since.
    """

    mean: Vector
    jump: Vector
    jump_1: Vector
    jump_2: Vector
    minus: Vector


class MeanAndJumps(Pairs, BetweenTwo):
    """The state, with what is asked of it, found once: who asks again knows by the array that it is the same."""

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

    @cached_property
    def q_jump(self) -> Vector:
        """The jump of the coordinates."""
        jump: Vector = self.jump[0]
        return jump

    @cached_property
    def points(self) -> tuple[Vector, Vector]:
        """Both traces, that before the jump as it was evaluated last, and that after it."""
        return self.minus.ravel(), (self.mean + self.jump / 2).ravel()

    @cached_property
    def known(self) -> tuple[Evaluated, ...]:
        """The same."""
        before, after = self.points
        last = Evaluated(*after.reshape(2, -1))
        return last if before is after else Evaluated(*before.reshape(2, -1)), last

    def ended(self, at: Vector) -> Self:
        """See ``BetweenTwo``."""
        return self._replace(minus=at)

    def mapped(self, of: Map) -> Self:
        """Return the state with mean and plus trace mapped; the jumps of earlier steps are what they were."""
        mean, plus = of(np.array([self.mean, self.points[-1].reshape(2, -1)]))
        jump = 2 * (plus - mean)
        plus = mean + jump / 2
        for pair in (mean, jump, plus):
            pair.setflags(write=False)
        after = type(self)(mean, jump, self.jump_1, self.jump_2, self.minus)
        after.__dict__["points"] = self.points[0], plus.ravel()
        return after


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

    def left(self, dt: float, size: int) -> Any:
        """Return h."""
        return 1.0

    def start(self, q: Vector, p: Vector) -> MeanAndJumps:
        """Return the state of a start without jumps."""
        pair = np.stack([q, p])
        none = 0 * pair
        return MeanAndJumps(pair, none, none, none, pair)

    def step(self, system: HamiltonianSystem, state: MeanAndJumps, t: float, dt: float) -> MeanAndJumps:
        """Return the state at t + dt; collective."""
        f = flow_of(system)
        z, d, d_1, d_2 = [pair.ravel() for pair in state[:-1]]
        plus, h = state.points[-1], self.left(dt, len(state.q))
        f_0 = f(plus, t)
        known: Vector = h * (z - d / 4 + dt / 4 * f_0)

        def residual(z_half: Vector) -> Vector:
            return z_half - known - dt / 4 * f(z_half, t + dt / 2)

        stage = Stage("(q, p) at 1/2", t + dt / 2, dt, dt / 4)
        z_half = system.stages.pair.solve(stage, residual, plus, near=Near(known, plus, f_0))
        moved = 4 * (z_half - known)  # dt f½
        minus = h * (h * plus + moved)
        minus.setflags(write=False)
        f_1 = f(minus, t + dt)
        smooth = dt / 6 * (h * h * f_0 + f_1) - h * moved / 3
        mean = h * (h * z + moved) + smooth
        newest = 2 * smooth - h * h * d
        jump = newest - self.kappa / 8 * (newest - 3 * d + 3 * d_1 - d_2)
        plus = mean + jump / 2
        for pair in (mean, jump, plus):  # nobody can change what the system knows by the array
            pair.setflags(write=False)
        points = minus, plus
        mean, jump, minus = [pair.reshape(2, -1) for pair in (mean, jump, minus)]
        after = MeanAndJumps(mean, jump, state.jump, state.jump_1, minus)
        after.__dict__["points"] = points  # which are found already
        return after


@dataclass(frozen=True)
class DampedSimpson4(Simpson4):
    """The same with damping of the momenta: of the same order and stability limit, however strong it is."""

    damping: Damping = field(kw_only=True)

    def left(self, dt: float, size: int) -> Vector:
        """Return h, shape (2 size,)."""
        return self.damping.of_pairs(dt / 2, size)
