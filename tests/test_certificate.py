"""The numerical uncertainty of a run covers its error; runs whose uncertainty is unknown say so."""

import signal
from importlib import import_module
from itertools import product

import numpy as np
import pytest
import xarray
from case_builders import build_case, piston
from conftest import fitted_slope, recorded
from mpi4py import MPI
from rich.console import Console
from tanks import written

from examples.paper.certificate import rows
from examples.scenes import CLASSES, executed
from wavetank.base.errors import BreakdownError, InputError, StoppedError
from wavetank.case.reading import read_case
from wavetank.output.columns import STANDARD_ERROR, Variable, with_standard_error
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.planning.companion import build_stable, companion, companion_cases, grid_order, needs_vertical_companion
from wavetank.planning.uncertainty import CompanionValues, Estimate, at_times, crests
from wavetank.recording import record_run

NUMERICS = {"order": 3, "vertical_order": 8, "tolerance": 1e-8}


def steady(steps, **numerics):
    """Return a wave of k d = 2 and 40 % of the maximum height in a ring, for two periods, and its exact surface."""
    tank = {"type": "ring", "length": np.pi, "depth": 1.0}
    parts = {"initial": {"type": "stream-function", "steepness": 0.4}, "gauges": [0.0]}
    one = build_case(tank, **parts)
    wave = one.initial.wave(one.tank)
    duration = 2 * np.pi / wave.speed
    chosen = NUMERICS | {"dt": duration / steps} | numerics
    return build_case(tank, duration=duration, numerics=chosen, **parts), wave


def values_of(cases, t):
    """Return the values of the companions' gauge at the times of the run."""
    runs = [one and executed(one).gauges for one in cases]
    return CompanionValues(*(None if one is None else at_times(np.minimum(t, one[-1, 0]), *one.T) for one in runs))


def uncertainty(case):
    """Return times, elevation, uncertainty of a run's gauge and its crests, by its companions."""
    run = executed(case)
    cases = companion_cases(case, run.dt, run.limit)
    t, eta = run.gauges.T
    parts = Estimate.of(case, cases, run.dt).series(t, eta, values_of(cases, t))
    return t, eta, parts, crests(t, eta, parts)


def test_uncertainty_covers_errors_of_a_steady_wave_and_decreases_with_fourth_order():
    """On average over meshes, as the order varies. Oracle: the exact wave, its crest at x = 0 after a period."""
    sizes, largest, covered, ratios, peak_covered = [], [], [], [], []
    for order, cells in product((3, 4), (8, 12, 16, 20, 24, 28)):
        case, wave = steady(8 * cells, cells=cells, order=order)
        t, eta, parts, peaks = uncertainty(case)
        error = np.abs(eta - wave.elevation(wave.crest - wave.speed * t))
        covered.append(np.mean(error <= parts.total))
        ratios.append(np.sqrt(np.mean(parts.total**2) / np.mean(error**2)))
        off = np.abs(peaks.time - np.pi / wave.speed), np.abs(peaks.height - wave.elevation(wave.crest))
        peak_covered.append(off[0] <= peaks.time_uncertainty)
        peak_covered.append(off[1] <= peaks.height_uncertainty)
        sizes.append(1 / cells)
        largest.append(parts.total.max())
    assert np.mean(covered) > 0.9 and np.mean(peak_covered) > 0.9
    assert 1.5 < np.median(ratios) < 5
    assert 3.5 < fitted_slope(sizes[6:], largest[6:]) < 6


@pytest.mark.parametrize(
    ("part", "numerics"),
    [("time_step", {"integrator": "stormer-verlet", "cells": 24}), ("parameters", {"vertical_order": 2, "cells": 24})],
)
def test_each_part_covers_its_error(part, numerics):
    """Where the time step or the vertical order causes nearly all of the error. Oracle: the exact wave."""
    case, wave = steady(480, **numerics)
    t, eta, parts, _ = uncertainty(case)
    error = np.abs(eta - wave.elevation(wave.crest - wave.speed * t))
    assert np.sqrt(np.mean(getattr(parts, part) ** 2)) > 0.5 * np.sqrt(np.mean(error**2))
    assert np.mean(error <= parts.total) > 0.95


def test_crest_height_of_a_low_vertical_order_is_covered():
    """Its error is in the form of the wave, not in its phase. Oracle: the exact wave."""
    case, wave = steady(240, cells=16, vertical_order=2)
    t, eta, parts, peaks = uncertainty(case)
    error = np.abs(peaks.height - wave.elevation(wave.crest))
    assert needs_vertical_companion(case)
    assert (10 * np.abs(parts.difference).max() < error).all() and (error <= peaks.height_uncertainty).all()


@pytest.mark.parametrize("order", [1, 2, 4])
def test_grid_error_has_the_order_of_its_estimate(order):
    """It is p + 1, at most 4: errors on three meshes, and the estimate over the error. Oracle: the exact wave.

    With p = 3 the order varies between 2 and 6 (docs/accuracy.md).
    """
    sizes, errors = [], []
    for cells in {1: (72, 96, 144), 2: (16, 24, 32), 4: (8, 12, 16)}[order]:
        case, wave = steady(600, cells=cells, order=order)
        t, eta, parts, _ = uncertainty(case)
        errors.append(np.sqrt(np.mean((eta - wave.elevation(wave.crest - wave.speed * t)) ** 2)))
        assert 0.5 < np.sqrt(np.mean(parts.difference**2)) / errors[-1] < 5.0
        sizes.append(1 / cells)
    assert fitted_slope(sizes, errors) == pytest.approx(grid_order(order), abs=0.7)


def test_grid_part_is_the_difference_by_the_order_and_the_safety_factor():
    """Of errors C h^4: 1.25 times the error. By hand."""
    case, _ = steady(60, cells=18)
    cases = companion_cases(case, 0.01, 1.0)
    t = np.linspace(0.0, 20.0, 400)
    one = np.sin(t)
    coarse = CompanionValues(one * (1 + 1e-3 * 1.5**4))
    parts = Estimate.of(case, cases, 0.01).series(t, one * (1 + 1e-3), coarse)
    np.testing.assert_allclose(parts.difference, 1.25e-3 * one, rtol=1e-6)


def test_harmonics_have_the_uncertainty_of_their_complex_amplitudes():
    """By hand: a companion that differs by 1 % and 0.02 rad in the first harmonic, and a frequency error of 1e-4."""
    case, _ = steady(60, cells=16)
    cases = companion_cases(case, 0.01, 1.0)
    t = np.arange(0.0, 20.0, 0.02)

    def record(size, phase):
        return 0.1 * size * np.cos(np.pi * t - phase) + 0.01 * np.cos(2 * np.pi * t)

    estimate, companions = Estimate.of(case, cases, 0.01), CompanionValues(record(1.01, 0.02))
    waves = estimate.harmonics(t, record(1.0, 0.0), companions, 2.0)
    np.testing.assert_allclose(waves.amplitude, [0.1, 0.01, 0.0], atol=1e-10)
    off = 2 * estimate.grid * 0.1 * np.abs(1.01 * np.exp(0.02j) - 1)
    iteration = 10 * case.numerics.tolerance * np.std(record(1.0, 0.0))
    np.testing.assert_allclose(waves.amplitude_uncertainty, np.hypot([off, 0.0, 0.0], iteration), rtol=1e-6)
    frequency = np.hypot(*estimate.frequency_errors(t, record(1.0, 0.0)))
    assert frequency > 0
    late = frequency * np.pi * t[-1] * np.array([1, 2])
    phases = np.hypot(late, np.hypot([off, 0.0], iteration) / [0.1, 0.01])
    np.testing.assert_allclose(waves.phase_uncertainty[:2], phases, rtol=1e-6)


def test_gauge_of_low_waves_does_not_determine_the_relative_uncertainty():
    """The second gauge has 5 % of the waves of the first, and an uncertainty of 80 % of its own."""
    parts = xarray.DataArray([[0.001, 0.004]], {"part": ["grid"]}, ("part", "gauge"))
    rms = xarray.DataArray([0.1, 0.005], dims="gauge")
    crests = {"height": [[0.2], [0.005]], "height_uncertainty": [[0.004], [0.004]]}
    data = xarray.Dataset({"part_rms": parts, "elevation_rms": rms})
    data = data.assign({f"crest_{name}": (("gauge", "crest"), values) for name, values in crests.items()})
    certifying = import_module("wavetank.recording.certify")
    relative = dict(certifying._relative(data, None))
    assert relative["gauges"] == pytest.approx(0.01) and relative["crest"] == pytest.approx(0.02)


def test_companion_that_breaks_down_leaves_the_uncertainty_unresolved(path, tmp_path, monkeypatch):
    certifying = import_module("wavetank.recording.certify")

    def breaking(*_):
        raise BreakdownError("t = 1 s: a wave breaks")

    monkeypatch.setattr(certifying, "build_stable", breaking)
    recorded(path, (), tmp_path / "run")
    run = RunDirectory(tmp_path / "run")
    assert run.status == "finished"
    assert run.manifest["certificate"]["reason"] == "the companion run fails: t = 1 s: a wave breaks"


def test_shapes_with_kinks_and_low_orders_need_a_vertical_companion():
    flap = {"type": "flap", "hinge": 0.5, "motion": WALL["motion"]}
    orders = {"fine": (WALL, 8, False), "low": (WALL, 2, True), "hinged": (flap, 8, True)}
    for name, (wall, n, needed) in orders.items():
        case = build_case(TANK, duration=4.0, wall=wall, gauges=[1.0], numerics=QUICK | {"vertical_order": n})
        assert needs_vertical_companion(case) is needed, name


def test_iteration_part_covers_the_error_of_the_solves():
    """Oracle: the same run with a tolerance of 1e-11."""
    loose, tight = (executed(steady(100, cells=12, tolerance=one)[0]).gauges.T[1] for one in (1e-4, 1e-11))
    case, _ = steady(100, cells=12, tolerance=1e-4)
    parts = uncertainty(case)[2]
    assert np.mean(np.abs(loose - tight) <= parts.iteration) > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("kind", CLASSES)
def test_uncertainty_covers_nine_of_ten_errors_of_each_class(kind):
    """Against runs with refined numerics (``wavetank verify certificate``)."""
    found = [row for seed in range(2000, 2004) for row in rows(kind, seed)]
    assert len(found) >= 6
    assert np.mean([row.samples for row in found]) > 0.9


WALL = piston(1.5, 0.02, ramp=1.5)
TANK = {"length": 6.0, "depth": 1.0}
QUICK = {"order": 3, "vertical_order": 4, "cells": 15, "dt": 0.05, "certify": True}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """The case of a piston that is certified."""
    case = build_case(TANK, duration=4.0, wall=WALL, gauges=[1.0, 3.0], numerics=QUICK)
    return written(tmp_path_factory.mktemp("certified") / "case.toml", case)


def test_a_certified_run_states_its_uncertainty(path, tmp_path, wavetank):
    """In its last lines, its manifest, and as CF's ancillary variable, half of the expanded uncertainty."""
    out = tmp_path / "run"
    said = wavetank("run", str(path), "--out", str(out))
    assert said.returncode == 0
    assert (out / "gauges.png").exists() and "not all figures" not in said.stdout + said.stderr
    assert "numerical uncertainty (95 %): " in said.stdout and "highest crest at a gauge: " in said.stdout
    run = RunDirectory(out)
    assert run.manifest["certificate"]["resolved"]
    data, copy = run.certificate, xarray.open_dataset(out / "gauges.nc")
    assert data.elevation_uncertainty.shape == run.gauges.shape
    assert copy.elevation.attrs["ancillary_variables"] == "elevation_standard_error"
    np.testing.assert_allclose(copy.elevation_standard_error.T, data.elevation_uncertainty / 2, rtol=1e-14)
    total = np.sqrt((data.part_rms**2).sum("part"))
    np.testing.assert_allclose(total, np.sqrt((data.elevation_uncertainty**2).mean("time")), rtol=1e-12)


def test_uncertainty_of_forces_and_energies_covers_their_errors(tmp_path):
    """Of a standing wave, with a scheme of second order. Oracle: a run of order 5 with simpson-4 and a small step."""
    initial = {"type": "standing-wave", "wave_amplitude": 0.05}
    numerics = NUMERICS | {"cells": 4, "dt": 0.03, "vertical_order": 4, "certify": True, "integrator": "stormer-verlet"}
    more = {"loads": [{"on": "far wall"}], "gauges": [0.0], "initial": initial}
    case = build_case({"length": 2.0, "depth": 1.0}, duration=6.0, numerics=numerics, **more)
    path = written(tmp_path / "case.toml", case)
    recorded(path, (), tmp_path / "run")
    fine = "numerics={cells=8, order=5, dt=0.01, vertical_order=7, tolerance=1e-10}"
    recorded(path, (fine,), tmp_path / "fine")
    run, exact = RunDirectory(tmp_path / "run"), RunDirectory(tmp_path / "fine")
    quantities = {"force_x": run.loads, "moment_y": run.loads, "kinetic": run.energy, "potential": run.energy}
    for name, table in quantities.items():
        other = (exact.loads if name in table and "wall" in table.dims else exact.energy)[name]
        error = np.abs(table[name] - other.interp(time=table.time, method="cubic"))
        assert float(np.mean(error.values <= run.certificate[f"{name}_uncertainty"].values)) > 0.9


def test_certificate_is_that_of_the_numbered_directory(path, tmp_path):
    """Of a default path that exists, a number is added."""
    for change in ("run.duration=3", "run.duration=4"):
        case, place = read_case(path, [change]), OutputPath(tmp_path / "run", numbered=True)
        record_run(case, place, comm=MPI.COMM_SELF, console=Console(quiet=True))
    second = RunDirectory(tmp_path / "run-2")
    np.testing.assert_array_equal(second.certificate.time, second.gauges.time)


def test_damaged_certificate_is_an_error_with_its_name(path, tmp_path):
    recorded(path, (), tmp_path / "run")
    file = tmp_path / "run" / "certificate.nc"
    for content in (b"", b"text", file.read_bytes()[:200]):
        file.write_bytes(content)
        with pytest.raises(InputError, match="certificate.nc: is damaged"):
            _ = RunDirectory(tmp_path / "run").certificate


def test_missing_certificate_is_an_error_with_its_remedy(path, tmp_path):
    recorded(path, ("numerics.certify=false",), tmp_path / "run")
    with pytest.raises(InputError, match="has no certificate; `wavetank run CASE --certify` makes one"):
        _ = RunDirectory(tmp_path / "run").certificate


def test_option_certifies_a_case_that_does_not_ask_for_it(path, tmp_path, wavetank):
    said = wavetank("run", str(path), "--set", "numerics.certify=false", "--certify", "--out", str(tmp_path / "run"))
    assert said.returncode == 0 and (tmp_path / "run" / "certificate.nc").exists()


def test_certificate_is_that_of_one_rank_on_several(path, recorded_on_ranks):
    alone, together = (run.certificate for run in recorded_on_ranks(path))
    np.testing.assert_allclose(alone.elevation_uncertainty, together.elevation_uncertainty, rtol=0.05, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("run.duration=0.5", "run or companion have 8 rows of gauges: at least 16 are needed"),
        ("numerics.cells=2", "the cells or the time step are too coarse"),
        ("numerics.cells=5 numerics.order=1", "the cells or the time step are too coarse"),
    ],
)
def test_unresolved_uncertainty_is_stated_with_its_reason(path, tmp_path, change, reason):
    recorded(path, tuple(change.split()), tmp_path / "run")
    run = RunDirectory(tmp_path / "run")
    assert run.status == "finished" and reason in run.manifest["certificate"]["reason"]
    assert reason in (run.path / "run.log").read_text() and not (run.path / "certificate.nc").exists()


def test_companion_has_two_thirds_of_the_cells_and_no_records_but_gauges_and_loads(path):
    more = ["windows=[{name='w', start=[1, 0], every=1}]", "probes=[{x=1.0, z=-0.5}]", "loads=[{on='far wall'}]"]
    case = read_case(path, more)
    coarse = companion(case, 0.05, 0.1)
    assert coarse.cells == 10 and coarse.loads and coarse.all_gauges and not coarse.probes and not coarse.windows
    assert coarse.numerics.dt == pytest.approx(0.075)


def test_companion_step_is_nine_tenths_of_its_own_stability_limit_if_a_longer_one_is_unstable():
    case, _ = steady(56, cells=16)
    run = executed(case)
    coarse = executed(companion(case, run.dt, run.limit))
    assert run.dt < coarse.dt < 1.5 * run.dt
    assert coarse.dt == pytest.approx(0.9 * coarse.limit, rel=0.05)


@pytest.mark.parametrize(
    "tank", [{"type": "basin", "depth": 0.5, "layout": {"type": "file", "file": "layout.msh"}}, "ring"]
)
def test_companion_of_a_mesh_that_cannot_be_coarser_has_an_order_less(tank):
    case = steady(20, cells=3)[0] if tank == "ring" else build_case(tank, numerics={"order": 3, "dt": 0.02})
    coarse = companion(case, 0.02, 1.0)
    assert coarse.numerics.order == 2 and coarse.cell_size == case.cell_size
    cases = companion_cases(case, 0.02, 1.0)
    assert Estimate.of(case, cases, 0.02).grid == pytest.approx(1.25 / 3)
    lowest = case.model_copy(update={"numerics": case.numerics.model_copy(update={"order": 1})})
    with pytest.raises(InputError, match="the mesh cannot be coarser, and the order is 1"):
        companion(lowest, 0.02, 1.0)


def test_standard_errors_of_successive_blocks_are_those_of_their_times():
    def block(first, last):
        return {"elevation": Variable(("gauge", "time"), np.zeros((2, last - first)), {"standard_name": "elevation"})}

    errors = np.arange(14.0).reshape(2, 7)
    parts = [one[STANDARD_ERROR].values for one in with_standard_error([block(0, 3), block(3, 7)], errors)]
    np.testing.assert_array_equal(np.hstack(parts), errors)


def test_resumed_run_has_a_certificate_of_all_times_unless_its_numerics_have_changed(path, tmp_path, wavetank):
    out = tmp_path / "run"
    recorded(path, ("run.duration=2",), out)
    assert wavetank("resume", str(out), "--extend", "1").returncode == 0
    run = RunDirectory(out)
    assert run.certificate.time.values[-1] == run.gauges.time.values[-1] >= 3.0
    assert wavetank("resume", str(out), "--extend", "1", "--set", "numerics.dt=0.02").returncode == 0
    run = RunDirectory(out)
    assert "parts with different numerics" in run.manifest["certificate"]["reason"]
    assert not (out / "certificate.nc").exists()


def test_run_that_is_certified_on_resume_equals_the_uninterrupted_one_bit_for_bit(path, tmp_path, wavetank):
    recorded(path, ("run.duration=3",), tmp_path / "complete")
    recorded(path, ("run.duration=2", "numerics.certify=false"), tmp_path / "run")
    more = "--extend", "1", "--set", "numerics.certify=true"
    assert wavetank("resume", str(tmp_path / "run"), *more).returncode == 0
    complete, resumed = (tmp_path / name / "gauges.csv" for name in ("complete", "run"))
    assert resumed.read_bytes() == complete.read_bytes() and (tmp_path / "run" / "certificate.nc").exists()


def test_companion_of_a_resumed_run_starts_as_the_run_did(tmp_path, wavetank):
    case, _ = steady(60, cells=10, certify=True)
    path = written(tmp_path / "case.toml", case)
    recorded(path, (), tmp_path / "complete")
    recorded(path, (f"run.duration={case.run.duration / 2}",), tmp_path / "run")
    assert wavetank("resume", str(tmp_path / "run"), "--extend", str(case.run.duration / 2)).returncode == 0
    expected, found = (RunDirectory(tmp_path / name).certificate for name in ("complete", "run"))
    np.testing.assert_allclose(found.elevation_uncertainty, expected.elevation_uncertainty, rtol=1e-3)


def test_gauge_that_is_added_on_resume_has_an_uncertainty_from_then_on(path, tmp_path, wavetank):
    out = tmp_path / "run"
    recorded(path, ("run.duration=2",), out)
    added = "gauges=[1.0, 3.0, 4.0]"
    assert wavetank("resume", str(out), "--extend", "2", "--set", added).returncode == 0
    data = RunDirectory(out).certificate.elevation_uncertainty
    assert data.isel(gauge=2).isnull().values.tolist() == (data.time < 2.0 + 1e-9).values.tolist()


def test_rounding_errors_of_still_water_are_no_difference(path, tmp_path):
    recorded(path, ("wall.motion={type='at-rest'}",), tmp_path / "run")
    assert float(RunDirectory(tmp_path / "run").certificate.elevation_uncertainty.max()) < 1e-12


def test_crests_of_coarse_samples_are_left_out(path, tmp_path):
    recorded(path, ("output.gauges_every=4",), tmp_path / "run")
    data = RunDirectory(tmp_path / "run").certificate
    assert data.elevation_uncertainty.notnull().all() and not data.crest_height.notnull().any()


def test_signal_during_the_companion_ends_the_run_which_is_certified_on_resume(path, tmp_path, monkeypatch, wavetank):
    certifying = import_module("wavetank.recording.certify")
    original = certifying.companion_cases

    def then_stopped(*arguments):
        signal.raise_signal(signal.SIGTERM)
        return original(*arguments)

    with monkeypatch.context() as patch, pytest.raises(StoppedError, match="companion run: .*interrupted by SIGTERM"):
        patch.setattr(certifying, "companion_cases", then_stopped)
        recorded(path, (), tmp_path / "run")
    recorded(path, ("numerics.certify=false",), tmp_path / "complete")
    run, complete = (RunDirectory(tmp_path / name) for name in ("run", "complete"))
    assert run.status == "stopped"
    np.testing.assert_array_equal(run.gauges, complete.gauges)
    assert wavetank("resume", str(run.path)).returncode == 0
    run = RunDirectory(run.path)
    assert run.status == "finished" and run.manifest["certificate"]["resolved"]
    np.testing.assert_array_equal(run.gauges, complete.gauges)


def test_uncertainty_of_the_last_samples_is_that_of_the_common_record(path, tmp_path):
    """The last step of the run ends after that of the companion; the companion's last value is no sample there."""
    recorded(path, ("numerics.dt=0.0613",), tmp_path / "run")
    u = RunDirectory(tmp_path / "run").certificate.elevation_uncertainty
    assert u.time.values[-1] > 4.02 and u.notnull().all()
    last, before = u.sel(time=slice(3.3, None)), u.sel(time=slice(2.0, 3.2))
    assert (last.max("time") < 3 * before.max("time")).all()


def test_harmonics_of_few_samples_are_omitted(path, tmp_path):
    recorded(path, ("output.gauges_every=6", "run.duration=6"), tmp_path / "run")
    run = RunDirectory(tmp_path / "run")
    assert run.manifest["certificate"]["resolved"] and "harmonic_amplitude" not in run.certificate


def test_surface_of_a_resumed_run_has_no_uncertainty(path, tmp_path, wavetank):
    """Only the later part is in memory."""
    out = tmp_path / "run"
    recorded(path, ('numerics.accuracy_of="surface"',), out)
    assert "surface" in RunDirectory(out).manifest["certificate"]["relative"]
    assert wavetank("resume", str(out), "--extend", "0.1").returncode == 0
    certificate = RunDirectory(out).manifest["certificate"]
    assert certificate["resolved"] and "surface" not in certificate["relative"]


def test_certificate_needs_a_gauge():
    with pytest.raises(ValueError, match="numerics.certify = true: needs a gauge"):
        build_case(TANK, wall=WALL, numerics=QUICK)


def test_rare_loads_have_no_uncertainty(path, tmp_path):
    """Fewer than 16 rows."""
    recorded(path, ("loads=[{on='far wall'}]", "output.probes_every=20"), tmp_path / "run")
    certificate = RunDirectory(tmp_path / "run").manifest["certificate"]
    assert certificate["resolved"] and "loads" not in certificate["relative"]


def test_water_at_rest_has_no_relative_uncertainty(path, tmp_path):
    recorded(path, ("wall.motion={type='at-rest'}",), tmp_path / "run")
    assert RunDirectory(tmp_path / "run").manifest["certificate"]["relative"]["gauges"] == 0.0


def test_companion_step_above_the_limit_of_its_mesh_is_shorter():
    """By 0.85, repeatedly; other errors of the case are raised."""
    case, _ = steady(56, cells=16)
    limit = executed(case).limit
    numerics = case.numerics.model_copy(update={"dt": 1.3 * limit})
    run, _ = build_stable(case.model_copy(update={"numerics": numerics}), MPI.COMM_SELF)
    assert run.clock.dt == pytest.approx(1.3 * 0.85**2 * limit)
    beyond = case.model_copy(update={"numerics": case.numerics.model_copy(update={"dt": 10 * limit})})
    with pytest.raises(InputError, match="numerics.dt"):
        build_stable(beyond, MPI.COMM_SELF)
