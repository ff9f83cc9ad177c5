"""A bed interpolated between survey points that lie anyhow, in Delaunay's triangles.

Clough and Tocher's cubics have continuous slopes, estimated so that the bed bends least (Nielson, Math. Comp. 40,
1983; SciPy's ``CloughTocher2DInterpolator``).
"""

from typing import Any

import numpy as np
import scipy

from wavetank.errors import InputError
from wavetank.mesh.gridded import Interpolation
from wavetank.values.formula import Array, finite

INWARD = 1e-9  # of the way to the middle: from the survey's edge into its triangles


class Survey:
    """Still-water depth interpolated between points; at their edge it goes on level for as far as they are apart.

    Parameters
    ----------
    x, y
        Where the points are [m], each of shape (N,), N >= 3.
    d
        Depths [m], shape (N,); points without one, NaN, are left out, and the mean is taken of those at one place.
    interpolation
        ``"cubic"`` has continuous slopes; ``"linear"`` never overshoots.
    source
        Where the data come from, for errors.

    Raises ``InputError`` where the points span no triangle or lie at no place.
    """

    def __init__(self, x: Array, y: Array, d: Array, *, interpolation: Interpolation = "cubic", source: str = "bed"):
        self._source, measured = source, np.isfinite(d)
        points, where = np.unique(np.column_stack([x, y])[measured], axis=0, return_inverse=True)
        if not np.isfinite(points).all():
            raise InputError(f"{source}: values of x and y must be finite.")
        self._origin = points.mean(axis=0) if len(points) else np.zeros(2)  # triangles want no offset of kilometres
        try:
            self._triangles = scipy.spatial.Delaunay(points - self._origin)
        except (scipy.spatial.QhullError, ValueError):
            count = f"{len(points)} survey points"
            raise InputError(f"{source}: {count} span no triangle; three that are not in line are needed.") from None
        depths = np.bincount(where.ravel(), weights=d[measured]) / np.bincount(where.ravel())
        of = scipy.interpolate
        kinds: dict[Interpolation, Any] = {"cubic": of.CloughTocher2DInterpolator, "linear": of.LinearNDInterpolator}
        self._depth = kinds[interpolation](self._triangles, depths)
        self._spacing = np.sqrt(_area(self._triangles) / len(points))

    def __call__(self, x: Array, y: Array) -> Array:
        """Return d [m] at places x, y [m], each of shape (N,); raise ``InputError`` far outside the points."""
        places = np.column_stack([x, y]) - self._origin
        d = np.asarray(self._depth(places), dtype=np.float64)
        outside = np.isnan(d)
        d[outside] = self._depth(self._at_the_edge(places[outside]))
        return finite(d, {"x": x, "y": y}, source=self._source)

    def _at_the_edge(self, places: Array) -> Array:
        """Return the nearest places on the edge, shape (N, 2), a little inwards."""
        nearest, distance = np.zeros_like(places), np.full(len(places), np.inf)
        for start, end in self._triangles.points[self._triangles.convex_hull]:
            along = np.clip((places - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
            foot = start + along[:, None] * (end - start)
            away = np.hypot(*(places - foot).T)
            nearest[away < distance] = foot[away < distance]
            distance = np.minimum(away, distance)
        for n in np.flatnonzero(~(distance <= self._spacing))[:1]:
            x, y = places[n] + self._origin
            apart = f"its points end {distance[n]:.3g} m from there and are {self._spacing:.3g} m apart"
            raise InputError(f"{self._source}: asked at x = {x:.6g} m, y = {y:.6g} m; {apart}.")
        return (1.0 - INWARD) * nearest


def _area(triangles: "scipy.spatial.Delaunay") -> float:
    a, b, c = np.moveaxis(triangles.points[triangles.simplices], 1, 0)
    return float(np.abs(np.linalg.det(np.stack([b - a, c - a], axis=-1))).sum() / 2)
