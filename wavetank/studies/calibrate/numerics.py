"""By which numerics it is first looked for a motion: a plan for a tenth, if that is so much cheaper than the case's."""

from collections.abc import Sequence

from wavetank.case import LinearWater, NonlinearWater, Scene
from wavetank.errors import InputError
from wavetank.planning.default_plan import default_plan
from wavetank.planning.plan import make_plan, own_plan
from wavetank.planning.resolution import DEFAULT, resolved

ROUGH = 0.1  # relative error of the elevation that is asked of it; a third of it is to be expected
WORTH = 0.45  # of the CPU time of the case's own numerics
CLOSE = 4.0  # of what is allowed: so near they, a few percent off themselves, have done what they can
LESS = 0.8  # of the least misfit before: and so where it is no less


def cheaper(scene: Scene) -> Scene | None:
    """Return the scene with cheap numerics, the water as its own numerics have it; None where none are worth it."""
    try:
        own = default_plan(scene) or (
            make_plan(scene, scene.numerics.accuracy)
            if scene.numerics.accuracy is not None
            else own_plan(resolved(scene), DEFAULT)
        )
        water = LinearWater() if own.physics == "linear" else NonlinearWater()
        rough = make_plan(scene.model_copy(update={"water": water}), ROUGH)
    except InputError:  # no plan is made of such scenes
        return None
    return rough.applied_to(scene) if rough.cost.cpu < WORTH * own.cost.cpu else None


def exhausted(misfits: Sequence[float]) -> bool:
    """Return whether cheap numerics, of attempts of such misfits over what is allowed, have done what they can."""
    *before, last = misfits
    return last <= CLOSE or last > LESS * min(before, default=float("inf"))
