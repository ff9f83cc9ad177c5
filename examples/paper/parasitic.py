"""Effect of nonlinearity on the parasitic modes (28), (31) of the third-order scheme (23); not in the paper.

For small omega dt a parasitic mode is an alternating jump, z⁻ - z⁺ = (-1)^n delta. By (28b), (31b) its envelope delta
rotates backwards at half the frequency. For a general H

    d delta / dt = -1/2 J H''(z(t)) delta,     J = (0 1; -1 0), H'' the second derivatives along the computed orbit,

independent of the step. On a periodic orbit the largest Floquet multiplier determines whether jumps grow. They start at
dt³ and grow by that factor every period until the solution is lost. On the harmonic oscillator the multiplier is one.
With the damping of ``wavetank/integrators/simpson.py`` they lose kappa a step, which is more.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from examples.paper.damped_jumps import Orbits
from examples.paper.oscillators import NonSeparable
from examples.paper.report import Report
from examples.paper.watched import watched
from wavetank.integrators import Simpson4
from wavetank.integrators.simpson import MeanAndJumps

Array = NDArray[Any]
ORBITS = ((0.3, 0.1), (0.5, 0.25), (0.8, 0.4), (0.9, 0.45), (1.0, 0.5), (1.2, 0.5), (1.5, 0.5))
DRAWN = {(0.5, 0.25): "#0072b2", (1.0, 0.5): "#e69f00", (1.5, 0.5): "#d55e00"}
STEPS, PERIODS = (48, 96), 8
UNDAMPED = Simpson4(0.0)  # which is (23)
SCHEMES = {"(23)": UNDAMPED, "Simpson 4": Simpson4()}


class Row(NamedTuple):
    """An orbit of H = (q² + 1)(p² + 1) / 2: growth factor of alternating jumps per period, predicted and measured."""

    q: float
    p: float
    floquet_multiplier: float
    measured_48_steps: float
    measured_96_steps: float
    damped_48_steps: float
    damped_96_steps: float


def floquet_multiplier(q: float, p: float) -> float:
    """Return the largest modulus of a multiplier of the envelope's equation over the orbit through (q, p)."""

    def rate(t: float, y: Array) -> Array:
        (q, p), delta = y[:2], y[2:].reshape(2, 2)
        linearised = np.array([[2 * q * p, q**2 + 1], [-(p**2) - 1, -2 * q * p]])
        return np.concatenate([[p * (q**2 + 1), -q * (p**2 + 1)], (-0.5 * linearised @ delta).ravel()])

    period = NonSeparable().period(q, p)
    end = solve_ivp(rate, (0, period), np.concatenate([[q, p], np.eye(2).ravel()]), rtol=1e-10, atol=1e-12).y[2:, -1]
    return float(np.abs(np.linalg.eigvals(end.reshape(2, 2))).max())


def alternating_jumps(orbits: Orbits, *, steps: int, scheme: Simpson4 = UNDAMPED) -> Array:
    """Return the size of alternating jumps by second differences, shape (steps - 2, orbits)."""

    def both(state: MeanAndJumps, step: int) -> Array:
        return state.values[1]

    jump = np.array(watched(orbits, scheme, both, start=(orbits.q, orbits.p), dt=1.0, steps=steps))[1:]
    return np.asarray(np.hypot(*(jump[2:] - 2 * jump[1:-1] + jump[:-2]).swapaxes(0, 1)) / 4)


def growth(jumps: Array, *, steps: int) -> Array:
    """Return the growth of the largest alternating jump from the second to the third period of ``steps``, per orbit."""
    second, third = jumps[steps - 2 : 2 * steps - 2], jumps[2 * steps - 2 : 3 * steps - 2]
    return np.asarray(third.max(axis=0) / second.max(axis=0))


def measured_growth(starts: Sequence[tuple[float, float]], *, steps: int, scheme: Simpson4 = UNDAMPED) -> Array:
    """Return the growth of the alternating jumps on orbits in so many steps a period, shape (orbits,)."""
    return growth(alternating_jumps(Orbits(starts, steps), steps=3 * steps, scheme=scheme), steps=steps)


def write(report: Report) -> None:
    """Write parasitic.csv and parasitic.png."""
    factors = [floquet_multiplier(q, p) for q, p in ORBITS]
    jumps = {
        (label, steps): alternating_jumps(Orbits(ORBITS, steps), steps=PERIODS * steps, scheme=scheme)
        for label, scheme in SCHEMES.items()
        for steps in STEPS
    }
    growths = np.transpose([growth(found, steps=steps) for (_, steps), found in jumps.items()])
    rows = [Row(*start, factor, *found) for start, factor, found in zip(ORBITS, factors, growths.tolist(), strict=True)]
    report.table("parasitic", Row._fields, rows)
    with report.figure("parasitic", 11, 5) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, label in zip(panels, SCHEMES, strict=True):
            _draw(axes, {steps: jumps[label, steps] for steps in STEPS}, factors)
            axes.set(xlabel="time [periods]", ylim=(1e-8, 1e1), title=f"{label}: 48 steps a period (full), 96 (dashed)")
        panels[0].set_ylabel("alternating jump [-]")
        figure.legend(*panels[0].get_legend_handles_labels(), ncols=3, loc="outside lower center", fontsize=9)


def _draw(axes: Axes, jumps: Mapping[int, Array], factors: Sequence[float]) -> None:
    for start, colour in DRAWN.items():
        i, (q, p) = ORBITS.index(start), start
        for (steps, found), style in zip(jumps.items(), ("-", "--"), strict=True):
            label = f"q = {q:g}, p = {p:g}; by theory × {factors[i]:.3g} a period"
            time = np.arange(len(found)) / steps
            axes.semilogy(time, found[:, i], style, color=colour, lw=0.9, label=label if steps == STEPS[0] else None)
