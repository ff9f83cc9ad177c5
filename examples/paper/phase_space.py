"""Part 6: phase space, Figs 7 and 8 of [G16]: four starts of (23), and the area between them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from examples.paper.oscillators import Harmonic
from examples.paper.report import Report
from examples.paper.schemes import third_order, trajectory

OMEGA, DT = 0.3162, 0.2484  # as printed; four of (p, q) of the size of the paper's figure
CORNERS = np.array([[-0.2, -1.2], [0.2, -1.2], [0.2, -0.8], [-0.2, -0.8]]) * 1e-3


def paths(periods: float) -> NDArray[Any]:
    """Return (q⁺, p⁺) of the four corners, shape (steps + 1, 4, 2)."""
    steps = round(periods * 2 * np.pi / OMEGA / DT)
    found = [trajectory(third_order(), Harmonic(OMEGA), q=q, p=p, dt=DT, steps=steps)[1:].T for p, q in CORNERS]
    return np.stack(found, axis=1)


def areas(corners: NDArray[Any]) -> NDArray[Any]:
    """Return the areas of quadrilaterals of shape (..., 4, 2), by the shoelace formula."""
    x, y = corners[..., 0], corners[..., 1]
    return np.asarray(0.5 * np.abs((x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1)).sum(axis=-1)))


def write(report: Report) -> None:
    """Write figures-7-8.csv, figure-7.png and figure-8.png."""
    ten = paths(10)
    area, t = areas(ten), DT * np.arange(len(ten))
    names = [f"{name}_{corner}" for corner in range(1, 5) for name in "qp"]
    report.table("figures-7-8", ("t", "area", *names), np.column_stack([t, area, ten.reshape(len(ten), 8)]))
    with report.figure("figure-7", 6, 6) as figure:
        axes = figure.subplots()
        one = ten[: round(2 * np.pi / OMEGA / DT) + 1]
        for frame in one[:: len(one) // 8]:
            axes.fill(1e3 * frame[:, 1], 1e3 * frame[:, 0], alpha=0.25, color="#0072b2")
        axes.plot(1e3 * one[:, :, 1], 1e3 * one[:, :, 0], ".", ms=3, color="#0b2d5c")
        axes.set(xlabel="p⁺ [10⁻³]", ylabel="q⁺ [10⁻³]", title=f"Four states over one period: ω = {OMEGA}, Δt = {DT}")
    with report.figure("figure-8", 11, 4) as figure:
        one, all_ten = figure.subplots(1, 2, sharey=True)
        periods, change = t * OMEGA / (2 * np.pi), 1e6 * (area / area[0] - 1)
        shown = periods <= 1
        one.plot(periods[shown], change[shown], ".-", color="#0072b2", lw=0.6, ms=4)
        one.set(xlabel="time [periods]", ylabel="area / first area - 1 [10⁻⁶]", xlim=(0, 1))
        one.set_title("The area of the quadrilateral in the (p⁺, q⁺) plane, step by step")
        numbers = np.arange(1, 11)
        within = [change[(number - 1 <= periods) & (periods < number)] for number in numbers]
        all_ten.vlines(numbers, [min(values) for values in within], [max(values) for values in within], color="#0072b2")
        all_ten.plot(numbers, [np.mean(values) for values in within], "o", color="#d55e00", ms=4, label="mean")
        all_ten.set(xlabel="period", xticks=numbers)
        all_ten.set_title("From the smallest to the largest in each of ten periods")
        all_ten.legend(loc="upper right", bbox_to_anchor=(1.0, 1.12))
