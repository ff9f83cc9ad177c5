"""Input of OpenFAST's module SeaState: wave elevation (WaveMod 5) and full kinematics (WaveMod 6) of external waves.

Documentation: OpenFAST, user documentation of SeaState, "Input Files" (``docs/source/user/seastate/input_files.rst``).
It describes files of kinematics without header and with one line for each time. SeaState of OpenFAST 4 itself reads 13
lines of header, then for each time a line for each z and y with the values of all x (``UserWaves_Init``), and writes
such files with ``WrWvKinMod = 2``. This module writes what the program reads. The order of the nodes is that of the
documentation: x first, then y, then z, each ascending.

SeaState's grid ends at still water. With Wheeler stretching (WaveStMod 3) SeaState evaluates a point at height z below
an elevation η at the node height z' with (d + z') / d = (d + z) / (d + η). The nodes therefore contain the flow at
these relative heights of the column, so that SeaState obtains the recorded flow up to the surface.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from math import ceil
from pathlib import Path

import numpy as np

from wavetank.base.errors import InputError
from wavetank.output.files import atomic_file
from wavetank.output.water_columns import Array, WaterColumns

KINEMATICS = {  # extension of a file: quantity of a window, its description in the header
    ".Vxi": ("velocity_x", "Fluid velocity along x (m/s)"),
    ".Vyi": ("velocity_y", "Fluid velocity along y (m/s)"),
    ".Vzi": ("velocity_z", "Fluid velocity along z (m/s)"),
    ".Axi": ("acceleration_x", "Fluid acceleration along x (m/s^2)"),
    ".Ayi": ("acceleration_y", "Fluid acceleration along y (m/s^2)"),
    ".Azi": ("acceleration_z", "Fluid acceleration along z (m/s^2)"),
    ".DynP": ("pressure", "Dynamic pressure (Pa)"),
}
ELEVATION = ".Elev"
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23)  # factors of half the number of steps with WaveMod 5
EQUAL = 1e-6  # largest difference of distances and depths, relative to the distance or depth
GRID = (
    "SeaState's grid has an odd number of columns along x at equal distances, at least 3, in water of constant depth, "
    "such as start = [2.0, 0.0], end = [6.0, 0.0], columns = 21 of [[windows]]; along y such a window at each of an "
    "odd number of equidistant y, or one"
)


@dataclass(frozen=True)
class SeaStateGrid:
    """SeaState's grid of nodes, centred at the middle of the columns.

    Attributes
    ----------
    order
        Index of the column of each node, shape (NY, NX); of a slice NY is 1 and the lines of nodes along y are equal.
    half_widths
        Half widths along x and y [m].
    lines
        Number of lines of nodes along y.
    depth
        Depth of the grid [m].
    levels
        Number of nodes over the depth.
    """

    order: np.ndarray[tuple[int, int], np.dtype[np.intp]]
    half_widths: tuple[float, float]
    lines: int
    depth: float
    levels: int

    @property
    def heights(self) -> Array:
        """Heights of the nodes above still water [m], ascending, shape (levels,)."""
        theta = np.pi / 2 * np.arange(self.levels)[::-1] / (self.levels - 1)
        return self.depth * (np.cos(theta) - 1.0)

    @property
    def middle(self) -> int:
        """Index of the column at the origin of SeaState."""
        return int(self.order[self.order.shape[0] // 2, self.order.shape[1] // 2])


def seastate_grid(columns: WaterColumns, width: float | None = None) -> SeaStateGrid:
    """Return the grid of columns; ``width`` [m] is that of the grid of a slice, default: its length.

    Raises ``InputError`` if the columns are no grid of SeaState.
    """
    order = np.lexsort((columns.x, columns.y))
    x, y = columns.x[order], columns.y[order]
    length = float(np.ptp(x)) or 1.0
    lines = 1 + int((np.diff(y) > EQUAL * length).sum())
    if len(x) % lines:
        raise InputError(f"{columns.source}: {len(x)} columns at {lines} different y received; {GRID}.")
    x, y = x.reshape(lines, -1), y.reshape(lines, -1)
    half_widths = []
    for name, places in (("x", x), ("y", y.T)):
        number, distances = places.shape[1], np.diff(places[0])
        if name == "y" and number == 1:
            half_widths.append((width or length) / 2)
            continue
        if number < 3 or number % 2 == 0:
            raise InputError(f"{columns.source}: {number} columns along {name} received; {GRID}.")
        if np.ptp(places, axis=0).max() > EQUAL * length or np.ptp(distances) > EQUAL * distances.mean():
            raise InputError(f"{columns.source}: unequal distances along {name} received; {GRID}.")
        half_widths.append(float(np.ptp(places[0])) / 2)
    low, high = float(columns.depth.min()), float(columns.depth.max())
    if high - low > EQUAL * high:
        raise InputError(f"{columns.source}: depths from {low:.6g} to {high:.6g} m received; {GRID}.")
    return SeaStateGrid(
        order.reshape(lines, -1), (half_widths[0], half_widths[1]), max(3, lines), high, len(columns.zeta)
    )


def check_kinematics(columns: WaterColumns) -> None:
    """Raise ``InputError`` for a table, which has no accelerations."""
    if "acceleration_x" not in columns.quantities:
        needed = 'WaveMod 6 needs accelerations, which format = "netcdf" of [[windows]] records'
        raise InputError(f"{columns.source}: has no accelerations; {needed}.")


def wave_time(rows: int, dt: str, *, periodic: bool) -> str:
    """Return WaveTMax for a number of rows with an interval, both as decimal numbers.

    SeaState takes ``ceil(WaveTMax / WaveDT)`` steps, which must not exceed the rows after the first. With periodic
    waves (WaveMod 5) it extends the record by still water unless this number is even and half of it is a product of
    ``PRIMES``; it also compares the last time with WaveTMax in single precision, so that one more row is needed.
    """
    for steps in range(rows - 1 - periodic, 0, -1):
        duration = str(Decimal(dt) * steps)
        if ceil(float(duration) / float(dt)) == steps and (not periodic or _has_small_factors(steps)):
            return duration
    raise InputError(f"{rows} rows received; WaveMod 5 of SeaState needs at least 4.")


def _has_small_factors(steps: int) -> bool:
    """Return whether a number is even and its half is a product of ``PRIMES``."""
    half, odd = divmod(steps, 2)
    for prime in PRIMES:
        while half > 1 and half % prime == 0:
            half //= prime
    return not odd and half == 1


def write_openfast(folder: Path, name: str, columns: WaterColumns, grid: SeaStateGrid | None) -> list[Path]:
    """Write the files of a window for SeaState; return their paths.

    Parameters
    ----------
    folder
        Output folder.
    name
        Root name of the files: ``NAME.Vxi`` and others of WaveMod 6, ``NAME-elevation.Elev`` of WaveMod 5, and
        ``NAME-SeaState.txt`` with the lines of SeaState's input file.
    columns
        The columns of water.
    grid
        Grid of WaveMod 6; None for the elevation alone, at the first column.
    """
    dt = f"{columns.dt:.10g}"
    t = [Decimal(dt) * n if n else 0 for n in range(len(columns.elevation))]
    middle = columns.elevation[:, 0 if grid is None else grid.middle]
    record = [
        f"Time Elevation\n{'(s)':4} (m)\n",
        *(f"{at} {eta:.8e}\n" for at, eta in zip(t, middle, strict=True)),
    ]
    files: dict[str, Iterator[str]] = {f"{name}-elevation{ELEVATION}": iter(record)}
    lines = [f"SeaState's input for {columns.source}; its time 0 is {columns.begin:.10g} s of the run", ""]
    if grid is not None:
        header = list(_header(grid, dt))
        zeta = 1.0 + grid.heights / grid.depth
        for extension, (quantity, meaning) in KINEMATICS.items():
            files[f"{name}{extension}"] = _rows(columns, grid, quantity, zeta, [meaning, *header])
        eta = columns.elevation[:, None, grid.order]  # times, levels (one), lines, nodes
        files[f"{name}{ELEVATION}"] = _lines(eta, grid.lines, ["Wave elevation (m)", *header])
        lines += ["WaveMod 6: full kinematics", *_settings(columns, grid, name, dt), ""]
    lines += ["WaveMod 5: elevation alone, of first order", *_settings(columns, None, f"{name}-elevation", dt)]
    files[f"{name}-SeaState.txt"] = (f"{line}\n" for line in lines)
    for file, text in files.items():
        with atomic_file(folder / file) as content:
            content.writelines(one.encode() for one in text)
    return [folder / file for file in files]


def _rows(columns: WaterColumns, grid: SeaStateGrid, name: str, zeta: Array, header: list[str]) -> Iterator[str]:
    """Yield the text of a quantity at the nodes."""
    values = columns.values(name, zeta)  # times, columns, levels
    if name == "pressure":  # without the hydrostatic pressure of still water
        h = grid.depth + columns.elevation[:, :, None]
        values = values + columns.density * columns.gravity * (h * zeta - grid.depth)
    yield from _lines(np.moveaxis(values, 2, 1)[:, :, grid.order], grid.lines, header)


def _lines(values: Array, lines: int, header: list[str]) -> Iterator[str]:
    """Yield a header and values over times, levels, lines and nodes; those of a slice are equal on each line."""
    yield "Wave kinematics of wavetank\n"
    yield from (f"{line}\n" for line in header)
    each = lines // values.shape[2]
    for of_time in values:
        yield "".join(f" {_numbers(row)}\n" * each for row in of_time.reshape(-1, of_time.shape[-1]))


def _header(grid: SeaStateGrid, dt: str) -> Iterator[str]:
    """Yield the last 11 of the 13 lines of a header, which SeaState skips."""
    nodes = grid.order.shape[1]
    sizes = zip(grid.half_widths, (nodes, grid.lines), strict=True)
    x, y = (np.linspace(-half, half, n, dtype=np.float64) for half, n in sizes)
    yield f"! {dt} - WaveDT (s)"
    yield from (f"! {n} - number of nodes along {axis}" for n, axis in ((nodes, "x"), (grid.lines, "y")))
    yield f"! {grid.levels} - number of nodes along z"
    yield from (f"! {at[1] - at[0]:.8g} - distance of nodes along {axis} (m)" for at, axis in ((x, "x"), (y, "y")))
    yield f"! {grid.depth:.8g} - Z_Depth (m)"
    yield f"! {np.pi / 2 / (grid.levels - 1):.8g} - step of the angle of nodes along z (rad)"
    yield from (f"! {_numbers(at)} - {axis} (m)" for at, axis in ((x, "x"), (y, "y"), (grid.heights, "z")))


def _settings(columns: WaterColumns, grid: SeaStateGrid | None, name: str, dt: str) -> Iterator[str]:
    """Yield the lines of SeaState's input file that an input of external waves needs, in their order."""
    depth = float(columns.depth[0]) if grid is None else grid.depth
    settings: dict[str, object] = {"WtrDens": f"{columns.density:g}", "WtrDpth": f"{depth:.8g}", "MSL2SWL": 0}
    if grid is not None:
        settings |= {
            "X_HalfWidth": f"{grid.half_widths[0]:.8g}",
            "Y_HalfWidth": f"{grid.half_widths[1]:.8g}",
            "Z_Depth": f"{grid.depth:.8g}",
            "NX": (grid.order.shape[1] + 1) // 2,
            "NY": (grid.lines + 1) // 2,
            "NZ": grid.levels,
        }
    settings |= {"WaveMod": 5 if grid is None else 6}
    settings |= {} if grid is None else {"WaveStMod": 3}
    settings |= {"WaveTMax": wave_time(len(columns.elevation), dt, periodic=grid is None), "WaveDT": dt}
    settings |= {"WvLowCOff": 0, "WvHiCOff": f"{np.pi / columns.dt:.8g}", "WaveDir": 0} if grid is None else {}
    settings |= {"WvKinFile": f'"{name}"', "WvDiffQTF": "FALSE", "WvSumQTF": "FALSE", "CurrMod": 0, "MCFD": 0}
    yield from (f"{value!s:>20}   {key}" for key, value in settings.items())


def _numbers(values: Array) -> str:
    """Return numbers as text of seven digits, separated by blanks."""
    return " ".join(f"{value:.6e}" for value in values)
