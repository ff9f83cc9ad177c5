"""The plan of a scene: the cheapest of all discretisations that are accurate enough, with the reasons.

Searched are p in {2, 3, 4, 5}, n from 2 to 16, cells on a geometric grid, and for each of these meshes the largest
step of the default scheme that accuracy and stability allow: other schemes cost as much or more, and are less accurate
(docs/plan.md). Errors of space and time add up (``resolution.py``), so the step follows from what the mesh leaves of
the accuracy. It must resolve a measured motion, too (``OF_MOTION``): steps of a few rows of the record are among those
searched, as they do best. What a case names beside an accuracy is not searched.

The stability limit is that of the largest frequency on still water, shifted by the current u under the highest crest,
dt (omega_max + u k_grid) < limit with k_grid = p pi / dx. Implicit stages of nonlinear waves, solved with the still
water's inverse, converge to larger or smaller steps: ``solvable`` of the integrator.
"""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from math import ceil
from typing import Any

import numpy as np

from wavetank.case import Case, LinearWater, NonlinearWater, Physics
from wavetank.errors import InputError
from wavetank.integrators import INTEGRATORS
from wavetank.motion import Motion
from wavetank.planning.cost import Cost, OutputCost, entries_of, kind_of, run_cost
from wavetank.planning.dispersion import Mesh
from wavetank.planning.requirements import Requirements, requirements
from wavetank.planning.resolution import ErrorModel, ErrorPart, Settings, solved_to, stroke_missed
from wavetank.simulation.build import ANSWERED, build_clock
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.tank.breakdown import FARTHEST
from wavetank.tank.dissipation import NEEDED

ORDERS = (2, 3, 4, 5)
VERTICAL_ORDERS = tuple(range(2, 17))
LEAST_ABSORBING = 4  # n before paddles that absorb by the elevation at their face, evanescent modes included
SCHEME = "simpson-4"
PER_WAVE = np.geomspace(0.7, 40.0, 30)  # cells in a wave length
PER_PEAK = np.geomspace(0.5, 4.0, 16)  # cells in the length of a run-up peak
STEP_RATIO = 1.08  # between neighbouring steps
MARGIN = 0.9  # of the stability limit
AIM = 1 / 3  # of the accuracy: the cheapest of all settings lean to those whose error is underestimated, by up to 3
OF_MOTION = 1 / 3  # of the accuracy: what a step may miss of a measured motion's displacement
BETWEEN = np.pi / 2  # rows, no whole number of them
ROWS = (0.5, 0.25)  # of its record in a step: what alternates from row to row must not do so from step to step


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Numerics for a scene, their predicted error and cost.

    Attributes
    ----------
    physics
        "linear" or "nonlinear".
    settings
        p, cells, n, dt and the integrator.
    accuracy, error
        Relative error of the elevation: required, and predicted.
    kind, steepness
        Of the waves, for the cost.
    cost
        CPU time and memory, predicted.
    steps
        Number of steps.
    cell_size
        dx [m].
    dt_omega_max
        dt times the largest frequency of the mesh on still water.
    output_cost
        Evaluations below the surface and their cost.
    reasons
        The required objects and why, a sentence each.
    """

    physics: Physics
    settings: Settings
    accuracy: float
    error: float
    kind: str
    steepness: float
    cost: Cost
    steps: int
    cell_size: float
    dt_omega_max: float
    output_cost: OutputCost
    reasons: tuple[str, ...]

    def applied_to(self, scene: Case) -> Case:
        """Return the scene with the plan's water and numerics, all of them named."""
        changes: dict[str, Any] = {"accuracy": None, "cell_size": None, **asdict(self.settings)}
        changes |= solved_to(self.accuracy, scene)
        water = LinearWater() if self.physics == "linear" else NonlinearWater()
        return scene.model_copy(update={"water": water, "numerics": scene.numerics.model_copy(update=changes)})


def named_numerics(scene: Case) -> dict[str, Any]:
    """Return the numerics that a case names beside an accuracy, by their names in ``Settings``."""
    numerics, names = scene.numerics, scene.numerics.model_fields_set
    if numerics.accuracy is None:
        return {}
    named = {"order", "vertical_order", "dt", "integrator"} & names
    cells = {"cells": scene.cells} if names & {"cells", "cell_size"} else {}
    return {name: getattr(numerics, name) for name in sorted(named)} | cells


class UnreachableError(InputError):
    """No discretisation searched is as accurate as required."""


def make_plan(scene: Case, accuracy: float) -> Plan:
    """Return the cheapest plan for a relative error of at most ``accuracy``: ``AIM`` of it is predicted at most.

    Raises ``InputError`` for an accuracy that is not between 0 and 1 and a scene that cannot be planned,
    ``UnreachableError`` if no discretisation searched is as accurate.
    """
    if not 0.0 < accuracy < 1.0:
        raise InputError(f"accuracy = {accuracy:g}: must be between 0 and 1.")
    search = _Search(scene, accuracy)
    result = [(search.cost(settings), settings) for settings in search.candidates()]
    if not result:
        raise UnreachableError(f"accuracy = {accuracy:g}: {search.reached}.")
    return search.plan(min(result, key=lambda one: one[0].cpu)[1])


def own_plan(scene: Case, accuracy: float) -> Plan:
    """Return the prediction of a scene's own water and numerics; raises ``InputError`` as a run does."""
    search = _Search(scene.model_copy(update={"water": scene.water or NonlinearWater()}), accuracy)
    return search.plan(search.own())


class _Search:
    """All discretisations of a scene with the numerics that it names."""

    def __init__(self, scene: Case, accuracy: float):
        self._scene, self._required = scene, requirements(scene, accuracy)  # first: it refuses what cannot be planned
        self._given, self._shift = named_numerics(scene), scene.frequency_shift
        self._errors, self._kind = ErrorModel(self._required), kind_of(scene, self._required.physics)
        self._scheme = self._given.get("integrator", SCHEME)
        self._steps = _Steps(self._errors, self._required, scheme=self._scheme, given=self._given.get("dt"))

    # ------------------------------------------------------------------------------------------ search
    def _values(self, name: str) -> Sequence[int]:
        """Return the values of p, cells or n that are searched."""
        if name in self._given:
            return [self._given[name]]
        if name == "order":
            return ORDERS
        if name == "vertical_order":
            return [n for n in VERTICAL_ORDERS if not self._scene.absorbing or n >= LEAST_ABSORBING]
        waves, fewest = self._required.tank.length * self._required.k / (2 * np.pi), self._scene.tank.fewest_cells
        counts = waves * PER_WAVE
        if (run_up := self._required.run_up) is not None:
            finer = self._required.tank.length / run_up.width * PER_PEAK
            counts = np.concatenate([counts, finer[finer > counts[-1]]])
        return sorted({max(fewest, ceil(one)) for one in counts})

    def _meshes(self) -> Iterator[Mesh]:
        for order, cells, n in product(*map(self._values, ("order", "cells", "vertical_order"))):
            mesh = self._errors.mesh(order, cells, n)
            if self._scene.numerics.edge_penalty > 0 or self._current(mesh) <= NEEDED:
                yield mesh

    def candidates(self) -> Iterator[Settings]:
        """Yield every mesh that is accurate enough, with its largest step."""
        for mesh in self._meshes():
            space = self._errors.space(mesh)
            if self._errors.total(space) > AIM * self._required.accuracy:
                continue
            if (dt := self._steps.largest(self._longest_step(mesh), space)) is not None:
                p, cells, n = mesh.cells.order, round(self._required.tank.length / mesh.cells.size), mesh.vertical_order
                yield Settings(order=p, cells=cells, vertical_order=n, dt=dt, integrator=self._scheme)

    @property
    def reached(self) -> str:
        """The best accuracy that all meshes reach, in words."""
        best = min((self._errors.total(self._errors.space(mesh)) for mesh in self._meshes()), default=np.inf) / AIM
        given = [f", {name} = {value:g} being set" for name, value in self._given.items() if name != "integrator"]
        orders = f"p <= {max(self._values('order'))}, n <= {max(self._values('vertical_order'))}"
        what = f"{orders} reach{''.join(given)} with a stable step"
        return f"must be above {best:.2g}, the best that {what}" if best < 1.0 else f"nothing that {what} is accurate"

    def _longest_step(self, mesh: Mesh) -> float:
        stable = float(INTEGRATORS[self._scheme].stability_limit)
        limit, required = MARGIN * stable, self._required
        limit = min(limit, MARGIN * ANSWERED) if self._scene.absorbing else limit
        if required.physics == "linear":
            return limit / mesh.largest_frequency
        shifted = mesh.largest_frequency + required.velocity * _k_grid(mesh)
        solvable = min(float(INTEGRATORS[self._scheme].solvable), FARTHEST * stable / self._shift)
        return min(limit / shifted, solvable / mesh.largest_frequency)

    def _current(self, mesh: Mesh) -> float:
        """Return u² k_grid / g; 0 for linear waves, which have no current."""
        required = self._required
        return 0.0 if required.physics == "linear" else required.velocity**2 * _k_grid(mesh) / required.tank.gravity

    # ------------------------------------------------------------------------------------------ prediction
    def own(self) -> Settings:
        """Return the scene's own numerics, defaults resolved."""
        numerics, cells = self._scene.numerics, self._scene.cells
        mesh = self._errors.mesh(numerics.order, cells, numerics.vertical_order)
        name = numerics.integrator
        return Settings(
            order=numerics.order,
            cells=cells,
            vertical_order=numerics.vertical_order,
            dt=build_clock(self._scene, mesh.largest_frequency, INTEGRATORS[name]()).dt,
            integrator=name,
        )

    def _mesh(self, settings: Settings) -> Mesh:
        return self._errors.mesh(settings.order, settings.cells, settings.vertical_order)

    def cost(self, settings: Settings) -> Cost:
        """Return the cost of a run."""
        return run_cost(
            self._kind,
            settings,
            duration=self._required.duration,
            dt_omega_max=settings.dt * self._mesh(settings).largest_frequency,
            steepness=self._required.highest,
            output_cost=OutputCost.of(self._scene, settings.dt),
        )

    def plan(self, settings: Settings) -> Plan:
        """Return settings with their prediction."""
        required, mesh, output_cost = self._required, self._mesh(settings), OutputCost.of(self._scene, settings.dt)
        cost = self.cost(settings)
        entries = entries_of(settings.order, settings.cells, settings.vertical_order)
        watched = output_cost.description(output_cost.in_slice(entries) / cost.cpu)
        absorbing_cost = output_cost.absorbing_cost(entries) / cost.cpu
        more = [f"records: {watched}."] if watched else []
        more += [f"absorption: {absorbing_cost:.0%} of the time."] if absorbing_cost else []
        return Plan(
            physics=required.physics,
            settings=settings,
            accuracy=required.accuracy,
            error=self._errors.predict(settings),
            kind=self._kind,
            steepness=required.highest,
            cost=cost,
            steps=Clock.covering(required.duration, settings.dt).steps,
            cell_size=mesh.cells.size,
            dt_omega_max=settings.dt * mesh.largest_frequency,
            output_cost=output_cost,
            reasons=(*required.reasons, self._penalty_reason(mesh), *more),
        )

    def _penalty_reason(self, mesh: Mesh) -> str:
        if self._required.physics == "linear":
            return "edge penalty: none, linear waves have no current."
        current = f"u² k_grid / g = {self._current(mesh):.2g} under the highest crest"
        if self._current(mesh) <= NEEDED:
            return f"edge penalty: none, {current} stays below {NEEDED:g}."
        if self._scene.numerics.edge_penalty > 0:
            return f"edge penalty: needed, {current} exceeds {NEEDED:g}; the run applies it by itself."
        return f"edge penalty: needed, {current} exceeds {NEEDED:g}, but numerics.edge_penalty = 0 forbids it."


def _k_grid(mesh: Mesh) -> float:
    return mesh.cells.order * np.pi / mesh.cells.size


class _Steps:
    """Steps that divide the duration, or some rows of a record, from coarse to fine; or the one that is given.

    Their contributions to the error, and what they miss of a measured motion, are computed once.
    """

    def __init__(self, errors: ErrorModel, required: Requirements, *, scheme: str, given: float | None):
        self._errors, self._required, self._scheme = errors, required, scheme
        coarsest = np.pi / float(required.waves.omega.min())
        counts = required.duration / coarsest * STEP_RATIO ** np.arange(120)
        divided = required.duration / np.unique(np.maximum(1, np.ceil(counts)))
        self._given, self._measured = given is not None, required.measured
        self._dt = np.sort([*divided, *self._of_rows()])[::-1] if given is None else np.array([given])
        self._part, self._missed = cache(lambda dt: errors.time(scheme, dt)), cache(self._missed_motion)

    def _of_rows(self) -> list[float]:
        """Return steps of some rows of each record that end within all."""
        end = min((motion.duration for motion in self._measured), default=0.0)
        steps = [
            Clock.covering(self._required.duration, rows * motion.interval)
            for motion in self._measured
            for rows in ROWS
            if motion.interval is not None
        ]
        return [clock.dt for clock in steps if clock.end <= end * (1 + ROUNDING)]

    def _resolves(self, dt: float) -> bool:
        """Return whether a step resolves measured motions; of a given step the run warns.

        If one of ``BETWEEN`` rows does not, the noise counts: longer steps resolve the motion by chance.
        """
        limit = OF_MOTION * self._required.accuracy
        return self._given or all(
            (dt <= ROWS[0] * row * (1 + ROUNDING) or self._missed(BETWEEN * row, motion) <= limit)
            and self._missed(dt, motion) <= limit
            for motion in self._measured
            if (row := motion.interval) is not None
        )

    def _missed_motion(self, dt: float, motion: Motion) -> float:
        nodes, steps = INTEGRATORS[self._scheme].nodes, max(1, int(self._required.duration / dt))
        return stroke_missed(motion.rates, dt=dt, steps=steps, nodes=nodes)

    def largest(self, limit: float, space: ErrorPart) -> float | None:
        """Return the largest step below ``limit`` [s] that is accurate and resolves the motion; None if none is."""
        aim, steps = AIM * self._required.accuracy, self._dt[self._dt <= limit].tolist()
        first = bisect_left(steps, True, key=lambda dt: self._errors.total(space, self._part(dt)) <= aim)
        return next(filter(self._resolves, steps[first:]), None)
