"""The third-order scheme (23) of Gagarina et al. 2016, in the mean and the jump of its traces, with smoothed jumps.

With z = (q, p), dz/dt = f(z, t) and the traces z± = z ± d/2 about their mean z, d the jump, (23) reads

    z½ = z - d/4 + dt/4 [ f(z + d/2; t) + f(z½; t + dt/2) ]                   implicit
    z' = z  + dt/6 (f₀ + 4 f½ + f₁)                                           Simpson's rule for the mean
    d' = -d + dt/3 (f₀ - 2 f½ + f₁)                                           the jump alternates

with f₀ and f½ as above and f₁ = f(z + d/2 + dt f½; t + dt) at the new minus trace: z' = z + dt f½ + s and
d' = 2 s - d with the smooth jump s = dt/6 (f₀ - 2 f½ + f₁). The mean is of **fourth** order (docs/integrators.md has
the proof); the scheme reports it. A smooth solution has the jump dt³/24 d³z/dt³. The remainder of the jump changes
its sign from step to step, and can grow on nonlinear motions. A difference in time damps the jump only, as the
Robert-Asselin filter damps the computational mode of the leapfrog scheme,

    d' <- d' - kappa/8 (d' - 3 d_n + 3 d_n-1 - d_n-2),     kappa = 0.1.

It removes the fraction kappa of the alternating part, and a fraction of order dt³ of a smooth jump. Jumps contain no
mass.

Damping dp/dt = -H_q - gamma p, [G16] (38), enters by h = e^(-gamma dt/2) for momenta, 1 for coordinates, as
for any scheme in ``wrappers.py``, written in p instead of P: f½ refers to the middle of the step, f₀ to its beginning.
"""

from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar, NamedTuple, Self

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.integrators.contract import HamiltonianSystem, Map, State, StepCosts
from wavetank.integrators.wrappers import Damping

KAPPA = 0.1


@dataclass(frozen=True, eq=False)
class MeanAndJumps(State):
    """The mean of the traces at t, and the jumps there and after the two previous steps.

    Attributes
    ----------
    values
        Mean, jump, and the jumps one and two steps before: pairs [q, p], shape (4, 2, n).
    """

    values: Vector

    @property
    def q(self) -> Vector:
        """Mean of the coordinates."""
        q: Vector = self.values[0, 0]
        return q

    @property
    def p(self) -> Vector:
        """Mean of the momenta."""
        p: Vector = self.values[0, 1]
        return p

    @property
    def q_jump(self) -> Vector:
        """Jump of the coordinates."""
        jump: Vector = self.values[1, 0]
        return jump

    @property
    def next_point(self) -> Vector:
        """Plus trace, shape (2, n)."""
        point: Vector = self.values[0] + 0.5 * self.values[1]
        return point

    def mapped(self, of: Map) -> Self:
        """Return the state with mean and plus trace mapped; the jumps of previous steps are unchanged."""
        mean, plus = of(np.array([self.values[0], self.next_point]))
        return type(self)(np.array([mean, 2 * (plus - mean), *self.values[2:]]), end=self.end)


class Coefficients(NamedTuple):
    """The coefficients of the scheme as a general linear method, which combines its vectors linearly.

    The vectors are, in this order, z, d, f₀, dt/4 f½, f₁, d_n, d_n-1 and d_n-2: damping scales z and d, not d_n = d.

    Attributes
    ----------
    known
        Coefficients of the known part of the stage, shape (3,).
    minus
        Coefficients of the new minus trace, shape (4,).
    update
        Coefficients of the new mean and of the new jump, shape (2, 8).
    """

    known: Vector
    minus: Vector
    update: Vector


@cache
def coefficients(dt: float, kappa: float) -> Coefficients:
    """Return the coefficients for a time step [s] and a damping kappa of alternating jumps."""
    z, d, f_0, quarter, f_1, d_n, d_1, d_2 = np.eye(8)
    advance = 4 * quarter  # dt f½
    smooth = dt / 6 * (f_0 + f_1) - advance / 3
    jump = 2 * smooth - d
    return Coefficients(
        known=(z - d / 4 + dt / 4 * f_0)[:3],
        minus=(z + d / 2 + advance)[:4],
        update=np.array([z + advance + smooth, jump - kappa / 8 * (jump - 3 * d_n + 3 * d_1 - d_2)]),
    )


@dataclass(frozen=True)
class Simpson4:
    """Scheme (23) reported at the mean of its traces, with damped parasitic modes; fourth order.

    Reversible up to the damping of jumps, stable for omega dt < 1.693004, where a parasitic root leaves the unit
    circle. Cost of a step: one implicit stage and two further evaluations of the derivatives.
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
    damping: Damping | None = None

    def damped(self, damping: Damping) -> Self:
        """Return the scheme with damping of the momenta, with the same order and stability limit for any rate."""
        return replace(self, damping=damping)

    def start(self, q: Vector, p: Vector) -> MeanAndJumps:
        """Return the state of a start without jumps."""
        values = np.zeros((4, 2, len(q)))
        values[0] = q, p
        return MeanAndJumps(values)

    def step(self, system: HamiltonianSystem, state: MeanAndJumps, t: float, dt: float) -> MeanAndJumps:
        """Return the state at t + dt; collective."""
        of, pair = coefficients(dt, self.kappa), state.values.shape[1:]
        begin = state.evaluation or state.evaluated(system, t).evaluation
        vectors = np.empty((8, *pair), dtype=state.values.dtype)
        rows = vectors.reshape(8, -1)
        vectors[:2], vectors[2], vectors[5:] = state.values[:2], begin.flow, state.values[1:]
        known = (of.known @ rows[:3]).reshape(pair)
        if self.damping is not None:
            known *= self.damping.of_pairs(dt / 2, pair[1])
        vectors[3] = system.solve_stage("(q, p) at 1/2", known, dt / 4, t + dt / 2, begin)
        vectors[3] -= known
        if self.damping is not None:
            vectors[:3] *= self.damping.of_pairs(dt, pair[1])
            vectors[3] *= self.damping.of_pairs(dt / 2, pair[1])
        q, p = (of.minus @ rows[:4]).reshape(pair)
        end = system.evaluate(q, p, t + dt, begin)
        vectors[4] = end.flow
        values = np.empty_like(state.values)
        np.matmul(of.update, rows, out=values[:2].reshape(2, -1))
        values[2:] = state.values[1:3]
        return MeanAndJumps(values, end=end)
