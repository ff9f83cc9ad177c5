"""Measured bathymetry, on a grid or at survey points, and its files: NetCDF by the CF conventions, CSV and XYZ.

On a grid, cubic splines through the data, not-a-knot at the ends (de Boor, A Practical Guide to Splines, 1978), have
continuous slopes. For a smooth bed their error is of order 4 in the spacing, that of the slope of order 3.

Between scattered survey points, Clough and Tocher's cubics on Delaunay triangles have continuous slopes, estimated with
the least bending of the bed (Nielson, Math. Comp. 40, 1983; SciPy's ``CloughTocher2DInterpolator``).
"""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import scipy

from wavetank.base.errors import InputError
from wavetank.base.files import regular
from wavetank.base.formula import Array, finite

if TYPE_CHECKING:  # imports in half a second; few cases need it
    from pandas import DataFrame


Interpolation = Literal["cubic", "linear"]
DEGREE: dict[Interpolation, int] = {"cubic": 3, "linear": 1}
ROUND_OFF = 1e-9  # distance outside of the range, over the range, within which a position is moved to its end


class Gridded:
    """Still-water depth interpolated in data on a rectangular grid.

    Parameters
    ----------
    axes
        Coordinates of the grid [m], ascending, by name: x, shape (A,), or x and y, shapes (A,) and (B,).
    d
        Depths [m], shape (A,) or (A, B); depths along x alone are valid for all y. They may be missing, NaN, if they
        are not needed: gaps are extrapolated linearly from the surrounding depths.
    interpolation
        ``"cubic"`` has continuous slopes; ``"linear"`` never overshoots.
    source
        Source of the data, for error messages.

    Raises ``InputError`` if the data are too few or all missing, or if their coordinates do not ascend.
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
            d, self._gap = _extrapolated(d, missing), _spline(axes.values(), 1.0 * missing, 1)
        self._spline = _spline(axes.values(), d, degree)

    def __call__(self, x: Array, y: Array) -> Array:
        """Return d [m] at positions x, y [m], shape (N,) each; raise ``InputError`` where there are no data."""
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


def _extrapolated(d: Array, missing: Array) -> Array:
    """Return depths; a missing one is 2 d_k - d_m or d_k, with the nearest given one k and its mirror image m."""
    nearest_indices = scipy.ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    mirror = 2 * nearest_indices - np.indices(d.shape)
    beyond = [(place < 0) | (place >= count) for place, count in zip(mirror, d.shape, strict=True)]
    nearest, mirrored = d[tuple(nearest_indices)], d[tuple(np.where(beyond, nearest_indices, mirror))]
    return np.where(missing & np.isfinite(mirrored), 2 * nearest - mirrored, nearest)


def _spline(axes: Iterable[Array], d: Array, degree: int) -> Any:
    """Return the spline of data on one or two axes, a function of positions."""
    if d.ndim == 1:
        return scipy.interpolate.make_interp_spline(*axes, d, k=degree)
    return scipy.interpolate.RectBivariateSpline(*axes, d, kx=degree, ky=degree, s=0).ev


INWARD = 1e-9  # distance from the hull into its triangles, over that to the centre


class Survey:
    """Still-water depth interpolated between points; outside of their hull it is constant over one spacing.

    Parameters
    ----------
    x, y
        Positions of the points [m], shape (N,) each, N >= 3.
    d
        Depths [m], shape (N,); points without one, NaN, are omitted, and depths at equal positions are averaged.
    interpolation
        ``"cubic"`` has continuous slopes; ``"linear"`` never overshoots.
    source
        Source of the data, for error messages.

    Raises ``InputError`` if the points span no triangle or have no position.
    """

    def __init__(self, x: Array, y: Array, d: Array, *, interpolation: Interpolation = "cubic", source: str = "bed"):
        self._source, measured = source, np.isfinite(d)
        points, where = np.unique(np.column_stack([x, y])[measured], axis=0, return_inverse=True)
        if not np.isfinite(points).all():
            raise InputError(f"{source}: values of x and y must be finite.")
        self._origin = points.mean(axis=0) if len(points) else np.zeros(2)  # against round-off
        try:
            self._triangles = scipy.spatial.Delaunay(points - self._origin)
        except (scipy.spatial.QhullError, ValueError):
            count = f"{len(points)} survey points"
            raise InputError(f"{source}: {count} span no triangle; three that are not in line are needed.") from None
        depths = np.bincount(where.ravel(), weights=d[measured]) / np.bincount(where.ravel())
        of = scipy.interpolate
        kinds: dict[Interpolation, Any] = {"cubic": of.CloughTocher2DInterpolator, "linear": of.LinearNDInterpolator}
        self._depth = kinds[interpolation](self._triangles, depths)
        a, b, c = np.moveaxis(self._triangles.points[self._triangles.simplices], 1, 0)
        area = float(np.abs(np.linalg.det(np.stack([b - a, c - a], axis=-1))).sum() / 2)
        self._spacing = np.sqrt(area / len(points))

    def __call__(self, x: Array, y: Array) -> Array:
        """Return d [m] at positions x, y [m], shape (N,) each; raise ``InputError`` far outside the points."""
        places = np.column_stack([x, y]) - self._origin
        d = np.asarray(self._depth(places), dtype=np.float64)
        outside = np.isnan(d)
        d[outside] = self._depth(self._at_the_edge(places[outside]))
        return finite(d, {"x": x, "y": y}, source=self._source)

    def _at_the_edge(self, places: Array) -> Array:
        """Return the nearest positions on the hull, shape (N, 2), slightly inwards."""
        nearest, distance = np.zeros_like(places), np.full(len(places), np.inf)
        for start, end in self._triangles.points[self._triangles.convex_hull]:
            along = np.clip((places - start) @ (end - start) / ((end - start) @ (end - start)), 0.0, 1.0)
            foot = start + along[:, None] * (end - start)
            separation = np.hypot(*(places - foot).T)
            nearest[separation < distance] = foot[separation < distance]
            distance = np.minimum(separation, distance)
        for n in np.flatnonzero(~(distance <= self._spacing))[:1]:
            x, y = places[n] + self._origin
            reach = f"its points end {distance[n]:.3g} m from there and are {self._spacing:.3g} m apart"
            raise InputError(f"{self._source}: asked at x = {x:.6g} m, y = {y:.6g} m; {reach}.")
        return (1.0 - INWARD) * nearest


Positive = Literal["down", "up"]
SIGN: dict[str, float] = {"down": 1.0, "up": -1.0}  # sign of depths
OPPOSITE = {"down": "up", "up": "down"}
METRES = ("m", "metre", "metres", "meter", "meters")
XYZ = ["x", "y", "depth"]
MAX_FILE_SIZE = 2e9  # largest size of a file [bytes]
MIN_FILL = 0.5  # least part of the points of a grid with rows; otherwise rows are survey points


class Measured(NamedTuple):
    """Data of a file: coordinates by name, values, and whether down is positive."""

    places: dict[str, Array]
    values: Array
    gridded: bool
    positive: str


def read_bed(
    path: Path,
    *,
    variable: str | None = None,
    interpolation: Interpolation = "cubic",
    positive: Positive | None = None,
) -> Gridded | Survey:
    """Return the bed of a file of depths, in metres.

    Parameters
    ----------
    path
        NetCDF (``.nc``) with coordinates x, or x and y, in any order; CSV (``.csv``) with a first line of names: x, or
        x and y, and the name of the depths; or XYZ (``.xyz``): only x, y and depth in each row. Rows may be in any
        order. Rows that fill less than half of a grid are survey points, which are triangulated.
    variable
        Name of the depths; required if a file has several variables.
    interpolation
        That of ``Gridded`` or ``Survey``.
    positive
        ``"down"`` for depths, ``"up"`` for elevations of the bed above still water; default: the attribute ``positive``
        of the variable, or ``"down"``.

    Raises ``InputError`` with the name of the file if it cannot be used.
    """
    if path.suffix not in READERS:
        raise InputError(
            f"{path}: must end in {', '.join(READERS)}, which is how measured beds are known; "
            "gdal_translate -of XYZ makes one of a raster."
        )
    try:
        data = READERS[path.suffix](regular(path, largest=MAX_FILE_SIZE), variable)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error).strip().removesuffix(".")
        raise InputError(f"{path}: cannot be read ({reason}).") from None
    down = data.positive if positive is None else positive
    d = SIGN[down] * data.values
    if np.isfinite(d).any() and not (d > 0).any():
        raise InputError(f"{path}: no depth is positive; with positive = '{OPPOSITE[down]}' all are.")
    if data.gridded:
        return Gridded(data.places, d, interpolation=interpolation, source=str(path))
    return Survey(data.places["x"], data.places["y"], d, interpolation=interpolation, source=str(path))


# ---------------------------------------------------------------- NetCDF
def _netcdf(path: Path, variable: str | None) -> Measured:
    import xarray

    with xarray.open_dataset(path, engine="netcdf4", decode_times=False) as dataset:
        dataset.load()
    data = dataset[_select_variable([str(name) for name in dataset.data_vars], variable, path)]
    names = sorted(str(name) for name in data.dims)
    if names not in (["x"], ["x", "y"]) or not all(name in data.coords for name in names):
        received = f"{', '.join(names) or 'none'}; survey points go into a file of CSV or XYZ"
        raise InputError(f"{path}: coordinates of {data.name!r} must be x, or x and y; they are: {received}.")
    for part in (data, *(data[name] for name in names)):
        if (units := part.attrs.get("units", "m")) not in METRES:
            raise InputError(f"{path}: {part.name!r} is in {units!r}; must be in metres, 'm'.")
    positive = str(data.attrs.get("positive", "down"))
    if positive not in SIGN:
        raise InputError(f"{path}: {data.name!r} is positive {positive!r}; must be positive 'down' or 'up'.")
    data = data.sortby(names).transpose(*names)
    axes = {name: np.asarray(data[name], dtype=np.float64) for name in names}
    return Measured(axes, np.asarray(data, dtype=np.float64), gridded=True, positive=positive)


# ---------------------------------------------------------------- tables
def _csv(path: Path, variable: str | None) -> Measured:
    import pandas

    return _table(pandas.read_csv(path, comment="#", skipinitialspace=True, dtype=np.float64), variable, path)


def _xyz(path: Path, variable: str | None) -> Measured:
    import pandas

    table = pandas.read_csv(path, comment="#", sep=r"\s+", header=None, dtype=np.float64)
    if len(table.columns) != len(XYZ):
        raise ValueError(
            f"its rows must be x, y and depth, with blanks between; they have {len(table.columns)} columns"
        )
    return _table(table.set_axis(XYZ, axis=1), variable, path)


def _table(table: "DataFrame", variable: str | None, path: Path) -> Measured:
    """Return the data of columns; values are missing if a grid has no row for them."""
    names = [name for name in ("x", "y") if name in table]
    if "x" not in names:
        named = "its first line must name its columns, e.g. x,y,depth"
        raise ValueError(f"it needs a column x, or x and y; it has: {', '.join(map(str, table))}; {named}")
    values = table[_select_variable([name for name in table if name not in names], variable, path)].to_numpy()
    places = {name: table[name].to_numpy() for name in names}
    axes, indices = zip(*(np.unique(place, return_inverse=True) for place in places.values()), strict=True)
    if names == ["x", "y"] and len(table) < MIN_FILL * axes[0].size * axes[1].size:
        return Measured(places, values, gridded=False, positive="down")
    if table.duplicated(names).any():
        raise ValueError(f"two rows have the same {' and '.join(names)}")
    grid = np.full([axis.size for axis in axes], np.nan)
    grid[indices] = values
    return Measured(dict(zip(names, axes, strict=True)), grid, gridded=True, positive="down")


READERS = {".nc": _netcdf, ".csv": _csv, ".xyz": _xyz}


def _select_variable(names: list[str], variable: str | None, path: Path) -> str:
    """Return the name of the variable of depths; raise ``InputError`` if it is absent or ambiguous."""
    wanted = names if variable is None else [variable]
    if len(wanted) != 1:
        raise InputError(f"{path}: one variable must be named, of: {', '.join(names) or 'none'}.")
    if wanted[0] not in names:
        raise InputError(f"{path}: has no variable {wanted[0]!r}; it has: {', '.join(names) or 'none'}.")
    return wanted[0]
