"""Part 8: the forced oscillator (50)-(57) of [G16], and the times at which H is evaluated.

dq/dt = p, dp/dt = -q + a gamma t. In (57), the adjoint Störmer-Verlet scheme, the force is evaluated at t* with q at
the left end of the slab and at t** with q at its right end. The times of a scheme are the nodes of its quadrature
rule; here they are changed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from examples.paper.oscillators import Forced
from examples.paper.report import Report
from examples.paper.schemes import point
from examples.paper.watched import watched
from wavetank.base.arrays import Vector
from wavetank.integrators import Simpson4, StormerVerlet, StormerVerletAdjoint, ThirdOrder
from wavetank.integrators.contract import Integrator, State
from wavetank.integrators.oscillators import Oscillators
from wavetank.integrators.wrappers import Wrapper

STEPS = (0.2, 0.1, 0.05, 0.025)
DURATION, START, SLOPE = 20.0, (0.3, 0.1), 0.7
Times = Mapping[float, float]


@dataclass(frozen=True)
class _Moved(Oscillators):
    """A system seen through another clock: H at t + c dt is H at t + times[c] dt."""

    system: Oscillators
    times: Times
    t_0: float
    dt: float

    def _clock(self, t: float) -> float:
        return self.t_0 + self.times[round((t - self.t_0) / self.dt, 6)] * self.dt

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        return self.system.H_q(q, p, self._clock(t))

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        return self.system.H_p(q, p, self._clock(t))

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        return self.system.energy(q, p, t)


class Choice(NamedTuple):
    """A scheme and where in the step, as parts of dt, it takes the force instead of at its nodes."""

    scheme: str
    integrator: Integrator[Any]
    times: Times
    name: str


def choices() -> list[Choice]:
    """Return (57) and (14) with four choices of t*, t**, and (23), jumps damped or not, with four of its three."""
    verlet = {
        "left, right: the quadrature rule's": {0.0: 0.0, 1.0: 1.0},
        "both in the middle": {0.0: 0.5, 1.0: 0.5},
        "swapped": {0.0: 1.0, 1.0: 0.0},
        "both left": {0.0: 0.0, 1.0: 0.0},
    }
    third = {
        "0, 1/2, 1: Simpson's": {0.0: 0.0, 0.5: 0.5, 1.0: 1.0},
        "all in the middle": {0.0: 0.5, 0.5: 0.5, 1.0: 0.5},
        "ends swapped": {0.0: 1.0, 0.5: 0.5, 1.0: 0.0},
        "all left": {0.0: 0.0, 0.5: 0.0, 1.0: 0.0},
    }
    schemes: list[tuple[str, Integrator[Any], dict[str, dict[float, float]]]] = [
        ("Störmer-Verlet, adjoint (57)", StormerVerletAdjoint(), verlet),
        ("Störmer-Verlet (14)", StormerVerlet(), verlet),
        ("third order (23)", ThirdOrder(), third),
        ("Simpson 4", Simpson4(), third),
    ]
    return [Choice(label, scheme, times, name) for label, scheme, table in schemes for name, times in table.items()]


class _ByAnotherClock(Wrapper[Any]):
    """A scheme that takes H at other times than its nodes."""

    def __init__(self, choice: Choice):
        super().__init__(choice.integrator)
        self._times = choice.times

    def step(self, system: Any, state: Any, t: float, dt: float) -> Any:
        return self.scheme.step(_Moved(system, self._times, t, dt), replace(state, evaluation=None), t, dt)


def path(choice: Choice, dt: float) -> NDArray[Any]:
    """Return t, q and p after each step, the start included, shape (3, steps + 1)."""

    def row(state: State, step: int) -> tuple[float, float, float]:
        return step * dt, state.q[0], state.p[0]

    scheme, steps = _ByAnotherClock(choice), round(DURATION / dt)
    return np.array(watched(Forced(SLOPE), scheme, row, start=point(*START), dt=dt, steps=steps)).T


def errors(choice: Choice, dt: float) -> tuple[float, float, float]:
    """Return the largest error of q and of p against (55), and the range of the energy (54) over the start's."""
    system = Forced(SLOPE)
    t, q, p = path(choice, dt)
    exact = np.array([system.exact(*START, time) for time in t]).T
    energy = np.array([system.invariant(*point) for point in zip(q, p, t, strict=True)])
    return float(np.abs(q - exact[0]).max()), float(np.abs(p - exact[1]).max()), float(np.abs(energy - energy[0]).max())


class Row(NamedTuple):
    """A choice of times: errors at dt = 0.1 of q and p against (55) and of (54), and their slopes over ``STEPS``."""

    scheme: str
    times: str
    error_q: float
    error_p: float
    error_energy: float
    order_q: float
    order_p: float
    order_energy: float


@cache
def measured() -> tuple[tuple[Choice, NDArray[Any]], ...]:
    """Return all choices with their errors, shape (steps, 3)."""
    return tuple((choice, np.array([errors(choice, dt) for dt in STEPS])) for choice in choices())


def rows() -> list[Row]:
    """Return all choices."""
    table = []
    for choice, found in measured():
        slopes = np.polyfit(np.log(STEPS), np.log(found), 1)[0]
        table.append(Row(choice.scheme, choice.name, *found[1].tolist(), *slopes.tolist()))
    return table


def write(report: Report) -> None:
    """Write forcing.csv and forcing.png."""
    report.table("forcing", Row._fields, rows())
    with report.figure("forcing", 15, 7) as figure:
        axes = figure.subplots(2, 3)
        groups = ("Störmer-Verlet, adjoint (57)", "third order (23)", "Simpson 4")
        for column, label in zip(axes.T, groups, strict=True):
            for (choice, found), colour in zip(
                [one for one in measured() if one[0].scheme == label],
                ("#0072b2", "#009e73", "#d55e00", "#e69f00"),
                strict=True,
            ):
                column[0].loglog(STEPS, found[:, 0], "o-", color=colour, label=choice.name, ms=4)
                t, q, p = path(choice, 0.2)
                energy = np.array([Forced(SLOPE).invariant(*point) for point in zip(q, p, t, strict=True)])
                column[1].plot(t, energy - energy[0], color=colour)
            column[0].set_xticks(STEPS, [f"{dt:g}" for dt in STEPS])
            column[0].minorticks_off()
            column[0].set(xlabel="Δt [s]", ylabel="largest error of q [-]", title=label)
            column[1].set(xlabel="time [s]", ylabel="energy (54) - its start [-]")
            column[0].legend(fontsize=8, title="force at")
        figure.suptitle("The forced oscillator: where in the step the force is taken")
