"""Part 5: symplecticity (32)-(37) and time reversal of every scheme, in symbols and on a non-separable system.

A step with derivative M preserves the two-form J of a scheme when M' J M = J. Schemes with one q and one p preserve
dq ^ dp. The traces of (20) preserve beta dq⁻ ^ dp⁺ + alpha dq⁺ ^ dp⁻, which for alpha = 1/2 is (37): each q is paired
with the p of the other side. A scheme is reversible when R step(R step(z)) = z, where R changes the sign of p and
exchanges the traces.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
import sympy

from examples.paper import symbolic
from examples.paper.oscillators import NonSeparable
from examples.paper.report import Report
from examples.paper.schemes import Scheme, all_schemes, discontinuous, discontinuous_adjoint, simpson, third_order
from wavetank.base.arrays import Vector
from wavetank.integrators import Simpson4
from wavetank.integrators.contract import HamiltonianSystem

DIFFERENCE = 1e-5  # of central differences: their error is its square, their round-off eps over it, about 1e-10 both
NO_SYMBOLS = ("suzuki-verlet", "simpson-4")  # cube roots of 4, eight numbers a state: measured in numbers only


class Row(NamedTuple):
    """A scheme's defects.

    ``symbolic`` is "0" where M' J M - J is zero in symbols on the linear oscillator; ``two_form`` is its largest
    entry on H = (q² + 1)(p² + 1) / 2 by central differences;
    ``reversal`` is the distance from where a step forth, and back with reversed momenta, began.
    """

    scheme: str
    symbolic: str
    two_form: float
    reversal: float
    reversible: bool


def derivative(scheme: Scheme, system: HamiltonianSystem, z: Vector, dt: float) -> Vector:
    """Return the derivative of a step at z by central differences, shape (width, width)."""
    e = DIFFERENCE
    columns = [
        (scheme.step(system, z + e * unit, 0.0, dt) - scheme.step(system, z - e * unit, 0.0, dt)) / (2 * e)
        for unit in np.eye(scheme.width)
    ]
    return np.array(columns).T


def state_away_from_rest(scheme: Scheme) -> Vector:
    """Return a state with every trace different, shape (width,)."""
    traces = np.array([0.35, 0.30, -0.28, -0.20])
    z = np.zeros(scheme.width)
    z[list(scheme.traces)] = traces
    return z


def two_form_defect(scheme: Scheme, *, dt: float = 0.3) -> float:
    """Return the largest entry of M' J M - J on the non-separable system."""
    M = derivative(scheme, NonSeparable(), state_away_from_rest(scheme), dt)
    return float(np.abs(M.T @ scheme.form @ M - scheme.form).max())


def symbolic_defect(scheme: Scheme) -> Any:
    """Return M' J M - J on the linear oscillator, in lowest terms."""
    M, J = symbolic.amplification(scheme), sympy.nsimplify(sympy.Matrix(scheme.form), rational=True)
    return (M.T * J * M - J).applyfunc(sympy.cancel)


def symbolic_zero(scheme: Scheme) -> bool:
    """Return whether M' J M = J in symbols."""
    return bool(symbolic_defect(scheme).is_zero_matrix)


def reversal_defect(scheme: Scheme, *, dt: float = 0.3) -> float:
    """Return how far a step, and one back with time turned round, ends from where it began; non-separable system."""
    system, z = NonSeparable(), state_away_from_rest(scheme)
    back = scheme.reverse @ scheme.step(system, scheme.reverse @ scheme.step(system, z, 0.0, dt), 0.0, dt)
    return float(np.abs(back - z).max())


@cache
def rows() -> tuple[Row, ...]:
    """Return all schemes, the discontinuous ones with several weights."""
    table = []
    for scheme in [
        *all_schemes(),
        *(discontinuous(alpha) for alpha in (0.5, 0.75)),
        *(discontinuous_adjoint(alpha) for alpha in (0.5, 0.25)),
        third_order(0.6),
        simpson(Simpson4(0.0)),
        simpson(),
    ]:
        zero = "" if scheme.integrator.name in NO_SYMBOLS else {True: "0", False: "not 0"}[symbolic_zero(scheme)]
        back = reversal_defect(scheme)
        table.append(Row(scheme.label, zero, two_form_defect(scheme), back, back < 1e-9))
    return tuple(table)


def write(report: Report) -> None:
    """Write symplecticity.csv and symplecticity.png."""
    table = rows()
    report.table("symplecticity", Row._fields, table)
    with report.figure("symplecticity", 10, 5.5) as figure:
        axes = figure.subplots()
        y = np.arange(len(table))[::-1]
        axes.semilogx([max(row.two_form, 1e-17) for row in table], y, "o", color="#0072b2", label="two-form, M'JM - J")
        axes.semilogx(
            [max(row.reversal, 1e-17) for row in table], y, "s", mfc="none", color="#d55e00", label="reversal"
        )
        axes.set_yticks(y, [row.scheme for row in table])
        axes.axvline(1e-9, ls=":", color="#555555")
        axes.set(xlim=(1e-17, 10), xlabel="defect on H = (q² + 1)(p² + 1)/2, Δt = 0.3 [-]")
        axes.set_title("Left of the dotted line a property holds, to the accuracy of differences and solves")
        axes.legend(loc="upper right", bbox_to_anchor=(0.9, 0.75), frameon=True)
