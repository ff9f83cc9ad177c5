"""Columns of the tables of a run directory: their names, and their values as variables of CF-NetCDF and xarray.

A column is named ``QUANTITY STATION@x=X;y=Y;z=Z [UNITS]``, without the parts that its table does not need:

    gauges         5@x=50              5@x=50;y=2
    probes         velocity_x A@x=2;z=-0.1 [m/s]
    loads          force_x paddle [N/m]
    over time      total [m^4/s^2]     position@y=2 [m]
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wavetank.base.arrays import Vector

if TYPE_CHECKING:
    from xarray import DataArray

ELEVATION = {
    "standard_name": "sea_surface_height_above_mean_sea_level",
    "long_name": "elevation of the surface above still water",
    "units": "m",
}
TIME = {"long_name": "time since the start", "units": "s"}  # without a date: no time coordinate of CF, nor an axis T
ALONG = {"long_name": "distance along the tank from the paddle at rest", "units": "m", "axis": "X"}
ACROSS = {"long_name": "distance across the tank", "units": "m", "axis": "Y"}
UPWARDS = {"long_name": "height above still water", "units": "m", "axis": "Z", "positive": "up"}
STANDARD_ERROR = "elevation_standard_error"
AXES = {"x": ALONG, "y": ACROSS, "z": UPWARDS}
ZETA = {"long_name": "height above the bed over that of the surface", "units": "1"}
STANDARD_NAMES = {  # names of the CF conventions
    "velocity_x": "sea_water_x_velocity",
    "velocity_y": "sea_water_y_velocity",
    "velocity_z": "upward_sea_water_velocity",
    "pressure": "sea_water_pressure_due_to_sea_water",
}
VECTORS = {  # with their units and meaning
    "velocity": ("m/s", "velocity of the water"),
    "local_acceleration": ("m/s^2", "rate of change of the velocity at the point"),
    "acceleration": ("m/s^2", "acceleration of the water that passes the point"),
}
PRESSURE = ("Pa", "pressure above that of the air, still water's included")
RATES = {"position": "m", "velocity": "m/s", "acceleration": "m/s^2"}  # methods of a motion, with their units
PUSH = {1: ("force [N/m]", "power [W/m]"), 2: ("force [N]", "power [W]")}  # by the tank's horizontal dimensions
FORCES = ("force_x", "force_y", "force_z")
MOMENTS = ("moment_x", "moment_y", "moment_z")


class Variable(NamedTuple):
    """A variable of a file: the names of its dimensions, its values and its attributes."""

    dimensions: tuple[str, ...]
    values: NDArray[Any]
    attributes: Mapping[str, str | np.float64]


# ---------------------------------------------------------------- names
def position_label(name: str, x: float, y: float = 0.0, z: float | None = None) -> str:
    """Return a name with its position [m], as ``5@x=50;y=2``: with semicolons, and without y = 0."""
    axes = {"x": x} | ({"y": y} if y else {}) | ({} if z is None else {"z": z})
    return f"{name}@" + ";".join(f"{axis}={np.format_float_positional(at, trim='-')}" for axis, at in axes.items())


def parse_position_label(label: str) -> tuple[str, float, float, float]:
    """Return name, x, y and z [m] of a label by ``position_label``, also with commas; absent y and z are 0.

    Raises ``ValueError`` for other texts.
    """
    name, separator, position = label.rpartition("@x=")
    if not separator:
        raise ValueError(f"{label!r} has no position")
    axes = (part.partition("=") for part in f"x={position}".replace(",", ";").split(";"))
    at = {axis: float(value) for axis, _, value in axes}
    return name, at["x"], at.get("y", 0.0), at.get("z", 0.0)


ENERGY = {  # unit of each column; of energies and mass by the dimensions of the tank
    "t": "s",
    **dict.fromkeys(("kinetic", "potential", "total", "paddle_work", "dissipated", "balance"), "m^{energy}/s^2"),
    "mass": "m^{mass}",
    "absorbed": "m^{energy}/s^2",  # only if paddles absorb
}


def energy_columns(dimensions: int, *, absorbed: bool = False) -> tuple[str, ...]:
    """Return the columns of the energy budget with their units, for a tank of one or two horizontal dimensions.

    Energies are per unit of density, and of width in one dimension. ``absorbed`` is a column if paddles absorb.
    """
    powers = {"mass": 1 + dimensions, "energy": 3 + dimensions}
    units = {name: unit for name, unit in ENERGY.items() if absorbed or name != "absorbed"}
    return tuple(f"{name} [{unit.format(**powers)}]" for name, unit in units.items())


def energy_rows(values: Mapping[str, Vector]) -> Vector:
    """Return rows of the energy budget, shape (K, columns), of values by the names of ``ENERGY``, shape (K,) each.

    Raises ``ValueError`` for an unknown name.
    """
    if unknown := values.keys() - ENERGY.keys():
        raise ValueError(f"{', '.join(unknown)}: not in ENERGY of wavetank/output/columns.py")
    return np.column_stack([values[name] for name in ENERGY if name in values])


def load_columns(walls: Sequence[str], dimensions: int) -> list[str]:
    """Return the columns of loads: all quantities of the first wall, then of the next.

    In a tank of one horizontal dimension they are per unit of width.
    """
    units = dict.fromkeys(FORCES, "N") | dict.fromkeys(MOMENTS, "N m")
    if dimensions == 1:
        units = {"force_x": "N/m", "force_z": "N/m", "moment_y": "N m/m"}
    return ["t [s]", *(f"{name} {wall} [{unit}]" for wall in walls for name, unit in units.items())]


def paddle_columns(places: Vector | None) -> list[str]:
    """Return the columns of a paddle; for a segmented one, of each position y along it [m]."""
    at = [""] if places is None else [f"@y={y:.6g}" for y in places]
    return ["t [s]", *(f"{name}{place} [{unit}]" for name, unit in RATES.items() for place in at)]


def probe_quantities(dimensions: int) -> dict[str, tuple[str, str]]:
    """Return unit and meaning of each quantity of a probe by its name, vectors by their components.

    A tank of one horizontal dimension has no component along y.
    """
    axes = "xyz" if dimensions == 2 else "xz"
    each = ((axis, name, units, text) for name, (units, text) in VECTORS.items() for axis in axes)
    vectors = {f"{name}_{axis}": (units, f"{text}, along {axis}") for axis, name, units, text in each}
    return vectors | {"pressure": PRESSURE}


def gauge_columns(gauges: Sequence[tuple[str, float] | tuple[str, float, float]]) -> list[str]:
    """Return the columns of gauges, given name, x and (if not 0) y [m]."""
    return ["t [s]", *(position_label(*gauge) for gauge in gauges)]


def probe_columns(points: Sequence[tuple[str, float, float, float]], dimensions: int) -> list[str]:
    """Return the columns of probes: all quantities of the first point, given name, x, y and z [m], then of the next."""
    quantities = probe_quantities(dimensions).items()
    return ["t [s]", *(f"{name} {position_label(*at)} [{units}]" for at in points for name, (units, _) in quantities)]


# ---------------------------------------------------------------- variables
def gauge_array(
    names: Sequence[str], x: ArrayLike, y: ArrayLike, t: ArrayLike, eta: ArrayLike, **attributes: Any
) -> "DataArray":
    """Return elevation [m], shape (gauges, N), over gauges at x and y [m] and times [s]."""
    from xarray import DataArray

    coordinates = {
        "gauge": list(names),
        "time": ("time", np.asarray(t, dtype=float), TIME),
        "x": ("gauge", np.asarray(x, dtype=float), ALONG),
        "y": ("gauge", np.asarray(y, dtype=float), ACROSS),
    }
    values = np.asarray(eta, dtype=float)
    return DataArray(values, coordinates, ("gauge", "time"), name="elevation", attrs=ELEVATION | attributes)


def quantity_attributes(name: str) -> dict[str, str]:
    """Return the CF attributes of a quantity of probes and windows."""
    units, meaning = probe_quantities(2)[name]
    standard_name = {"standard_name": STANDARD_NAMES[name]} if name in STANDARD_NAMES else {}
    return {"units": units, "long_name": meaning} | standard_name


def station_variables(dimension: str, header: Sequence[str], rows: Vector) -> dict[str, Variable]:
    """Return time, stations with their positions, and each quantity over station and time; NaN if it is missing.

    Parameters
    ----------
    dimension
        Kind of the stations: ``"gauge"``, ``"probe"`` or ``"wall"``.
    header
        The columns, time first. Raises ``ValueError`` or ``KeyError`` for those of another table.
    rows
        Their values, shape (times, columns).
    """
    columns = [_parsed(dimension, column) for column in header[1:]]
    stations = list(dict.fromkeys((name, position) for _, name, position, _ in columns))
    axes = {"gauge": "xy", "probe": "xyz", "wall": ""}[dimension]
    positions = np.array([position for _, position in stations], dtype=float).reshape(len(stations), len(axes))
    names = np.array([name for name, _ in stations], dtype=str)
    result = {
        "time": Variable(("time",), rows[:, 0], TIME),
        dimension: Variable((dimension,), names, {"cf_role": "timeseries_id", "long_name": f"name of the {dimension}"}),
        **{axis: Variable((dimension,), positions[:, n], AXES[axis]) for n, axis in enumerate(axes)},
    }
    quantities = {name: attributes for name, _, _, attributes in columns}
    for name, attributes in ({"elevation": ELEVATION} if dimension == "gauge" else quantities).items():
        result[name] = Variable((dimension, "time"), np.full((len(stations), len(rows)), np.nan), attributes)
    for (name, station, position, _), values in zip(columns, rows.T[1:], strict=True):
        result[name].values[stations.index((station, position))] = values
    return result


def with_standard_error(
    blocks: Iterable[dict[str, Variable]], errors: NDArray[np.float64]
) -> Iterator[dict[str, Variable]]:
    """Yield blocks of variables of gauges with the standard error of the elevation [m], shape (gauges, times).

    The error is an ancillary variable of the elevation (CF 1.8, section 3.4).
    """
    begin = 0
    for block in blocks:
        elevation = block["elevation"]
        part = errors[:, begin : begin + elevation.values.shape[1]]
        begin += elevation.values.shape[1]
        name = f"{elevation.attributes['standard_name']} standard_error"
        error = Variable(elevation.dimensions, part, {"units": "m", "standard_name": name})
        attributes = {**elevation.attributes, "ancillary_variables": STANDARD_ERROR}
        yield {**block, "elevation": elevation._replace(attributes=attributes), STANDARD_ERROR: error}


def _parsed(dimension: str, column: str) -> tuple[str, str, tuple[float, ...], Mapping[str, str]]:
    """Return quantity, station, its position [m] and the attributes of the quantity."""
    if dimension == "gauge":
        name, x, y, _ = parse_position_label(column)
        return "elevation", name, (x, y), ELEVATION
    label, _, units = column.removesuffix("]").rpartition(" [")
    quantity, _, station = label.partition(" ")
    if dimension == "wall":
        return quantity, station, (), {"units": units, "long_name": quantity.replace("_", " along ")}
    name, *at = parse_position_label(station)
    attributes = dict(zip(("units", "long_name"), probe_quantities(2)[quantity], strict=True))
    return quantity, name, tuple(at), attributes


def time_variables(header: Sequence[str], rows: Vector) -> dict[str, Variable]:
    """Return the columns of a table over time by name; those at several positions y [m] also over y."""
    columns: dict[tuple[str, str], dict[str, Vector]] = {}
    for column, values in zip(header[1:], rows.T[1:], strict=True):
        label, _, units = column.removesuffix("]").partition(" [")
        name, _, y = label.partition("@y=")
        columns.setdefault((name, units), {})[y] = values
    result = {"time": Variable(("time",), rows[:, 0], TIME)}
    for (name, units), by_place in columns.items():
        attributes = {"units": units, "long_name": name.replace("_", " ")}
        if "" in by_place:
            result[name] = Variable(("time",), by_place[""], attributes)
        else:
            result["y"] = Variable(("y",), np.array([*map(float, by_place)]), ACROSS)
            result[name] = Variable(("time", "y"), np.column_stack([*by_place.values()]), attributes)
    return result


def point_variables(header: Sequence[str], rows: Vector) -> dict[str, Variable]:
    """Return the columns of a table without times over point, by name, with their units."""
    heads = [head.removesuffix("]").partition(" [") for head in header]
    columns = zip(heads, rows.T, strict=True)
    return {name: Variable(("point",), column, {"units": units}) for (name, _, units), column in columns}


def window_variables(header: Sequence[str], rows: Vector) -> dict[str, Variable]:
    """Return the variables of the table of a window at complete times."""
    names = [one.partition(" [")[0] for one in header]
    at = [n for n, name in enumerate(names) if name in ("x", "y")]
    time, counts = np.unique(rows[:, 0], return_counts=True)
    each = int(counts[0]) if counts.size else 1
    columns = len(np.unique(rows[:each, at], axis=0)) if counts.size else 1
    time = time[counts == each]
    values = rows[: time.size * each].reshape(time.size, columns, -1, len(names))
    result = {
        "time": Variable(("time",), time, TIME),
        "y": Variable(("column",), np.zeros(columns), ACROSS),
        "zeta": Variable(("level",), np.linspace(0.0, 1.0, values.shape[2]), ZETA),
    }
    for n, name in enumerate(names[1:], start=1):
        if n in at:
            result[name] = Variable(("column",), values[0, :, 0, n] if time.size else np.zeros(columns), AXES[name])
        elif name == "elevation":
            result[name] = Variable(("time", "column"), values[:, :, 0, n], ELEVATION)
        else:
            attributes = UPWARDS if name == "z" else quantity_attributes(name) | {"coordinates": "x y z"}
            result[name] = Variable(("time", "column", "level"), values[..., n], attributes)
    return result
