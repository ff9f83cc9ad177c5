"""The bed of a run, from its scene, or, where that names code, from its record."""

import numpy as np
from pydantic import TypeAdapter, ValidationError
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError

from wavetank.case.tank import AnyTank, Depth, PythonBed, Tank
from wavetank.errors import InputError
from wavetank.output.directory import BED, RunDirectory


def still_water(run: RunDirectory) -> Depth | None:
    """Return d(x, y) [m] of a run; None where the bed is flat, or the manifest does not say.

    Raises ``InputError`` if the bed is in a file that cannot be had or used.
    """
    try:
        tank: AnyTank = TypeAdapter(Tank).validate_python(run.manifest["scene"]["tank"])
    except (KeyError, ValidationError):
        return None
    if isinstance(tank.bed, PythonBed) and (run.path / BED).exists():
        return _recorded(run)
    return None if tank.bed is None else tank.bed.build(tank.depth)


def _recorded(run: RunDirectory) -> Depth:
    """Return the linear interpolation of the recorded depths [m]; outside of the water the nearest of them."""
    columns = run.bed()
    if set(columns) - {"y"} != {"x", "depth"} or not columns.sizes["point"]:
        names = ", ".join(map(str, columns))
        raise InputError(f"{run.path / BED}: columns {names}; needed are rows of x, y (of a basin), depth.")
    x, depth = columns.x.values, columns.depth.values
    if "y" not in columns:
        order = np.argsort(x)
        return lambda at, _: np.interp(at, x[order], depth[order])
    try:
        inside, outside = (kind((x, columns.y.values), depth) for kind in (LinearNDInterpolator, NearestNDInterpolator))
    except (QhullError, ValueError) as error:
        raise InputError(
            f"{run.path / BED}: the depths cannot be interpolated ({str(error).splitlines()[0]})."
        ) from None
    return lambda *at: np.where(np.isnan(depths := inside(*at)), outside(*at), depths)
