"""The predicted error of the elevation, and of a paddle's displacement.

**The displacement of a paddle.** A scheme evaluates the velocity at its nodes c_i. The displacement in a step is the
quadrature

    dt sum_i b_i v(t + c_i dt),     sum_i b_i c_i^m = 1 / (m + 1) for m = 0, 1, ...,

and its errors add up. With long steps the noise of single rows of a measured motion is integrated as motion.

**The error of the elevation** is predicted before a run. A component of frequency omega and travel time ``age`` has the
phase error

    Phi = omega age sum_m w_m ( |e_space(m k)| + |e_time(m omega dt)| ),     w_m = m r_m² / sum_l l r_l²,

with relative errors e of the frequency (``dispersion.py``) and relative amplitudes r_m of bound harmonics, which travel
with the wave and change its phase in proportion to their energy. The error of a component is 2 sin(s Phi / 2), with the
mean square slope of the form s² = sum_m m² r_m² / sum_m r_m², plus the bounded errors of the nodal values and of the
initial state in other modes of the scheme. The prediction is the root mean square over the components, weighted with
their energies. Frequencies in space are always too high (the discrete potential has more energy than the exact one), as
are those of all schemes but Gauss-Legendre: errors that might cancel are added.

Nonlinear terms destroy the superconvergence of the discretisation: the part tau_m of the harmonics that the cells do
not represent enters as ``PRODUCT_FACTOR`` (k a omega age sum_(m > 1) r_m² tau_m²)^(1/2). The age of a group is at most
the time for which it is steep: twice int A² dt over the square of its highest A. Form and constant are empirical, from
standing waves and waves of permanent form; single runs scatter, as harmonics may resonate with branches of the mesh:
the error of 29 of 46 waves of permanent form is predicted within a factor of three (docs/plan.md). Linear waves have no
such part.

**The run-up of a solitary wave** of length l has the relative error

    e = 0.1 (dx / ((p - 1) l))⁴ + |e_n(k d = (d + R) / l)|,

with the relative error e_n of the linear frequency by the vertical order alone. The first term is fitted to p = 2 to 5
with e = 0.1 to 5 %: it is 0.7 to 2 times the measured error for h = 0.5 and 0.6, and 2 to 6 times for lower waves. The
second is 0.9 to 2 times the measured error if that is above 0.1 % (docs/plan.md). The step needs no term: the error of
a stable step is below 0.1 %. The larger of this error and that of the travelling wave is the prediction.

**Paddles that absorb waves by the elevation** extrapolate it within a step. This changes the reflection by C c^(-3/2)
(omega dt)^(7/2), with the transfer function c of the paddle and C from runs of regular waves between a generating and
an absorbing paddle (``requirements.py``).

The error is relative to an exact computation of the same waves. Between reflecting walls the age of a paddle's waves
grows with the run (``travel.py``).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from wavetank.base.arrays import Vector
from wavetank.case import EndWall
from wavetank.integrators import INTEGRATORS
from wavetank.planning.dispersion import Mesh, UniformCells, relative_frequency_error, step_errors
from wavetank.planning.paddle_waves import RunUp
from wavetank.planning.requirements import Requirements, absorption_error
from wavetank.waves import airy

ABSORPTION_POWER = 3.5  # exponent of omega dt; measured 3.2 to 3.9
PRODUCT_FACTOR = 6.3  # factor of the error of nonlinear terms
RUN_UP, ORDER_1_FACTOR = 0.1, 0.3  # factor of the error of cells; value that replaces p - 1 for order 1
INTERVAL_STEPS, INTERVALS = 500, 8  # steps and number of intervals over which a displacement is summed


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The numerics of a run: orders p and n, number of cells along the tank, step [s], name of the integrator."""

    order: int
    cells: int
    vertical_order: int
    dt: float
    integrator: str


class ErrorModel:
    """Predicts errors for the requirements of a case.

    Contributions of space and time are arrays of shape (2, N): phase [rad] and bounded error of each component.
    """

    def __init__(self, required: Requirements):
        self._required, self._tank = required, required.case.tank
        ratios, waves = required.form.harmonics, required.waves
        m = np.arange(1, ratios.size + 1)
        self._weights = m * ratios**2 / np.sum(m * ratios**2)
        self._slope = float(np.sqrt(m**2 @ ratios**2 / np.sum(ratios**2)))
        self._absorbing = absorption_error(required.case, waves.k)
        self._energy = waves.amplitude**2 / np.sum(waves.amplitude**2)
        self._k, self._omega = (np.multiply.outer(of, m) for of in (waves.k, waves.omega))
        self._exact = airy.angular_frequency(self._k, self._tank.depth, self._tank.gravity)
        self._waves_on, self._space, self.time = cache(self._of_cells), cache(self._of_space), cache(self._of_time)

    def mesh(self, order: int, cells: int, vertical_order: int) -> Mesh:
        """Return the mesh of orders and a number of cells."""
        along = UniformCells(order, self._tank.length / cells)
        return Mesh(cells=along, vertical_order=vertical_order, depth=self._tank.depth, gravity=self._tank.gravity)

    def _phase(self, frequency: Vector) -> Vector:
        """Return the phase [rad] by relative frequency errors, shape (N, M); ``nan`` for unresolved waves."""
        off = np.fmin(np.abs(frequency), 1.0)
        return np.asarray(self._omega[:, 0] * self._required.waves.age * (off @ self._weights))

    def _of_cells(self, cells: UniformCells) -> tuple[Vector, Vector]:
        """Return mu of all harmonics, and the bounded error.

        Bound harmonics are forced, not free: their error is the truncation error, not a mix of branches.
        """
        required, ratios = self._required, self._required.form.harmonics
        mu, profile = cells.waves(self._k)
        missing = np.sqrt(cells.truncation_error(self._k[:, 1:]) ** 2 @ ratios[1:] ** 2)
        steep = required.waves.omega * np.minimum(required.waves.age, required.steep_time)
        return mu, np.hypot(profile[:, 0], PRODUCT_FACTOR * np.sqrt(required.k * required.crest * steep) * missing)

    def _of_space(self, mesh: Mesh) -> Vector:
        mu, bounded = self._waves_on(mesh.cells)
        return np.array([self._phase(mesh.frequency(mu) / self._exact - 1.0), bounded])

    def _of_time(self, integrator: str, dt: float) -> Vector:
        x = self._omega * dt
        frequency, shape = step_errors(INTEGRATORS[integrator](), x)
        absorbing = self._absorbing * x[:, 0] ** ABSORPTION_POWER
        bounded = np.hypot(np.sqrt(shape**2 @ self._required.form.harmonics**2), absorbing)
        return np.array([self._phase(frequency), bounded])

    def total(self, mesh: Mesh, time: Vector | float = 0.0) -> float:
        """Return the predicted relative error of the elevation on a mesh, given the contribution of time."""
        phase, bounded = self._space(mesh) + time
        phase, bounded = np.minimum(self._slope * phase, np.pi), np.minimum(bounded, 1.0)
        error = float(np.sqrt(self._energy @ ((2 * np.sin(phase / 2)) ** 2 + bounded**2)))
        run_up = self._required.run_up
        return error if run_up is None else max(error, min(run_up_error(run_up, mesh), 1.0))

    def predict(self, settings: Settings) -> float:
        """Return the predicted relative error of the elevation of a run with these settings; inf if it is unstable."""
        mesh = self.mesh(settings.order, settings.cells, settings.vertical_order)
        if settings.dt * mesh.largest_frequency > INTEGRATORS[settings.integrator].stability_limit:
            return np.inf
        return self.total(mesh, self.time(settings.integrator, settings.dt))


def run_up_error(run_up: RunUp, mesh: Mesh) -> float:
    """Return the predicted relative error of R on a mesh."""
    nodes = mesh.cells.size / max(mesh.cells.order - 1, ORDER_1_FACTOR)
    kd = (run_up.depth + run_up.elevation) / run_up.length
    return RUN_UP * (nodes / run_up.length) ** 4 + abs(relative_frequency_error(kd, mesh.vertical_order))


def stroke_missed(end: EndWall, *, dt: float, steps: int, nodes: Sequence[float]) -> float:
    """Return the root mean square error of a paddle's displacement by a scheme, relative to the displacement.

    Parameters
    ----------
    end
        The wall.
    dt, steps
        Step [s] and number of steps.
    nodes
        Nodes of the scheme, fractions of the step.
    """
    row = min(steps, INTERVAL_STEPS)
    starts = np.unique(np.linspace(0, steps - row, min(INTERVALS, -(-steps // row))).astype(int))
    begin = dt * np.add.outer(starts, np.arange(row)).ravel()
    powers = np.arange(len(nodes))
    weights = np.linalg.solve(np.power.outer(np.asarray(nodes, dtype=float), powers).T, 1.0 / (powers + 1))
    quadrature = dt * sum(weight * end.rates(begin + node * dt)[1] for weight, node in zip(weights, nodes, strict=True))
    before, after = end.rates(begin)[0], end.rates(begin + dt)[0]
    off = np.cumsum((quadrature - after + before).reshape(starts.size, row, -1), axis=1)
    stroke = float(np.std(before))
    return float(np.sqrt(np.mean(off**2))) / stroke if stroke > 0.0 else 0.0
