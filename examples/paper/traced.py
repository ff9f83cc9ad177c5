"""Compiled steps of a scheme: the scheme runs once on values that record their operations as C code.

10⁵ periods then take seconds, without a second implementation of a scheme. The system is H = (q² + 1)(p² + 1) / 2.
Implicit stages use ``ITERATIONS`` fixed-point iterations, each of which removes nine tenths of the error at sixteen
steps a period.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from examples.paper.oscillators import NonSeparable
from wavetank.base.arrays import Vector
from wavetank.fem.codegen import Unit
from wavetank.integrators.contract import Integrator, like, rows

ITERATIONS = 20
FLAGS = ["-O2", "-march=native", "-Wno-unused-variable"]
SOURCE = """
static void run(long periods, int steps, double *state, double *energies)
{
%(begin)s
    for (long period = 0; period < periods; ++period) {
        double sum = 0.0;
        for (int n = 0; n < steps; ++n) {
%(step)s
        }
        energies[period] = sum / steps;
    }
%(end)s
}
"""


class Traced:
    """A symbolic number; each operation on it appends a line of C.

    Parameters
    ----------
    name
        Of its variable.
    lines
        The code so far.
    """

    def __init__(self, name: str, lines: list[str]):
        self._name, self._lines = name, lines

    def __repr__(self) -> str:
        return self._name

    def _line(self, left: Any, operator: str, right: Any) -> "Traced":
        new = Traced(f"v{len(self._lines)}", self._lines)
        first, second = (one if isinstance(one, Traced) else repr(float(one)) for one in (left, right))
        self._lines.append(f"const double {new} = {first} {operator} ({second});")
        return new

    def __add__(self, other: Any) -> "Traced":
        return self._line(self, "+", other)

    def __radd__(self, other: Any) -> "Traced":
        return self._line(other, "+", self)

    def __sub__(self, other: Any) -> "Traced":
        return self._line(self, "-", other)

    def __rsub__(self, other: Any) -> "Traced":
        return self._line(other, "-", self)

    def __mul__(self, other: Any) -> "Traced":
        return self._line(self, "*", other)

    def __rmul__(self, other: Any) -> "Traced":
        return self._line(other, "*", self)

    def __truediv__(self, other: Any) -> "Traced":
        return self._line(self, "/", other)

    def __neg__(self) -> "Traced":
        return self._line(-1.0, "*", self)

    def __pow__(self, power: int) -> "Traced":
        return self if power == 1 else self * self ** (power - 1)


class Unrolled(NonSeparable):
    """The system with its stages solved by a number of rounds of fixed-point iteration."""

    def energy(self, q: Any, p: Any, t: float) -> float:
        """Return nan: it is traced once a step alone."""
        return np.nan

    def fixed_point(self, image: Callable[[Any], Any], start: Any) -> Any:
        """Return z = image(z) to round-off, of the shape of the start."""
        z = start
        for _ in range(ITERATIONS):
            z = image(z)
        return z


def source(integrator: Integrator[Any], dt: float) -> str:
    """Return the code of a scheme's steps of length dt; states are theirs, one number after the other."""
    lines: list[str] = []
    start = integrator.start(np.zeros(1), np.zeros(1))
    names = [f"s{i}" for i in range(len(rows(start)))]
    lines += [f"const double before_{name} = {name};" for name in names]
    state = like(start, np.array([[Traced(f"before_{name}", lines)] for name in names]))
    new = integrator.step(Unrolled(), state, 0.0, dt)
    energy = 0.5 * (new.q[0] ** 2 + 1) * (new.p[0] ** 2 + 1)
    after = [f"{name} = {value[0]};" for name, value in zip(names, rows(new), strict=True)]
    return SOURCE % {
        "begin": "\n".join(f"    double {name} = state[{i}];" for i, name in enumerate(names)),
        "step": "\n".join([*lines, *after, f"sum += {energy};"]),
        "end": "\n".join(f"    state[{i}] = {name};" for i, name in enumerate(names)),
    }


def energies(integrator: Integrator[Any], *, q: float, p: float, steps: int, periods: int) -> Vector:
    """Return the mean energy over each period of the orbit through (q, p), shape (periods,)."""
    state = rows(integrator.start(np.array([q]), np.array([p])))
    dt = NonSeparable().period(q, p) / steps
    found, code = np.empty(periods), source(integrator, dt)
    orbit = Unit(MPI.COMM_SELF, "orbit", flags=FLAGS).add("orbit", code, exports=["run"])
    orbit.function("run", periods, steps, state, found)()
    return found
