"""Part 7: the damped oscillator (38)-(49), Fig. 9 of [G16], and the exact damping factor in schemes of higher order.

dq/dt = p, dp/dt = -q - gamma p. In Q = q e^(gamma t / 2), P = p e^(gamma t / 2) the modified energy (49),
H~ = (P² + Q² + gamma P Q) / 2, is constant. The drift of H~ measures the error of a treatment of damping.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from examples.paper.oscillators import Harmonic
from examples.paper.report import Report
from examples.paper.schemes import Scheme, amplification, continuous, simpson, third_order
from examples.paper.symplectic_euler import SymplecticEuler
from wavetank.integrators import Damping, StormerVerlet, damped

Array = NDArray[Any]
GAMMA, DT = 0.02, 0.2
PERIODS = 10_000
BLOCK = 500  # steps taken at once
START = (1.0, 0.0)

Map = Callable[[float, float], Array]  # (gamma, dt) -> M with z' = M z


def exact(scheme: Scheme) -> Map:
    """Return the map of a scheme with the exact damping factor, the scheme run on unit vectors."""

    def matrix(gamma: float, dt: float) -> Array:
        integrator: Any = damped(scheme.integrator, Damping(np.array([gamma])))
        return amplification(replace(scheme, integrator=integrator), Harmonic(), dt)

    return matrix


def euler_forward(gamma: float, dt: float) -> Array:
    """Return (47): p' = p - dt q - dt gamma p; q' = q + dt p'."""
    row = np.array([-dt, 1 - dt * gamma])
    return np.array([[1.0, 0.0] + dt * row, row])


def euler_backward(gamma: float, dt: float) -> Array:
    """Return (48): p' = p - dt q - dt gamma p'; q' = q + dt p'."""
    row = np.array([-dt, 1.0]) / (1 + dt * gamma)
    return np.array([[1.0, 0.0] + dt * row, row])


class Treatment(NamedTuple):
    """A treatment of damping.

    Attributes
    ----------
    label
        Name in tables and pictures.
    matrix
        (gamma, dt) -> M, shape (width, width).
    q, p
        Indices of the reported q and p in z.
    symplectic
        Whether areas shrink at the exact rate.
    """

    label: str
    matrix: Map
    q: int
    p: int
    symplectic: bool = True


def treatments() -> list[Treatment]:
    """Return the paper's three, then the exact factor in schemes of higher order, as (38) has it."""
    euler, verlet, third = continuous("", SymplecticEuler()), continuous("", StormerVerlet()), third_order()
    return [
        Treatment("symplectic Euler (44): exact factor", exact(euler), 0, 1),
        Treatment("symplectic Euler (47): forward", euler_forward, 0, 1),
        Treatment("symplectic Euler (48): backward", euler_backward, 0, 1),
        Treatment("Störmer-Verlet: exact factor", exact(verlet), 0, 1),
        Treatment("third order (23): exact factor", exact(third), 1, 3),
        Treatment("Simpson 4: exact factor", exact(simpson()), 0, 1, False),
    ]


def path(treatment: Treatment, *, gamma: float, dt: float, steps: int) -> Array:
    """Return Q and P after each step, the start included, shape (steps + 1, 2)."""
    matrix = np.exp(gamma * dt / 2) * treatment.matrix(gamma, dt)
    traces = len(matrix) // 2 if treatment.symplectic else 1  # of q, then of p; then jumps, of which there are none
    z = np.zeros(len(matrix))
    z[:traces], z[traces : 2 * traces] = START
    powers = np.array([np.linalg.matrix_power(matrix, k) for k in range(BLOCK)])
    rows = []
    for _ in range(0, steps + 1, BLOCK):
        rows.append(powers @ z)
        z = matrix @ rows[-1][-1]
    return np.concatenate(rows)[: steps + 1, [treatment.q, treatment.p]]


def modified_energy(QP: Array, gamma: float) -> Array:
    """Return (49)."""
    Q, P = QP.T
    return np.asarray((P**2 + Q**2 + gamma * P * Q) / 2)


class DriftRow(NamedTuple):
    """A treatment: its growth of the modified energy over 10⁴ periods, the mean of the last fifty against the first.

    ``order`` is the slope of the error of q over dt = 0.2, 0.1, 0.05 at t = 20; ``area`` is det M e^(width/2 gamma
    dt) - 1, the defect of the exact rate at which areas shrink; none where jumps are damped.
    """

    treatment: str
    order: float
    drift: float
    fluctuation: float
    area: float


@cache
def drift_rows() -> tuple[DriftRow, ...]:
    """Return all treatments with gamma = 0.02, dt = 0.2."""
    rows, period = [], round(2 * np.pi / DT)
    for treatment in treatments():
        energy = modified_energy(path(treatment, gamma=GAMMA, dt=DT, steps=PERIODS * period), GAMMA)
        first, last = energy[: 50 * period], energy[-50 * period :]
        matrix = treatment.matrix(GAMMA, DT)
        area = np.linalg.det(matrix) * np.exp(len(matrix) / 2 * GAMMA * DT) - 1 if treatment.symplectic else np.nan
        drift, swing = last.mean() / first.mean() - 1, np.ptp(first) / first[0]
        rows.append(DriftRow(treatment.label, order(treatment), float(drift), float(swing), float(area)))
    return tuple(rows)


def order(treatment: Treatment, *, gamma: float = 0.3) -> float:
    """Return the slope of the error of (Q, P) at t = 20."""
    sizes, errors = (0.2, 0.1, 0.05), []
    omega = np.sqrt(1 - gamma**2 / 4)
    exact_Q = np.cos(20 * omega) + gamma / (2 * omega) * np.sin(20 * omega)
    exact_P = -np.sin(20 * omega) / omega
    for dt in sizes:
        last = path(treatment, gamma=gamma, dt=dt, steps=round(20 / dt))[-1]
        errors.append(np.hypot(*(last - (exact_Q, exact_P))))
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def write(report: Report) -> None:
    """Write damping.csv, figure-9.csv and .png."""
    report.table("damping", DriftRow._fields, drift_rows())
    gamma, dt, steps = 0.1, 0.1, 600
    t = dt * np.arange(steps + 1)
    energies = {one.label: modified_energy(path(one, gamma=gamma, dt=dt, steps=steps), gamma) for one in treatments()}
    report.table("figure-9", ("t", *energies), np.column_stack([t, *energies.values()]))
    with report.figure("figure-9", 11, 5) as figure:
        left, right = figure.subplots(1, 2)
        labels = list(energies)
        for label, look in zip(labels[:3], (("-", "#0072b2"), ("o", "#d55e00"), ("x", "#009e73")), strict=True):
            energy = energies[label] / energies[label][0]
            left.plot(t, energy, look[0], ms=4, color=look[1], label=label, markevery=12, mfc="none")
        left.set(xlabel="time [s]", ylabel="modified energy (49) / its start [-]")
        left.set_title(f"Symplectic Euler, γ = {gamma} 1/s, Δt = {dt} s (Fig. 9)")
        for label, colour in zip(labels[3:], ("#e69f00", "#0072b2", "#009e73"), strict=True):
            right.semilogy(*largest_swings(t, energies[label]), "o-", ms=4, mfc="none", color=colour, label=label)
        right.set(xlabel="time [s]", ylabel="largest |(49) / its start - 1| in a period [-]")
        right.set_title("Higher order: no drift, either")
        for axes in (left, right):
            axes.legend(fontsize=8, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.14))


def largest_swings(t: Array, energy: Array) -> tuple[Array, Array]:
    """Return the middles of periods of 2 pi, and the largest energy difference from the start in each."""
    period = (t // (2 * np.pi)).astype(int)
    whole = np.arange(period[-1])
    off = np.abs(energy / energy[0] - 1)
    return 2 * np.pi * (whole + 0.5), np.array([off[period == number].max() for number in whole])
