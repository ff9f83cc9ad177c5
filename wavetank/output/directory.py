"""The run directory: the files of a run, written during the computation, so that a killed run has records.

    manifest.json   the evaluated case, versions, host, command, git revision, timings, counters, status
    gauges.csv      t [s], then one column per gauge, elevation [m]; the header has names and positions, "5@x=50" or
                    "5@x=50;y=2" if y is not 0
    gauges.nc       the same as CF-NetCDF, after the end of the run, with the standard error if there is a certificate
    certificate.nc  the numerical uncertainty of the records (``recording/certify.py``), after the end of the run
    energy.csv      the energy budget, units in the header
    paddle.csv      position [m], velocity [m/s], acceleration [m/s^2] of a moving wall at the times of the gauges;
                    for a segmented one at positions along it, "position@y=2 [m]"; for a far wall in far-paddle.csv
    probes.csv      velocity [m/s], accelerations [m/s^2] and pressure [Pa] of each probe, empty while it is dry:
                    "velocity_x A@x=2;z=-0.1 [m/s]"
    probes.nc       the same as CF-NetCDF, after the end of the run
    loads.csv       force and moment on walls, "force_x paddle [N/m]", of a slice per width
    window-NAME.nc  kinematics of columns of water, for other programs (``fields.py``), or window-NAME.csv
    surface.nc      of a slice or ring, snapshots of x [m], elevation [m], surface potential [m²/s], as CF-NetCDF
    surface.xdmf    index of surface.nc for ParaView
    surface.pvd, velocity.pvd, fields/     snapshots for ParaView, written by all ranks (``fields.py``)
    checkpoint.zip  the state of the run for a restart, at intervals; ``checkpoint-before.zip`` is the one before
    bed.csv         of a bed by a Python function, its depth [m] at the degrees of freedom
    broken.csv      the last surface of a run that broke down; drawn in broken.png
    breaking.csv    crests above the threshold of breaking, after the end of the run; absent without such crests
    run.log         the messages of the run: its summary, progress, warnings, and the cause of its end
    .lock           during the computation (``files.py``)

The first rank writes all files (``writer.py``) except the fields. Snapshots are passed to the operating system at once,
rows of tables in blocks of about a second. A run that is killed, or that ends by an error on some of its ranks, loses
the rows of the last block; a resumed run computes them again. Readers ignore incomplete records. All numbers are
finite.
"""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO
from pathlib import Path
from socket import gethostname
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from wavetank.base.errors import InputError
from wavetank.base.run_warning import RunWarning, run_warning
from wavetank.output.columns import (
    Variable,
    point_variables,
    station_variables,
    time_variables,
    window_variables,
    with_standard_error,
)
from wavetank.output.fields import index_file, read_index, read_snapshots, window_file
from wavetank.output.files import FIELDS, check_entries, is_locked, open_regular
from wavetank.output.manifest import read_manifest
from wavetank.output.netcdf import complete_records, conventions, write_records
from wavetank.output.tables import read_blocks

if TYPE_CHECKING:
    import xarray

SURFACE, SURFACE_INDEX = "surface.nc", "surface.xdmf"
TABLES = GAUGES, ENERGY, PADDLE, FAR_PADDLE, PROBES, LOADS = (
    *("gauges.csv", "energy.csv", "paddle.csv", "far-paddle.csv", "probes.csv", "loads.csv"),
)
PADDLES = {"wall": PADDLE, "far_wall": FAR_PADDLE}  # file names by the key of the wall
STATIONS = {GAUGES: "gauge", PROBES: "probe", LOADS: "wall"}  # dimensions of the tables of stations
NAMES = {GAUGES: "NAME@x=METRES, NAME@x=METRES;y=METRES", PROBES: "QUANTITY NAME@x=METRES;z=METRES [UNITS]"}
COPIES = {GAUGES: "gauges.nc", PROBES: "probes.nc"}  # copies as CF-NetCDF, after the end of the run
DERIVED = COPIES | {SURFACE: SURFACE_INDEX}
CHECKPOINT, CHECKPOINT_BEFORE = "checkpoint.zip", "checkpoint-before.zip"
CERTIFICATE = "certificate.nc"
CERTIFIED = ["elevation_uncertainty", "crest_time", "crest_height_uncertainty"]  # quantities that are read
BED = "bed.csv"
BROKEN, BROKEN_PICTURE = BROKENS = "broken.csv", "broken.png"
BREAKING = "breaking.csv"
POINT_TABLES = BROKEN, BED  # tables without times
PLACES = ["x", "y", "z", "zeta"]  # names of coordinates
CHECKPOINTS = CHECKPOINT, CHECKPOINT_BEFORE, f".{CHECKPOINT}"  # the last one: temporary file
SERIES, LOG = ("surface", "velocity"), "run.log"
REST_POSITION = "rest position"  # (x, y) [m] in the reference tank, of the points of a surface
VIEWS = "view.png", "view.mp4", "view.gif"
PICTURES = "surface.png", "gauges.png", "energy.png", "probes.png", "loads.png", *VIEWS
ANALYSES = "compare.png", "compare.csv", "compare-harmonics.*", "analysis-*.png", "analysis-*.csv"
LINES = 2**12  # bytes, more than a row of energies
FINAL_MANIFEST_SIZE = 2**14  # bytes reserved for the final manifest on a full disk, in addition to its present content


def derived_files(run: Path) -> Iterator[Path]:
    """Yield the files and pictures in a run directory that are made from its records after the run."""
    for pattern in (*BROKENS, BREAKING, CERTIFICATE, *COPIES.values(), *PICTURES, *ANALYSES):
        yield from run.glob(pattern)


def record_files(run: Path) -> Iterator[Path]:
    """Yield the records in a run directory, and the files made from them."""
    yield from derived_files(run)
    files = (*TABLES, BED, SURFACE, SURFACE_INDEX, LOG, *CHECKPOINTS)
    indices = (*(f"{name}.pvd" for name in SERIES), "window-*.nc", "window-*.csv")
    pieces = (f"{FIELDS}/{name}_*.{kind}" for name in SERIES for kind in ("vtu", "pvtu"))
    for pattern in (*files, *indices, *pieces):
        yield from run.glob(pattern)


class RunDirectory:
    """A reader of a run directory, also during the run and after a kill.

    Raises ``InputError`` if there is none at ``path``, or if a requested file is missing or damaged.
    """

    def __init__(self, path: Path | str):
        self.path = Path(path)
        self.manifest = read_manifest(self.path)
        check_entries(self.path)

    def __repr__(self) -> str:
        return f"RunDirectory({str(self.path)!r})"

    @property
    def status(self) -> str:
        """The status of the run.

        ``"running"``, ``"finished"``, ``"stopped"`` by a signal, ``"broke down"`` if the water could not be computed,
        ``"failed"`` for another reason, ``"killed"`` if no process writes it, or ``"unknown"`` on another host.
        """
        status = str(self.manifest.get("status", ""))
        if status != "running":
            return status
        if is_locked(self.path):
            return "running"
        status = str(read_manifest(self.path).get("status"))  # the lock is released after the final manifest
        if status != "running":
            return status
        return "killed" if self.manifest.get("host", gethostname()) == gethostname() else "unknown"

    @property
    def reached(self) -> float | None:
        """The time [s] of the last complete row of energies, which may exceed that of the manifest; None without."""
        with suppress(OSError, ValueError), open_regular(self.path / ENERGY) as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - LINES))
            *_, last, _ = file.read().split(b"\n")  # without an incomplete line
            return float(last.partition(b",")[0])
        return None

    @property
    def warnings(self) -> list[RunWarning]:
        """The warnings of the run, most severe first."""
        return [run_warning(one) for one in self.manifest.get("warnings", [])]

    @property
    def title(self) -> str:
        """The title of the case."""
        return str(self.manifest.get("case", {}).get("title", ""))

    # ------------------------------------------------------------ as xarray, which takes a second to load
    @property
    def gauges(self) -> "xarray.DataArray":
        """The elevation [m] over gauge and time [s]; gauges have names and positions x and y [m]."""
        elevation: xarray.DataArray = self._dataset(GAUGES).elevation
        return elevation.assign_attrs(source="computed")

    @property
    def energy(self) -> "xarray.Dataset":
        """The energy budget over time [s], each column by name, with units."""
        return self._dataset(ENERGY)

    @property
    def paddle(self) -> "xarray.Dataset":
        """Position [m], velocity [m/s] and acceleration [m/s^2] over time [s], and along a segmented paddle over y [m].

        Raises ``InputError`` for a fixed wall.
        """
        return self._motion("wall")

    @property
    def far_paddle(self) -> "xarray.Dataset":
        """The same for the far wall, positive into the water, towards -x."""
        return self._motion("far_wall")

    def _motion(self, wall: str) -> "xarray.Dataset":
        """Return the record of a wall by its key."""
        if self.manifest.get("case", {}).get(wall, {}).get("type") == "fixed":
            name = wall.replace("_", " ")
            raise InputError(f"{self.path}: the {name} does not move in this run, so there is no record of a paddle.")
        return self._dataset(PADDLES[wall])

    @property
    def probes(self) -> "xarray.Dataset":
        """Quantities at probes over probe and time [s], by name, with units; NaN: dry.

        Probes have names and positions x, y and z [m]. Raises ``InputError`` without probes.
        """
        return self._dataset(PROBES)

    @property
    def loads(self) -> "xarray.Dataset":
        """Forces and moments over wall and time [s], by name, with units, of a slice per width.

        Walls are named as in loads. Raises ``InputError`` without loads.
        """
        return self._dataset(LOADS)

    @property
    def certificate(self) -> "xarray.Dataset":
        """The numerical uncertainty of the records at a confidence of 95 %; see ``recording/certify.py``.

        Raises ``InputError`` without certificate, and for a damaged one.
        """
        from xarray import load_dataset

        if not (self.path / CERTIFICATE).exists():
            stated = self.manifest.get("certificate", {}).get("reason")
            raise InputError(f"{self.path}: has no certificate; {stated or '`wavetank run CASE --certify` makes one'}.")
        with self._reading(CERTIFICATE), open_regular(self.path / CERTIFICATE) as file:
            content = BytesIO(file.read())
        try:
            result = load_dataset(content, engine="scipy")
            _ = result[CERTIFIED]
            return result
        except (TypeError, ValueError, KeyError, OSError, IndexError) as error:
            raise InputError(f"{self.path / CERTIFICATE}: is damaged ({error}).") from None

    @property
    def surface(self) -> "xarray.Dataset":
        """``elevation`` [m] and ``surface_potential`` [m²/s] of a slice or ring over time [s] and position.

        With a fixed mesh the positions are x [m]; otherwise points, with x [m] at each time. Raises ``InputError`` for
        a basin, whose surface is in ``surface.pvd``.
        """
        data = self.snapshots()
        if not data.time.size:
            raise InputError(f"{self.path}: has no snapshot of the surface.")
        if (data.x == data.x[0]).all():
            return data.assign_coords(x=data.x[0].drop_vars("time")).swap_dims(point="x")
        return data

    def snapshots(self) -> "xarray.Dataset":
        """Return ``surface`` over time and point, also without snapshots, as in a run killed before the first one.

        ``x`` [m] of each point depends on time, because the paddle moves the mesh; at point 0 it is the position of the
        paddle.
        """
        if index_file(self.path, "surface").exists():
            raise InputError(f"{self.path}: its surface is a basin's, in surface.pvd, which pyvista and ParaView open.")
        return read_snapshots(self._complete_netcdf(SURFACE), self.path / SURFACE)

    def window(self, name: str) -> "xarray.Dataset":
        """Return the kinematics of a window over time [s], column and level; for a table, those in it.

        Raises ``InputError`` if there is no such window, or no row of it.
        """
        from xarray import load_dataset

        file, table = (window_file(name, form) for form in ("netcdf", "csv"))
        if (self.path / table).exists():
            data = self._dataset(table)
            if not data.time.size:
                raise InputError(f"{self.path / table}: has no row.")
            return data
        if not (self.path / file).exists():
            there = ", ".join(sorted(path.stem.removeprefix("window-") for path in self.path.glob("window-*.*")))
            raise InputError(f"{self.path}: has no window {name!r}; there are {there or 'none'}.")
        if not (content := self._complete_netcdf(file)):
            raise InputError(f"{self.path / file}: has no row.")
        return load_dataset(BytesIO(content), engine="scipy").set_coords(PLACES)

    def broken(self) -> "xarray.Dataset":
        """Return the last surface of a run that broke down, over point.

        x, y (of a basin) [m], elevation [m], slope [-], velocity [m/s]. Raises ``InputError`` without this record.
        """
        return self._dataset(BROKEN)

    def bed(self) -> "xarray.Dataset":
        """Return the depth of a bed by a Python function over point: x, y (of a basin) and depth [m].

        Raises ``InputError`` without this record.
        """
        return self._dataset(BED)

    # ------------------------------------------------------------ as files
    def write_netcdf(self, table: str, file: BinaryIO) -> None:
        """Write one of ``COPIES`` as CF-NetCDF of time series at stations (CF 1.8, section H.2), with times as records.

        The memory does not depend on the number of rows. Raises ``InputError`` without this record.
        """

        def described(variables: dict[str, Variable]) -> dict[str, Variable]:
            details: dict[str, str | np.float64] = {
                "coordinates": " ".join(name for name in PLACES if name in variables),
                "_FillValue": np.float64(np.nan),  # before a gauge existed, or while a probe is dry
            }
            return {
                name: Variable(one.dimensions[::-1], one.values.T, {**one.attributes, **details})
                if len(one.dimensions) == 2
                else one
                for name, one in variables.items()
            }

        blocks: Iterator[dict[str, Variable]] = (
            self._variables(table, *block) for block in self._blocks(table) if block[1].size
        )
        if table == GAUGES and (self.path / CERTIFICATE).exists():
            blocks = with_standard_error(blocks, self.certificate.elevation_uncertainty.values / 2)
        if not write_records(file, map(described, blocks), conventions(self.manifest) | {"featureType": "timeSeries"}):
            raise InputError(f"{table} has no row")

    def fields(self, name: str) -> list[tuple[float, Path]]:
        """Return time [s] and file, for pyvista or ParaView, of each snapshot of a series, one of ``SERIES``."""
        if name == "surface" and (self.path / SURFACE).exists():
            raise InputError(f"{self.path}: its surface is a slice's or ring's, in {SURFACE}: `.surface` reads it.")
        with self._reading(index_file(self.path, name).name):
            return read_index(self.path, name)

    def _complete_netcdf(self, file: str) -> bytes:
        """Return the complete records of a NetCDF file that is being written."""
        with self._reading(file), open_regular(self.path / file) as content:
            try:
                return complete_records(content.read())
            except ValueError as error:
                raise InputError(f"{self.path / file}: {error}.") from None

    def _dataset(self, file: str) -> "xarray.Dataset":
        """Return a table as a data set."""
        from xarray import Dataset

        variables = self._variables(file, *self._table(file))
        coordinates = [] if file in POINT_TABLES else [name for name in PLACES if name in variables]
        return Dataset(variables).set_coords(coordinates)

    def _variables(self, file: str, header: Sequence[str], rows: NDArray[np.float64]) -> dict[str, Variable]:
        """Return columns of a table as variables over stations, points or time, or those of a window."""
        if file in POINT_TABLES:
            return point_variables(header, rows)
        if file not in STATIONS:
            return time_variables(header, rows) if file in TABLES else window_variables(header, rows)
        try:
            return station_variables(STATIONS[file], header, rows)
        except (KeyError, ValueError):
            allowed = f"; allowed are {NAMES[file]}" if file in NAMES else ""
            raise InputError(f"{self.path / file}: column names {header[1:]}{allowed}.") from None

    def _table(self, file: str) -> tuple[list[str], NDArray[np.float64]]:
        """Return column names and complete rows, shape (rows, columns)."""
        (header, *_), blocks = zip(*self._blocks(file), strict=True)
        return header, np.concatenate(blocks)

    def _blocks(self, file: str) -> Iterator[tuple[list[str], NDArray[np.float64]]]:
        """Yield column names and complete rows in blocks, each of shape (rows, columns); the first has no row."""
        with self._reading(file), open_regular(self.path / file) as table:
            yield from read_blocks(table, self.path / file, ascending=file in TABLES)

    @contextmanager
    def _reading(self, file: str) -> Iterator[None]:
        """Raise ``InputError`` with the name of the file for an ``OSError`` of the block."""
        try:
            yield
        except OSError as error:
            raise InputError(f"{self.path}: has no readable {file} ({error.strerror}).") from None


def open_run(path: Path | str) -> RunDirectory:
    """Return the reader of a run directory; raises ``InputError`` if there is none."""
    return RunDirectory(path)
