"""Breaking: when the run says that a wave breaks, when it must not, and what is then taken out of the water.

Oracles: still water, which stays still; the decay of linear waves by diffusion; exact waves, which do not break.
"""

import csv
import re
from contextlib import nullcontext
from io import StringIO
from itertools import count as counted

import numpy as np
import pytest
import ufl
from dolfinx import mesh
from mpi4py import MPI
from records import with_numerics
from rich.console import Console
from scipy.signal import find_peaks
from tanks import CREST, case_of, executed
from test_basin import basin

import wavetank
from examples.paper.breaking import BreakingCase, bore, cases, dissipated, luth_c, over_steep, refined, release, row
from wavetank.base.arrays import largest
from wavetank.base.errors import ConvergenceError, RunError
from wavetank.case import Case
from wavetank.fem.mass import PenalisedMass, mass_matrix
from wavetank.fem.plane import Plane
from wavetank.integrators.contract import Point
from wavetank.output.directory import RunDirectory
from wavetank.recording import record_run
from wavetank.simulation.build import build_run
from wavetank.tank.breaking import (
    COHERENT,
    ONSET,
    BasinBreakingWatch,
    BreakingAlarm,
    BreakingDissipation,
    BreakingWatch,
)
from wavetank.tank.crests import LEAST, Profile, steep_crests
from wavetank.tank.dissipation import EdgePenalty, Smoothing
from wavetank.tank.footprint import Ring, Slice
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.walls import Wall
from wavetank.tank.waves import NonlinearWaves, Tolerances
from wavetank.waves.stream_function import maximum_height, stream_function_wave


def bar(x, y):
    return 0.4 - 0.3 * np.exp(-(((x - 5.0) / 0.6) ** 2)) - 0.02 * np.maximum(0.0, x - 7.3)


def over_a_bar():
    """Return waves over a bar and the toe of a beach, which lies within a cell."""
    footprint = Slice(10.0, 40, comm=MPI.COMM_WORLD)
    return NonlinearWaves(Plane(footprint.mesh, 3), depth=bar, wall=Wall(), vertical_order=4)


def penalty(waves):
    return EdgePenalty(waves, SurfaceFlow(waves), cell_size=0.25, dt=0.01, threshold=0.0)


def viscosity(waves):
    return Smoothing(waves, lambda u, v: 0.01 * ufl.inner(ufl.grad(u), ufl.grad(v)) * waves.plane.dx)


@pytest.mark.parametrize("make", [penalty, viscosity])
def test_still_water_over_a_bed_stays_still(make):
    """Also far from a crest that is smoothed: what is taken there makes no waves over the bar."""
    waves = over_a_bar()
    smoothing, x = make(waves), waves.plane.x
    q, p = waves.state(0 * x, 0 * x)
    ((after_q, after_p),) = smoothing.passed(np.array([[q, p]]))
    assert np.abs(waves.mass.solve(after_q - q)).max() < 1e-12
    assert np.abs(after_p).max() < 1e-12
    q, _ = waves.state(np.where(x < 2.0, 0.1 * np.cos(np.pi * x / 4) ** 3, 0.0), 0 * x)
    change = waves.mass.solve(smoothing.passed(np.array([[q, p]]))[0, 0] - q)
    near, far = (largest(waves.plane.comm, np.abs(change[at]).max(initial=0.0)) for at in (x < 2.0, x > 6.0))
    assert near > 1e-7 and far < 1e-12


@pytest.mark.parametrize("dimensions", [1, 2])
def test_a_sum_of_mass_matrix_and_penalty_is_inverted(dimensions):
    """By factors in a slice, by conjugate gradients in a basin, from nothing and from the solution. Oracle: numpy."""
    if dimensions == 1:
        plane = Plane(mesh.create_interval(MPI.COMM_SELF, 8, [0.0, 1.0]), 3)
    else:
        plane = Plane(mesh.create_unit_square(MPI.COMM_SELF, 3, 3, cell_type=mesh.CellType.quadrilateral), 3)
    mass, x = mass_matrix(plane, 1.0), plane.coordinates()[:, 0]

    def smoothing(u, v):
        return 0.01 * ufl.inner(ufl.grad(u), ufl.grad(v)) * plane.dx

    raised, units = PenalisedMass(plane, mass, 1.0, smoothing), np.eye(plane.owned)
    matrix = np.array([mass.apply(unit) + raised.penalty(unit) for unit in units])
    assert np.abs(np.array([raised.penalty(unit) for unit in units]).sum(axis=0)).max() < 1e-13
    right = mass.apply(np.sin(40.0 * x))
    exact = np.linalg.solve(matrix, right)
    for start in (0.0 * right, exact):
        assert raised.solve(right, start) == pytest.approx(exact, abs=1e-7 * np.abs(exact).max())


# ---------------------------------------------------------------- a crest's speed and its water's
def exact(shift, *, current=0.0, noise=0.0):
    """Return the profile of three exact waves of 80 %, kd = 1, moved on by ``shift`` [m], on a current [m/s]."""
    length = 2 * np.pi
    wave = stream_function_wave(0.8 * maximum_height(length, 1.0), length, depth=1.0)
    x, e = np.linspace(0.0, 3 * length, 1200), 1e-6

    def at(place):
        eta, psi = wave.surface((place - shift + length / 2) % length - length / 2)
        return eta + noise * np.sin(40.0 * place), psi

    (behind, psi_behind), (here, _), (ahead, psi_ahead) = at(x - e), at(x), at(x + e)
    return Profile(x, here, (ahead - behind) / (2 * e), (psi_ahead - psi_behind) / (2 * e) + current), wave


@pytest.mark.parametrize("current", [-4.0, -1.0, 0.0, 1.0, 4.0])
@pytest.mark.parametrize(("noise", "time"), [(0.0, 0.01), (1e-3, 0.01), (0.0, 0.02)])
def test_velocity_over_speed_is_that_of_the_exact_wave_on_any_current_for_any_step(current, noise, time):
    """Oracle: the wave's own B; where the current runs faster than the water in the crest, or the other way."""
    before, wave = exact(0.3, current=current, noise=noise)
    after, _ = exact(0.3 + (wave.speed + current) * time, current=current, noise=noise)
    _, (behind, ahead) = wave.surface(np.array([-1e-5, 1e-5]))
    expected = (ahead - behind) / 2e-5 / wave.speed
    crests = steep_crests(before, after, time=time, front=0.25, cell=0.1)
    assert len(crests) == 3
    for crest in crests[1:]:  # before the first there is but half a trough
        assert crest.speed - current == pytest.approx(wave.speed, rel=0.03)
        assert expected - 0.01 < crest.overtaking < expected + 0.1 * (current > 0.0) + 0.01


def gaussian(speed, *, front=0.5, back=0.5, potential=lambda eta: 0.0 * eta):
    """Return a lone crest before and after 0.01 s at a speed, and the velocities of its water in the upper half.

    ``potential`` is the slope of the surface potential at a height. Places are not equally far apart.
    """
    share = np.linspace(0.0, 1.0, 1201)
    x, reach = 12.0 * share + 0.3 * np.sin(6 * np.pi * share), np.sqrt(np.log(2.0))

    def at(x):
        w = np.where(x < 6.0, back, front)
        eta = 0.4 * np.exp(-(((x - 6.0) / w) ** 2))
        return eta, -2 * (x - 6.0) / w**2 * eta, potential(eta)

    _, slope, psi_x = at(np.linspace(6.0 - back * reach, 6.0 + front * reach, 2001))
    water = (psi_x + speed * slope**2) / (1.0 + slope**2)
    return *(Profile(x, *at(x - speed * t)) for t in (0.0, 0.01)), water


@pytest.mark.parametrize(("speed", "steepest"), [(2.0, 1.0), (-2.0, 0.5)])
def test_the_front_is_the_side_ahead_and_the_current_that_of_the_water_around(speed, steepest):
    """Oracles: a Gaussian's steepest slope, (2/e)^(1/2) of height over width; still water around, or a plateau's.

    And how its water moves.
    """
    for plateau in (0.0, 0.35 * speed):
        potential = lambda eta, plateau=plateau: speed * eta + plateau  # noqa: E731
        before, after, water = gaussian(speed, front=1.0, potential=potential)
        fastest = max(water, key=lambda one: one * speed)
        (one,) = steep_crests(before, after, time=0.01, front=0.1, cell=0.1)
        assert one.front == pytest.approx(np.sqrt(2 / np.e) * 0.4 / steepest, rel=0.01)
        assert one.current == pytest.approx(plateau, abs=1e-3) and one.speed == pytest.approx(speed, rel=0.01)
        assert one.velocity == pytest.approx(fastest, rel=0.02) and one.coherence == pytest.approx(1.0, abs=0.01)
        assert one.outrun == 0.0 and np.abs(water).max() < abs(one.speed)
        assert not steep_crests(before, after, time=0.01, front=0.1, cell=1.5)  # its upper half is 1.25 m wide


def test_outrun_is_the_part_of_a_crest_whose_water_is_faster_than_the_crest():
    """Oracle: water of 1.25 c at the top, in proportion to the height of a Gaussian, is faster above 0.8 of it."""
    before, after, _ = gaussian(2.0, front=1.0, back=1.0, potential=lambda eta: 1.25 * 2.0 * eta / 0.4)
    (one,) = steep_crests(before, after, time=0.01, front=0.1, cell=0.1)
    assert one.outrun == pytest.approx((np.log(1.25) / np.log(2.0)) ** 0.5, abs=0.02)


def test_peaks_are_those_of_scipy():
    """Oracle: scipy.signal.find_peaks, which takes a second to load; noise, waves, and places that cells share."""
    random, x = np.random.default_rng(1), np.linspace(0.0, 40.0, 300)
    for trial in range(40):
        y = np.cumsum(random.normal(size=300)) if trial % 2 else np.sin(x) + 0.1 * random.normal(size=300)
        y = np.repeat(y, random.integers(1, 3, size=300))
        heights = y * (1.0 + 1e-15 * random.normal(size=y.size))  # where cells meet, both compute the height
        place, none = np.arange(float(y.size)), np.zeros(y.size)
        still = Profile(place, heights, none, none)
        found = steep_crests(still, still, time=1.0, front=-1.0, cell=0.0)
        peaks = find_peaks(y, prominence=LEAST * float(np.ptp(y)))[0]
        assert [y[int(crest.x)] for crest in found] == list(y[peaks]) and len(found) == len(peaks)


# ---------------------------------------------------------------- what is taken
def crest(x, B, outrun=0.0):
    return CREST._replace(x=x, velocity=2.0 * B, outrun=outrun)


def dissipation(length=12.0, cells=96, *, dt=1e-3):
    """Return a ring and what dissipates in it."""
    footprint = Ring(length, cells, comm=MPI.COMM_WORLD)
    plane = Plane(footprint.mesh, 3, footprint.chart)
    waves = NonlinearWaves(plane, depth=1.0, wall=Wall(), vertical_order=4, tolerances=Tolerances(1e-12, 1e-13))
    return waves, BreakingDissipation(waves, BreakingWatch(waves, SurfaceFlow(waves), length=length), dt=dt)


@pytest.mark.parametrize(("place", "B", "part"), [(0.0, 0.9, 1.0), (5.0, 0.9, 1.0), (5.0, 0.725, 0.5)])
def test_dissipated_energy_is_that_of_diffusion_at_the_crest_also_across_the_seam_of_a_ring(place, B, part):
    """Of full strength from B = 0.85 on, in proportion to B - 0.6 below.

    Oracle: linear waves, a e^(-nu k² t), much shorter than the viscosity's reach: k² g a² int nu dx a second.
    """
    waves, breaking = dissipation()
    k, a, x = 2 * np.pi / 0.75, 1e-4, waves.plane.x
    omega = np.sqrt(9.81 * k * np.tanh(k))
    q, p = waves.state(a * np.cos(k * x), a * 9.81 / omega * np.sin(k * x))
    breaking.place([crest(place, B)])
    before = waves.energy(q, p, 0.0)
    ((after_q, after_p),) = breaking.passed(np.array([[q, p]]))
    breaking.account(before - waves.energy(after_q, after_p, 0.0), of=before)
    viscosity = 0.2 * 2.0 * 1.0 * 4.0 * 1.0  # alpha c H times R, the integral of cos² from -R to R, as published
    assert breaking.energy_taken == pytest.approx(part * 1e-3 * k**2 * 9.81 * a**2 * viscosity, rel=0.1)
    assert waves.total_mass(after_q) == pytest.approx(waves.total_mass(q), rel=1e-14)


def test_breaking_lasts_until_the_crest_recovers():
    """A crest at 2 m/s that passes the seam of the ring; another one is not taken for it."""
    _, breaking = dissipation()
    watch = breaking.watch
    story = [(0.8, 0), (0.86, 1), (0.9, 1), (0.7, 1), (0.51, 1), (0.49, 0), (0.7, 0), (0.84, 0), (0.86, 1)]
    for step, (B, count) in enumerate(story):
        t = 0.2 * step
        found = watch.follow([crest((11.3 + 2.0 * t) % 12.0, B), crest((5.3 + 2.0 * t) % 12.0, 0.8)], t)
        assert len(found) == count
    assert [alarm.t for alarm in watch.alarms] == pytest.approx([0.2, 1.6])
    assert [(alarm.largest, alarm.end) for alarm in watch.alarms] == [(0.9, pytest.approx(0.8)), (0.86, 1.6)]
    sentence = "2 crests passed u/c = 0.85, the threshold of breaking, the first at t = 0.2 s, x = 11.7 m"
    assert watch.story == f"{sentence}; largest u/c 0.90"
    before = watch.state
    watch.follow([crest(8.0, 0.9)], 1.8)
    assert len(watch.alarms) == 3
    watch.state = before
    assert len(watch.alarms) == 2 and [index for index, _ in watch.state.active] == [1]


@pytest.mark.parametrize(("B", "stops"), [(0.99, None), (1.01, 1.2)])
def test_crest_outrun_for_an_eighth_of_its_period_stops_the_run_and_is_recorded(B, stops):
    """A crest at 2 m/s has a period of 1.28 s; it is missed once, and followed from t = 1 s on."""
    _, breaking = dissipation()
    watch = breaking.watch
    watch.search = lambda state, t: watch.follow([] if t == 1.1 else [crest(1.0 + 2.0 * t, B)], t)
    stop, ended = BreakingAlarm(watch, stop=True), None
    for t in np.round(np.arange(1.0, 1.5, 0.05), 2):
        with nullcontext() if t != stops else pytest.raises(RunError, match=r"outruns the crest for 0\.16 periods"):
            stop.needed(None, float(t))
        ended = t
        if t == stops:
            break
    assert len(watch.columns["t [s]"]) == 1 and ended == (stops or 1.45)


@pytest.mark.parametrize(("x", "examined"), [(0.9, 0), (1.1, 1), (10.9, 1), (11.1, 0)])
def test_crests_within_a_depth_of_a_wall_are_not_examined(x, examined):
    """A lone crest of water 1 m deep that travels at 2 m/s in a tank of 12 m."""
    footprint = Slice(12.0, 120, comm=MPI.COMM_WORLD)
    waves = NonlinearWaves(Plane(footprint.mesh, 3), depth=1.0, wall=Wall(), vertical_order=4)
    watch = BreakingWatch(waves, SurfaceFlow(waves), length=None)
    for t in (0.0, 0.01):
        eta = 0.3 * np.exp(-(((waves.plane.x - x + 2.0 * (0.01 - t)) / 0.3) ** 2))
        watch.search(Point(*waves.state(eta, 2.0 * np.cumsum(0 * eta))), t)
    assert len(watch.crests) == examined


@pytest.mark.parametrize(("moving", "seen"), [(0.0, 0), (1.0, 4)])
def test_only_travelling_crests_are_coherent(moving, seen):
    """Four steep cosines that grow in place, and four that travel."""
    waves, breaking = dissipation()
    watch, x, k, c = breaking.watch, waves.plane.x, 2 * np.pi / 3.0, 2.0
    for t, a in ((0.0, 0.29), (0.01, 0.3)):
        eta = a * np.cos(k * (x - moving * c * t))
        psi = 0.3 * np.cos(k * x) if moving == 0.0 else 1.5 / k * np.sin(k * (x - c * t))
        watch.search(Point(*waves.state(eta, psi)), t)
    assert len(watch.crests) == 4
    assert sum(crest.coherence > COHERENT for crest in watch.crests) == seen


# ---------------------------------------------------------------- the gate
def test_bore_raises_no_alarm():
    """The water of its plateau moves; it stopped after 0.95 s."""
    assert executed(with_numerics(bore(0.1, duration=1.2), vertical_order=4))[0].t >= 1.2


def with_breaking(case, on_breaking="warn", **run):
    return case.model_copy(update={"run": case.run.model_copy(update={"on_breaking": on_breaking, **run})})


def test_every_mode_records_the_same_alarm_and_a_stopped_run_resumes_with_dissipation(tmp_path):
    """The alarm alone stops nothing; the run that stops keeps the step before, and its alarms."""
    quiet = {"comm": MPI.COMM_SELF, "console": Console(quiet=True)}
    alarms, steep = [], with_numerics(over_steep(0.6), vertical_order=4)
    for mode in ("warn", "dissipate", "stop"):
        case, out = with_breaking(steep, mode, duration=0.34 if mode != "stop" else 0.6), tmp_path / mode
        with pytest.raises(RunError, match="a wave breaks: the water outruns") if mode == "stop" else nullcontext():
            record_run(case, out, **quiet)
        alarms.append(RunDirectory(out).manifest["breaking"]["alarms"][0])
        with (out / "breaking.csv").open() as file:
            (row,) = csv.DictReader(file)
        assert [float(row[name]) for name in ("t [s]", "x [m]")] == [alarms[-1]["t"], alarms[-1]["x"]]
        assert float(row["largest u/c [-]"]) > ONSET
        assert "1 crest passed u/c = 0.85" in (out / "run.log").read_text()
    warned, damped, stopped = [(one["t"], one["x"], one["onset"]) for one in alarms]
    assert warned == damped == stopped
    t = RunDirectory(tmp_path / "stop").manifest["last_checkpoint"]
    assert warned[0] < t < 0.6
    on = wavetank.resume(tmp_path / "stop", ["run.on_breaking=dissipate", "run.duration=0.5"])
    resumed = on.manifest["breaking"]
    assert resumed["alarms"][0]["t"] == warned[0] and resumed["energy_taken"] > 0.0


@pytest.mark.parametrize(
    ("case", "until"), [(release(0.5), 0.6), (luth_c(2), 18.8)], ids=["transient crest", "crest of a bar's transient"]
)
def test_a_wave_that_recovers_raises_no_alarm_and_stops_nothing(case, until):
    """It stopped at 0.48 s, and at 18.3 s. Oracles: the exact release; finer cells, which pass that crest."""
    found = row(BreakingCase("", False, with_breaking(case, duration=until)))
    assert not found.stopped and found.end == pytest.approx(until, abs=0.05)
    assert np.isnan(found.alarm) and found.largest < 0.7


def test_before_a_far_wall_that_moves_waves_break_as_before_the_near_one():
    """Within its reach; of the mirrored tank the place is the mirrored one."""
    motion, found = {"type": "sinusoid", "paddle_amplitude": 0.05, "period": 0.8, "ramp": 0.8}, []
    piston, tank = {"type": "piston", "reach": 1.0, "motion": motion}, {"length": 2.0, "depth": 0.5}
    for walls in ((piston,), (None, piston)):
        run = {"duration": 1.3, "on_breaking": "dissipate"}
        run, *_ = executed(case_of(*walls, tank=tank, run=run, cells=24, dt=0.01, tolerance=1e-7))
        (breaking,) = (one for one in run.filters if isinstance(one, BreakingDissipation))
        alarms = breaking.watch.alarms
        found.append((alarms[0].t, alarms[0].x, len(alarms), breaking.energy_taken))
    (t, x, *near), (then, there, *far) = found
    assert x < 1.0 and t == then and there == pytest.approx(2.0 - x, abs=1e-5)
    assert far == pytest.approx(near, rel=1e-4) and near[1] > 0.0


def test_run_reports_breaking_dissipation_and_the_breakdown_that_they_cause(tmp_path, monkeypatch):
    """A solve that fails at the fifth time stands for what the viscosity does not hold; who goes on counts it once."""
    steps, smoothed, said = counted(1), BreakingDissipation.passed, StringIO()

    def passed(self, pairs):
        if next(steps) == 5:
            raise ConvergenceError("a solve did not end")
        return smoothed(self, pairs)

    monkeypatch.setattr(BreakingDissipation, "passed", passed)
    case = with_breaking(with_numerics(over_steep(0.6), vertical_order=4), "dissipate", duration=0.8)
    with pytest.raises(RunError, match=r"a solve did not end: .*; 1 crest passed .* was insufficient"):
        record_run(case, tmp_path / "run", comm=MPI.COMM_SELF, console=Console(file=said, width=200))
    (begins,) = re.findall(r"(t = \S+ s, x = \S+ m): a wave breaks; an eddy viscosity acts on it", said.getvalue())
    taken = rf"1 crest passed .*, at {re.escape(begins)}; .*; the eddy viscosity dissipated (\S+) % of the energy"
    (taken,) = re.findall(taken, said.getvalue().replace("\n", " "))
    assert 0.1 < float(taken) < 20.0
    kept = RunDirectory(tmp_path / "run").manifest["breaking"]
    assert [f"t = {one['t']:.6g} s, x = {one['x']:.4g} m" for one in kept["alarms"]] == [begins] and kept["waves"] == 1
    assert 100 * kept["part_taken"] == pytest.approx(float(taken), rel=0.06) and kept["energy_taken"] > 0.0
    on = wavetank.resume(tmp_path / "run", ["run.duration=0.4"])
    (resumed,), (alarm,) = on.manifest["breaking"]["alarms"], kept["alarms"]
    assert (resumed["t"], resumed["x"], resumed["onset"]) == (alarm["t"], alarm["x"], alarm["onset"])


@pytest.mark.parametrize(("outrun", "stops"), [(0.19, False), (0.21, True)])
def test_a_run_stops_where_water_outruns_a_crest_in_a_fifth_of_its_upper_half(outrun, stops):
    _, breaking = dissipation()
    watch = breaking.watch
    watch.search = lambda state, t: watch.follow([crest(1.0, 1.1, outrun)], t)
    state = Point(np.zeros(1), np.zeros(1))
    with pytest.raises(RunError, match="in 21 % of its upper half") if stops else nullcontext():
        assert not BreakingAlarm(watch, stop=True).needed(state, 1.0)
    assert len(watch.alarms) == 1


@pytest.mark.slow
@pytest.mark.parametrize("times", [0.5, 1.0, 2.0])
def test_no_sound_wave_stops_a_run_and_no_breaking_one_is_missed(times, tmp_path):
    """What it prints is the table of docs/breaking.md."""
    wrong = []
    for case in cases(tmp_path):
        found = row(refined(case, times))
        print(found)
        missed = case.breaks and times >= 1.0 and np.isnan(found.alarm)
        if missed or (found.stopped and not case.breaks):
            wrong.append(found)
    assert not wrong


@pytest.mark.slow
def test_onset_and_dissipated_energy_do_not_depend_on_step_and_cells(tmp_path):
    """Of all that break: 5 % and 10 % for half and a quarter of the step, and twice the cells."""
    for case in (case for case in cases(tmp_path) if case.breaks):
        fine = ((1.0, 1.0), (1.0, 2.0), (1.0, 4.0), (2.0, 1.0))
        first, *finer = (dissipated(refined(case, times, steps=steps)) for times, steps in fine)
        print(first, *finer)
        for one in finer:
            assert one.alarm == pytest.approx(first.alarm, rel=0.05)
            assert one.viscosity + one.penalty == pytest.approx(first.viscosity + first.penalty, rel=0.1)


# ---------------------------------------------------------------- basins
LENGTH = 1.5  # of the exact wave [m]
TIME = 0.01  # between two searches [s]


def exact_waves(angle, *, steepness=0.85, kind="quadrilaterals"):
    """Return a watch, the exact wave's states at both searches in a basin, and the wave."""
    waves = basin(4.0, 2.0, [40, 20], kind=kind)
    wave = stream_function_wave(steepness * maximum_height(LENGTH, 0.5), LENGTH, depth=0.5)
    along = waves.plane.places @ [np.cos(angle), np.sin(angle)]

    def at(t):
        place = along - 0.6 - wave.speed * t
        return Point(*waves.state(*wave.surface((place + LENGTH / 2) % LENGTH - LENGTH / 2)))

    return BasinBreakingWatch(waves, waves.surface), (at(0.0), at(TIME)), wave


@pytest.mark.parametrize(("angle", "kind"), [(0.0, "quadrilaterals"), (0.4, "triangles"), (2.5, "quadrilaterals")])
def test_crests_of_an_oblique_wave_have_its_speed_and_its_waters(angle, kind):
    """Oracle: speed c and crest velocity u of the exact wave, 85 % as high as the highest, in any direction."""
    watch, states, wave = exact_waves(angle, kind=kind)
    for state, t in zip(states, (0.0, TIME), strict=True):
        watch.search(state, t)
    _, (behind, ahead) = wave.surface(np.array([-1e-4, 1e-4]))
    assert watch.crests
    for crest in watch.crests:
        phase = (crest.x * np.cos(angle) + crest.y * np.sin(angle) - 0.6 - wave.speed * TIME) / LENGTH
        assert phase == pytest.approx(round(phase), abs=0.04)
        assert crest.speed == pytest.approx(wave.speed, rel=0.04)
        assert crest.velocity == pytest.approx((ahead - behind) / 2e-4, rel=0.05)
    if angle == 0.0:  # the third crest is within a depth of the wall at x = 4 m
        assert {round(crest.x, 1) for crest in watch.crests} == {0.6, 2.1}
    apart = [np.hypot(a.x - b.x, a.y - b.y) for n, a in enumerate(watch.crests) for b in watch.crests[:n]]
    assert min(apart, default=1.0) >= 0.07  # a cell: each crest once


def test_sections_of_one_crest_dissipate_as_one_section():
    """A long crest is cut by several sections near each other; of each point the largest viscosity acts."""
    waves = basin(4.0, 2.0, [10, 5])
    crest = CREST._replace(x=2.0, height=0.15, velocity=1.4, speed=1.5, y=1.0)
    breaking = BreakingDissipation(waves, BasinBreakingWatch(waves, waves.surface), dt=0.01)
    x = waves.plane.places[:, 0]
    pair = np.array([waves.state(0.01 * np.cos(np.pi * x), 0.03 * np.sin(np.pi * x))])
    breaking.place([crest])
    once = breaking.passed(pair)
    breaking.place([crest, crest._replace(height=0.1)])
    assert np.abs(once - pair).max() > 1e-3 * np.abs(pair).max()
    assert breaking.passed(pair) == pytest.approx(once, rel=1e-12)


def packet(tank, *, amplitude, on_breaking="stop", duration=0.6):
    """Return a case of a long-crested packet of waves of 1.5 m that travels along x, its middle at x = 3 m."""
    where = {"k": "2*pi/1.5", "a": str(amplitude), "s": "x-3", "env": "exp(-(s/1.5)**2)"}
    start = {"type": "formula", "eta": "a*env*cos(k*s)", "psi": "a*env*sqrt(9.81/k)*sin(k*s)", "where": where}
    numerics = {"cell_size": 0.1, "order": 3, "vertical_order": 4, "dt": 0.01}
    run = {"duration": duration, "on_breaking": on_breaking}
    return Case.model_validate({"tank": {"depth": 0.7} | tank, "initial": start, "run": run, "numerics": numerics})


SLICE = {"type": "slice", "length": 9.0}
BASIN = {"type": "basin", "layout": {"type": "rectangle", "length": 9.0, "width": 0.2}}  # two cells across


def stopped(scene):
    """Return when a run breaks down [s], and the sentence."""
    run, _ = build_run(scene, MPI.COMM_SELF)
    with pytest.raises(RunError) as error:
        run.execute()
    return run.t, str(error.value)


def test_a_breaking_wave_of_a_slice_stops_a_basin_at_the_same_time_and_place():
    """Oracle: the slice. The wave is long-crested."""
    (t, along), (basin_t, across) = (stopped(packet(tank, amplitude=0.13)) for tank in (SLICE, BASIN))
    assert t < 0.4 and basin_t == pytest.approx(t, abs=0.011)
    said = along.partition(": a wave breaks")[0]
    assert across.startswith(said + ", y = ") and ": a wave breaks: the water outruns the crest" in across


def test_a_steep_sound_wave_finishes_in_a_basin_without_alarm():
    """Its slopes pass the threshold of the front, so that crests are judged."""
    scene = packet(BASIN | {"layout": BASIN["layout"] | {"length": 6.0}}, amplitude=0.085, duration=0.3)
    run, waves = build_run(scene, MPI.COMM_SELF)
    run.execute()
    watch = run.filters[0].watch
    assert waves.surface.largest_slope > 0.3 and watch.alarms == () and watch.crests


@pytest.mark.slow
def test_dissipation_takes_as_much_of_a_long_crest_in_a_basin_as_in_a_slice(tmp_path):
    """Oracle: the slice. The alarms begin together, and their table has y."""
    figures = []
    for name, tank in (("slice", SLICE), ("basin", BASIN)):
        out = tmp_path / name
        record_run(
            packet(tank, amplitude=0.13, on_breaking="dissipate"), out, comm=MPI.COMM_SELF, console=Console(quiet=True)
        )
        figures.append(RunDirectory(out).manifest["breaking"])
    with (tmp_path / "basin" / "breaking.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert 0.0 < float(rows[0]["y [m]"]) < 0.2
    along, across = figures
    for key in ("t", "x"):
        assert across["alarms"][0][key] == pytest.approx(along["alarms"][0][key], rel=0.05)
    assert across["part_taken"] == pytest.approx(along["part_taken"], rel=0.1) and along["part_taken"] > 0.1


ANGLE = np.pi / 6
WHERE = {  # distances along and across the direction of propagation from (3, 2.5) m
    "k": "2*pi/1.5",
    "a": "0.13",
    "s": f"(x-3)*cos({ANGLE})+(y-2.5)*sin({ANGLE})",
    "n": f"(y-2.5)*cos({ANGLE})-(x-3)*sin({ANGLE})",
    "env": "exp(-(s/1.5)**2-(n/0.9)**6)",
}


@pytest.mark.slow
def test_a_breaking_packet_of_finite_width_at_an_angle_stops_a_basin():
    """It is as steep as the one that stops a slice after 0.33 s; its sides spread, so that it stops at 0.55 s."""
    layout = {"type": "rectangle", "length": 7.0, "width": 5.0}
    scene = packet({"type": "basin", "layout": layout}, amplitude=0.13)
    t, said = stopped(scene.model_copy(update={"initial": scene.initial.model_copy(update={"where": WHERE})}))
    assert 0.3 < t < 0.6 and ": a wave breaks: the water outruns the crest" in said
