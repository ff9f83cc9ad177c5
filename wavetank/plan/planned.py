"""What stands for an accuracy in a case: the same plan on all ranks."""

from collections.abc import Callable

from mpi4py import MPI

from wavetank.fe.agreed import from_first
from wavetank.plan.cost_model import cost_model
from wavetank.plan.plan import make_plan
from wavetank.scene import Scene


def planned(scene: Scene, comm: MPI.Comm, say: Callable[[str], None]) -> Scene:
    """Return the scene with the water and numerics its accuracy requires, or as it is if it asks for none; collective.

    The plan is made on the first rank, which tells ``say`` what takes time. Raises ``InputError`` on all ranks if no
    plan can be made.
    """
    accuracy = scene.numerics.accuracy
    if accuracy is None:
        return scene
    return from_first(comm, lambda: make_plan(scene, accuracy, costs=cost_model(say)).applied_to(scene))
