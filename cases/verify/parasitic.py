"""Beyond the paper: what nonlinearity does to the parasitic modes (28), (31) of the third-order scheme (23).

For small omega dt a parasitic mode is an alternating jump, z⁻ - z⁺ = (-1)^n delta, and by (28b), (31b) its envelope
delta turns backwards at half the frequency. Where H is not quadratic that reads

    d delta / dt = -1/2 J H''(z(t)) delta,     J = (0 1; -1 0), H'' the second derivatives along the computed orbit,

whatever the step. On a periodic orbit the largest Floquet multiplier says whether jumps grow: they start at dt³,
but then grow by that factor every period until they spoil the solution. On the harmonic oscillator the multiplier
is one. Damped, as in ``wavetank/integrators/simpson.py``, they lose kappa a step, which is more.
"""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from wavetank.hamiltonian.oscillators import NonSeparable
from wavetank.integrators import Simpson4
from wavetank.integrators.simpson import MeanAndJumps
from wavetank.verify.damped_jumps import Orbits
from wavetank.verify.report import Report
from wavetank.verify.watched import watched

Array = NDArray[Any]
ORBITS = ((0.3, 0.1), (0.5, 0.25), (0.8, 0.4), (0.9, 0.45), (1.0, 0.5), (1.2, 0.5), (1.5, 0.5))
DRAWN = {(0.5, 0.25): "#0072b2", (1.0, 0.5): "#e69f00", (1.5, 0.5): "#d55e00"}
STEPS = (48, 96)
UNDAMPED = Simpson4(0.0)  # which is (23)
SCHEMES = {"(23)": UNDAMPED, "Simpson 4": Simpson4()}


class Row(NamedTuple):
    """An orbit of H = (q² + 1)(p² + 1) / 2: by what factor alternating jumps grow a period, predicted and measured."""

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


def alternating_jump(q: float, p: float, *, steps: int, periods: int, scheme: Simpson4 = UNDAMPED) -> Array:
    """Return the size of the alternating part of the jumps after each step, from their second differences."""
    orbit = Orbits([(q, p)], steps)

    def both(state: MeanAndJumps, step: int) -> tuple[float, float]:
        return state.q_jump[0], state.p_jump[0]

    jump = np.array(watched(orbit, scheme, both, start=(orbit.q, orbit.p), dt=1.0, steps=periods * steps))[1:]
    return np.asarray(np.hypot(*(jump[2:] - 2 * jump[1:-1] + jump[:-2]).T) / 4)


def measured_growth(q: float, p: float, *, steps: int, scheme: Simpson4 = UNDAMPED) -> float:
    """Return the growth of the largest alternating jump from the second to the third period."""
    jump = alternating_jump(q, p, steps=steps, periods=3, scheme=scheme)
    return float(jump[2 * steps - 2 :].max() / jump[steps - 2 : 2 * steps - 2].max())


def rows() -> list[Row]:
    """Return all orbits."""
    table = []
    for q, p in ORBITS:
        growths = [measured_growth(q, p, steps=steps, scheme=scheme) for scheme in SCHEMES.values() for steps in STEPS]
        table.append(Row(q, p, floquet_multiplier(q, p), *growths))
    return table


def write(report: Report) -> None:
    """Write parasitic.csv and parasitic.png."""
    report.table("parasitic", Row._fields, rows())
    with report.figure("parasitic", 11, 5) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for axes, (label, scheme) in zip(panels, SCHEMES.items(), strict=True):
            _draw(axes, scheme)
            axes.set(xlabel="time [periods]", ylim=(1e-8, 1e1), title=f"{label}: 48 steps a period (full), 96 (dashed)")
        panels[0].set_ylabel("alternating jump [-]")
        figure.legend(*panels[0].get_legend_handles_labels(), ncols=3, loc="outside lower center", fontsize=9)


def _draw(axes: Axes, scheme: Simpson4) -> None:
    for (q, p), colour in DRAWN.items():
        factor = floquet_multiplier(q, p)
        for steps, style in zip(STEPS, ("-", "--"), strict=True):
            jump = alternating_jump(q, p, steps=steps, periods=8, scheme=scheme)
            label = f"q = {q:g}, p = {p:g}; by theory × {factor:.3g} a period"
            time = np.arange(jump.size) / steps
            axes.semilogy(time, jump, style, color=colour, lw=0.9, label=label if steps == STEPS[0] else None)
