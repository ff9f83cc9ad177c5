"""Checks of a case before its run, by code, key and value, and numerics that a case does not name.

Oracles: the sums of interpolation errors and of Simpson's rule by hand, linear theory for wave lengths, an explicit
accuracy for the plan.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from case_builders import SLICE, build_case, moving, piston, warnings_before
from mpi4py import MPI
from records import gauge_rows
from rich.console import Console

from wavetank.base.errors import InputError
from wavetank.case import Case, LinearWater
from wavetank.case.reading import read_case
from wavetank.output.directory import RunDirectory
from wavetank.planning.checks import coarse, too_high, waves_missed
from wavetank.planning.dispersion import Mesh, UniformCells
from wavetank.planning.plan import planned, rule_summary
from wavetank.planning.requirements import requirements
from wavetank.planning.resolution import resolved
from wavetank.recording import record_run
from wavetank.simulation import stability
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers, build_watch
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory, Records
from wavetank.waves.airy import wave_number

CHECKOUT = Path(__file__).resolve().parents[1]
OVER_A_BAR = SLICE | {"bed": {"type": "formula", "depth": "1 - 0.7 * exp(-((x - 8) / 2) ** 4)"}}
BAR = {"bed": {"type": "formula", "depth": "0.4 - 0.3 * clip((x - 6) / 6, 0, 1) + 0.3 * clip((x - 14) / 3, 0, 1)"}}
BASIN = {"type": "basin", "depth": 1.0, "layout": {"type": "rectangle", "length": 4.0, "width": 1.0}}


def standing(mode=1):
    return {"type": "standing-wave", "wave_amplitude": 1e-4, "mode": mode}


def test_run_reports_the_rule_if_no_plan_is_made(tmp_path):
    """With the reason; the manifest has the cells that result, a third of the depth."""
    bed, start = {"type": "formula", "depth": "1 - 0.01 * x"}, {"initial": standing()}
    one = build_case({"length": 4.0, "depth": 1.0, "bed": bed}, duration=0.1, **start)
    record_run(one, tmp_path / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))
    reason = "no accuracy is predicted, cells and vertical order follow a rule (docs/plan.md): tank.bed.type = "
    assert reason in (tmp_path / "run" / "run.log").read_text()
    assert RunDirectory(tmp_path / "run").manifest["numerics"]["cells"] == 12
    assert rule_summary(build_case(BASIN)).endswith("with a flat bed")
    assert not any(map(rule_summary, (build_case(**start), build_case(SLICE | {"bed": bed}, numerics={"cells": 9}))))


RIPPLES = {"bed": {"type": "formula", "depth": "1 + 0.1 * sin(200 * x)"}}
CELLS, ORDER = "numerics.cell_size", "numerics.vertical_order"
DRIVEN = {"wall": piston(1.8), "numerics": {"cells": 20}}
SHORT_SPONGE = {"sponge": {"type": "end", "length": 1.0}}
STEP = {"type": "formula", "gamma": "20 * clip(1e6 * (x - 12), 0, 1)"}  # begins at once
WEAK = {"type": "end", "length": 4.0, "strength": 0.05}
FAST = {"wall": piston(0.1, 1e-4), "numerics": {"cell_size": 2.0, "order": 2, "dt": 0.08}}
PLACES = [{"name": "far", "x": 3.5, "y": 0.5}, {"name": "near", "x": 2.0, "y": 0.5}]
IN_BASIN = {"tank": BASIN | {"layout": BASIN["layout"] | {"sponge_length": 1.0}}, "sponge": {"type": "group"}}
BARRED = {"tank": OVER_A_BAR, "numerics": {"cells": 40, "vertical_order": 4}}
TOO_DEEP = {"tank": {"length": 0.0209, "depth": 1.0}, "initial": standing() | {"wave_amplitude": 1e-6}}
WARNED = {  # case: parts of it, its warnings as {(code, key): expected value}
    "cells ten times too large": (
        {"wall": piston(1.8), "duration": 20.0, "numerics": {"cell_size": 10.0}},
        {("inaccurate", "numerics"): 1.0},
    ),
    "steps as long as the paddle's period": (
        FAST,
        {("cells-too-large", CELLS): None, ("waves-too-deep", ORDER): None, ("step-misses-motion", "numerics.dt"): 2.2},
    ),
    "a sponge of a quarter of a wave": (DRIVEN | SHORT_SPONGE, {("sponge-reflects", "sponge"): 0.37}),
    "a sponge behind a bar": (
        {"wall": piston(1.8)} | BARRED | SHORT_SPONGE,
        {("sponge-reflects", "sponge"): 0.37, ("coarse-over-bed", CELLS): None},
    ),
    "a sponge that begins at once behind a bar": (
        DRIVEN | {"tank": OVER_A_BAR, "wall": piston(2.0), "sponge": STEP},
        {("sponge-reflects", "sponge"): 0.62, ("coarse-over-bed", CELLS): None},
    ),
    "a sponge as weak as none": (DRIVEN | {"wall": piston(1.5), "sponge": WEAK}, {("sponge-reflects", "sponge"): 0.94}),
    "a basin's sponge of a quarter of a wave, a gauge in it": (
        {"wall": piston(1.8), "gauges": PLACES, "numerics": {"cell_size": 0.5, "vertical_order": 4}} | IN_BASIN,
        {("sponge-reflects", "sponge"): 0.37},
    ),
    "too deep for any vertical order": (TOO_DEEP | {"duration": 1.0}, {("inaccurate-deep-waves", "numerics"): None}),
}


@pytest.mark.parametrize("name", WARNED)
def test_run_warns_by_code_and_key(name):
    parts, expected = WARNED[name]
    found = warnings_before(planned(build_case(**{"duration": 2.0} | parts), MPI.COMM_SELF).case)
    assert [(one.code, one.key) for one in found] == [*expected] and all(map(str, found))
    values = {(one.code, one.key): one.value for one in found if expected[one.code, one.key]}
    assert values == pytest.approx({key: value for key, value in expected.items() if value}, rel=0.05)


@pytest.mark.parametrize(("dt", "codes"), [(0.055, ["unstable-under-crests"]), (0.049, [])])
def test_step_too_long_under_crests_is_warned_of(dt, codes):
    """Oracle: runs of 24 s, of which the first is inaccurate from 13.75 s on and the second has no warning."""
    case = read_case(CHECKOUT / "cases" / "focusing.toml", [f"numerics.dt={dt}"])
    assert [one.code for one in warnings_before(planned(case, MPI.COMM_SELF).case)] == codes


CASES = sorted(path.stem for path in (CHECKOUT / "cases").glob("*.toml"))
LONG = {"berkhoff-1982", "cylinder", "directional-focus"}  # basins whose kernels no other test needs


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in CASES])
def test_cases_have_no_warnings(name):
    try:
        case = read_case(CHECKOUT / "cases" / f"{name}.toml")
    except InputError:
        pytest.skip("its data are not on this machine")
    chosen, warnings = planned(case, MPI.COMM_SELF)
    assert [*warnings, *warnings_before(chosen)] == []


@pytest.mark.parametrize("case", ["wavemaker", "focusing"])
@pytest.mark.parametrize(
    "changes", [["run.duration=0.3"], ["run.duration=2.0"], ["run.duration=0.02", "numerics.dt=0.01"]]
)
def test_short_run_has_the_numerics_of_the_complete_motion(case, changes):
    """A motion cut off amid a stroke has waves of all lengths; in two steps Simpson's rule misses 0.13 of a ramp."""
    chosen, warnings = planned(read_case(CHECKOUT / "cases" / f"{case}.toml", changes), MPI.COMM_SELF)
    assert chosen.numerics.vertical_order == 8  # as that of 24 s
    assert [*warnings, *warnings_before(chosen)] == []


TOO_HIGH = {
    "focused": {"linear_crest": 0.4, "focus_x": 10.0, "focus_time": 20.0},
    "sinusoid": {"paddle_amplitude": 0.2, "period": 1.6},
}
GROUP = {"lowest_frequency": 0.4, "highest_frequency": 1.3, "spectrum": {"type": "jonswap", "peak_frequency": 0.65}}


def driven(kind, **motion):
    return build_case(duration=24.0, wall=moving("piston", kind, **motion))


@pytest.mark.parametrize("kind", TOO_HIGH)
def test_wave_too_high_has_height_place_and_time(kind):
    """By Miche's limit in depth, and the target crest, or the wavemaker's transfer function."""
    motion = TOO_HIGH[kind] | (GROUP if kind == "focused" else {})
    one = driven(kind, **motion)
    (warning,) = too_high(one)
    k = 2 * np.pi / warning.details["length"]
    assert warning.limit == pytest.approx(0.142 * warning.details["length"] * np.tanh(k), rel=0.05)
    assert warning.value > warning.limit
    if kind == "focused":
        assert (warning.x, warning.t) == pytest.approx((10.0, 20.0), abs=1.0)
        assert 1.5 < warning.value / motion["linear_crest"] < 2.0
    else:  # highest at the front of the train
        stroke = 2 * motion["paddle_amplitude"]
        assert 1.0 < warning.value / (stroke * one.wall.wavemaker.transfer(k, 1.0)) < 1.25
    assert not [*too_high(one.model_copy(update={"run": one.run.model_copy(update={"on_breaking": "dissipate"})}))]


def test_steep_waves_are_not_too_high():
    """Nor a solitary wave, which has no trough. Oracle: groups as high have run, and higher ones broken."""
    group = TOO_HIGH["focused"] | GROUP
    steep, breaks = (driven("focused", **group | {"linear_crest": crest}) for crest in (0.16, 0.19))
    assert not [*too_high(steep), *too_high(driven("solitary-wave", height=0.4))]
    (warning,) = too_high(breaks)
    assert 0.81 < warning.value / warning.limit < 1.0


def on_a_slope(period, **numerics):
    """Return a piston before a slope from 1 m of water to 0.5 m, with the usual cells unless named."""
    bed = {"type": "formula", "depth": "1 - 0.025 * x"}
    return resolved(build_case(SLICE | {"bed": bed}, wall=piston(period, 1e-4), numerics=numerics))


def test_cells_too_large_miss_the_speed_of_linear_elements():
    """By linear elements' waves, mu = 6 (1 - cos k h) / (h² (2 + cos k h)), in deep water, omega² = g mu^(1/2)."""
    one = on_a_slope(0.5, cell_size=0.08, order=1, dt=0.01)
    (warning,) = waves_missed(one, 0.08)
    cosine = np.cos((k := 16 * np.pi**2 / 9.81) * 0.08)
    speed = (6 * (1 - cosine) / (0.08**2 * (2 + cosine)) / k**2) ** 0.25
    expected = {"order": 1, "nodes": 4.88, "period": 0.5, "length": 0.39, "missed": speed - 1}
    assert {name: warning.details[name] for name in expected} == pytest.approx(expected, rel=5e-3)
    assert warning.code == "cells-too-large" and not [*waves_missed(one, warning.limit)]
    assert not [*waves_missed(on_a_slope(0.5), on_a_slope(0.5).cell_size)]


FAR_FROM_THE_RULE = [  # numerics, warnings as code, value and limit
    ({"cell_size": 0.12}, []),  # right to 2.5 % at all gauges
    ({"cell_size": 0.16}, [("coarse-over-bed", 0.159, 0.08)]),  # a wave breaks
    ({"cell_size": 0.3, "order": 8}, []),
    ({"vertical_order": 4}, []),  # right to 0.5 %
    ({"vertical_order": 2}, [("low-order-over-bed", 2, 8)]),  # to 26 %
]


@pytest.mark.parametrize(("numerics", "expected"), FAR_FROM_THE_RULE, ids=str)
def test_numerics_far_from_the_rule_over_a_bed_are_warned_of(numerics, expected):
    """Oracle: waves of 30 mm over a bar from 0.4 m to 0.1 m, against cells of 0.05 m (docs/plan.md)."""
    one = resolved(build_case({"length": 22.0, "depth": 0.4} | BAR, duration=2.0, wall=piston(1.5), numerics=numerics))
    found = [(warning.code, warning.value, warning.limit) for warning in coarse(one, one.cell_size)]
    assert found == [(code, *map(pytest.approx, (value, limit), [0.01, 0.01])) for code, value, limit in expected]


def test_vertical_order_too_low_misses_the_speed_of_waves():
    """By hand: one linear function makes of tanh(x) / x, x = k d, 1 - 3/4 x² / (x² + 3)."""
    one = on_a_slope(2.0, vertical_order=1)
    x = float(wave_number(np.pi, 1.0, 9.81))
    speed = np.sqrt(x / np.tanh(x) * (1 - 0.75 * x**2 / (x**2 + 3)))
    (warning,) = waves_missed(one, one.cell_size)
    assert (warning.code, warning.value) == ("vertical-order-too-low", 1)
    assert warning.details["missed"] == pytest.approx(speed - 1, abs=1e-3)
    enough = on_a_slope(2.0, vertical_order=warning.limit)
    assert not [*waves_missed(enough, enough.cell_size)]


def test_cells_too_large_for_the_shortest_waves_are_warned_of():
    """Of two as strong in one motion, T = 1.6 s and 0.5 s, the longer ones have just over half of the power."""
    position = "1e-4 * (1.05 * sin(2*pi*t/1.6) / 1.25 + sin(4*pi*t) / 4)"
    wall = moving("piston", "formula", position=position, ramp=2.0)
    (warning,) = waves_missed(resolved(build_case(BASIN, wall=wall, duration=32.0, numerics={"cell_size": 0.4})), 0.4)
    assert (warning.details["period"], warning.details["length"]) == pytest.approx((0.5, 0.39), rel=0.03)


WAVE = {"initial": {"type": "standing-wave", "wave_amplitude": 0.1}}


@pytest.mark.parametrize(
    ("numerics", "start", "off"),
    [({"integrator": "stormer-verlet", "dt": 0.08}, WAVE, True), ({}, WAVE, False), ({}, {}, False)],
    ids=["long steps", "usual", "still water"],
)
def test_energy_balance_is_warned_of_by_its_largest_difference(numerics, start, off):
    """However few rows of it are recorded."""
    chosen = {"cells": 2, "vertical_order": 4} | numerics
    one = build_case({"length": 2.0, "depth": 1.0}, duration=6.0, numerics=chosen, **start)
    run, waves = build_run(one, MPI.COMM_SELF)
    energy = Memory()
    budget, *_ = build_observers(one, waves, Records(Memory(), energy, None), sinks=run.sinks)
    seldom = EnergyBudget(waves, record=Memory(), every=50, sinks=run.sinks)
    run.diagnostics += [budget, seldom]
    run.execute()
    warnings = budget.warnings()
    assert len(warnings) == off and [*map(str, seldom.warnings())] == [*map(str, warnings)]
    balance, total = np.abs(energy.array()[:, 6]).max(), energy.array()[:, 3].max()
    assert [one.value for one in warnings] == pytest.approx([balance / total] * off, rel=0.05)


def test_warnings_are_printed_before_and_after_the_run_and_in_its_manifest(wavetank, tmp_path):
    case, out = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(
        'tank = {length = 2.0, depth = 1.0}\ninitial = {type = "standing-wave", wave_amplitude = 0.1}\n'
        'run.duration = 6.0\nnumerics = {cells = 2, vertical_order = 4, dt = 0.08, integrator = "stormer-verlet"}\n'
    )
    result = wavetank("run", str(case), "--no-plots", "--out", str(out))
    assert result.returncode == 0, result.stderr
    worst, *_, sentence = map(str, RunDirectory(out).warnings)
    assert sentence.startswith("the energy balance is off by 0.0")
    assert f"\nwarning: {sentence}\nhighest crest: " in result.stdout
    assert result.stdout.split("\nt = ", maxsplit=1)[0].endswith(f"\nwarning: {worst}")
    assert f" of the energy; 2 warnings, the worst: {worst}\n" in result.stdout


# ------------------------------------------------------------------------------------------------ what is not named
def test_case_without_numerics_has_the_plan_for_one_per_cent():
    """Of waves of k d = 8.9, which 40 cells, a fifth of the depth, do not resolve."""
    parts = {"tank": {"length": 8.0, "depth": 1.0}, "wall": piston(0.67), "duration": 6.0}
    plain, asking = build_case(**parts), build_case(**parts, numerics={"accuracy": 1e-2})
    chosen = planned(plain, MPI.COMM_SELF).case
    assert chosen == planned(asking, MPI.COMM_SELF).case
    assert chosen.numerics.cells > 40 and plain.cells == 40
    again = Case.model_validate(plain.model_dump(mode="json"))
    assert again == plain and again.numerics.open


def test_water_with_recorded_velocities_is_nonlinear():
    """Linear water, which would do, has none."""
    for output, physics in (({}, "linear"), ({"velocity_every": 1.0}, "nonlinear")):
        assert requirements(build_case(wall=piston(2.0), output=output), 1e-2).physics == physics


@pytest.mark.parametrize("period", [0.5, 0.67, 3.0])
def test_cells_of_a_basin_follow_the_shortest_wave(period):
    """Three in a wave length of linear theory, but none larger than half a depth."""
    chosen = resolved(build_case(BASIN, wall=piston(period), duration=20.0))
    length = 2 * np.pi / float(wave_number(2 * np.pi / period, 1.0, 9.81))
    assert 0.75 * min(0.5, length / 3) < chosen.cell_size <= min(0.5, length / 3)  # the ramp has shorter waves yet
    assert chosen.numerics.vertical_order == {0.5: 9, 0.67: 8, 3.0: 8}[period]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_cells_follow_the_named_order(order):
    """The frequency of the paddle's waves on them, against that on very fine ones, by the discrete dispersion."""
    chosen = resolved(build_case(wall=piston(0.5), duration=20.0, numerics={"order": order}))
    k = float(wave_number(4 * np.pi, 1.0, 9.81))
    on_these, on_fine = (
        float(Mesh(cells=cells, vertical_order=8, depth=1.0, gravity=9.81).frequency(cells.waves(k).mu))
        for cells in (UniformCells(order, chosen.cell_size), UniformCells(8, 0.05))
    )
    assert 2e-5 < on_these / on_fine - 1 < 3e-4


def test_cells_follow_bed_and_start():
    bed = resolved(build_case(SLICE | RIPPLES, wall=piston(1.8)))
    start = resolved(build_case(BASIN, initial={"type": "formula", "eta": "0.001 * cos(4 * pi * x) * cos(3 * pi * y)"}))
    assert bed.cell_size == pytest.approx(2 * np.pi / 200 / 3 * 5 / 3, rel=0.01)  # of order 4
    assert start.cell_size == pytest.approx(2 * np.pi / (5 * np.pi) / 3, rel=0.3)  # looked at along x and along y


ORDERS = [  # numerics that a case over a bed names, then order and cell size
    ({}, 4, pytest.approx(27 / 202)),
    ({"order": 3}, 3, None),
    ({"order": 5}, 5, None),
    ({"cell_size": 0.2}, 3, 0.2),
    ({"cells": 135}, 3, None),  # of 0.2 depths
    ({"integrator": "third-order", "vertical_order": 6}, 4, pytest.approx(27 / 202)),
]


def test_order_over_a_bed_is_4_in_a_slice_and_3_in_a_basin():
    """Measured: the cheaper one (docs/plan.md, tests/test_plan_measured.py). What a case names is not changed."""
    basin = resolved(build_case(BASIN | BAR, wall=piston(2.02)))
    assert (basin.numerics.order, basin.cell_size) == (3, 0.5)
    for numerics, order, size in ORDERS:
        one = resolved(build_case({"length": 27.0, "depth": 0.4} | BAR, wall=piston(2.02), numerics=numerics))
        assert one.numerics.order == order and (size is None or one.cell_size == size)


TRAIN = "(1 + 0.1 * cos(pi * x / 16)) * cos(pi * x / 2)"  # eight waves of 4 m
AHEAD = "(1 + 0.1 * cos(pi * x / 16)) * sin(pi * x / 2)"


@pytest.mark.parametrize(("steepness", "harmonics"), [(0.01, 1), (0.1, 2), (0.2, 3)])
@pytest.mark.parametrize("keys", [("eta",), ("psi",), ("eta", "psi")], ids="-".join)
def test_cells_of_a_steep_start_follow_its_bound_harmonics(steepness, harmonics, keys):
    """Oracle: Stokes' deep-water harmonics s / 2 and 3 s² / 8 against 1 %, s of the crest; three cells in the shortest.

    The shortest of the free waves is the shorter side band, 32/9 m: its power is 0.25 % of the carrier's.
    """
    amplitude = steepness / (np.pi / 2 * 1.1)
    assert sum(part > 0.01 for part in (1.0, steepness / 2, 3 * steepness**2 / 8)) == harmonics
    start = {"eta": f"{amplitude} * {TRAIN}", "psi": f"{amplitude * np.sqrt(9.81 / (np.pi / 2))} * {AHEAD}"}
    start = {"type": "formula", "eta": "0"} | {key: start[key] for key in keys}
    one = build_case({"type": "ring", "length": 32.0, "depth": 8.0}, duration=2.0, initial=start)
    assert resolved(one).cell_size == pytest.approx(4.0 / harmonics / 3, rel=0.02)
    assert rule_summary(one).endswith(f"; the shortest wave, {4 / harmonics:.3g} m, is that of the initial surface")
    linear = one.model_copy(update={"water": LinearWater()})
    assert resolved(linear).cell_size == pytest.approx(4.0 / 3, rel=0.02)  # it has no bound harmonics


def recorded(folder, t, position):
    """Return a piston whose position at times t is in a file."""
    np.savetxt(folder / "paddle.dat", np.column_stack([t, position]))
    return moving("piston", "recorded", position=str(folder / "paddle.dat"))


def noisy(folder, *, noise=1e-4):
    """Return a piston of 20 mm at 1.8 s, at rest until 3 s, as it is measured: at 50 Hz, to 0.1 mm."""
    t = 0.02 * np.arange(1001)
    x = 0.02 * np.clip((t - 3) / 3, 0.0, 1.0) ** 2 * np.sin(2 * np.pi * (t - 3) / 1.8)
    return recorded(folder, t, x + noise * np.random.default_rng(1).standard_normal(t.size))


@pytest.mark.parametrize("duration", [0.3, 15.0])
@pytest.mark.parametrize("tank", [SLICE, BASIN], ids=["slice", "basin"])
def test_cells_do_not_follow_the_noise_of_a_record(tmp_path, tank, duration):
    """They are those of the same record without noise."""
    parts = {"duration": duration, "numerics": {"dt": 0.02}}
    plain, measured = (resolved(build_case(tank, wall=noisy(tmp_path, noise=one), **parts)) for one in (0.0, 1e-4))
    assert plain.numerics == measured.numerics


def by_simpson(motion, dt, steps):
    """Return what Simpson's rule misses of a motion's displacement, root mean square, relative to it."""
    t = dt * np.arange(steps + 1)
    thirds = motion.velocity(t[:-1]) + 4 * motion.velocity(t[:-1] + dt / 2) + motion.velocity(t[1:])
    positions = motion.position(t)
    off = positions[0] + np.cumsum(dt / 6 * thirds) - positions[1:]
    return float(np.sqrt(np.mean(off**2)) / np.std(positions[:-1]))


@pytest.mark.parametrize("duration", [pytest.param(15.0, marks=pytest.mark.slow), 14.987])
def test_planned_step_resolves_a_measured_motion(tmp_path, duration):
    """Of a record with noise a long step takes that of single rows for motion that lasts."""
    one = build_case({"length": 25.0, "depth": 1.0}, wall=noisy(tmp_path), duration=duration)
    dt = planned(one, MPI.COMM_SELF).case.numerics.dt
    assert by_simpson(one.motion(), dt, int(np.ceil(duration / dt - 1e-9))) < 0.01 / 3
    assert dt <= 0.02 / 2  # two steps a row at least: longer ones hold it by chance
    assert by_simpson(one.motion(), duration / 121, 121) > 0.05  # which the waves alone would need


@pytest.mark.slow
def test_planned_step_resolves_the_waves_of_a_noisy_record(tmp_path):
    """Against a quarter of the step, on the same cells: by less than the 1 % asked, noise and all."""
    named = build_case({"length": 8.0, "depth": 1.0}, wall=noisy(tmp_path), duration=12.0, gauges=[2.0, 4.0])
    chosen = planned(named, MPI.COMM_SELF).case
    coarse, fine = (gauge_rows(chosen, dt=chosen.numerics.dt / parts)[::parts, 1:] for parts in (1, 4))
    fine = fine[: len(coarse)]
    assert np.sqrt(np.mean((coarse - fine) ** 2, axis=0) / np.mean(fine**2, axis=0)).max() < 0.01


@pytest.mark.parametrize(("dt", "off"), [(0.125, True), (0.04, False)])
def test_step_that_misses_a_measured_motion_is_warned_of(tmp_path, dt, off):
    numerics = {"cells": 10, "vertical_order": 4, "dt": dt}
    one = build_case(wall=noisy(tmp_path), duration=15.0, numerics=numerics)
    missed = by_simpson(one.motion(), dt, round(15.0 / dt))
    found = [warning.value for warning in warnings_before(one) if warning.code == "step-misses-motion"]
    assert off == (missed > 0.01) and found == pytest.approx([missed] * off, rel=0.05)


@pytest.mark.parametrize(("integrator", "place"), [("simpson-4", "IN_JUMP"), ("gauss-legendre-4", "IN_ELEVATION")])
def test_noise_of_a_measured_paddle_is_not_growth(tmp_path, monkeypatch, integrator, place):
    """A record of 1 µm of noise: its short waves are the highest there are; counted as growth, they would warn."""
    t = 0.02 * np.arange(201)
    wall = recorded(tmp_path, t, 1e-6 * np.random.default_rng(3).standard_normal(t.size) + 2e-5 * t**2)
    numerics = {"cells": 25, "vertical_order": 4, "dt": 0.04, "integrator": integrator}
    one = build_case({"length": 5.0, "depth": 1.0}, wall=wall, duration=1.6, numerics=numerics)
    criterion = getattr(stability, place)
    for driven, expected in ((criterion.driven, 0), (0.0, 1)):
        monkeypatch.setattr(f"wavetank.simulation.case_diagnostics.{place}", replace(criterion, driven=driven))
        run, waves = build_run(one, MPI.COMM_WORLD)
        warnings = []
        run.diagnostics += build_watch(run, waves, warnings.append)
        run.execute()
        assert len(warnings) == expected
