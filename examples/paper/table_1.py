"""Part 2: Table 1 of [G16], the third-order scheme (23) on the harmonic oscillator, omega² = 0.1, T = 40.

The printed digits are those of q(0) = 0, p(0) = -0.001; the table's caption has the two swapped.
"""

from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from examples.paper.oscillators import Harmonic
from examples.paper.report import Report
from examples.paper.schemes import path, third_order

OMEGA, DURATION = 0.1**0.5, 40.0
START = (0.0, -0.001)
PRINTED = {  # dt: L-infinity(q), L2(q), Delta H
    1: (4.1204e-6, 6.1191e-6, 1.3489e-9),
    1 / 2: (5.1937e-7, 7.0457e-7, 1.6565e-10),
    1 / 4: (6.5058e-8, 8.6159e-8, 2.0613e-11),
    1 / 8: (8.1366e-9, 1.0710e-8, 2.5735e-12),
    1 / 16: (1.0172e-9, 1.3369e-9, 3.2171e-13),
    1 / 32: (1.2716e-10, 1.6705e-10, 4.0211e-14),
    1 / 64: (1.5895e-11, 2.0879e-11, 5.0263e-15),
}
EXTRA = (1 / 128,)  # beyond the paper: where does round-off begin?


class Row(NamedTuple):
    """A row of Table 1; orders against the row above (0 in the first), printed values 0 where the paper has none.

    ``round_off_rules`` names the errors to which round-off, eps times the number of steps times the largest value,
    adds more than 1 %.
    """

    dt: float
    l_infinity_q: float
    l_infinity_order: float
    l2_q: float
    l2_order: float
    delta_h: float
    delta_h_order: float
    printed_l_infinity: float
    printed_l2: float
    printed_delta_h: float
    round_off_rules: str


def errors(dt: float) -> tuple[float, float, float]:
    """Return (24a) of q, the L2 norm over the polynomial (17b), and (24b)."""
    (q, p), steps = START, round(DURATION / dt)
    states, integral = path(third_order(), Harmonic(OMEGA), q=q, p=p, dt=dt, steps=steps), 0.0
    nodes, weights = np.polynomial.legendre.leggauss(5)
    x = (1 + nodes) / 2
    for step, (z, after) in enumerate(pairwise(states)):
        middle = (z[3] - after[2]) / (OMEGA**2 * dt)  # (20d): p⁻' = p⁺ - dt omega² q½
        polynomial = (1 - x) * (1 - 2 * x) * z[1] + 4 * x * (1 - x) * middle - x * (1 - 2 * x) * after[0]
        exact = exact_q(dt * (step + x))
        integral += dt / 2 * float(weights @ (polynomial - exact) ** 2)
    _, q, _, p = states.T
    energy = (p**2 + OMEGA**2 * q**2)[1:] / 2
    largest = np.abs(q - exact_q(dt * np.arange(q.size))).max()
    return float(largest), float(np.sqrt(integral)), float(np.ptp(energy))


def exact_q(t: NDArray[Any]) -> NDArray[Any]:
    """Return (A.8) from ``START``."""
    return np.asarray(START[0] * np.cos(OMEGA * t) + START[1] / OMEGA * np.sin(OMEGA * t))


@cache
def rows() -> tuple[Row, ...]:
    """Return the table, its seven rows and the extra ones."""
    table, before = [], (np.nan,) * 3
    for dt in (*PRINTED, *EXTRA):
        found = errors(dt)
        order = np.nan_to_num(np.log2(np.divide(before, found)))
        q_off, H_off = (np.finfo(float).eps * DURATION / dt * scale for scale in (0.001 / OMEGA, 0.5e-6))
        names = ("l_infinity", "l2", "delta_h")
        ruled = [
            name for name, error, off in zip(names, found, (q_off, q_off, H_off), strict=True) if off > 0.01 * error
        ]
        (a, a_order), (b, b_order), (c, c_order) = zip(found, order.tolist(), strict=True)
        printed = PRINTED.get(dt, (0.0, 0.0, 0.0))
        table.append(Row(dt, a, a_order, b, b_order, c, c_order, *printed, " ".join(ruled)))
        before = found
    return tuple(table)


def write(report: Report) -> None:
    """Write table-1.csv and table-1.png."""
    table = rows()
    report.table("table-1", Row._fields, table)
    dt = np.array([row.dt for row in table])
    with report.figure("table-1", 7, 5) as figure:
        axes = figure.subplots()
        for name, label, colour in (
            ("l_infinity", "$L_\\infty$ of q", "#0072b2"),
            ("l2", "$L_2$ of q", "#009e73"),
            ("delta_h", "range of H", "#d55e00"),
        ):
            computed = [getattr(row, {"delta_h": "delta_h"}.get(name, f"{name}_q")) for row in table]
            printed = [getattr(row, f"printed_{name}") or np.nan for row in table]
            axes.loglog(
                dt,
                printed,
                "o",
                ms=10,
                mfc="none",
                mec="#9a9a9a",
                mew=2,
                label="Table 1" if colour == "#d55e00" else None,
            )
            axes.loglog(dt, computed, ".-", color=colour, label=label)
        axes.loglog(dt, 2e-6 * dt**3, "k--", lw=0.8, label="slope 3")
        axes.set(xlabel="time step Δt [s]", ylabel="error", title="Scheme (23), ω² = 0.1, T = 40 s")
        axes.legend()
