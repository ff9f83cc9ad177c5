"""Part 3: linear stability (21)-(22), Figs 4 and 5 of [G16], and the limit of every scheme.

The amplification matrix is the scheme applied to unit vectors, in numbers or in symbols (``symbolic.py``).

Proof of the limit of (23): with x = lambda + 1/lambda and theta = omega dt the characteristic polynomial is a
quadratic in x with the discriminant 36 (theta³ + 6 theta² - 24) (theta³ - 6 theta² + 24) / 36², up to a square. All
lambda are on the unit circle as long as both x are real and in [-2, 2]. The first factor becomes positive, and x
complex, at the root of theta³ + 6 theta² - 24. With theta = y - 2 that is y³ - 12 y - 8 = 0, y = 4 cos(pi / 9):
theta = 4 cos(pi / 9) - 2 = 1.758770.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import sympy
from matplotlib import colormaps
from matplotlib.axes import Axes
from numpy.typing import NDArray

from examples.paper import symbolic
from examples.paper.oscillators import Harmonic
from examples.paper.report import Report
from examples.paper.schemes import Scheme, all_schemes, amplification, simpson, third_order
from wavetank.integrators import ThirdOrder
from wavetank.planning.dispersion import amplification as amplifications

PRINTED_LIMIT = 1.757  # of (23), section 4.1.1
GROWTH = 1e-6  # what a modulus must exceed one by to count: a double eigenvalue is known to sqrt(eps) = 1e-8 only
LARGEST = 8.0


class LimitRow(NamedTuple):
    """A scheme's limit of omega dt: by bisection to 1e-10, in the code, in the paper; inf: none below 8."""

    scheme: str
    found: float
    stated: float
    paper: str


def spectral_radius(scheme: Scheme, omega_dt: float) -> float:
    """Return the largest modulus of an eigenvalue of the amplification matrix."""
    return float(np.abs(np.linalg.eigvals(amplification(scheme, Harmonic(), omega_dt))).max())


def limit(scheme: Scheme) -> float:
    """Return the smallest omega dt with a growing mode, to 1e-10; inf if there is none below ``LARGEST``."""
    thetas = np.linspace(0.0, LARGEST, 401, dtype=np.float64)[1:]
    radii = np.abs(np.linalg.eigvals(np.asarray(amplifications(scheme.integrator, thetas)))).max(axis=-1)
    unstable = np.flatnonzero(radii > 1 + GROWTH)
    if not unstable.size:
        return np.inf
    high = float(thetas[unstable[0]])
    low = high - thetas[0]
    while high - low > 1e-11:
        middle = (low + high) / 2
        low, high = (low, middle) if spectral_radius(scheme, middle) > 1 + GROWTH else (middle, high)
    return float(low)


def limit_rows() -> list[LimitRow]:
    """Return the limits of all schemes."""
    paper = {"third order (23)": "1.757", "P2N3Q4Lob": "2 sqrt(2), of [22]"}
    return [
        LimitRow(scheme.label, limit(scheme), scheme.integrator.stability_limit, paper.get(scheme.label, ""))
        for scheme in (*all_schemes(), simpson())
    ]


def proved_limit() -> Any:
    """Return the limit of (23) from its discriminant, as an exact number."""
    theta, x = symbolic.THETA, sympy.Symbol("x")
    quadratic = reduced(symbolic.characteristic(symbolic.amplification(third_order())), x)
    discriminant = sympy.factor(sympy.discriminant(quadratic, x))
    candidates = [root for root in sympy.real_roots(sympy.numer(discriminant)) if root > 0]
    return min(root for root in candidates if changes_sign(discriminant, theta, root))


def reduced(characteristic: Any, x: Any) -> Any:
    """Return a palindromic quartic in lambda, divided by lambda², as a quadratic in x = lambda + 1/lambda."""
    a, b, c, d, e = sympy.Poly(sympy.numer(characteristic), symbolic.LAMBDA).all_coeffs()
    if sympy.expand(a - e) != 0 or sympy.expand(b - d) != 0:
        raise ArithmeticError(f"the characteristic polynomial {characteristic} is not palindromic")
    return a * (x**2 - 2) + b * x + c


def changes_sign(expression: Any, symbol: Any, root: Any) -> bool:
    """Return whether an expression has different signs on the two sides of a root."""
    below, above = (expression.subs(symbol, root.evalf(30) + side) for side in (-1e-6, 1e-6))
    return bool(below * above < 0)


def modulus_map(alphas: NDArray[Any], thetas: NDArray[Any]) -> NDArray[Any]:
    """Return the largest modulus of the eigenvalues of (20), shape (thetas, alphas)."""
    matrix = symbolic.amplification(replace(third_order(), integrator=ThirdOrder(symbolic.ALPHA)))
    evaluate = sympy.lambdify((symbolic.ALPHA, symbolic.THETA), [matrix[i, j] for i in range(4) for j in range(4)])
    grid = np.meshgrid(alphas, thetas)
    entries = np.broadcast_arrays(*(np.asarray(entry, dtype=float) for entry in evaluate(*grid)), grid[0])[:-1]
    stacked = np.moveaxis(np.array(entries), 0, -1).reshape(*grid[0].shape, 4, 4)
    return np.asarray(np.abs(np.linalg.eigvals(stacked)).max(axis=-1))


def write(report: Report) -> None:
    """Write stability-limits.csv, figure-4.csv and .png, figure-5.csv and .png."""
    report.table("stability-limits", LimitRow._fields, limit_rows())
    _write_map(report)
    thetas = np.arange(0.02, 6.0, 0.02)
    schemes = [scheme for scheme in all_schemes() if scheme.integrator.name in ("third-order", "p2n3q4lob")]
    schemes.insert(1, simpson())
    moduli = [_moduli(scheme, thetas) for scheme in schemes]
    columns = [f"{scheme.label}: modulus {i + 1}" for scheme in schemes for i in range(scheme.width)]
    report.table("figure-5", ("omega_dt", *columns), np.column_stack([thetas, *moduli]))
    with report.figure("figure-5", 9, 9) as figure:
        panels = figure.subplots(3, 1, sharex=True)
        for axes, scheme, values in zip(panels, schemes, moduli, strict=True):
            _draw_moduli(axes, thetas, values, scheme)
        panels[-1].set_xlabel("ω Δt [-]")


def _moduli(scheme: Scheme, thetas: NDArray[Any]) -> NDArray[Any]:
    return np.array([np.sort(np.abs(np.linalg.eigvals(amplification(scheme, Harmonic(), theta)))) for theta in thetas])


def _draw_moduli(axes: Axes, thetas: NDArray[Any], values: NDArray[Any], scheme: Scheme) -> None:
    stable = values.max(axis=1) < 1 + GROWTH
    axes.fill_between(thetas, 0, 3, where=stable.tolist(), color="#9a9a9a", alpha=0.25, lw=0, label="stable")
    axes.plot(thetas, values, color="#0072b2", label=["|λ|", *[None] * (values.shape[1] - 1)])
    axes.axhline(1, ls=":", color="#d55e00")
    axes.set(ylim=(0, 3), ylabel="modulus |λ| [-]")
    axes.set_title(f"{scheme.label}: stable below ω Δt = {scheme.integrator.stability_limit:.6f}")
    axes.legend(loc="upper left")


def _write_map(report: Report) -> None:
    alphas, thetas = np.linspace(0.005, 0.995, 199), np.arange(0.02, 6.0, 0.02)
    modulus = modulus_map(alphas, thetas)
    report.table(
        "figure-4",
        ("omega_dt", *(f"alpha {alpha:.3f}" for alpha in alphas)),
        ((theta, *row) for theta, row in zip(thetas, modulus, strict=True)),
    )
    with report.figure("figure-4", 7.5, 6) as figure:
        axes = figure.subplots()
        palette = colormaps["Blues"].with_extremes(under="#e69f00")
        colours = axes.pcolormesh(alphas, thetas, modulus, cmap=palette, vmin=1 + GROWTH, vmax=3, shading="nearest")
        axes.grid(False)
        axes.set(xlabel="weight α [-]", ylabel="ω Δt [-]", xticks=np.linspace(0.1, 0.9, 9))
        axes.set_title("Scheme (20). Orange: stable, all |λ| = 1; for small steps with α = 1/2 only")
        figure.colorbar(colours, ax=axes, label="largest modulus |λ| [-], from 3 upwards one colour", extend="max")
