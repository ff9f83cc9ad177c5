"""Part 12: 10⁵ periods of an orbit of H = (q² + 1)(p² + 1) / 2, and the effect of damped jumps of (23) on the energy.

A step changes the jump by D. By the two-form dq ^ dp - 1/4 d(jump of q) ^ d(jump of p) that (23) preserves, this
changes the energy by -1/4 d(jump)/dt ^ D. The jump is dt³/24 z''' and D = -kappa/8 times its third backward
difference, dt³ d³/dt³ - 3/2 dt⁴ d⁴/dt⁴. The first term gives the derivative of a periodic function; the second

    dH/dt = kappa dt⁹ / (1536 (8 - kappa)) [ q⁽⁵⁾ p⁽⁶⁾ - p⁽⁵⁾ q⁽⁶⁾ ],

in the mean over a period, for any H. On the oscillator it is the modulus 1 - kappa theta¹⁰ / (1536 (8 - kappa)).
"""

from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from examples.paper.oscillators import NonSeparable
from examples.paper.report import Report
from examples.paper.traced import energies
from wavetank.base.arrays import Vector
from wavetank.integrators import GaussLegendre4, Simpson4
from wavetank.integrators.contract import Integrator

ORBIT = (0.5, 0.25)
STEPS, PERIODS = (16, 20, 24, 32, 40, 48), 100_000
DAMPED = "Simpson 4"
SCHEMES: dict[str, Integrator[Any]] = {
    DAMPED: Simpson4(),
    "(23), mean": Simpson4(0.0),
    "Gauss-Legendre 4": GaussLegendre4(),
}
HARMONICS = 128  # places on the orbit, from which half as many are known


def error(scheme: str, steps: int, *, periods: int = PERIODS) -> Vector:
    """Return how far the mean energy over each period is from the start's, relative, shape (periods,)."""
    q, p = ORBIT
    start = NonSeparable().energy(np.array([q]), np.array([p]), 0.0)
    found = energies(SCHEMES[scheme], q=q, p=p, steps=steps, periods=periods)
    return np.asarray(found / start - 1, dtype=float)


def drift(error: Vector) -> float:
    """Return the slope of a line through the errors, a period."""
    return float(np.polyfit(np.arange(error.size), error, 1)[0])


def predicted(steps: int) -> float:
    """Return the relative change of the energy a period as theory has it to leading order; from Fourier series."""
    (q, p), kappa, system = ORBIT, Simpson4().kappa, NonSeparable()
    period = system.period(q, p)
    dt = period / steps
    path = np.array([system.exact(q, p, period * n / HARMONICS) for n in range(HARMONICS)]).T
    k = np.fft.fftfreq(HARMONICS, 1 / HARMONICS)
    modes = np.where(np.abs(k) < HARMONICS / 4, np.fft.fft(path) / HARMONICS, 0.0)
    fifth, sixth = ((2j * np.pi / period * k) ** n * modes for n in (5, 6))
    area = float(np.real(np.sum(fifth[0].conj() * sixth[1] - fifth[1].conj() * sixth[0])))
    start = system.energy(np.array([q]), np.array([p]), 0.0)
    return kappa * dt**9 / (1536 * (8 - kappa)) * area * period / start


class Row(NamedTuple):
    """A scheme and a step, as omega dt: the largest relative error of a period's mean energy, and its drift a period.

    ``predicted`` is theory's to leading order, where jumps are damped; 0 where there is none to predict.
    """

    scheme: str
    omega_dt: float
    largest_error: float
    drift_per_period: float
    predicted: float


def row(scheme: str, steps: int, error: Vector) -> Row:
    """Return the row of an error."""
    theory = predicted(steps) if scheme == DAMPED else 0.0
    return Row(scheme, 2 * np.pi / steps, float(np.abs(error - error[0]).max()), drift(error), theory)


def write(report: Report) -> None:
    """Write long-orbits.csv and .png."""
    errors = {(scheme, steps): error(scheme, steps) for scheme in SCHEMES for steps in STEPS}
    rows = [row(*key, one) for key, one in errors.items()]
    report.table("long-orbits", Row._fields, rows)
    with report.figure("long-orbits", 11, 4.6) as figure:
        left, right = figure.subplots(1, 2)
        _draw_errors(left, {scheme: errors[scheme, 24] for scheme in SCHEMES})
        _draw_drifts(right, [one for one in rows if one.scheme == DAMPED])


def _draw_errors(axes: Axes, errors: dict[str, Vector]) -> None:
    shown = np.unique(np.geomspace(1, PERIODS, 300).astype(int)) - 1
    for (label, one), colour in zip(errors.items(), ("#009e73", "#0072b2", "#d55e00"), strict=True):
        axes.loglog(shown[1:] + 1, np.abs(one - one[0])[shown[1:]], color=colour, label=label)
    axes.set(xlabel="time [periods]", ylabel="change of the mean energy of a period, of H [-]", xlim=(1, 1.2 * PERIODS))
    axes.set_title("24 steps a period, ωΔt = 0.26")
    axes.legend(loc="upper left")


def _draw_drifts(axes: Axes, rows: list[Row]) -> None:
    theta = np.array([one.omega_dt for one in rows])
    measured, theory = (np.array([getattr(one, name) for one in rows]) for name in ("drift_per_period", "predicted"))
    axes.loglog(theta, measured, "o", color="#009e73", label="Simpson 4, measured")
    axes.loglog(theta, theory, "k--", lw=0.8, label="theory, (ωΔt)⁹")
    axes.set_xticks(theta, [f"{value:.2f}" for value in theta])
    axes.minorticks_off()
    axes.set(xlabel="ω Δt [-]", ylabel="gain of energy a period, of H [-]")
    axes.set_title(f"Energy over {PERIODS:,} periods".replace(",", "\u202f"))
    axes.legend(loc="upper left")
