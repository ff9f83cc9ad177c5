"""Bed and sponge of a run, from its case; a bed by code from its record; the closed surface of a ring."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError
from xarray import Dataset, concat

from wavetank.base.errors import InputError
from wavetank.case.tank import AnyTank, Depth, FormulaSponge, PythonBed, Tank
from wavetank.output.directory import BED, RunDirectory


def still_water(run: RunDirectory) -> Depth | None:
    """Return d(x, y) [m] of a run; None for a flat bed, or if the manifest has no bed.

    Raises ``InputError`` if the file of the bed is missing or cannot be used.
    """
    try:
        tank: AnyTank = TypeAdapter(Tank).validate_python(run.manifest["case"]["tank"])
    except (KeyError, ValidationError):
        return None
    if isinstance(tank.bed, PythonBed) and (run.path / BED).exists():
        return _recorded(run)
    return None if tank.bed is None else tank.bed.build(tank.depth)


def _recorded(run: RunDirectory) -> Depth:
    """Return the linear interpolation of the recorded depths [m]; outside of the water the nearest one."""
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


def sponge_rate(case: Mapping[str, Any], x: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return the damping rate of the sponge of a slice at x [m] up to a factor, shape (N,); None without a sponge.

    ``case`` is that of a manifest; x ends at the far end of the tank.
    """
    match case.get("sponge"):
        case {"type": "end", "length": length}:
            return np.asarray(np.clip(1.0 + (x - x.max()) / length, 0.0, 1.0) ** 2)
        case {"type": "formula", "gamma": _} as formula:
            return FormulaSponge.model_validate(formula).build()(x, 0 * x)
    return None


def closed(surface: Dataset, length: float) -> Dataset:
    """Return the snapshots of a ring of a length [m] with the first point repeated at the end."""
    first = surface.isel(point=[0])
    both = [surface[["elevation"]], first[["elevation"]].assign_coords(x=first.x + length)]
    return concat(both, "point", data_vars="minimal", coords="minimal", compat="override")
