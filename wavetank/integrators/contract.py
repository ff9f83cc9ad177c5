"""The contract of a time integrator: one step, written as in the paper."""

from typing import NamedTuple, Protocol

from wavetank.base.arrays import Vector
from wavetank.integrators.hamiltonian import HamiltonianSystem
from wavetank.integrators.states import Map, S, State

__all__ = ["CaseIntegrator", "Integrator", "Map", "S", "State", "StepCosts"]


class StepCosts(NamedTuple):
    """What a step costs, measured on one machine by ``python -m benchmarks --only costs`` (``planning/cost.py``).

    Attributes
    ----------
    products
        dt omega_max of the steps that are timed.
    linear, nonlinear, driven
        Constants (a, b, c, a', b', c') [s] of the kinds of waves.
    """

    products: tuple[float, ...]
    linear: tuple[float, ...]
    nonlinear: tuple[float, ...]
    driven: tuple[float, ...]


class Integrator(Protocol[S]):
    """One step of size dt from time t; knows nothing of finite elements."""

    @property
    def name(self) -> str:
        """The name in a case file."""

    @property
    def order(self) -> int:
        """Order of accuracy."""

    @property
    def stability_limit(self) -> float:
        """Largest omega dt on the oscillator for which the scheme is stable."""

    @property
    def frequency_error(self) -> tuple[float, int]:
        """The pair (c, m) with relative frequency error of size c (omega dt)^m to leading order."""

    @property
    def nodes(self) -> tuple[float, ...]:
        """The times (t - t_n) / dt at which H is evaluated, as in the scheme's quadrature rule."""

    def start(self, q: Vector, p: Vector) -> S:
        """Return the state of a smooth start, without jumps."""

    def step(self, system: HamiltonianSystem, state: S, t: float, dt: float) -> S:
        """Return the state at t + dt; collective."""


class CaseIntegrator(Integrator[S], Protocol[S]):
    """An integrator that a case can name: plans need more of it."""

    @property
    def solvable(self) -> float:
        """Largest dt omega_max at which the iteration of its implicit stages converges; inf of an explicit scheme."""

    @property
    def costs(self) -> StepCosts:
        """What a step costs."""
