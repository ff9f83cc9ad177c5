"""A bed interpolated in data on a grid: depths along x for a slice, over x and y for a basin.

Cubic splines through the data, not-a-knot at the ends (de Boor, A Practical Guide to Splines, 1978), have continuous
slopes; the error of a smooth bed is of order 4 in the spacing, that of its slope of order 3.
"""

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
from scipy.interpolate import RectBivariateSpline, make_interp_spline

from wavetank.errors import InputError
from wavetank.formula import Array

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
        Depths [m], shape (A,) or (A, B); those along x alone hold for every y.
    interpolation
        ``"cubic"`` has continuous slopes; ``"linear"`` never overshoots.
    source
        Where the data come from, for errors.

    Raises ``InputError`` where the data are too few, not finite, or their coordinates do not ascend.
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
        if missing := int((~np.isfinite(d)).sum()):
            raise InputError(f"{source}: {missing} of {d.size} depths are missing or not finite; all are needed.")
        self._spline: Callable[..., Any] = SPLINES[d.ndim](*axes.values(), d, degree)

    def __call__(self, x: Array, y: Array) -> Array:
        """Return d [m] at places x, y [m], each of shape (N,); raise ``InputError`` outside the data's range."""
        places = {"x": x, "y": y}
        inside = [self._inside(name, places[name]) for name in self._axes]
        return np.asarray(self._spline(*inside), dtype=np.float64)

    def _inside(self, name: str, place: Array) -> Array:
        first, last = self._axes[name][[0, -1]]
        slack = ROUND_OFF * (last - first)
        outside = place[~((first - slack <= place) & (place <= last + slack))]
        if outside.size:
            reach = f"its data reach from {first:g} to {last:g} m"
            raise InputError(f"{self._source}: asked at {name} = {outside[0]:.6g} m; {reach}.")
        return np.asarray(np.clip(place, first, last), dtype=np.float64)


def _along(x: Array, d: Array, degree: int) -> Any:
    return make_interp_spline(x, d, k=degree)


def _over(x: Array, y: Array, d: Array, degree: int) -> Any:
    return RectBivariateSpline(x, y, d, kx=degree, ky=degree, s=0).ev


SPLINES: dict[int, Callable[..., Callable[..., Any]]] = {1: _along, 2: _over}
