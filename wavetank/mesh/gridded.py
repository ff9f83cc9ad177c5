"""A bed interpolated in data on a grid: depths along x for a slice, over x and y for a basin.

Cubic splines through the data, not-a-knot at the ends (de Boor, A Practical Guide to Splines, 1978), have continuous
slopes; the error of a smooth bed is of order 4 in the spacing, that of its slope of order 3.
"""

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
import scipy

from wavetank.errors import InputError
from wavetank.values.formula import Array

Interpolation = Literal["cubic", "linear"]
DEGREE: dict[Interpolation, int] = {"cubic": 3, "linear": 1}
ROUND_OFF = 1e-9  # of the range: places this far outside are on its end


class Gridded:
    """Still-water depth interpolated in data on a rectangular grid.

    Parameters
    ----------
    axes
        Coordinates of the grid [m], ascending, by name: x, shape (A,), or x and y, shapes (A,) and (B,).
    d
        Depths [m], shape (A,) or (A, B); those along x alone hold for every y. They may be missing, NaN, where nobody
        asks for one: beside such a gap the spline sees the depths around it go on as they come, in line.
    interpolation
        ``"cubic"`` has continuous slopes; ``"linear"`` never overshoots.
    source
        Where the data come from, for errors.

    Raises ``InputError`` where the data are too few, all missing, or their coordinates do not ascend.
    """

    def __init__(
        self, axes: Mapping[str, Array], d: Array, *, interpolation: Interpolation = "cubic", source: str = "bed"
    ):
        self._axes, self._source, degree = axes, source, DEGREE[interpolation]
        for name, axis in axes.items():
            if len(axis) <= degree:
                raise InputError(
                    f"{source}: {len(axis)} values of {name}; {interpolation} needs at least {degree + 1}."
                )
            if not (np.diff(axis) > 0).all():
                raise InputError(f"{source}: values of {name} must be finite and differ from one another.")
        missing = ~np.isfinite(d)
        if missing.all():
            raise InputError(f"{source}: none of its {d.size} depths is a finite number.")
        self._missing = f"{missing.sum()} of {d.size} depths are missing"
        self._gap: Callable[..., Any] | None = None
        if missing.any():
            d, self._gap = _continued(d, missing), SPLINES[d.ndim](*axes.values(), 1.0 * missing, 1)
        self._spline: Callable[..., Any] = SPLINES[d.ndim](*axes.values(), d, degree)

    def __call__(self, x: Array, y: Array) -> Array:
        """Return d [m] at places x, y [m], each of shape (N,); raise ``InputError`` where there are no data."""
        places = {"x": x, "y": y}
        inside = [self._inside(name, places[name]) for name in self._axes]
        if self._gap is not None:
            for n in np.flatnonzero(self._gap(*inside) > ROUND_OFF)[:1]:
                where = ", ".join(f"{name} = {places[name][n]:.6g} m" for name in self._axes)
                raise InputError(f"{self._source}: has no depth at {where}, where there is water; {self._missing}.")
        return np.asarray(self._spline(*inside), dtype=np.float64)

    def _inside(self, name: str, place: Array) -> Array:
        first, last = self._axes[name][[0, -1]]
        slack = ROUND_OFF * (last - first)
        outside = place[~((first - slack <= place) & (place <= last + slack))]
        if outside.size:
            reach = f"its data reach from {first:g} to {last:g} m"
            raise InputError(f"{self._source}: asked at {name} = {outside[0]:.6g} m; {reach}.")
        return np.asarray(np.clip(place, first, last), dtype=np.float64)


def _continued(d: Array, missing: Array) -> Array:
    """Return depths, the missing ones from the nearest known one k and its mirror image m: 2 d_k - d_m, or d_k."""
    known = scipy.ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    mirror = 2 * known - np.indices(d.shape)
    beyond = [(place < 0) | (place >= count) for place, count in zip(mirror, d.shape, strict=True)]
    nearest, mirrored = d[tuple(known)], d[tuple(np.where(beyond, known, mirror))]
    return np.where(missing & np.isfinite(mirrored), 2 * nearest - mirrored, nearest)


def _along(x: Array, d: Array, degree: int) -> Any:
    return scipy.interpolate.make_interp_spline(x, d, k=degree)


def _over(x: Array, y: Array, d: Array, degree: int) -> Any:
    return scipy.interpolate.RectBivariateSpline(x, y, d, kx=degree, ky=degree, s=0).ev


SPLINES: dict[int, Callable[..., Callable[..., Any]]] = {1: _along, 2: _over}
