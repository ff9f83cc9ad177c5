"""The error of the elevation to expect of a discretisation, before anything is run.

A component of frequency omega, followed for its age, has its phase wrong by

    Phi = omega age sum_m w_m ( |e_space(m k)| + |e_time(m omega dt)| ),     w_m = m r_m² / sum_l l r_l²,

e being relative errors of the frequency (``dispersion.py``) and r_m the relative amplitudes of bound harmonics: they
travel with the wave and drag its phase along in proportion to their energy. To 2 sin(s Phi / 2), s² = sum_m m² r_m² /
sum_m r_m² being the mean square slope of the form, come the bounded errors, of the nodal values and of the start in
the scheme's other modes, and the root mean square over the components, weighted with their energies, is the
prediction. Frequencies in space are too high, always (the discrete potential has more energy than the exact one), and
so are those of the schemes but for Gauss-Legendre's: what might cancel is not counted upon.

Products of waves cost the discretisation its superconvergence: what the cells do not hold of the harmonics, tau_m,
enters directly, as ``PRODUCTS`` (k a omega age sum_(m > 1) r_m² tau_m²)^(1/2), of a group at most the time for which it
is steep: twice int A² dt over the square of its highest A. Form and constant are empirical, from standing waves and
waves of permanent form; single runs scatter about it, as harmonics resonate with branches of the
mesh or do not: of 46 waves of permanent form 29 have their error predicted within a factor of three (docs/plan.md).
Linear waves have none of this.

A solitary wave that meets a wall has its run-up beside that (``run_up.py``): the larger of both errors counts.

Elevations are compared with an exact computation of the same waves. Between walls that reflect a paddle's waves age
with the run (``travel.py``). Paddles that absorb add an error of the step (``absorption_error.py``).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.integrators import INTEGRATORS
from wavetank.planning.absorption_error import POWER
from wavetank.planning.dispersion import BlochWaves, Cells, Mesh, step_errors
from wavetank.planning.requirements import Requirements
from wavetank.waves import airy

PRODUCTS = 6.3


@dataclass(frozen=True, kw_only=True)
class Settings:
    """The numerics of a run.

    Attributes
    ----------
    order, vertical_order
        p and n.
    cells
        Number of cells along the tank.
    dt
        [s].
    integrator
        Its name in a case file.
    """

    order: int
    cells: int
    vertical_order: int
    dt: float
    integrator: str


class ErrorPart(NamedTuple):
    """What space or time contributes to the error.

    Attributes
    ----------
    phase, bounded
        Of each component: the phase [rad], and what is bounded, shape (N,).
    run_up
        The relative error of a solitary wave's run-up at a wall.
    """

    phase: Vector
    bounded: Vector
    run_up: float = 0.0


class ErrorModel:
    """Predicts errors for what a scene requires."""

    def __init__(self, required: Requirements):
        self._required = required
        self._ratios = ratios = required.harmonics
        self._m = np.arange(1, ratios.size + 1)
        self._weights = self._m * ratios**2 / np.sum(self._m * ratios**2)
        self._slope = float(np.sqrt(self._m**2 @ ratios**2 / np.sum(ratios**2)))
        waves = required.waves
        self._radians = waves.omega * waves.age
        self._energy = waves.amplitude**2 / np.sum(waves.amplitude**2)
        self._k = np.multiply.outer(waves.k, self._m)
        self._exact = airy.angular_frequency(self._k, required.depth, required.gravity)
        self._known: dict[tuple[int, int], Cells] = {}
        self._meshes: dict[tuple[int, int, int], Mesh] = {}
        self._waves: dict[Cells, BlochWaves] = {}
        self._products: dict[Cells, Vector] = {}

    def _part(self, frequency: Vector, bounded: Vector) -> ErrorPart:
        """Return the part of relative errors per component and harmonic, shape (N, M); ``nan`` is a wave lost."""
        frequency = np.fmin(np.abs(frequency), 1.0)  # what is nan among it, too
        return ErrorPart(self._radians * (frequency @ self._weights), np.sqrt(bounded**2 @ self._ratios**2))

    def mesh(self, order: int, cells: int, vertical_order: int) -> Mesh:
        """Return the mesh of the tank, one object however often."""
        key, required = (order, cells, vertical_order), self._required
        if key not in self._meshes:
            along = self._cells(order, cells)
            self._meshes[key] = Mesh(
                cells=along, vertical_order=vertical_order, depth=required.depth, gravity=required.gravity
            )
        return self._meshes[key]

    def _cells(self, order: int, cells: int) -> Cells:
        if (order, cells) not in self._known:
            along = Cells(order, self._required.length / cells)
            self._known[order, cells] = along
            self._waves[along] = along.waves(self._k)
            self._products[along] = self._of_products(along)
        return self._known[order, cells]

    def _of_products(self, cells: Cells) -> Vector:
        missing = np.sqrt(cells.truncation_error(self._k[:, 1:]) ** 2 @ self._ratios[1:] ** 2)
        steep = self._required.waves.omega * np.minimum(self._required.waves.age, self._required.lasting)
        return np.asarray(PRODUCTS * np.sqrt(self._required.steepness * steep) * missing)

    def space(self, mesh: Mesh) -> ErrorPart:
        """Return what a mesh of this model contributes."""
        _, mu, profile = self._waves[mesh.cells]
        part = self._part(mesh.surface_frequency(mu) / self._exact - 1.0, profile)
        # Bound harmonics are forced, not free: of them the cells miss what the products have, not a mix of branches.
        run_up = self._required.run_up
        return part._replace(
            bounded=np.hypot(profile[:, 0], self._products[mesh.cells]),
            run_up=0.0 if run_up is None else run_up.error(mesh),
        )

    def time(self, integrator: str, dt: float) -> ErrorPart:
        """Return what a scheme contributes."""
        x = np.multiply.outer(self._required.waves.omega, self._m) * dt
        part = self._part(*step_errors(INTEGRATORS[integrator](), x))
        return part._replace(bounded=np.hypot(part.bounded, self._required.absorption_error * x[:, 0] ** POWER))

    def total(self, *parts: ErrorPart) -> float:
        """Return the predicted relative error of the elevation."""
        phase = np.minimum(self._slope * sum(part.phase for part in parts), np.pi)
        bounded = np.minimum(sum(part.bounded for part in parts), 1.0)
        travelling = float(np.sqrt(self._energy @ ((2 * np.sin(phase / 2)) ** 2 + bounded**2)))
        return max(travelling, min(sum(part.run_up for part in parts), 1.0))

    def predict(self, settings: Settings) -> float:
        """Return the predicted relative error of the elevation of a run with these settings; inf if it is unstable."""
        mesh = self.mesh(settings.order, settings.cells, settings.vertical_order)
        if settings.dt * mesh.largest_frequency > INTEGRATORS[settings.integrator].stability_limit:
            return np.inf
        return self.total(self.space(mesh), self.time(settings.integrator, settings.dt))
