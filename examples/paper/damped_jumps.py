"""Part 11: damping of the parasitic modes of (23), compared with other remedies, and its cost.

Eigenvalues on the oscillator for differences of order m and strengths kappa; strongly nonlinear orbits of
H = (q² + 1)(p² + 1) / 2 on which (23) fails. All orbits are stepped as one vector, with all rules for jumps.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import comb
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from examples.paper.oscillators import NonSeparable
from examples.paper.report import Report
from examples.paper.watched import watched
from wavetank.base.arrays import Vector
from wavetank.integrators import GaussLegendre4, Simpson4, ThirdOrder
from wavetank.integrators.contract import HamiltonianSystem, Integrator, State
from wavetank.integrators.oscillators import Oscillators
from wavetank.integrators.simpson import MeanAndJumps

ORBITS = ((0.5, 0.25), (1.0, 0.5), (1.2, 0.5), (1.5, 0.5))
STEPS = (24, 48)  # a period
PERIODS = 50


# ---------------------------------------------------------------- the oscillator
def matrices(theta: NDArray[Any], kappa: float, m: int) -> NDArray[Any]:
    """Return the steps of dz/dt = i z, omega dt = theta, on (z, d_n, ..., d_n-m+1), shape (thetas, m + 1, m + 1)."""
    columns = []
    for z, d, *earlier in np.eye(m + 1):
        plus = z + d / 2
        half = (z - d / 4 + 0.25j * theta * plus) / (1 - 0.25j * theta)
        f_0, f_half, f_1 = 1j * theta * plus, 1j * theta * half, 1j * theta * (plus + 1j * theta * half)
        jumps = [-d + (f_0 - 2 * f_half + f_1) / 3, d, *earlier]
        alternating = sum((-1) ** k * comb(m, k) * jump for k, jump in enumerate(jumps)) / 2**m
        column = [z + (f_0 + 4 * f_half + f_1) / 6, jumps[0] - kappa * alternating, *jumps[1:-1]]
        columns.append(np.broadcast_arrays(*column))
    return np.array(columns).transpose(2, 1, 0)


class Roots(NamedTuple):
    """Moduli of the roots, each shape (thetas,): that of the motion, and the largest of the others."""

    physical: NDArray[Any]
    parasitic: NDArray[Any]

    @property
    def largest(self) -> NDArray[Any]:
        """The largest of all."""
        return np.asarray(np.maximum(self.physical, self.parasitic))


def roots(theta: NDArray[Any], kappa: float, m: int) -> Roots:
    """Return the moduli; the motion's root is the one next to exp(i theta)."""
    values = np.linalg.eigvals(matrices(theta, kappa, m))
    physical = np.argmin(np.abs(values - np.exp(1j * theta)[:, None]), axis=1)[:, None]
    moduli = np.abs(values)
    motion = np.take_along_axis(moduli, physical, axis=1)[:, 0]
    np.put_along_axis(moduli, physical, 0.0, axis=1)
    return Roots(motion, moduli.max(axis=1))


def limit(kappa: float, m: int, *, growth: float = 1e-9) -> float:
    """Return the smallest omega dt with a modulus above 1 + growth, to 1e-10: on ever finer grids."""
    low, high = 0.0, 2.0
    while high - low > 1e-11:
        grid = np.linspace(low, high, 202)[1:]
        first = int(np.argmax(roots(grid, kappa, m).largest > 1 + growth))
        low, high = float(grid[first] - (grid[1] - grid[0])), float(grid[first])
    return low


class LimitRow(NamedTuple):
    """A difference of order m and a strength: the limit of omega dt, and the roots well below it."""

    m: int
    kappa: float
    limit: float
    physical_at_0_8: float
    parasitic_at_0_8: float
    physical_at_1_2: float
    parasitic_at_1_2: float


def limit_rows() -> list[LimitRow]:
    """Return m = 1 to 4 with strengths from 0.02 to 0.5; moduli less 1 of the motion, as they are of the others."""
    rows = []
    for m in (1, 2, 3, 4):
        for kappa in (0.02, 0.05, 0.1, 0.2, 0.5):
            (mild, long), (mild_others, long_others) = roots(np.array([0.8, 1.2]), kappa, m)
            rows.append(LimitRow(m, kappa, limit(kappa, m), mild - 1, mild_others, long - 1, long_others))
    return rows


# ---------------------------------------------------------------- the cures
Settle = Callable[[Sequence[Vector], Vector, int], Vector]  # jumps, smooth jump, number of the step: the new jump


@dataclass(frozen=True)
class SideBySide(Simpson4):
    """(23) in mean and jump with other rules for the jumps: as many equal parts of the orbits, each with its own.

    A rule sees jumps of shape (2, orbits).
    """

    rules: tuple[Settle, ...] = (lambda jumps, smooth, n: jumps[0],)
    _count: list[int] = field(default_factory=list, compare=False)

    def step(self, system: HamiltonianSystem, state: MeanAndJumps, t: float, dt: float) -> MeanAndJumps:
        """Return the state at t + dt, its newest jump by the rules."""
        self._count.append(0)
        after = Simpson4(0.0).step(system, state, t, dt)
        jumps = after.values[1], *state.values[1:]
        parts = [np.split(one, len(self.rules), axis=1) for one in ((jumps[0] + jumps[1]) / 2, *jumps)]
        new = [rule(own, smooth, len(self._count)) for rule, smooth, *own in zip(self.rules, *parts, strict=True)]
        return replace(after, values=np.array([after.values[0], np.concatenate(new, axis=1), *after.values[2:]]))


def difference(kappa: float, m: int) -> Settle:
    """Return the rule that takes kappa of what alternates, by the difference of order m <= 3."""

    def rule(jumps: Sequence[Vector], smooth: Vector, n: int) -> Vector:
        signs = ((-1) ** k * comb(m, k) * jump for k, jump in enumerate(list(jumps)[: m + 1]))
        return np.asarray(jumps[0] - kappa / 2**m * sum(signs))

    return rule


def at_intervals(every: int, value: Callable[[Vector], Vector]) -> Settle:
    """Return the rule that puts a value in the place of the jump at intervals."""
    return lambda jumps, smooth, n: value(smooth) if n % every == 0 else jumps[0]


def towards(kappa: float) -> Settle:
    """Return the rule that takes kappa of the difference from the smooth jump."""
    return lambda jumps, smooth, n: np.asarray(jumps[0] + kappa * (smooth - jumps[0]))


def beyond(factor: float) -> Settle:
    """Return the rule that takes the smooth jump where the difference from it passes a multiple of its size."""

    def rule(jumps: Sequence[Vector], smooth: Vector, n: int) -> Vector:
        off, size = np.hypot(*(jumps[0] - smooth)), np.hypot(*smooth)
        return np.where(off > factor * size, smooth, jumps[0])

    return rule


def of_slopes(kappa: float) -> Settle:
    """Return the rule that takes kappa of what alternates in the slopes' part of the jump, by its third difference."""
    parts: deque[Vector] = deque(maxlen=4)

    def rule(jumps: Sequence[Vector], smooth: Vector, n: int) -> Vector:
        parts.appendleft(smooth)
        return jumps[0] if len(parts) < 4 else jumps[0] + difference(kappa, 3)(parts, smooth, n) - smooth

    return rule


def rules() -> dict[str, Settle]:
    """Return what is compared, by name."""
    return {
        "(23), mean": difference(0.0, 3),
        **{f"third difference, κ = {kappa:g}": difference(kappa, 3) for kappa in (0.02, 0.05, 0.1, 0.2)},
        "second difference, κ = 0.1": difference(0.1, 2),
        "first difference, κ = 0.1": difference(0.1, 1),
        "third difference of slopes alone, κ = 0.2": of_slopes(0.2),
        "towards the smooth jump, κ = 0.05": towards(0.05),
        "smooth jump every 20 steps": at_intervals(20, lambda smooth: smooth),
        "smooth jump every 200 steps": at_intervals(200, lambda smooth: smooth),
        "restart every 200 steps": at_intervals(200, lambda smooth: 0 * smooth),
        "smooth jump beyond 3 times it": beyond(3.0),
    }


OTHERS: dict[str, Integrator[Any]] = {"(23), plus trace": ThirdOrder(), "Gauss-Legendre 4": GaussLegendre4()}


class Orbits(Oscillators):
    """Orbits of H = (q² + 1)(p² + 1) / 2 side by side, each in its own time: a step lasts 1.

    Parameters
    ----------
    starts
        (q, p) of each.
    steps
        How many a period, of all or of each.
    """

    def __init__(self, starts: Sequence[tuple[float, float]], steps: int | Sequence[int]):
        self._system = NonSeparable()
        self.q, self.p = (np.array(values) for values in zip(*starts, strict=True))
        self._rate: Vector = np.array([self._system.period(q, p) for q, p in starts]) / np.array(steps)

    def H_q(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return q (p² + 1) in the orbits' own times."""
        return np.asarray(self._rate * self._system.H_q(q, p, t))

    def H_p(self, q: Vector, p: Vector, t: float) -> Vector:
        """Return p (q² + 1) in the orbits' own times."""
        return np.asarray(self._rate * self._system.H_p(q, p, t))

    def energy(self, q: Vector, p: Vector, t: float) -> float:
        """Return the sum of the energies."""
        return float(self.energies(q, p).sum())

    def fixed_point(self, image: Callable[[Vector], Vector], start: Vector) -> Vector:
        """Return z = image(z) by iteration to round-off; an orbit that has left all bounds is left alone."""
        z = start
        for _ in range(60):
            new = image(z)
            step, z = new - z, new
            if not np.nanmax(np.abs(step) / (1 + np.abs(z))) > 1e-15:
                break
        return z

    def energies(self, q: Vector, p: Vector) -> Vector:
        """Return each orbit's H."""
        return np.asarray(0.5 * (q**2 + 1) * (p**2 + 1))

    def errors(self, integrator: Integrator[Any], *, steps: int) -> Vector:
        """Return the relative error of each energy after each step, shape (steps, orbits); inf once it is lost."""
        start = self.energies(self.q, self.p)

        def error(state: State, step: int) -> Vector:
            return np.asarray(self.energies(state.q, state.p) / start - 1)

        with np.errstate(all="ignore"):
            rows = np.array(watched(self, integrator, error, start=(self.q, self.p), dt=1.0, steps=steps))[1:]
        return np.nan_to_num(rows, nan=np.inf, posinf=np.inf)


class CureRow(NamedTuple):
    """A cure on an orbit: the largest relative error of the energy, and its mean change a period."""

    cure: str
    q: float
    p: float
    steps_per_period: int
    largest_error: float
    drift_per_period: float


def cure_rows() -> list[CureRow]:
    """Return all cures on ``ORBITS`` over ``PERIODS``."""
    settings = [(orbit, steps) for steps in STEPS for orbit in ORBITS]
    compared = rules()
    groups: list[tuple[Sequence[str], Integrator[Any]]] = [(list(compared), SideBySide(rules=tuple(compared.values())))]
    groups += [([name], scheme) for name, scheme in OTHERS.items()]
    rows = []
    for names, scheme in groups:
        orbits, counts = zip(*(settings * len(names)), strict=True)
        errors = Orbits(orbits, counts).errors(scheme, steps=PERIODS * max(STEPS))
        parts = [(name, *setting) for name in names for setting in settings]
        for (name, (q, p), steps), error in zip(parts, errors.T, strict=True):
            own = error[: PERIODS * steps]
            rows.append(CureRow(name, q, p, steps, float(np.abs(own).max()), drift(own, steps)))
    return rows


def drift(error: Vector, steps: int) -> float:
    """Return the change a period between the means over the first and the last tenth of the periods."""
    means = error[: error.size // steps * steps].reshape(-1, steps).mean(axis=1)
    part = max(1, means.size // 10)
    return float((means[-part:].mean() - means[:part].mean()) / (means.size - part))


# ---------------------------------------------------------------- tables and pictures
def write(report: Report) -> None:
    """Write damped-jumps-limits.csv, -cures.csv and damped-jumps-roots.png, -cures.png."""
    report.table("damped-jumps-limits", LimitRow._fields, limit_rows())
    rows = cure_rows()
    report.table("damped-jumps-cures", CureRow._fields, rows)
    with report.figure("damped-jumps-roots", 11, 4.6) as figure:
        _draw_roots(*figure.subplots(1, 2))
    with report.figure("damped-jumps-cures", 11, 5.5) as figure:
        _draw_cures(figure.subplots(1, 2, sharey=True), rows)


def _draw_roots(left: Axes, right: Axes) -> None:
    theta = np.arange(0.005, 1.8, 0.005)
    left.plot(theta, roots(theta, 0.0, 3).parasitic, "k--", label="(23) as it is")
    names = ("first difference", "second", "third", "fourth")
    for m, (label, colour) in enumerate(zip(names, ("#56b4e9", "#e69f00", "#009e73", "#d55e00"), strict=True), start=1):
        moduli = roots(theta, 0.1, m)
        left.plot(theta, moduli.parasitic, color=colour, label=label)
        right.semilogy(theta, np.abs(moduli.physical - 1), color=colour, label=label)
    right.semilogy(theta, 0.1 / (1536 * 7.9) * theta**10, "k:", label="κ (ωΔt)¹⁰ / (1536 (8 - κ))")
    left.set(xlabel="ω Δt [-]", ylabel="largest modulus of a parasitic root [-]", ylim=(0.85, 1.1), title="κ = 0.1")
    right.set(xlabel="ω Δt [-]", ylabel="what a step takes from the motion, | |λ| - 1 |", ylim=(1e-14, 1e-1))
    right.set_title("κ = 0.1")
    left.legend(loc="upper left")
    right.legend(loc="lower right")


def _draw_cures(panels: NDArray[Any], rows: Sequence[CureRow]) -> None:
    names = list(dict.fromkeys(row.cure for row in rows))[::-1]
    for axes, (q, p) in zip(panels, ((1.0, 0.5), (1.5, 0.5)), strict=True):
        for steps, colour, marker in zip(STEPS, ("#d55e00", "#0072b2"), "os", strict=True):
            orbit = [row for row in rows if (row.q, row.p, row.steps_per_period) == (q, p, steps)]
            found = {row.cure: row.largest_error for row in orbit}
            values = [found[name] for name in names]
            axes.semilogx(values, range(len(names)), marker, color=colour, label=f"{steps} steps a period")
        axes.set(xlabel=f"largest relative error of H in {PERIODS} periods")
        axes.set_title(f"orbit through q = {q:g}, p = {p:g}")
    panels[0].set_yticks(range(len(names)), names)
    panels[0].legend(loc="upper left")
