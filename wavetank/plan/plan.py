"""The plan of a scene: of all discretisations that are accurate enough, the cheapest, with what is needed and why.

Searched are p in {2, 3, 4, 5}, n from 2 to 16, cells on a geometric grid, both schemes, and for each of them the
largest step that accuracy and stability allow. Errors of space and time add up (``error_model.py``), so the step
follows from what the mesh leaves of the accuracy.

Left out are meshes so fine that the current under the crest, u, carries their shortest waves along: where
u² k_grid / g, k_grid = p pi / dx, comes near 1, those waves have negative energy and grow, and without a penalty on the
edges a nonlinear run breaks down. The bound rests on few runs: at 1.2 and 1.9 they broke down, at 1.02 and 1.07 not;
steps differed too, so it is a rule of thumb and no theorem.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import ceil

import numpy as np

from wavetank.errors import InputError
from wavetank.integrators import INTEGRATORS
from wavetank.plan.cost_model import Cost, CostModel
from wavetank.plan.dispersion import Mesh
from wavetank.plan.error_model import ErrorModel, Part, Settings
from wavetank.plan.requirements import Physics, Requirements, requirements
from wavetank.scene import Scene

ORDERS = (2, 3, 4, 5)
VERTICAL_ORDERS = tuple(range(2, 17))
STRONGEST_CURRENT = 1.0  # u² k_grid / g of a mesh that needs no edge penalty
SCHEMES = ("third-order", "stormer-verlet")
PER_WAVE = np.geomspace(0.7, 40.0, 30)  # cells in a wave length
STEP_RATIO = 1.08  # between neighbouring steps
MARGIN: dict[Physics, float] = {"linear": 0.95, "nonlinear": 0.6}  # of the stability limit; currents shift frequencies


@dataclass(frozen=True, kw_only=True)
class Plan:
    """The numerics proposed for a scene.

    Attributes
    ----------
    physics
        "linear" or "nonlinear".
    settings
        p, cells, n, dt and the integrator.
    accuracy, error
        Relative error of the elevation: asked for, and predicted.
    cost
        CPU time and memory, predicted.
    steps
        Number of steps.
    dt_omega_max
        dt times the largest frequency of the mesh on still water.
    reasons
        Which objects are needed and why, a sentence each.
    """

    physics: Physics
    settings: Settings
    accuracy: float
    error: float
    cost: Cost
    steps: int
    dt_omega_max: float
    reasons: tuple[str, ...]


def make_plan(scene: Scene, accuracy: float, *, costs: CostModel) -> Plan:
    """Return the cheapest plan with a predicted relative error of at most ``accuracy``.

    Raises ``InputError`` for an accuracy that is not between 0 and 1, or that no discretisation searched reaches.
    """
    if not 0.0 < accuracy < 1.0:
        raise InputError(f"accuracy = {accuracy:g}: must be between 0 and 1.")
    required = requirements(scene, accuracy)
    errors = ErrorModel(required)
    steps = _Steps(errors, required)
    found = [
        (costs.run(required.physics, settings, required.duration), settings)
        for settings in _candidates(errors, steps, required)
    ]
    if not found:
        best = min((errors.total(errors.space(mesh)) for mesh in _meshes(errors, required)), default=np.inf)
        raise InputError(
            f"accuracy = {accuracy:g}: must be above {best:.2g}, the best that p <= 5, n <= 16 reach "
            "on meshes that need no edge penalty."
        )
    cost, settings = min(found, key=lambda one: one[0].cpu)
    mesh = errors.mesh(settings.order, settings.cells, settings.vertical_order)
    return Plan(
        physics=required.physics,
        settings=settings,
        accuracy=accuracy,
        error=errors.predict(settings),
        cost=cost,
        steps=ceil(required.duration / settings.dt * (1 - 1e-9)),
        dt_omega_max=settings.dt * mesh.largest_frequency,
        reasons=(*required.reasons, _penalty_reason(mesh, required)),
    )


def _penalty_reason(mesh: Mesh, required: Requirements) -> str:
    if required.physics == "linear":
        return "edge penalty: none, linear waves have no current."
    return f"edge penalty: none, u² k_grid / g = {_current(mesh, required):.2g} stays below {STRONGEST_CURRENT:g}."


def _meshes(errors: ErrorModel, required: Requirements) -> Iterator[Mesh]:
    counts = sorted({max(1, ceil(required.length * required.k / (2 * np.pi) * one)) for one in PER_WAVE})
    for order, cells, n in product(ORDERS, counts, VERTICAL_ORDERS):
        mesh = errors.mesh(order, cells, n)
        if required.physics == "linear" or _current(mesh, required) <= STRONGEST_CURRENT:
            yield mesh


def _current(mesh: Mesh, required: Requirements) -> float:
    """Return u² k_grid / g."""
    return required.velocity**2 * mesh.cells.order * np.pi / mesh.cells.size / required.gravity


def _candidates(errors: ErrorModel, steps: "_Steps", required: Requirements) -> Iterator[Settings]:
    """Yield every mesh that is accurate enough, with each scheme's largest step."""
    for mesh in _meshes(errors, required):
        space = errors.space(mesh)
        if errors.total(space) > required.accuracy:
            continue
        for name in SCHEMES:
            limit = MARGIN[required.physics] * INTEGRATORS[name].stability_limit / mesh.largest_frequency
            if (dt := steps.largest(name, limit, space)) is not None:
                cells = round(required.length / mesh.cells.size)
                n = mesh.vertical_order
                yield Settings(order=mesh.cells.order, cells=cells, vertical_order=n, dt=dt, integrator=name)


class _Steps:
    """Steps that divide the duration, from coarse to fine, and what each contributes to the error."""

    def __init__(self, errors: ErrorModel, required: Requirements):
        self._errors, self._required = errors, required
        coarsest = np.pi / float(required.waves.omega.min())
        counts = required.duration / coarsest * STEP_RATIO ** np.arange(120)
        self._dt = required.duration / np.unique(np.maximum(1, np.ceil(counts)))
        self._parts: dict[tuple[str, int], Part] = {}

    def _part(self, name: str, i: int) -> Part:
        if (name, i) not in self._parts:
            self._parts[name, i] = self._errors.time(name, float(self._dt[i]))
        return self._parts[name, i]

    def largest(self, name: str, limit: float, space: Part) -> float | None:
        """Return the largest step below ``limit`` [s] that keeps the accuracy, by bisection; None if there is none."""
        low = int(np.searchsorted(-self._dt, -limit))
        high = self._dt.size
        while low < high:
            middle = (low + high) // 2
            accurate = self._errors.total(space, self._part(name, middle)) <= self._required.accuracy
            low, high = (low, middle) if accurate else (middle + 1, high)
        return float(self._dt[low]) if low < self._dt.size else None
