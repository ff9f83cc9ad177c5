"""Beyond the paper: what nonlinearity does to the parasitic modes (28), (31) of the third-order scheme (23).

For small omega dt a parasitic mode is an alternating jump, z⁻ - z⁺ = (-1)^n delta, and by (28b), (31b) its envelope
delta turns backwards at half the frequency. Where H is not quadratic that reads

    d delta / dt = -1/2 J H''(z(t)) delta,     J = (0 1; -1 0), H'' the second derivatives along the computed orbit,

whatever the step. On a periodic orbit the largest Floquet multiplier says whether jumps grow: they start at dt³,
but then grow by that factor every period until they spoil the solution. On the harmonic oscillator the multiplier
is one.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from wavetank.hamiltonian.oscillators import NonSeparable
from wavetank.verify.report import Report
from wavetank.verify.schemes import third_order

Array = NDArray[Any]
ORBITS = ((0.3, 0.1), (0.5, 0.25), (0.8, 0.4), (0.9, 0.45), (1.0, 0.5), (1.2, 0.5), (1.5, 0.5))


class Row(NamedTuple):
    """An orbit of H = (q² + 1)(p² + 1) / 2: by what factor alternating jumps grow a period, predicted and measured."""

    q: float
    p: float
    floquet_multiplier: float
    measured_48_steps: float
    measured_96_steps: float


def floquet_multiplier(q: float, p: float) -> float:
    """Return the largest modulus of a multiplier of the envelope's equation over the orbit through (q, p)."""

    def rate(t: float, y: Array) -> Array:
        (q, p), delta = y[:2], y[2:].reshape(2, 2)
        linearised = np.array([[2 * q * p, q**2 + 1], [-(p**2) - 1, -2 * q * p]])
        return np.concatenate([[p * (q**2 + 1), -q * (p**2 + 1)], (-0.5 * linearised @ delta).ravel()])

    period = NonSeparable().period(q, p)
    end = solve_ivp(rate, (0, period), np.concatenate([[q, p], np.eye(2).ravel()]), rtol=1e-10, atol=1e-12).y[2:, -1]
    return float(np.abs(np.linalg.eigvals(end.reshape(2, 2))).max())


def alternating_jump(q: float, p: float, *, steps: int, periods: int) -> Array:
    """Return the size of the alternating part of the jumps after each step, from their second differences."""
    scheme, system = third_order(), NonSeparable()
    dt = system.period(q, p) / steps
    z = scheme.vector(scheme.start(q, p))
    jumps = []
    for _ in range(periods * steps):
        z = scheme.step(system, z, 0.0, dt)
        jumps.append((z[0] - z[1], z[2] - z[3]))
    jump = np.array(jumps)
    return np.asarray(np.hypot(*(jump[2:] - 2 * jump[1:-1] + jump[:-2]).T) / 4)


def measured_growth(q: float, p: float, *, steps: int) -> float:
    """Return the growth of the largest alternating jump from the second to the third period."""
    jump = alternating_jump(q, p, steps=steps, periods=3)
    return float(jump[2 * steps - 2 :].max() / jump[steps - 2 : 2 * steps - 2].max())


def rows() -> list[Row]:
    """Return all orbits."""
    return [
        Row(q, p, floquet_multiplier(q, p), *(measured_growth(q, p, steps=steps) for steps in (48, 96)))
        for q, p in ORBITS
    ]


def write(report: Report) -> None:
    """Write parasitic.csv and parasitic.png."""
    report.table("parasitic", Row._fields, rows())
    with report.figure("parasitic", 9, 4.6) as figure:
        axes = figure.subplots()
        for (q, p), colour in zip(
            ((0.5, 0.25), (1.0, 0.5), (1.5, 0.5)), ("#0072b2", "#e69f00", "#d55e00"), strict=True
        ):
            factor = floquet_multiplier(q, p)
            for steps, style in ((48, "-"), (96, "--")):
                jump = alternating_jump(q, p, steps=steps, periods=8)
                label = f"q = {q:g}, p = {p:g}: predicted factor {factor:.3g} a period" if steps == 48 else None
                axes.semilogy(np.arange(jump.size) / steps, jump, style, color=colour, lw=0.9, label=label)
        axes.set(xlabel="time [periods]", ylabel="alternating jump [-]", ylim=(1e-7, 1e2))
        axes.set_title("Jumps of (23) on three orbits of (q² + 1)(p² + 1)/2: 48 steps a period (full), 96 (dashed)")
        axes.legend(loc="upper left", fontsize=9)
