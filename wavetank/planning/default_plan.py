"""Numerics of a case that names an accuracy, or not all numerics: planned, or by its shortest wave."""

from typing import NamedTuple

from mpi4py import MPI

from wavetank.case import BasinTank, Case, RunState
from wavetank.errors import InputError
from wavetank.mesh import MeshFile
from wavetank.mpi import from_first
from wavetank.planning.plan import Plan, UnreachableError, make_plan
from wavetank.planning.requirements import unplanned
from wavetank.planning.resolution import DEFAULT, resolved, shortest_wave, too_short
from wavetank.run_warning import RunWarning
from wavetank.simulation.initial import with_its_numerics
from wavetank.values.case_model import CaseError, about

LESS = (0.03, 0.1)  # accuracies that are tried if the default one cannot be reached


class PlannedCase(NamedTuple):
    """A scene whose numerics are planned or resolved, and warnings of the plan."""

    scene: Case
    warnings: tuple[RunWarning, ...] = ()


def planned(scene: Case, comm: MPI.Comm) -> PlannedCase:
    """Return the scene with the water and numerics that its accuracy, or the default one, requires.

    If no plan can be made, or some numerics are named, the rest follows its shortest wave. Made on the first
    rank; collective. Raises ``InputError`` on all ranks if an accuracy is named that cannot be planned for.
    """
    return from_first(comm, lambda: _planned(scene))


def _planned(scene: Case) -> PlannedCase:
    if isinstance(scene.initial, RunState) and scene.numerics.accuracy is None:
        with about("initial"):
            return PlannedCase(with_its_numerics(scene, scene.initial))
    on_file = isinstance(scene.tank, BasinTank) and isinstance(scene.tank.layout, MeshFile)
    if scene.numerics.open or not (on_file or scene.numerics.model_fields_set & {"cells", "cell_size"}):
        check_resolvable(scene)
    if scene.numerics.accuracy is not None:
        return PlannedCase(make_plan(scene, scene.numerics.accuracy).applied_to(scene))
    try:
        plan = default_plan(scene)
    except UnreachableError:
        plan = None
    if plan is None:
        return PlannedCase(resolved(scene))
    if plan.accuracy == DEFAULT:
        return PlannedCase(plan.applied_to(scene))
    warning = RunWarning("less-accurate", key="numerics.accuracy", value=plan.accuracy, limit=DEFAULT)
    return PlannedCase(plan.applied_to(scene), (warning,))


def check_resolvable(scene: Case) -> None:
    """Raise ``CaseError`` if no numerics resolve a paddle's waves."""
    named = "; cells that the case names are not replaced"
    if problems := [one._replace(allowed=one.allowed + named) for one in too_short(scene)]:
        raise CaseError(problems)


def default_plan(scene: Case) -> Plan | None:
    """Return the plan of a scene that names no numerics, to the best of the usual accuracies; None if none is made.

    Nor is one made for a scene that asks for an accuracy: it gets the plan for that one, or none. Raises
    ``UnreachableError`` if none of these accuracies can be had.
    """
    if scene.numerics.accuracy is not None or not scene.numerics.open:
        return None
    for accuracy in (DEFAULT, *LESS):
        try:
            return make_plan(scene, accuracy)
        except UnreachableError as error:
            least = error
        except InputError:  # nothing moves, or nothing that a plan knows
            return None
    raise UnreachableError(f"the case names no accuracy, and none that is tried then can be had: {least}")


def rule_summary(requested: Case) -> str:
    """Return why no accuracy is predicted of a scene that names no numerics, with its shortest wave; else nothing."""
    ruled = requested.numerics.open and not isinstance(requested.initial, RunState)
    why = unplanned(requested) if ruled else None
    if why is None:
        return ""
    rule = f"no accuracy is predicted, cells and vertical order follow a rule (docs/plan.md): {why}"
    return f"{rule}; {wave}" if (wave := str(shortest_wave(requested))) else rule
