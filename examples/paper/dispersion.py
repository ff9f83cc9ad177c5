"""Part 4: dispersion (25)-(31) of the third-order scheme (23), Fig. 6 of [G16], and the effect of the start.

With theta = omega dt, (27): X = sqrt(1 - theta⁶ / (36 (4 - theta²)²)), Y = theta³ / (6 (4 - theta²)), and

    cos(omega^ dt) = [ ± 4 (4 - theta²) X + theta² (theta² / 6 - 3) ] / (theta² + 16)

plus for the physical families (29), (30), minus for the parasitic ones (28), (31). The modes are (p⁻, q⁻, p⁺, q⁺) =
(a, b, c, d) with c = -i d omega for omega^ > 0, +i d omega for omega^ < 0, a of b likewise, and |b| = |d|: q⁻ is q⁺
rotated by a small angle. A start without jumps, q⁻ = q⁺, is therefore not exactly on the physical modes. The sine of
the angle is Y, so the jump of a smooth solution is dt³ / 24 times its third derivative. A start without it excites a
parasitic mode of that size. This is the complete third-order error of the scheme on the linear oscillator.
"""

import operator
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import sympy
from matplotlib.axes import Axes
from numpy.typing import NDArray

from examples.paper import symbolic
from examples.paper.oscillators import Harmonic
from examples.paper.report import Report
from examples.paper.schemes import Scheme, all_schemes, amplification, simpson, third_order
from wavetank.integrators import Simpson4, ThirdOrder

Array = NDArray[Any]


NO_SERIES = ("suzuki-verlet", "simpson-4")  # cube roots of 4; eight numbers a state: ``mean_jump.py`` has its series


class Families(NamedTuple):
    """Numerical frequencies times dt of the families of (23), each shape (thetas,)."""

    parasitic_28: Array
    physical_29: Array
    physical_30: Array
    parasitic_31: Array


def families(theta: Array) -> Families:
    """Return (28b), (29b), (30b) and (31b) for omega dt below the stability limit."""
    X = np.sqrt(1 - theta**6 / (36 * (4 - theta**2) ** 2))
    rest, swing = theta**2 * (theta**2 / 6 - 3), 4 * (4 - theta**2) * X
    physical, parasitic = (np.arccos((rest + sign * swing) / (theta**2 + 16)) for sign in (1, -1))
    return Families(parasitic, physical, -physical, -parasitic)


def from_eigenvalues(theta: Array) -> Families:
    """Return the same from the eigenvalues of the scheme run on unit vectors."""
    scheme = third_order()
    rows = []
    for value in theta:
        a, b, c, d = np.sort(np.angle(np.linalg.eigvals(amplification(scheme, Harmonic(), value))))
        rows.append((d, c, b, a))
    return Families(*np.array(rows).T)


def shape_defect(theta: float) -> float:
    """Return the largest violation of the relations between a, b, c and d in (28a)-(31a), for omega = 1."""
    values, modes = np.linalg.eig(amplification(third_order(), Harmonic(), theta))
    X = np.sqrt(1 - theta**6 / (36 * (4 - theta**2) ** 2))
    Y = theta**3 / (6 * (4 - theta**2))
    defects = []
    for value, (q_minus, q_plus, p_minus, p_plus) in zip(values, modes.T, strict=True):
        turn = 1j * np.sign(value.imag)
        parasitic = abs(np.angle(value)) > np.pi / 2
        ratio = (-X if parasitic else X) + turn * Y
        defects += [abs(p_plus - turn * q_plus), abs(p_minus - turn * q_minus), abs(q_minus - ratio * q_plus)]
    return float(max(defects))


def frequency(scheme: Scheme, theta: float) -> float:
    """Return the numerical frequency times dt of the mode closest to the exact one."""
    angles = np.angle(np.linalg.eigvals(amplification(scheme, Harmonic(), theta)))
    return float(angles[np.argmin(np.abs(angles - theta))])


def leading_error(scheme: Scheme) -> tuple[Any, int]:
    """Return (c, m), exactly, with omega^ / omega = 1 + c theta^m + ..., from lambda = exp(i theta (...)) in series."""
    theta, c = symbolic.THETA, sympy.Symbol("c")
    polynomial = sympy.numer(symbolic.characteristic(symbolic.amplification(scheme)))
    factors = sympy.Poly(polynomial, symbolic.LAMBDA).all_coeffs()[::-1]
    for m in (2, 4, 6):
        phase = sympy.I * theta * (1 + c * theta**m)
        powers = [sum((k * phase) ** n / sympy.factorial(n) for n in range(m + 4)) for k in range(len(factors))]
        lowest = lowest_coefficient(sympy.expand(sum(map(operator.mul, factors, powers))), theta)
        solutions = sympy.solve(lowest, c)
        if solutions and solutions[0] != 0:
            return solutions[0], m
    raise ArithmeticError(f"{scheme.label}: the frequency is right to order 6")


def lowest_coefficient(expression: Any, symbol: Any) -> Any:
    """Return the coefficient of the lowest power of a symbol that is not zero."""
    coefficients = reversed(sympy.Poly(expression, symbol).all_coeffs())
    return next(one for one in map(sympy.simplify, coefficients) if one != 0)


class ErrorRow(NamedTuple):
    """The leading relative frequency error c (omega dt)^m: by series where a scheme runs on symbols, and as stated."""

    scheme: str
    c: str
    m: int
    stated_size: float
    measured_c: float


@cache
def error_rows() -> tuple[ErrorRow, ...]:
    """Return the leading errors of all schemes; measured at omega dt = 0.1."""
    rows = []
    for scheme in (*all_schemes(), simpson()):
        size, power = scheme.integrator.frequency_error
        by_series = scheme.integrator.name not in NO_SERIES
        coefficient = str(leading_error(scheme)[0]) if by_series else ""
        rows.append(ErrorRow(scheme.label, coefficient, power, size, (frequency(scheme, 0.1) / 0.1 - 1) / 0.1**power))
    return tuple(rows)


class StartRow(NamedTuple):
    """A start of (23) on the oscillator, omega = q = 1, p = 0: its parasitic modes, and the errors up to t = 20."""

    start: str
    dt: float
    parasitic_amplitude: float
    largest_error: float
    energy_range: float


def starts(dt: float) -> dict[str, Array]:
    """Return starts (q⁻, q⁺, p⁻, p⁺): without jumps, with the smooth jump, and with a wrong jump of 10 %."""
    third = np.array([0.0, 1.0])  # q''' and p''' of (cos t, -sin t) at t = 0
    jump = dt**3 / 24 * third
    return {
        "no jump": np.array([1.0, 1.0, 0.0, 0.0]),
        "jump of a smooth solution": np.array([1.0 - jump[0], 1.0, -jump[1], 0.0]),
        "wrong: jump of 10 % in q": np.array([0.9, 1.0, 0.0, 0.0]),
    }


def start_path(z: Array, dt: float) -> Array:
    """Return the traces of (23) from z on, over a time of 20, shape (steps + 1, 4)."""
    matrix, rows = amplification(third_order(), Harmonic(), dt), [z]
    for _ in range(round(20 / dt)):
        rows.append(matrix @ rows[-1])
    return np.array(rows)


def start_rows() -> list[StartRow]:
    """Return the errors of each start at three steps."""
    rows = []
    for dt in (0.4, 0.2, 0.1):
        values, modes = np.linalg.eig(amplification(third_order(), Harmonic(), dt))
        parasitic = np.abs(np.angle(values)) > np.pi / 2
        for name, z in starts(dt).items():
            amplitudes = np.linalg.solve(modes, z.astype(complex)) * modes[1]
            path = start_path(z, dt)
            t = dt * np.arange(len(path))
            error = np.hypot(path[:, 1] - np.cos(t), path[:, 3] + np.sin(t)).max()
            energy = (path[:, 1] ** 2 + path[:, 3] ** 2) / 2
            rows.append(StartRow(name, dt, float(np.abs(amplitudes[parasitic]).sum()), error, float(np.ptp(energy))))
    return rows


def write(report: Report) -> None:
    """Write frequency-errors.csv, figure-6.csv and .png, starts.csv and .png."""
    report.table("frequency-errors", ErrorRow._fields, error_rows())
    theta = np.linspace(0.01, 0.999 * ThirdOrder.stability_limit, 176)
    formula, found, verlet = families(theta), from_eigenvalues(theta), 2 * np.arcsin(theta / 2)
    names = [f"{name} {source}" for source in ("formula", "eigenvalues") for name in Families._fields]
    report.table("figure-6", ("omega_dt", *names, "Stormer-Verlet"), np.column_stack([theta, *formula, *found, verlet]))
    with report.figure("figure-6", 11, 4.6) as figure:
        left, right = figure.subplots(1, 2)
        _draw_families(left, theta, formula, found)
        right.plot(theta, theta - verlet, "--", color="#d55e00", label="Störmer-Verlet")
        right.plot(theta, theta - formula.physical_29, color="#0072b2", label="third order (23)")
        damped = theta[theta < Simpson4.stability_limit]
        turned = [frequency(simpson(), value) for value in damped]
        right.plot(damped, damped - turned, ":", color="#009e73", lw=2, label="the same, jumps damped")
        right.set(xlabel="ω Δt [-]", ylabel="(ω - ω̂) Δt [-]", title="Difference from the exact frequency (Fig. 6)")
        right.legend()
    report.table("starts", StartRow._fields, start_rows())
    with report.figure("starts", 11, 4.6) as figure:
        _draw_starts(figure.subplots(1, 2, sharey=True))
        figure.legend(*figure.axes[0].get_legend_handles_labels(), ncols=3, loc="outside lower center")


def _draw_starts(panels: Array) -> None:
    """Draw the distance from the exact point of the plus trace, which (23) reports, or of the mean, right at first."""
    looks = (("o-", "#0072b2"), ("s--", "#009e73"), (".-", "#d55e00"))
    for (name, z), (style, colour) in zip(starts(0.4).items(), looks, strict=True):
        for axes, side in zip(
            panels, (0.0, 0.5), strict=True
        ):  # of the minus trace in what starts, and is looked at, right
            q_off, p_off = side * (z[1] - z[0]), side * (z[3] - z[2])
            q_minus, q_plus, p_minus, p_plus = start_path(z + (q_off, q_off, p_off, p_off), 0.4).T
            t = 0.4 * np.arange(q_plus.size)
            q, p = q_plus + side * (q_minus - q_plus), p_plus + side * (p_minus - p_plus)
            error = np.hypot(q - np.cos(t), p + np.sin(t))
            axes.semilogy(t[1:], error[1:], style, color=colour, ms=4, lw=0.9, label=name)
    for axes, what in zip(panels, ("plus trace", "mean of the traces"), strict=True):
        axes.set(xlabel="ω t [-]", title=f"Scheme (23) at ω Δt = 0.4 from three starts: {what}")
    panels[0].set_ylabel("distance of (q, p) from the exact point [-]")


def _draw_families(axes: Axes, theta: Array, formula: Families, found: Families) -> None:
    axes.plot(theta, theta, color="#9a9a9a", lw=3, alpha=0.6, label="exact")
    for name, values, dots in zip(Families._fields, formula, found, strict=True):
        colour = "#0072b2" if name.startswith("physical") else "#d55e00"
        axes.plot(theta, values, color=colour, label=name.replace("_", " (") + ")")
        axes.plot(theta[::12], dots[::12], "o", ms=4, mfc="none", color=colour)
    axes.set(xlabel="ω Δt [-]", ylabel="numerical frequency, ω̂ Δt [-]")
    axes.set_title("Scheme (23): formulae (lines), eigenvalues (circles)")
    axes.legend(fontsize=8)
