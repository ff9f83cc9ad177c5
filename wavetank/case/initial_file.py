"""An initial surface from a file."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from wavetank import data
from wavetank import motion as motions
from wavetank.case.tanks import AnyTank, BasinTank, RingTank
from wavetank.errors import InputError
from wavetank.values.columns import check_ascending, read_columns
from wavetank.values.noun import FilePath, Noun

APART = 2.0  # times what is most between two points may be from the last round to the first
FEWEST = 4  # points: of a cubic spline, or of triangles


class FileSurface(Noun):
    """Elevation and potential of a file: columns x, eta and psi of a slice or ring, x, y, eta and psi of a basin.

    Released from rest where psi is left out. Between its points is a cubic spline along a slice or ring, periodic round
    this, and in basins a surface on triangles with continuous slopes.
    """

    type: Literal["file"] = "file"
    file: FilePath = Field(
        description="text file of columns: x, eta [m] and, if not at rest, psi [m^2/s]; in a basin x, y, eta, psi"
    )

    def surface(self, tank: AnyTank, x: motions.Array, y: motions.Array) -> tuple[motions.Array, motions.Array]:
        """Return eta [m] and psi [m²/s] at places x, y [m], each of shape (N,).

        Raises ``InputError`` for a file that cannot be read, or that does not reach there.
        """
        path = data.resolve(self.file, Path())
        axes = ["x", "y"] if isinstance(tank, BasinTank) else ["x"]
        allowed = f"allowed are finite numbers: {', '.join(axes)}, eta and, where the water moves, psi"
        found = read_columns(path, allowed=allowed)
        rows, columns = found.values.shape
        if rows < FEWEST or columns not in (len(axes) + 1, len(axes) + 2):
            raise InputError(f"{path}: {rows} rows of {columns} columns received; {allowed}, {FEWEST} rows or more.")
        at, values = found.values[:, : len(axes)], found.values[:, len(axes) :]
        if isinstance(tank, BasinTank):
            surface = _over(path, at, values)(np.column_stack([x, y]))
        else:
            check_ascending(path, found.lines, at[:, 0], what=("x =", "places"))
            surface = _along(path, at[:, 0], values, around=tank.length if isinstance(tank, RingTank) else None)(x)
        if np.isnan(surface).any():
            where = int(np.flatnonzero(np.isnan(surface).any(axis=1))[0])
            place = ", ".join(f"{axis} = {one[where]:.6g} m" for axis, one in zip(axes, (x, y), strict=False))
            raise InputError(f"{path}: does not reach {place}, where there is water.")
        eta, psi = surface[:, 0], surface[:, 1] if columns == len(axes) + 2 else np.zeros_like(x)
        return eta, psi


def _along(path: Path, at: motions.Array, values: motions.Array, *, around: float | None) -> Any:
    """Return values [.] along x, by a spline; nan beyond its ends, and round a ring [m] none."""
    from scipy.interpolate import CubicSpline

    if around is None:
        return CubicSpline(at, values, extrapolate=False)
    if at[-1] - at[0] > around * (1 + 1e-9):
        raise InputError(f"{path}: x from {at[0]:g} to {at[-1]:g} m received; a ring of {around:g} m is shorter.")
    gap, widest = around - (at[-1] - at[0]), float(np.diff(at).max())
    if gap > APART * widest:
        reach = f"{path}: x from {at[0]:g} to {at[-1]:g} m received, {widest:.3g} m apart at the most"
        raise InputError(f"{reach}; {gap:.3g} m of a ring of {around:g} m are left out: points must go all round.")
    if gap > around * 1e-9:
        at, values = np.append(at, at[0] + around), np.vstack([values, values[:1]])
    values = np.vstack([values[:-1], values[:1]])  # which is the last
    return CubicSpline(at, values, bc_type="periodic", extrapolate="periodic")


def _over(path: Path, at: motions.Array, values: motions.Array) -> Any:
    """Return values over (x, y) on triangles; nan beyond."""
    from scipy.interpolate import CloughTocher2DInterpolator
    from scipy.spatial import QhullError

    try:
        return CloughTocher2DInterpolator(at, values)
    except QhullError:
        raise InputError(f"{path}: its points stand on one line; a basin's must reach around it.") from None
