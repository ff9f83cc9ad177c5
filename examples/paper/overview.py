"""Part 1: every scheme with its order and cost; the discontinuous and the classical Störmer-Verlet scheme."""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from examples.paper.oscillators import Counted, Harmonic, Iterated, NonSeparable
from examples.paper.report import Report
from examples.paper.schemes import (
    Scheme,
    all_schemes,
    amplification,
    continuous,
    discontinuous,
    discontinuous_adjoint,
    largest_error,
    path,
    simpson,
    third_order,
    trajectory,
)
from wavetank.integrators import StormerVerlet, StormerVerletAdjoint

STEPS = (0.2, 0.1, 0.05)


class SchemeRow(NamedTuple):
    """A scheme as measured: slopes of the error over ``STEPS``, evaluations of H's derivatives a step."""

    scheme: str
    stated_order: int
    order_linear: float
    order_nonseparable: float
    evaluations_per_step: float


def order(scheme: Scheme, system: Any) -> float:
    """Return the slope of the largest error against dt."""
    errors = [largest_error(scheme, system, q=0.3, p=0.1, dt=dt, duration=8.0) for dt in STEPS]
    return float(np.polyfit(np.log(STEPS), np.log(errors), 1)[0])


def scheme_rows() -> list[SchemeRow]:
    """Return all schemes with their measured orders, and their cost on the non-separable system at dt = 0.1."""
    rows = []
    for scheme in (*all_schemes(), simpson()):
        counted = Counted(Iterated(NonSeparable()))
        trajectory(scheme, counted, q=0.3, p=0.1, dt=0.1, steps=80)
        found = order(scheme, Harmonic(1.3)), order(scheme, NonSeparable())
        rows.append(SchemeRow(scheme.label, scheme.integrator.order, *found, counted.evaluations / 80))
    return rows


class JumpRow(NamedTuple):
    """A discontinuous and the classical scheme on the non-separable system, and the factor of the jump per step."""

    scheme: str
    largest_difference: float
    jump_factor: float


def jump_rows(*, steps: int = 200, dt: float = 0.1) -> list[JumpRow]:
    """Return (14) with alpha from 1/2 to 1 and (15)-(16) with alpha from 0 to 1/2."""
    weights = (0.5, 0.6, 0.75, 0.9, 1.0)
    pairs = [(discontinuous(weight), continuous("", StormerVerlet())) for weight in weights]
    pairs += [(discontinuous_adjoint(1 - weight), continuous("", StormerVerletAdjoint())) for weight in weights]
    rows = []
    for pair in pairs:
        one, other = (trajectory(scheme, NonSeparable(), q=1.0, p=0.5, dt=dt, steps=steps) for scheme in pair)
        rows.append(JumpRow(pair[0].label, float(np.abs(one - other).max()), jump_factor(pair[0])))
    return rows


def jump_factor(scheme: Scheme) -> float:
    """Return the eigenvalue other than 1 of a step of zero length, the factor of a jump."""
    eigenvalues = np.linalg.eigvals(amplification(scheme, Harmonic(), 0.0))
    return float(eigenvalues[np.argmax(np.abs(eigenvalues - 1))].real)


def slabs(scheme: Scheme, *, omega_dt: float, steps: int) -> NDArray[Any]:
    """Return q and p at the beginning, middle and end of each slab on the harmonic oscillator, shape (2, steps, 3).

    The middle of a quadratic follows from (20c)-(20d), that of a straight line is the mean.
    """
    system, (q_minus, q_plus, p_minus, p_plus) = Harmonic(), scheme.traces
    rows = []
    for z, after in pairwise(path(scheme, system, q=1.0, p=0.0, dt=omega_dt, steps=steps)):
        q, p = (z[q_plus], after[q_minus]), (z[p_plus], after[p_minus])
        middle = (np.mean(q), np.mean(p)) if scheme.width < 4 else (-np.diff(p)[0] / omega_dt, np.diff(q)[0] / omega_dt)
        rows.append(((q[0], middle[0], q[1]), (p[0], middle[1], p[1])))
    return np.array(rows).transpose(1, 0, 2)


def write(report: Report) -> None:
    """Write schemes.csv, jumps.csv and jumps.png."""
    report.table("schemes", SchemeRow._fields, scheme_rows())
    report.table("jumps", JumpRow._fields, jump_rows())
    with report.figure("jumps", 11, 6) as figure:
        columns = (discontinuous(0.75), discontinuous_adjoint(0.25), third_order())
        axes = figure.subplots(2, 3, sharex=True, sharey=True)
        for column, scheme in zip(axes.T, columns, strict=True):
            _draw(column, scheme)
        axes[0, 0].set_ylabel("coordinate q [-]")
        axes[1, 0].set_ylabel("momentum p [-]")
        axes[0, 0].legend(loc="lower left", fontsize=8)
        figure.suptitle("One oscillation in steps of ω Δt = 0.8: what jumps between the slabs of each scheme")


def _draw(column: NDArray[Any], scheme: Scheme) -> None:
    omega_dt, steps = 0.8, 8
    fine = np.linspace(0, omega_dt * steps, 400)
    computed = slabs(scheme, omega_dt=omega_dt, steps=steps)
    for axes, values, exact in zip(column, computed, (np.cos(fine), -np.sin(fine)), strict=True):
        axes.plot(fine, exact, color="#9a9a9a", lw=3, alpha=0.6, label="exact")
        for slab, nodes in enumerate(values):
            _draw_slab(axes, omega_dt * slab, omega_dt, nodes)
    column[0].set_title(scheme.label)
    column[1].set_xlabel("ω t [-]")


def _draw_slab(axes: Axes, begin: float, length: float, nodes: NDArray[Any]) -> None:
    x = np.linspace(0, 1, 21)
    axes.plot(begin + length * x, np.polyval(np.polyfit((0, 0.5, 1), nodes, 2), x), color="#0072b2")
    axes.plot([begin], nodes[:1], "o", color="#0072b2", ms=4, label="plus trace" if begin == 0 else None)
    axes.plot(
        [begin + length], nodes[-1:], "o", mfc="white", mec="#d55e00", ms=6, label="minus trace" if begin == 0 else None
    )
