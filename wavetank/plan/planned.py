"""What stands for an accuracy in a case, and for numerics that it does not name: the same on all ranks."""

from typing import NamedTuple

from mpi4py import MPI

from wavetank.errors import InputError
from wavetank.fe.agreed import from_first
from wavetank.plan.defaults import DEFAULT, resolved
from wavetank.plan.plan import Plan, UnreachableError, make_plan
from wavetank.scene import Scene

LESS = (0.03, 0.1)  # accuracies that are tried where the default one cannot be had


class Planned(NamedTuple):
    """A scene whose numerics are planned or resolved, and what whoever reads its results must know of that."""

    scene: Scene
    warnings: tuple[str, ...] = ()


def planned(scene: Scene, comm: MPI.Comm) -> Planned:
    """Return the scene with the water and numerics that its accuracy requires, or where it names none the default one.

    Where no plan can be made, or some numerics are named, its shortest wave decides on the others. Made on the first
    rank; collective. Raises ``InputError`` on all ranks if an accuracy is asked for that cannot be planned for.
    """
    return from_first(comm, lambda: _planned(scene))


def _planned(scene: Scene) -> Planned:
    if scene.numerics.accuracy is not None:
        return Planned(make_plan(scene, scene.numerics.accuracy).applied_to(scene))
    plan = default_plan(scene)
    if plan is None:
        return Planned(resolved(scene))
    less = f"no numerics that a plan knows are accurate to {DEFAULT:g}: these are planned for {plan.accuracy:g}"
    return Planned(plan.applied_to(scene), () if plan.accuracy == DEFAULT else (less,))


def default_plan(scene: Scene) -> Plan | None:
    """Return the plan of a scene that names no numerics, to the best of the usual accuracies; None if none is made.

    Nor is one made for a scene that asks for an accuracy: it gets the plan for that one, or none.
    """
    if scene.numerics.accuracy is not None or not scene.numerics.open:
        return None
    for accuracy in (DEFAULT, *LESS):
        try:
            return make_plan(scene, accuracy)
        except UnreachableError:
            continue
        except InputError:  # nothing moves, or nothing that a plan knows
            return None
    return None
