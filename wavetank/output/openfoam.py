"""Boundary tables of OpenFOAM: ``constant/boundaryData/PATCH`` of ``timeVaryingMappedFixedValue``.

``points`` has the positions, ``TIME/U`` and ``TIME/alpha.water`` the values at them. The files are lists without a
header, which OpenFOAM of openfoam.com (from v1912 on) and of openfoam.org (from version 5 on) read, and with them the
solvers of waves2Foam and olaFlow. Documentation: ``timeVaryingMappedFixedValueFvPatchField.H`` of both.

OpenFOAM interpolates linearly in the plane of the points, and in time. Points are the centres of intervals of equal
height, one of which ends at still water: the centres of faces of cells of this height. The fraction of water at a point
is that of its interval. The integral of the interpolated fraction over the height is exactly that of the water.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavetank.base.errors import InputError
from wavetank.output.files import write_atomically
from wavetank.output.water_columns import Array, WaterColumns

TABLES = Path("constant") / "boundaryData"
FIELDS = "U", "alpha.water"
SETTINGS = "fields-{patch}.txt"
MOST = 10**5  # points of a patch
STILL = 1e-6  # range of the elevation of still water [m]


@dataclass(frozen=True)
class Patch:
    """Points of a patch: K heights at each of C columns, or of a single column at two places across the tank.

    Attributes
    ----------
    name
        Name of the patch.
    spacing
        Vertical distance of the points [m].
    heights
        Heights of the points of each column above still water [m], shape (C, K).
    width
        Distance of the two places of a single column [m].
    origin
        Origin of the coordinates of the points, x, y and z in the tank [m].
    """

    name: str
    spacing: float
    heights: Array
    width: float
    origin: tuple[float, float, float]


def patch_of(
    columns: WaterColumns,
    name: str,
    *,
    spacing: float,
    width: float | None = None,
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Patch:
    """Return the points of a patch in the plane of the columns, from the deepest bed to above the highest crest.

    The spacing should be at most the height of the cells at the surface [m]. The default of ``width`` is 1 m. Raises
    ``InputError`` for a spacing above half the range of the elevation, and for too many points.
    """
    if STILL < (extent := float(np.ptp(columns.elevation))) < 2.0 * spacing:
        allowed = f"allowed is at most half the range of the elevation, {extent / 2:.3g} m"
        raise InputError(f"{columns.source}: spacing of {spacing:g} m received; {allowed}.")
    deepest, crest = float(columns.depth.max()), float(columns.elevation.max())
    lowest, highest = np.floor(-deepest / spacing), np.ceil(crest / spacing) + 2.0  # intervals
    if (number := highest - lowest) * len(columns.x) > MOST:
        received = f"spacing of {spacing:g} m received, {number:.0f} points in each of {len(columns.x)} columns"
        raise InputError(f"{columns.source}: {received}; at most {MOST} points are allowed.")
    heights = spacing * (np.arange(lowest, highest) + 0.5) + np.zeros((len(columns.x), 1))
    return Patch(name, spacing, heights, width or 1.0, origin)


def points(columns: WaterColumns, patch: Patch) -> Array:
    """Return the points of a patch, x, y and z [m], shape (points, 3): column after column, upwards."""
    at = np.column_stack([columns.x, columns.y])
    heights = patch.heights
    if len(at) == 1:
        across = np.array([[0.0, -patch.width / 2], [0.0, patch.width / 2]])
        at, heights = at + across, np.repeat(heights, 2, axis=0)
    return np.column_stack([np.repeat(at, heights.shape[1], axis=0), heights.ravel()]) - patch.origin


def fractions(columns: WaterColumns, patch: Patch) -> Array:
    """Return the fractions of water at the points of the columns, shape (N, C, K)."""
    above = (columns.elevation[:, :, None] - patch.heights) / patch.spacing
    return np.clip(above + 0.5, 0.0, 1.0)


def velocities(columns: WaterColumns, patch: Patch) -> Array:
    """Return velocities along x, y and z at the points of the columns [m/s], shape (N, C, K, 3).

    Up to one distance of points above the surface, where faces still have water, it is that of the surface; the air
    above is at rest.
    """
    depth = columns.depth[:, None]
    height = columns.elevation[:, :, None] - patch.heights
    zeta = (depth + patch.heights) / (depth + columns.elevation[:, :, None])
    of_water = [columns.values(f"velocity_{axis}", np.clip(zeta, 0.0, 1.0)) for axis in "xyz"]
    return np.stack(of_water, axis=-1) * (height > -1.5 * patch.spacing)[..., None]


def write_openfoam(folder: Path, columns: WaterColumns, patch: Patch) -> list[Path]:
    """Write the tables of a patch, in place of earlier ones; return the folder of the tables and the settings."""
    tables = TABLES / patch.name
    _remove_tables(folder / tables)
    at = points(columns, patch)
    (folder / tables).mkdir(parents=True, exist_ok=True)
    write_atomically(folder / tables / "points", _list(at))
    repeated = 2 if len(columns.x) == 1 else 1
    alpha, velocity = fractions(columns, patch), velocities(columns, patch)
    for t, of_time, u in zip(columns.t, alpha, velocity, strict=True):
        contents = _list(np.tile(u.reshape(-1, 3), (repeated, 1))), _list(np.tile(of_time.ravel(), repeated))
        (now := folder / tables / f"{t:.10g}").mkdir(exist_ok=True)
        for field, content in zip(FIELDS, contents, strict=True):
            write_atomically(now / field, content)
    settings = folder / SETTINGS.format(patch=patch.name)
    write_atomically(settings, "".join(_settings(columns, patch)).encode())
    return [folder / tables, settings]


def _list(values: Array) -> bytes:
    """Return numbers or vectors as a list of OpenFOAM."""
    form = "({:.7g} {:.7g} {:.7g})" if values.ndim > 1 else "{:.7g}"
    rows = (form.format(*row) for row in values.reshape(len(values), -1))
    return "\n".join([str(len(values)), "(", *rows, ")", ""]).encode()


def _remove_tables(tables: Path) -> None:
    """Remove the tables of an earlier export, whose times may be others."""
    for field in FIELDS:
        for file in tables.glob(f"*/{field}"):
            file.unlink()
            with suppress(OSError):  # a folder with other files remains
                file.parent.rmdir()


def _settings(columns: WaterColumns, patch: Patch) -> Iterator[str]:
    """Yield the entries of the patch in the fields of the case."""
    yield f"// Patch {patch.name}: {columns.source}; time 0 is {columns.begin:.10g} s of the run\n"
    for field, zero in (("U", "(0 0 0)"), ("alpha.water", "0")):
        keys = "type timeVaryingMappedFixedValue", "setAverage false", f"offset {zero}", f"value uniform {zero}"
        yield _entry(field, patch, keys)
    yield _entry("p_rgh", patch, ("type fixedFluxPressure", "value uniform 0"))


def _entry(field: str, patch: Patch, keys: Sequence[str]) -> str:
    """Return the entry of a patch in a field."""
    return "\n".join(["", f"// 0/{field}", patch.name, "{", *(f"    {key};" for key in keys), "}", ""])
