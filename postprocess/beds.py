"""The bed of a run, as its scene says it."""

from pydantic import TypeAdapter, ValidationError

from wavetank.case.beds import Depth
from wavetank.case.tanks import AnyTank, Tank
from wavetank.records.directory import RunDirectory


def still_water(run: RunDirectory) -> Depth | None:
    """Return d(x, y) [m] of a run; None where the bed is flat, or the manifest does not say.

    Raises ``SceneError`` if the bed is in a file that cannot be had or used.
    """
    try:
        tank: AnyTank = TypeAdapter(Tank).validate_python(run.manifest["scene"]["tank"])
    except (KeyError, ValidationError):
        return None
    return None if tank.bed is None else tank.bed.build(tank.depth)
