"""Windows as input of other programs. Oracle: a stream-function wave, read by the rules of the programs."""

import json
import re
from dataclasses import replace
from math import ceil
from pathlib import Path

import numpy as np
import pytest
from conftest import commanded
from mpi4py import MPI
from records import refusal
from rich.console import Console
from scipy.interpolate import CubicSpline, RegularGridInterpolator

from wavetank import data
from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.case.output import RecordTarget
from wavetank.output.columns import Variable
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import surface_variables, window_columns, window_record, window_row, window_rows
from wavetank.output.netcdf import conventions, netcdf, write_records
from wavetank.output.openfast import KINEMATICS, wave_time
from wavetank.output.water_columns import water_columns
from wavetank.recording import record_run
from wavetank.waves.stream_function import stream_function_wave

DEPTH, GRAVITY, DENSITY = 0.5, 9.81, 1025.0
HEIGHT, LENGTH = 0.1, 2.5
WAVE = stream_function_wave(HEIGHT, LENGTH, depth=DEPTH)
DT, ROWS = 0.02, 41
T = DT * np.arange(ROWS)
X = np.linspace(2.0, 3.0, 11)


class Flow:
    """The flow below a wave of permanent form: harmonics of the potential fitted to that of the surface."""

    def __init__(self):
        x = LENGTH * np.linspace(0.0, 0.5, 200)
        eta, psi = WAVE.surface(x)
        self.k = 2 * np.pi / LENGTH * np.arange(1, 16)
        self.amplitudes = np.linalg.lstsq(self._cosh(eta[:, None]) * np.sin(self.k * x[:, None]), psi, rcond=None)[0]
        self.constant = 0.0
        self.constant = float(self(x, eta, 0.0)["pressure"][0])

    def _cosh(self, z):
        return np.cosh(self.k * (z + DEPTH)) / np.cosh(self.k * DEPTH)

    def __call__(self, x, z, t):
        """Return the quantities of a window at points and times."""
        theta = self.k * (np.asarray(x) - WAVE.speed * np.asarray(t))[..., None]
        z = np.asarray(z)[..., None]
        up, slope = self._cosh(z), np.sinh(self.k * (z + DEPTH)) / np.cosh(self.k * DEPTH)
        a, k, c = self.amplitudes, self.k, WAVE.speed
        u, w = (a * k * up * np.cos(theta)).sum(-1), (a * k * slope * np.sin(theta)).sum(-1)
        u_x, w_x = -(a * k**2 * up * np.sin(theta)).sum(-1), (a * k**2 * slope * np.cos(theta)).sum(-1)
        local = {"local_acceleration_x": -c * u_x, "local_acceleration_z": -c * w_x}
        total = {"acceleration_x": (u - c) * u_x + w * w_x, "acceleration_z": (u - c) * w_x - w * u_x}
        pressure = DENSITY * (c * u - (u**2 + w**2) / 2 - GRAVITY * z[..., 0]) - self.constant
        return {"velocity_x": u, "velocity_z": w, **local, **total, "pressure": pressure}


FLOW = Flow()


def written(path: Path, name="inlet", *, x=X, y=0.0, levels=6, form="netcdf", times=T, depth=DEPTH):
    """Return the directory of a run with a window of the wave."""
    path.mkdir(exist_ok=True)
    tank = {"depth": DEPTH, "density": DENSITY, "gravity": GRAVITY}
    (path / "manifest.json").write_text(json.dumps({"status": "finished", "case": {"title": "a wave", "tank": tank}}))
    places = np.column_stack([x, np.full_like(x, y)])
    rows, zeta = [], np.linspace(0.0, 1.0, levels)
    for t in times:
        eta = WAVE.elevation(x, t)
        z = np.outer(depth + eta, zeta) - np.broadcast_to(depth, x.shape)[:, None]
        rows.append((10.0 + t, z, eta, np.array([*FLOW(np.repeat(x[:, None], levels, 1), z, t).values()])))
    if form == "csv":
        table = np.concatenate([window_rows(*row, places=places, dimensions=1) for row in rows])
        np.savetxt(path / f"window-{name}.csv", table, "%.12g", ",", header=",".join(window_columns(1)), comments="")
    else:
        with (path / f"window-{name}.nc").open("wb") as file:
            blocks = (window_record(window_row(*row), places=places, levels=levels, dimensions=1) for row in rows)
            write_records(file, blocks, conventions({}))
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return written(tmp_path_factory.mktemp("export") / "run", levels=21)


def exported(run, out, *words, windows=("inlet",), to="openfast"):
    result = commanded("export", str(run), *windows, "--to", to, "--out", str(out), *words)
    assert result.returncode == 0, result.stderr
    return result.stdout


# ---------------------------------------------------------------- OpenFAST
def settings(path, mode):
    """Return the lines of SeaState's input for a WaveMod."""
    text = path.read_text().partition(f"WaveMod {mode}:")[2].partition("\n\n")[0]
    return {key: value for value, key in re.findall(r"^ *(\S+)   (\w+)$", text, flags=re.MULTILINE)}


class SeaState:
    """A reader by the rules of SeaState: 13 lines of header; a line has all x, lines are ordered by time, z and y."""

    def __init__(self, folder, name="inlet"):
        self.given = settings(folder / f"{name}-SeaState.txt", 6)
        assert self.given["WvKinFile"] == f'"{name}"'
        dt, duration = (float(self.given[key]) for key in ("WaveDT", "WaveTMax"))
        self.steps = ceil(duration / dt)
        nx, ny = (2 * int(self.given[key]) - 1 for key in ("NX", "NY"))
        nz = int(self.given["NZ"])
        self.depth = float(self.given["Z_Depth"])
        t = dt * np.arange(self.steps + 1)
        x, y = (float(self.given[f"{axis}_HalfWidth"]) * np.linspace(-1, 1, n) for axis, n in (("X", nx), ("Y", ny)))
        self.angles = np.linspace(-np.pi / 2, 0.0, nz)  # of nodes z = d (cos - 1), upwards
        read = {
            extension: np.loadtxt(folder / f"{name}{extension}", skiprows=13, ndmin=2)
            for extension in (*KINEMATICS, ".Elev")
        }
        eta = read.pop(".Elev").reshape(-1, ny, nx)[: len(t)]
        self.elevation = RegularGridInterpolator((t, y, x), eta)
        fields = np.stack([rows.reshape(-1, nz, ny, nx)[: len(t)] for rows in read.values()], axis=-1)
        self.values = RegularGridInterpolator((t, self.angles, y, x), fields)

    def flow(self, t, x, y, z):
        """Return the quantities at points in the water, with Wheeler stretching."""
        eta = self.elevation(np.column_stack([t, y, x]))
        below = self.depth * (self.depth + z) / (self.depth + eta) - self.depth
        values = self.values(np.column_stack([t, -np.arccos(1.0 + below / self.depth), y, x]))
        return dict(zip((quantity for quantity, _ in KINEMATICS.values()), values.T, strict=True))


QUANTITIES = "velocity_x", "velocity_z", "acceleration_x", "acceleration_z", "pressure"
LARGEST = {name: np.abs(values).max() for name, values in FLOW(X, WAVE.elevation(X), 0.0).items()}
LARGEST["pressure"] = DENSITY * GRAVITY * HEIGHT / 2  # dynamic


def check_flow(seastate, t, x, y, z, *, tolerance):
    """Compare what SeaState computes at points with the wave, relative to the largest values at the surface."""
    got, exact = seastate.flow(t, x, y, z), FLOW(2.5 + x, z, t)
    exact["pressure"] = exact["pressure"] + DENSITY * GRAVITY * z
    for name in QUANTITIES:
        np.testing.assert_allclose(got[name], exact[name], atol=tolerance * LARGEST[name], err_msg=name)
    assert not got["velocity_y"].any() and not got["acceleration_y"].any()


def test_seastate_reads_the_wave_up_to_the_crest(run, tmp_path):
    """Within 1.5 % by its linear interpolation, also above still water, and within 1e-5 at nodes."""
    said = exported(run, tmp_path)
    assert "time 0 is 10 s of the run" in said and f"{ROWS} rows, one every 0.02 s" in said
    seastate = SeaState(tmp_path)
    wanted = {"WaveMod": "6", "WaveStMod": "3", "NX": "6", "NY": "2", "NZ": "21", "WtrDpth": "0.5", "MSL2SWL": "0"}
    assert seastate.given.items() >= wanted.items() and seastate.steps == ROWS - 1
    generator = np.random.default_rng(1)
    t = generator.uniform(0.0, DT * (ROWS - 1), 500)
    x, y = generator.uniform(-0.5, 0.5, (2, 500))
    eta = WAVE.elevation(2.5 + x, t)
    z = generator.uniform(0.0, 0.999, 500) * (DEPTH + eta) - DEPTH
    np.testing.assert_allclose(seastate.elevation(np.column_stack([t, y, x])), eta, atol=0.01 * HEIGHT)
    assert z.max() > 0.04
    check_flow(seastate, t, x, y, z, tolerance=0.015)
    t, x, y = DT * np.array([3, 20]), X[[2, 9]] - 2.5, np.array([0.0, 0.5])
    z = np.cos(seastate.angles[[12, 19]]) * (DEPTH + WAVE.elevation(2.5 + x, t)) - DEPTH  # of nodes, below the wave
    check_flow(seastate, t, x, y, z, tolerance=1e-5)


def test_elevation_alone_is_that_of_the_middle_in_a_periodic_time(run, tmp_path):
    """WaveMod 5: two columns; an even number of steps, half of it a product of small primes, that the rows exceed."""
    exported(run, tmp_path, "--every", "0.01")
    t, eta = np.loadtxt(tmp_path / "inlet-elevation.Elev", skiprows=2).T
    np.testing.assert_allclose(t, 0.01 * np.arange(2 * ROWS - 1), atol=1e-12)
    np.testing.assert_allclose(eta, WAVE.elevation(2.5, t), atol=2e-5 * HEIGHT)
    given = settings(tmp_path / "inlet-SeaState.txt", 5)
    assert given.items() >= {"WaveMod": "5", "WaveDT": "0.01", "WvKinFile": '"inlet-elevation"'}.items()
    assert float(given["WaveTMax"]) == 0.78 and "WaveStMod" not in given
    assert settings(tmp_path / "inlet-SeaState.txt", 6)["Y_HalfWidth"] == "0.5"
    exported(run, tmp_path, "--overwrite", "--width", "3", "--every", "0.0123456789")
    assert (tmp_path / "inlet-elevation.Elev").read_text().splitlines()[2].split()[0] == "0"
    assert settings(tmp_path / "inlet-SeaState.txt", 6)["Y_HalfWidth"] == "1.5"


@pytest.mark.parametrize("dt", ["0.1", "0.02", "0.0125", "0.04962779156", "0.3333333333", "7"])
def test_wave_time_is_the_number_of_steps_that_seastate_computes(dt):
    for rows in (5, 31, 60, 1001):
        steps = ceil(float(wave_time(rows, dt, periodic=False)) / float(dt))
        assert rows - 1 >= steps >= rows - 4
        steps = ceil(float(wave_time(rows, dt, periodic=True)) / float(dt))
        assert rows - 2 >= steps > 0.9 * rows - 4 and steps % 2 == 0
        half = steps // 2
        for prime in (2, 3, 5, 7, 11, 13, 17, 19, 23):
            while half % prime == 0:
                half //= prime
        assert half == 1


def test_windows_at_several_y_are_one_grid(tmp_path):
    """Nodes along x, then y: the elevation of each window is on its line."""
    for name, y in {"b": 1.0, "a": 0.0, "c": 2.0}.items():
        written(tmp_path / "run", name, x=X[::-1], y=y)
    words = "export", str(tmp_path / "run"), "--to", "openfast", "--out", str(tmp_path / "out")
    assert "2 columns along y received" in refusal(*words, "b", "a")
    written(tmp_path / "run", "d", x=X + 0.1, y=2.0)
    assert "unequal distances along x received" in refusal(*words, "a", "b", "d")
    exported(tmp_path / "run", tmp_path / "out", windows=("b", "a", "c"))
    given = settings(tmp_path / "out" / "b-SeaState.txt", 6)
    assert given["NY"] == "2" and given["Y_HalfWidth"] == "1" and given["X_HalfWidth"] == "0.5"
    seastate = SeaState(tmp_path / "out", "b")
    at = np.array([[0.1, y, 0.5] for y in (-1.0, 0.0, 1.0)])
    np.testing.assert_allclose(seastate.elevation(at), WAVE.elevation(3.0, 0.1), atol=1e-6)


# ---------------------------------------------------------------- OpenFOAM
def foam_list(path):
    """Return the numbers of a list of OpenFOAM: their count, then the values in parentheses."""
    count, opened, *rows, closed = path.read_text().split("\n")[:-1]
    values = np.array([row.strip("()").split() for row in rows], dtype=float)
    assert (opened, closed) == ("(", ")") and len(values) == int(count)
    return values if values.shape[1] > 1 else values[:, 0]


@pytest.mark.parametrize("form", ["netcdf", "csv"])
def test_openfoam_reads_the_flow_and_the_height_of_the_surface(tmp_path, form):
    """At the points the flow within 2e-6 of a spline of 21 levels, and the water exactly; air at rest above."""
    path = written(tmp_path / "run", x=np.array([2.5]), levels=21, form=form)
    exported(path, tmp_path / "out", "--spacing", "0.02", "--width", "0.3", "--origin", "2.5,0,-0.5", to="openfoam")
    tables = tmp_path / "out" / "constant" / "boundaryData" / "inlet"
    x, y, z = foam_list(tables / "points").T
    assert (
        not x.any()
        and {*y} == {-0.15, 0.15}
        and z[:3] == pytest.approx([0.01, 0.03, 0.05])
        and z.max() == pytest.approx(0.59)
    )
    times = sorted((one.name for one in tables.iterdir() if one.is_dir()), key=float)
    assert list(map(float, times)) == pytest.approx(T)
    for time in times[::8]:
        t = float(time)
        eta, alpha, u = WAVE.elevation(2.5, t), foam_list(tables / time / "alpha.water"), foam_list(tables / time / "U")
        half = len(z) // 2
        assert 0.02 * alpha[:half].sum() == pytest.approx(DEPTH + eta, abs=1e-7)
        np.testing.assert_array_equal(alpha[:half], alpha[half:])
        wet = z - 0.5 < eta
        exact = FLOW(np.full(wet.sum(), 2.5), z[wet] - 0.5, t)
        np.testing.assert_allclose(
            u[wet], np.column_stack([exact["velocity_x"], 0 * u[wet, 1], exact["velocity_z"]]), atol=2e-6
        )
        surface = FLOW(2.5, eta, t)["velocity_x"]
        np.testing.assert_allclose(u[(alpha > 0) & ~wet, 0], surface, atol=2e-6)
        assert not u[z - 0.5 > eta + 0.03].any()
    fields = (tmp_path / "out" / "fields-inlet.txt").read_text()
    assert fields.count("timeVaryingMappedFixedValue") == 2 and "fixedFluxPressure" in fields


def test_a_line_of_columns_is_a_plane_and_replaces_an_earlier_one(run, tmp_path):
    exported(run, tmp_path, "--every", "0.03", "--spacing", "0.04", to="openfoam")
    mine = tmp_path / "constant" / "boundaryData" / "inlet" / "0.03" / "k"
    mine.write_text("1")
    exported(run, tmp_path, "--overwrite", "--spacing", "0.04", to="openfoam")
    at = foam_list(tmp_path / "constant" / "boundaryData" / "inlet" / "points")
    assert {*np.round(at[:, 0], 9)} == {*np.round(X, 9)} and not at[:, 1].any()
    times = {one.name for one in mine.parents[1].iterdir() if one.is_dir()}
    assert len(times) == ROWS + 1 and [one.name for one in mine.parent.iterdir()] == ["k"]


def test_levels_are_interpolated_by_a_cubic_spline(tmp_path):
    """Oracle: scipy's spline of one column, of a function that is no cubic polynomial."""
    columns = water_columns(RunDirectory(written(tmp_path / "run", levels=5)), ["inlet"])
    values = np.broadcast_to(np.abs(columns.zeta - 0.4), columns.quantities["pressure"].shape)
    kinked = replace(columns, quantities={"pressure": values})
    zeta = np.linspace(0.0, 1.0, 9)
    exact = CubicSpline(columns.zeta, values[0, 0])(zeta)
    np.testing.assert_allclose(kinked.values("pressure", zeta)[3, 4], exact, atol=1e-12)


def test_uneven_rows_are_interpolated(tmp_path):
    times = np.concatenate([DT * np.arange(20), DT * 20 + 0.5 * DT * np.arange(40)])
    columns = water_columns(RunDirectory(written(tmp_path / "run", times=times)), ["inlet"])
    assert columns.begin == 10.0 and columns.t[-1] == pytest.approx(times[-1])
    np.testing.assert_allclose(columns.elevation[:, 4], WAVE.elevation(X[4], columns.t), atol=1e-4 * HEIGHT)


# ---------------------------------------------------------------- refusals
@pytest.mark.parametrize(
    ("window", "words", "sentence"),
    [
        ({"x": X[:10]}, [], r"10 columns along x received; SeaState's grid has an odd number .* columns = 21"),
        ({"form": "csv"}, [], r"has no accelerations; .* format = \"netcdf\" of \[\[windows\]\]"),
        ({"depth": np.linspace(0.4, 0.5, 11)}, [], r"depths from 0.4 to 0.5 m received; SeaState's grid"),
        ({"times": DT * np.arange(3)}, [], r"has 3 rows; at least 4 are needed"),
        ({}, ["--every", "1"], r"must be above 0 and at most 0.2667 s: at least 4 rows are needed\."),
        ({}, ["--every", "0"], r"--every 0 received"),
        ({}, ["--to", "openfoam", "--patch", "../inlet"], r"--patch '../inlet' received; allowed are letters"),
        (
            {},
            ["--to", "openfoam", "--spacing", "0.05", "--origin", "1,2"],
            r"--origin '1,2' received; allowed is X,Y,Z",
        ),
        ({}, ["--to", "openfoam"], r"--spacing: needed by openfoam; allowed is at most the height of the cells"),
        (
            {},
            ["--to", "openfoam", "--spacing", "0.06"],
            r"spacing of 0.06 m received; allowed is at most half the range of the elevation, 0.05 m",
        ),
        ({}, ["--to", "openfoam", "--spacing", "1e-5"], r"spacing of 1e-05 m received, .* at most 100000 points"),
    ],
)
def test_what_does_not_fit_is_refused_before_anything_is_written(tmp_path, window, words, sentence):
    run = written(tmp_path / "run", **window)
    said = refusal("export", str(run), "inlet", "--to", "openfast", "--out", str(tmp_path / "out"), *words)
    assert re.search(sentence, said), said
    assert not (tmp_path / "out").exists()


def test_other_windows_and_folders_are_refused(run, tmp_path):
    words = "--to", "openfoam", "--spacing", "0.04", "--out", str(tmp_path / "out")
    assert "has no window 'outlet'; there are inlet" in refusal("export", str(run), "outlet", *words)
    other = written(tmp_path / "run", "inlet")
    written(other, "later", times=1.0 + T)
    assert "2 windows received; a patch of openfoam: allowed is one window" in refusal(
        "export", str(other), "inlet", "inlet", *words
    )
    said = refusal("export", str(other), "inlet", "later", *words, "--to", "openfast")
    assert "windows inlet and later differ in times" in said
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("")
    assert "holds files already" in refusal("export", str(run), "inlet", *words)


# ---------------------------------------------------------------- windows as records of gauges
@pytest.mark.parametrize("form", ["nc", "csv"])
def test_columns_of_a_window_are_gauges(tmp_path, form):
    path = written(tmp_path / "run", levels=4, form={"nc": "netcdf"}.get(form, form)) / f"window-inlet.{form}"
    gauges = data.gauge_records(data.opened(str(path)))[0]
    assert gauges.gauge.values.tolist() == [str(n) for n in range(1, 12)] and gauges.x.values == pytest.approx(X)
    t, eta = RecordTarget(x=2.0, file=str(path), gauge="3", delay=1.0).record("target")
    np.testing.assert_allclose(eta, WAVE.elevation(X[2], t - 11.0), atol=1e-10)
    with pytest.raises(InputError, match="must be a gauge of .*: 1, 2, 3"):
        RecordTarget(x=2.0, file=str(path)).record("target")


def test_gauges_in_netcdf_have_their_names(tmp_path):
    """Elevation over gauge and time, or time and gauge."""
    eta = np.array([WAVE.elevation(X[:2], t) for t in T])
    names = {"gauge": Variable(("gauge",), np.array(["A", "far"]), {})}
    places = {name: Variable(("gauge",), values, {}) for name, values in (("x", X[:2]), ("y", np.array([0.0, 1.0])))}
    for dimensions, values in ((("time", "gauge"), eta), (("gauge", "time"), eta.T)):
        series = {"time": Variable(("time",), T, {}), "elevation": Variable(dimensions, values, {})}
        (tmp_path / "gauges.nc").write_bytes(netcdf(series | names | places, {}))
        gauges = data.gauge_records(data.opened(str(tmp_path / "gauges.nc")))[0]
        assert gauges.gauge.values.tolist() == ["A", "far"] and gauges.y.values.tolist() == [0.0, 1.0]
        np.testing.assert_array_equal(gauges.values, eta.T)


@pytest.mark.parametrize(
    "content",
    [b"\x89HDF\r\n\x1a\n", b"CDF\x02\0\0", b"CDF\x01" + 40 * b"\0"],
    ids=["netcdf-4", "truncated", "empty"],
)
def test_other_netcdf_files_are_refused(tmp_path, content):
    path = tmp_path / "file.nc"
    path.write_bytes(content)
    with pytest.raises(InputError, match="is NetCDF-4; allowed is the classic|cannot be read .* elevation over time"):
        data.opened(str(path))


def test_surface_of_a_run_has_no_gauges(tmp_path):
    path = tmp_path / "surface.nc"
    with path.open("wb") as file:
        rows = (np.concatenate([[t], X, WAVE.elevation(X, t), X]) for t in T)
        write_records(file, map(surface_variables, rows), conventions({}))
    with pytest.raises(InputError, match=r"surface.nc: has no gauges; allowed are gauges.nc and window-NAME.nc"):
        data.opened(str(path))


GROUP = {
    "tank": {"length": 12.0, "depth": DEPTH},
    "sponge": {"type": "end", "length": 5.0},
    "gauges": [4.0],
    "numerics": {"accuracy": 0.005},
}
FOCUSED = {
    "type": "focused",
    "linear_crest": 0.003,
    "focus_x": 4.0,
    "focus_time": 12.0,
    "spectrum": {"type": "jonswap", "peak_frequency": 0.7, "gamma": 3.3},
}


@pytest.mark.slow
def test_a_motion_for_a_window_makes_its_waves(tmp_path):
    """Within 1 % (rms) of waves so low that their bound harmonics, which count as free ones, are below 1 %."""
    window = {"name": "inlet", "start": [4.0, 0.0], "levels": 4, "every": 0.05}
    first = GROUP | {"wall": {"type": "piston", "motion": FOCUSED}, "windows": [window], "run": {"duration": 24.0}}
    record_run(Case.model_validate(first), tmp_path / "1", comm=MPI.COMM_SELF, console=Console(quiet=True))
    motion = {"type": "surface", "file": str(tmp_path / "1" / "window-inlet.nc"), "x": 4.0, "delay": 6.0}
    again = GROUP | {"wall": {"type": "piston", "motion": motion}, "run": {"duration": 30.0}}
    record_run(Case.model_validate(again), tmp_path / "2", comm=MPI.COMM_SELF, console=Console(quiet=True))
    wanted, got = (RunDirectory(tmp_path / name).gauges[0] for name in "12")
    t = wanted.time.values
    error = CubicSpline(got.time - 6.0, got)(t) - wanted
    assert float(error.std() / wanted.std()) < 0.01
