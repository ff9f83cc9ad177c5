"""The plan of a case: the cheapest discretisation that reaches the accuracy, with the reasons.

The search covers p in {2, 3, 4, 5}, n from 2 to 16, and cells on a geometric grid. For each mesh the step of the
default scheme is the largest that accuracy and stability allow. Other schemes cost as much or more and are less
accurate (docs/plan.md). Errors of space and time add up (``prediction.py``): the step follows from the part of the
accuracy that the mesh leaves. The step must also resolve a measured motion (``MOTION_ERROR``): the search includes
steps of half and a quarter of a row of its record, which resolve noise. Numerics that a case sets with an accuracy are
not varied.

The stability limit is that of the largest frequency on still water, shifted by the current u under the highest crest,
dt (omega_max + u k_grid) < limit with k_grid = p pi / dx. Implicit stages of nonlinear waves, solved with the inverse
of the operator on still water, converge up to a step ``solvable`` of the integrator.
"""

from bisect import bisect_left
from dataclasses import asdict, dataclass
from functools import cache
from itertools import product
from math import ceil
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.case_model import CaseError, about
from wavetank.base.errors import InputError
from wavetank.base.mpi import from_first
from wavetank.base.run_warning import RunWarning
from wavetank.case import Case, LinearWater, NonlinearWater, Physics, RunState
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.planning.cost import Cost, slice_cost
from wavetank.planning.dispersion import Mesh
from wavetank.planning.prediction import ErrorModel, Settings, stroke_missed
from wavetank.planning.requirements import Requirements, requirements, unplanned
from wavetank.planning.resolution import DEFAULT, resolved, shortest_wave, solved_to, too_short
from wavetank.simulation.build import build_clock, stability_limit
from wavetank.simulation.clock import ROUNDING, Clock
from wavetank.simulation.initial import with_its_numerics
from wavetank.tank.breakdown import FARTHEST
from wavetank.tank.dissipation import NEEDED

ORDERS = (2, 3, 4, 5)
VERTICAL_ORDERS = tuple(range(2, 17))
MIN_ABSORBING_ORDER = 4  # n before paddles that absorb by the elevation at their face, evanescent modes included
SCHEME = "simpson-4"
CELLS_PER_WAVE = np.geomspace(0.7, 40.0, 30)  # cells in a wave length
CELLS_PER_PEAK = np.geomspace(0.5, 4.0, 16)  # cells in the length of a run-up peak
STEP_RATIO = 1.08  # ratio of successive time steps
MARGIN = 0.9  # largest time step over the stability limit
AIM = 1 / 3  # predicted error over the accuracy: the error of the cheapest settings is up to 3 times the prediction
LOWER_ACCURACIES = (0.03, 0.1)  # further accuracies if the default one cannot be reached
MOTION_ERROR = 1 / 3  # largest error of the displacement of a measured motion, over the accuracy
NOISE_STEP = np.pi / 2  # time step in rows of a record, not an integer, whose error reveals noise
RECORD_STEPS = (0.5, 0.25)  # time steps in rows of a record that resolve noise alternating from row to row


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Numerics for a case, their predicted error and cost.

    Attributes
    ----------
    physics
        "linear" or "nonlinear".
    settings
        p, cells, n, dt and the integrator.
    accuracy, error
        Relative error of the elevation: required, and predicted.
    cost
        Predicted cost.
    cell_size
        dx [m].
    dt_omega_max
        dt times the largest frequency of the mesh on still water.
    reasons
        Required parts of the model and the reasons, one sentence each.
    """

    physics: Physics
    settings: Settings
    accuracy: float
    error: float
    cost: Cost
    cell_size: float
    dt_omega_max: float
    reasons: tuple[str, ...]

    def applied_to(self, case: Case) -> Case:
        """Return the case with all of the plan's water and numerics."""
        changes: dict[str, Any] = {"accuracy": None, "cell_size": None, **asdict(self.settings)}
        changes |= solved_to(self.accuracy, case)
        water = LinearWater() if self.physics == "linear" else NonlinearWater()
        return case.model_copy(update={"water": water, "numerics": case.numerics.model_copy(update=changes)})


class UnreachableError(InputError):
    """No discretisation of the search reaches the required accuracy."""


def named_numerics(case: Case) -> dict[str, Any]:
    """Return the numerics that a case sets together with an accuracy, by their names in ``Settings``."""
    numerics, names = case.numerics, case.numerics.model_fields_set
    if numerics.accuracy is None:
        return {}
    named = {"order", "vertical_order", "dt", "integrator"} & names
    cells = {"cells": case.cells} if names & {"cells", "cell_size"} else {}
    return {name: getattr(numerics, name) for name in sorted(named)} | cells


def make_plan(case: Case, accuracy: float) -> Plan:
    """Return the cheapest plan for a relative error ``accuracy``; its predicted error is at most ``AIM`` of it.

    Raises ``InputError`` for an accuracy that is not between 0 and 1 and for a case that cannot be planned,
    ``UnreachableError`` if no discretisation of the search reaches it.
    """
    if not 0.0 < accuracy < 1.0:
        raise InputError(f"accuracy = {accuracy:g}: must be between 0 and 1.")
    required, named = requirements(case, accuracy), named_numerics(case)
    errors, best = ErrorModel(required), np.inf
    searched = {
        "order": ORDERS,
        "cells": _numbers_of_cells(required),
        "vertical_order": [n for n in VERTICAL_ORDERS if not case.absorbing or n >= MIN_ABSORBING_ORDER],
    } | {name: [value] for name, value in named.items()}
    steps = _Steps(errors, required, named)
    result = list[tuple[float, Settings]]()
    for order, cells, n in product(searched["order"], searched["cells"], searched["vertical_order"]):
        mesh = errors.mesh(order, cells, n)
        if case.numerics.edge_penalty == 0 and current_parameter(required, mesh) > NEEDED:
            continue
        error = errors.total(mesh)
        best = min(best, error)
        if error <= AIM * accuracy and (dt := steps.largest(mesh)) is not None:
            settings = Settings(order=order, cells=cells, vertical_order=n, dt=dt, integrator=steps.scheme)
            result.append((_cost(required, settings, mesh).cpu, settings))
    if result:
        return _predicted(errors, required, min(result, key=lambda one: one[0])[1])
    given = "".join(f", {name} = {value:g} being set" for name, value in named.items() if name != "integrator")
    orders = f"p <= {max(searched['order'])}, n <= {max(searched['vertical_order'])}"
    what = f"that {orders} reach{given} with a stable step"
    reached = f"must be above {best / AIM:.2g}, the best {what}" if best < AIM else f"nothing {what} is accurate"
    raise UnreachableError(f"accuracy = {accuracy:g}: {reached}.")


def own_plan(case: Case, accuracy: float) -> Plan:
    """Return the prediction for the water and numerics of a case; raises ``InputError`` as a run does."""
    case = case.model_copy(update={"water": case.water or NonlinearWater()})
    required, numerics = requirements(case, accuracy), case.numerics
    errors, chosen = ErrorModel(required), {"order": numerics.order, "vertical_order": numerics.vertical_order}
    largest = errors.mesh(cells=case.cells, **chosen).largest_frequency
    dt = build_clock(case, largest, INTEGRATORS[numerics.integrator]()).dt
    settings = Settings(cells=case.cells, dt=dt, integrator=numerics.integrator, **chosen)
    return _predicted(errors, required, settings)


def largest_step_under_crests(case: Case, integrator: Integrator[Any]) -> float:
    """Return the limit [s] of an integrator's step on the current under the highest crest; raises as ``own_plan``."""
    required, numerics = requirements(case, DEFAULT), case.numerics
    mesh = ErrorModel(required).mesh(numerics.order, case.cells, numerics.vertical_order)
    return float(integrator.stability_limit) / _frequency_under_crests(required, mesh)


def _frequency_under_crests(required: Requirements, mesh: Mesh) -> float:
    """Return the largest frequency of a mesh [rad/s] on the current under the highest crest."""
    return float(mesh.largest_frequency + required.form.velocity * mesh.largest_wave_number)


class PlannedCase(NamedTuple):
    """A case with planned or resolved numerics, and warnings of the plan."""

    case: Case
    warnings: tuple[RunWarning, ...] = ()


def planned(case: Case, comm: MPI.Comm) -> PlannedCase:
    """Return the case with the water and numerics that its accuracy, or the default one, requires.

    Without a plan, or if the case sets some numerics, the others follow from its shortest wave. The plan is made on the
    first rank; collective. Raises ``InputError`` on all ranks if the case sets an accuracy that cannot be planned.
    """
    return from_first(comm, lambda: _planned(case))


def _planned(case: Case) -> PlannedCase:
    if isinstance(case.initial, RunState) and case.numerics.accuracy is None:
        with about("initial"):
            return PlannedCase(with_its_numerics(case, case.initial))
    numerics = case.numerics
    if numerics.open or not (case.on_mesh_file or numerics.model_fields_set & {"cells", "cell_size"}):
        check_resolvable(case)
    try:
        plan = default_plan(case)
    except InputError as error:
        if numerics.accuracy is not None and numerics.accuracy_of is not None:  # finer numerics follow from its run
            return _planned(case.model_copy(update={"numerics": numerics.without("accuracy")}))
        if numerics.accuracy is not None or not isinstance(error, UnreachableError):
            raise
        plan = None
    if plan is None:
        return PlannedCase(resolved(case))
    accurate = plan.accuracy == (numerics.accuracy or DEFAULT)
    warning = RunWarning("less-accurate", key="numerics.accuracy", value=plan.accuracy, limit=DEFAULT)
    return PlannedCase(plan.applied_to(case), () if accurate else (warning,))


def check_resolvable(case: Case) -> None:
    """Raise ``CaseError`` if no numerics resolve the waves of a paddle."""
    named = "; cells that the case names are not replaced"
    if problems := [one._replace(allowed=one.allowed + named) for one in too_short(case)]:
        raise CaseError(problems)


def default_plan(case: Case) -> Plan | None:
    """Return the plan for the accuracy of a case or, if it sets no numerics, for the best of the default accuracies.

    Returns None for a case that sets some numerics and no accuracy, or that cannot be planned. Raises ``InputError``
    for an accuracy that cannot be planned, ``UnreachableError`` if no default accuracy is reached.
    """
    if case.numerics.accuracy is not None:
        return make_plan(case, case.numerics.accuracy)
    if not case.numerics.open:
        return None
    for accuracy in (DEFAULT, *LOWER_ACCURACIES):
        try:
            return make_plan(case, accuracy)
        except UnreachableError as error:
            least = error
        except InputError:  # nothing moves, or the case cannot be planned
            return None
    raise UnreachableError(f"the case names no accuracy, and none that is tried then can be had: {least}")


def rule_summary(requested: Case) -> str:
    """Return why a case without numerics has no predicted accuracy, and its shortest wave; empty for other cases."""
    ruled = requested.numerics.open and not isinstance(requested.initial, RunState)
    why = unplanned(requested) if ruled else None
    if why is None:
        return ""
    rule = f"no accuracy is predicted, cells and vertical order follow a rule (docs/plan.md): {why}"
    return f"{rule}; {wave}" if (wave := str(shortest_wave(requested))) else rule


def current_parameter(required: Requirements, mesh: Mesh) -> float:
    """Return u² k_grid / g under the highest crest; 0 for linear waves, which have no current."""
    return required.form.velocity**2 * mesh.largest_wave_number / mesh.gravity


def _numbers_of_cells(required: Requirements) -> list[int]:
    """Return the numbers of cells of the search."""
    tank = required.case.tank
    counts = tank.length * required.k / (2 * np.pi) * CELLS_PER_WAVE
    if required.run_up is not None:
        finer = tank.length / required.run_up.length * CELLS_PER_PEAK
        counts = np.concatenate([counts, finer[finer > counts[-1]]])
    return sorted({max(tank.fewest_cells, ceil(one)) for one in counts})


def _cost(required: Requirements, settings: Settings, mesh: Mesh) -> Cost:
    product, steepness = settings.dt * mesh.largest_frequency, required.k * required.form.crest
    return slice_cost(required.case, settings, required.physics, dt_omega_max=product, steepness=steepness)


def _predicted(errors: ErrorModel, required: Requirements, settings: Settings) -> Plan:
    """Return settings with their predicted error and cost."""
    mesh = errors.mesh(settings.order, settings.cells, settings.vertical_order)
    cost, current = _cost(required, settings, mesh), current_parameter(required, mesh)
    penalty = f"none, u² k_grid / g = {current:.2g} under the highest crest stays below {NEEDED:g}."
    if required.physics == "linear":
        penalty = "none, linear waves have no current."
    elif current > NEEDED:
        run = "the run applies it by itself" if required.case.numerics.edge_penalty else "edge_penalty = 0 forbids it"
        penalty = f"needed, u² k_grid / g = {current:.2g} under the highest crest exceeds {NEEDED:g}; {run}."
    more = [f"records: {cost.records}."] if cost.records else []
    more += [f"absorption: {cost.absorption / cost.cpu:.0%} of the time."] if cost.absorption else []
    return Plan(
        physics=required.physics,
        settings=settings,
        accuracy=required.accuracy,
        error=errors.predict(settings),
        cost=cost,
        cell_size=mesh.cells.size,
        dt_omega_max=settings.dt * mesh.largest_frequency,
        reasons=(*required.reasons, f"edge penalty: {penalty}", *more),
    )


class _Steps:
    """Steps that divide the duration, or multiples of a row of a record, descending; or the step of the case."""

    def __init__(self, errors: ErrorModel, required: Requirements, named: dict[str, Any]):
        case, duration = required.case, required.case.run.duration
        self.scheme = named.get("integrator", SCHEME)
        self._errors, self._required, self._shift = errors, required, case.frequency_shift
        self._integrator, self._missed = INTEGRATORS[self.scheme], cache(self._motion_missed)
        self._measured = [] if "dt" in named else [end for end in case.paddles if end.motion().interval is not None]
        rows = [float(end.motion().interval or 0.0) for end in self._measured]
        counts = duration / np.pi * float(required.waves.omega.min()) * STEP_RATIO ** np.arange(120)
        recorded = [Clock.covering(duration, part * row) for row in rows for part in RECORD_STEPS]
        steps = [clock.dt for clock in recorded if clock.end <= case.motions_end * (1 + ROUNDING)]
        steps += [*duration / np.unique(np.maximum(1, np.ceil(counts)))]
        # if a step of NOISE_STEP rows does not resolve a noisy motion, longer ones that do are accurate by chance
        noisy = [RECORD_STEPS[0] * row * (1 + ROUNDING) for row in rows if not self._resolves(NOISE_STEP * row)]
        longest = min(noisy, default=np.inf)
        self._dt = [named["dt"]] if "dt" in named else sorted((dt for dt in steps if dt <= longest), reverse=True)

    def largest(self, mesh: Mesh) -> float | None:
        """Return the largest stable step [s] that is accurate and resolves the motion; None if there is none."""
        limit = self._stable(mesh)
        steps = [dt for dt in self._dt if dt <= limit]
        first = bisect_left(steps, True, key=lambda dt: self._is_accurate(dt, mesh))
        return next(filter(self._resolves, steps[first:]), None)

    def _is_accurate(self, dt: float, mesh: Mesh) -> bool:
        return self._errors.total(mesh, self._errors.time(self.scheme, dt)) <= AIM * self._required.accuracy

    def _stable(self, mesh: Mesh) -> float:
        """Return the longest step [s] that is stable and whose stages converge."""
        stable, required = float(self._integrator.stability_limit), self._required
        limit = MARGIN * stability_limit(required.case, self._integrator())
        if required.physics == "linear":
            return limit / mesh.largest_frequency
        shifted = _frequency_under_crests(required, mesh)
        solvable = min(float(self._integrator.solvable), FARTHEST * stable / self._shift)
        return min(limit / shifted, solvable / mesh.largest_frequency)

    def _motion_missed(self, dt: float) -> float:
        """Return the largest displacement error of a measured motion; 0 for a step of the case, which has a warning."""
        steps, nodes = max(1, int(self._required.case.run.duration / dt)), self._integrator.nodes
        return max((stroke_missed(end, dt=dt, steps=steps, nodes=nodes) for end in self._measured), default=0.0)

    def _resolves(self, dt: float) -> bool:
        return self._missed(dt) <= MOTION_ERROR * self._required.accuracy
