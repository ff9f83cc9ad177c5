"""The contract of a time integrator: one step, written as in the paper."""

from collections.abc import Callable
from typing import NamedTuple, Protocol, Self, TypeVar

from wavetank.arrays import Vector
from wavetank.integrators.hamiltonian import HamiltonianSystem

Map = Callable[[Vector], Vector]
"""What acts on points of a state alike, of pairs [q, p], shape (m, 2, n), and makes such of them."""


class Evaluated(NamedTuple):
    """A point at which a scheme evaluates the system anyway.

    Attributes
    ----------
    q, p
        Coordinates and momenta there.
    """

    q: Vector
    p: Vector


class State(Protocol):
    """What a scheme carries from step to step; q and p are the values it reports."""

    @property
    def q(self) -> Vector:
        """The coordinates at the state's time."""

    @property
    def p(self) -> Vector:
        """The momenta at the state's time."""

    @property
    def known(self) -> tuple[Evaluated, ...]:
        """The points next to (q, p), at its time, that the scheme evaluates anyway.

        A step ends at the first and the next one begins at the last.

        Their mean is (q, p), or nearly so.
        """

    @property
    def q_jump(self) -> Vector | None:
        """The jump of the coordinates at the state's time; None of a scheme that lets them have none."""

    def mapped(self, of: Map) -> Self:
        """Return the state with its points mapped."""


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


S = TypeVar("S", bound=State)


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
