"""What a run says of its own accuracy: doubtful scenes are named, sound ones are not, and what is not named is chosen.

Oracles: the sums of interpolation errors and of Simpson's rule by hand, linear theory for wave lengths, an explicit
accuracy for the plan.
"""

import re
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from rich.console import Console

from wavetank.case import Case, LinearWater
from wavetank.case.reading import read_case
from wavetank.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.files import RunLog
from wavetank.planning.checks import coarse, in_sponge, run_warnings, too_high
from wavetank.planning.default_plan import planned, rule_summary
from wavetank.planning.dispersion import Cells, Mesh
from wavetank.planning.requirements import requirements
from wavetank.planning.resolution import resolved, waves_missed
from wavetank.recording import Warnings, record_run
from wavetank.simulation import stability
from wavetank.simulation.build import build_observers, build_run, build_watch
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.records import Memory, Records
from wavetank.waves import stream_function
from wavetank.waves.airy import wave_number

CHECKOUT = Path(__file__).resolve().parents[1]
SLICE = {"length": 20.0, "depth": 1.0}
OVER_A_BAR = SLICE | {"bed": {"type": "formula", "depth": "1 - 0.7 * exp(-((x - 8) / 2) ** 4)"}}
BAR = {"bed": {"type": "formula", "depth": "0.4 - 0.3 * clip((x - 6) / 6, 0, 1) + 0.3 * clip((x - 14) / 3, 0, 1)"}}
BASIN = {"type": "basin", "depth": 1.0, "layout": {"type": "rectangle", "length": 4.0, "width": 1.0}}


def scene(*, tank=SLICE, duration=2.0, **parts):
    return Case.model_validate({"tank": tank, "run": {"duration": duration}, **parts})


def piston(period, amplitude=0.005):
    return {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": amplitude, "period": period}}


def standing(mode=1):
    return {"type": "standing-wave", "wave_amplitude": 1e-4, "mode": mode}


def said_of(one):
    run, waves = build_run(one, MPI.COMM_SELF)
    return [*map(str, run_warnings(one, run.clock, waves))]


def test_where_a_rule_stands_for_a_plan_the_run_says_so(tmp_path):
    """With the reason; and the manifest has the cells that came of it."""
    bed, start = {"type": "formula", "depth": "1 - 0.01 * x"}, {"initial": standing()}
    said = "no accuracy is predicted, cells and vertical order follow a rule (docs/plan.md): tank.bed.type = "
    one = scene(tank={"length": 4.0, "depth": 1.0, "bed": bed}, duration=0.1, **start)
    record_run(one, tmp_path / "run", comm=MPI.COMM_SELF, console=Console(quiet=True))
    assert said in (tmp_path / "run" / "run.log").read_text()
    assert RunDirectory(tmp_path / "run").manifest["numerics"]["cells"] == 12  # of a third of the depth
    assert rule_summary(scene(tank=BASIN)).endswith("with a flat bed")
    assert not any(map(rule_summary, (scene(**start), scene(tank=SLICE | {"bed": bed}, numerics={"cells": 9}))))


TURNED = {"type": "sinusoid", "paddle_amplitude": 1.0, "period": 8.0, "ramp": 0.0}
FLAP = {"type": "flap", "motion_as": "angle", "motion": TURNED}
RIPPLES = {"bed": {"type": "formula", "depth": "1 + 0.1 * sin(200 * x)"}}
FORMULA = {"type": "piston", "motion": {"type": "formula", "position": "0.01 * sin(pi * t)"}}
DOUBTFUL = {
    "cells ten times too large": (
        {"wall": piston(1.8), "duration": 20.0, "numerics": {"cell_size": 10.0}},
        "predicted to miss the elevation by all of it; `wavetank plan` proposes others",
    ),
    "a wave between the nodes": (
        {"initial": standing(1000), "numerics": {"cells": 16}},
        "the mesh misses the initial elevation by .* of it: cells of 1.25 m are too large",
    ),
    "a bed between the nodes": (
        {"tank": SLICE | RIPPLES, "wall": piston(1.8), "numerics": {"cells": 20}},
        "the mesh misses the bed by 0.08.* of the depth: cells of 1 m are too large",
    ),
    "steps as long as the paddle's period": (
        {"wall": piston(0.1, 1e-4), "numerics": {"cell_size": 2.0, "order": 2, "dt": 0.08}},
        "the step of 0.08 s misses the paddle's motion by 2.2 of it",
    ),
    "large strokes in linear water": (
        {"wall": FLAP, "water": {"type": "linear"}, "numerics": {"cell_size": 1.0, "vertical_order": 4}},
        r"the paddle of wall moves at up to 0\.[234].* and goes 1\.\d* m from rest in water 1 m deep; water\.type",
    ),
    "a ramp as long as the run": (
        {"wall": piston(1.8), "numerics": {"cells": 20}},
        r"^the ramp of wall\.motion is over after 3\.6 s, the run of 2 s before: its waves do not get their height$",
    ),
    "a paddle that moves at once": (
        {"wall": FORMULA, "numerics": {"cells": 20}},
        r"^the paddle of wall starts at t = 0 s from rest at 0\.0314 m/s, 1 of its largest speed: .*wall\.motion\.ramp",
    ),
    "a sponge of a quarter of a wave": (
        {"wall": piston(1.8), "numerics": {"cells": 20}, "sponge": {"type": "end", "length": 1.0}},
        r"^the sponge sends back about 37 % of the paddle's waves of T = 1\.8 s, 4\.\d* m long, and steep ones may",
    ),
    "a sponge behind a bar": (
        {
            "tank": OVER_A_BAR,
            "wall": piston(1.8),
            "numerics": {"cells": 40, "vertical_order": 4},
            "sponge": {"type": "end", "length": 1.0},
        },
        r"^the sponge sends back about 37 % of the paddle's waves of T = 1\.8 s, 4\.\d* m long",
    ),
    "a bar before a paddle of one period": (
        {
            "tank": OVER_A_BAR,
            "wall": piston(2.0, 0.05),
            "far_wall": {"type": "piston", "motion": {"type": "at-rest"}, "absorb": {"type": "spring-damper"}},
            "numerics": {"cells": 40, "vertical_order": 4},
            "duration": 20.0,
        },
        r"(?s)the bed frees second harmonics of the waves of 2 s, about 100 % as high; far_wall, whose band begins at "
        r"2 s.*\ncells of 0\.5 m are coarse over this bed, and no accuracy is predicted: the rule .* takes 0\.2 m",
    ),
    "a sponge that begins at once behind a bar": (
        {
            "tank": OVER_A_BAR,
            "wall": piston(2.0),
            "numerics": {"cells": 20},
            "sponge": {"type": "formula", "gamma": "20 * clip(1e6 * (x - 12), 0, 1)"},
        },
        r"^the sponge sends back about 62 % of the paddle's waves of T = 2 s, 5\.\d* m",
    ),
    "a sponge as weak as none": (
        {
            "wall": piston(1.5),
            "numerics": {"cells": 20},
            "sponge": {"type": "end", "length": 4.0, "strength": 0.05},
        },
        r"^the sponge sends back about 9[0-9] % of the paddle's waves of T = 1\.5 s, 3\.\d* m",
    ),
    "a gauge in a sponge": (
        {"gauges": [14, 14.1], "wall": piston(1.8), "numerics": {"cells": 20}, "sponge": {"type": "end", "length": 6}},
        r"^gauge 2 stands in the sponge, which takes waves from x = 14 m on$",
    ),
    "gauges in a sponge by formula": (
        {
            "gauges": [2, 14, 15],
            "wall": piston(1.8),
            "numerics": {"cells": 20},
            "sponge": {"type": "formula", "gamma": "1 + tanh(4 * (x - 13))"},
        },
        r"^gauges 2 to 3 stand in the sponge, which takes waves there$",
    ),
    "a load behind a sponge": (
        {
            "gauges": [14.5],
            "loads": [{"on": "far wall"}, {"on": "paddle"}],
            "wall": piston(1.8),
            "numerics": {"cells": 20},
            "sponge": {"type": "end", "length": 6},
        },
        r"^gauge 1 and load far wall stand in the sponge, which takes waves from x = 14 m on$",
    ),
    "a load behind a sponge by formula": (
        {
            "loads": [{"on": "paddle"}, {"on": "far wall", "name": "end"}],
            "wall": piston(1.8),
            "numerics": {"cells": 20},
            "sponge": {"type": "formula", "gamma": "1 + tanh(4 * (x - 13))"},
        },
        r"^load end stands in the sponge, which takes waves there$",
    ),
    "a basin's sponge of a quarter of a wave": (
        {
            "gauges": [{"name": "far", "x": 3.5, "y": 0.5}, {"name": "near", "x": 2.0, "y": 0.5}],
            "tank": BASIN | {"layout": BASIN["layout"] | {"sponge_length": 1.0}},
            "wall": piston(1.8),
            "numerics": {"cell_size": 0.5, "vertical_order": 4},
            "sponge": {"type": "group"},
        },
        r"(?s)^the sponge sends back about 37 % of the paddle's waves of T = 1\.8 s, .*\n"
        "gauge far stands in the sponge, which takes waves there$",
    ),
    "a paddle too fast for any vertical order": (
        {"wall": piston(0.05, 1e-5), "numerics": {"cells": 20}},
        r"(?s)to the paddle's waves, T = 0\.05 s, .*\nnumerics\.vertical_order = 16 misses .*: no order holds them$",
    ),
    "too deep for any vertical order": (
        {"tank": {"length": 0.0209, "depth": 1.0}, "initial": standing() | {"wave_amplitude": 1e-6}, "duration": 1.0},
        r"predicted .* waves as short against the depth \(k d = 150\) are the same in a tank that is less deep",
    ),
}


@pytest.mark.parametrize("name", DOUBTFUL)
def test_what_is_doubtful_is_said(name):
    parts, sentence = DOUBTFUL[name]
    one = planned(scene(**parts), MPI.COMM_SELF).scene
    assert re.search(sentence, "\n".join(said_of(one)), re.MULTILINE)


CASES = sorted(path.stem for path in (CHECKOUT / "cases").glob("*.toml"))
LONG = {"berkhoff-1982", "cylinder", "directional-focus", "flap", "irregular", "ntnu-flap", "planned"}


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow) if n in LONG else n for n in CASES])
def test_nothing_is_said_of_the_cases(name):
    try:
        case = read_case(CHECKOUT / "cases" / f"{name}.toml")
    except InputError:
        pytest.skip("its data are not on this machine")
    chosen, doubts = planned(case, MPI.COMM_SELF)
    assert [*doubts, *said_of(chosen)] == []


@pytest.mark.parametrize("case", ["wavemaker", "focusing"])
def test_a_case_cut_short_is_what_it_was(case):
    """A motion cut off amid a stroke has waves of all lengths; those of the run are the whole motion's."""
    for duration in (0.3, 2.0):
        cut = read_case(CHECKOUT / "cases" / f"{case}.toml", [f"run.duration={duration}"])
        chosen, doubts = planned(cut, MPI.COMM_SELF)
        assert chosen.numerics.vertical_order == 8  # as that of 24 s
        (only,) = [*doubts, *said_of(chosen)]
        assert re.fullmatch(rf"the ramp of wall\.motion is over .* the run of {duration:g} s before: .*", only)


def test_a_motion_of_two_steps_is_judged_as_it_goes_on():
    """Of the first two alone a step would miss 0.13: a ramp begins like t^4, which Simpson's rule has not."""
    cut = read_case(CHECKOUT / "cases" / "wavemaker.toml", ["run.duration=0.02", "numerics.dt=0.01"])
    (only,) = said_of(planned(cut, MPI.COMM_SELF).scene)
    assert only.startswith("the ramp of wall.motion is over after 4 s")


TOO_HIGH = {
    "focused": {"linear_crest": 0.4, "focus_x": 10.0, "focus_time": 20.0},
    "sinusoid": {"paddle_amplitude": 0.2, "period": 1.6},
}
GROUP = {"lowest_frequency": 0.4, "highest_frequency": 1.3, "spectrum": {"type": "jonswap", "peak_frequency": 0.65}}


def driven(kind, *, parts=(), **motion):
    return scene(wall={"type": "piston", "motion": {"type": kind} | motion}, duration=24.0, **dict(parts))


@pytest.mark.parametrize("left", [None, -3.0])
def test_what_stands_in_a_sponge_is_named(left):
    """By hand, of 20 m with a sponge of 12 m: a basin's gauges count from its x, the focus from the paddle."""
    layout = {"type": "rectangle", "length": 20.0, "width": 1.0, "origin": [left, 0.0]}
    tank, start = (SLICE, 0.0) if left is None else (BASIN | {"layout": layout}, left)
    gauges = [{"name": str(x), "x": start + x, "y": 0.5 * (left is not None)} for x in (8, 9, 10, 7, 11)]
    parts = {"tank": tank, "gauges": gauges, "sponge": {"type": "end", "length": 12.0}}
    (said,) = in_sponge(driven("focused", parts=parts, **TOO_HIGH["focused"] | GROUP))
    edge = f"which takes waves from x = {start + 8:g} m on"
    assert said == f"gauges 9 to 10 and gauge 11 and wall.motion.focus_x stand in the sponge, {edge}"


@pytest.mark.parametrize("kind", TOO_HIGH)
def test_waves_that_are_too_high_are_told(kind):
    """By Miche's limit in depth, and the crest that is asked for, or the wavemaker's transfer function."""
    motion = TOO_HIGH[kind] | (GROUP if kind == "focused" else {})
    one = driven(kind, **motion)
    (said,) = too_high(one)
    height, length, x, t, most = map(float, re.findall(r"(\d[\d.]*) (?:m|s)\b", said))
    k = 2 * np.pi / length
    assert most == pytest.approx(0.142 * length * np.tanh(k), rel=0.05) and height > most
    if kind == "focused":
        assert (x, t) == pytest.approx((10.0, 20.0), abs=1.0) and 1.5 < height / motion["linear_crest"] < 2.0
    else:  # highest at the front of the train
        stroke = 2 * motion["paddle_amplitude"]
        assert 1.0 < height / (stroke * one.wall.wavemaker.transfer(k, 1.0)) < 1.25
    runs = [one.run.model_copy(update={"on_breaking": what}) for what in ("dissipate", "ignore")]
    taken, ignored = (one.model_copy(update={"run": run}) for run in runs)
    assert not [*too_high(taken)] and "dissipate" in said
    assert [line.endswith('; run.on_breaking = "ignore" does not look for it') for line in too_high(ignored)] == [True]


def test_waves_that_are_steep_are_not_told_to_be_too_high():
    """Nor a solitary wave, which has no trough. Oracle: groups as high have run, and higher ones broken."""
    steep, breaks = (
        driven("focused", **TOO_HIGH["focused"] | GROUP | {"linear_crest": crest}) for crest in (0.16, 0.19)
    )
    assert not [*too_high(steep), *too_high(driven("solitary-wave", height=0.4))]
    (said,) = too_high(breaks)
    assert "nearly all made 0.81 times as high, or more, broke there or before; run.on_breaking" in said


@pytest.mark.parametrize("position", ["0.01 * (1 - cos(pi * t))", "0.01 * sin(pi * t)"])
def test_a_paddle_that_starts_from_rest_is_not_told_to_begin_gently(position):
    """By itself, or in water that moves as well: only what jumps in water at rest is a blow."""
    still = position.endswith("cos(pi * t))")
    motion = FORMULA["motion"] | {"position": position}
    one = scene(wall=FORMULA | {"motion": motion}, numerics={"cells": 20}, **({} if still else {"initial": standing()}))
    assert not any("from rest" in sentence for sentence in said_of(one))


def on_a_slope(period, **numerics):
    """A piston before a slope from 1 m of water to 0.5 m: the usual cells, but for what is named."""
    bed = {"type": "formula", "depth": "1 - 0.025 * x"}
    return resolved(scene(tank=SLICE | {"bed": bed}, wall=piston(period, 1e-4), duration=20.0, numerics=numerics))


def test_cells_that_miss_a_paddle_s_waves_over_a_bed_are_told():
    """By linear elements' waves, mu = 6 (1 - cos k h) / (h² (2 + cos k h)), in deep water, omega² = g mu^(1/2)."""
    one = on_a_slope(0.5, cell_size=0.08, order=1, dt=0.01)
    (said,) = waves_missed(one, 0.08)
    cosine = np.cos((k := 16 * np.pi**2 / 9.81) * 0.08)
    speed = (6 * (1 - cosine) / (0.08**2 * (2 + cosine)) / k**2) ** 0.25
    assert said.startswith("cells of 0.08 m and order 1 leave 4.9 nodes to the paddle's waves, T = 0.5 s, 0.39 m long")
    missed, enough = map(float, re.search(r"their speed by (\S+)%: cells of (\S+) m hold them", said).groups())
    assert missed / 100 == pytest.approx(speed - 1, abs=1e-3)
    assert not [*waves_missed(one, enough)] and not [*waves_missed(on_a_slope(0.5), on_a_slope(0.5).cell_size)]


@pytest.mark.parametrize(
    ("numerics", "told"),
    [
        ({"cell_size": 0.12}, []),  # right to 2.5 % at all gauges
        ({"cell_size": 0.16}, ["cells of 0.159 m are coarse .* 0.08 m"]),  # a wave breaks
        ({"cell_size": 0.3, "order": 8}, []),
        ({"vertical_order": 4}, []),  # right to 0.5 %
        (
            {"vertical_order": 2},
            ["a vertical order of 2 is low .* 8"],
        ),  # to 26 %
    ],
    ids=str,
)
def test_what_is_far_from_the_rule_over_a_bed_is_told(numerics, told):
    """Oracle: waves of 30 mm over a bar from 0.4 m to 0.1 m, against cells of 0.05 m (docs/plan.md)."""
    depth = "0.4 - 0.3 * clip((x - 6) / 6, 0, 1) + 0.3 * clip((x - 14) / 3, 0, 1)"
    tank = {"length": 22.0, "depth": 0.4, "bed": {"type": "formula", "depth": depth}}
    one = resolved(scene(tank=tank, wall=piston(1.5), numerics=numerics))
    said = [*coarse(one, one.cell_size)]
    assert len(said) == len(told) and all(map(re.fullmatch, told, said))


def test_waves_that_cells_do_not_carry_are_told_in_a_basin():
    one = resolved(scene(tank=BASIN, wall=piston(0.5), duration=20.0, numerics={"cell_size": 1.0, "order": 2}))
    assert re.search("leave 0.78 nodes to .*, and carry none as short: cells of 0.056 m", *waves_missed(one, 1.0))


def test_a_vertical_order_that_misses_a_paddle_s_waves_is_told():
    """By hand: one linear function makes of tanh(x) / x, x = k d, 1 - 3/4 x² / (x² + 3)."""
    one = on_a_slope(2.0, vertical_order=1)
    x = float(wave_number(np.pi, 1.0, 9.81))
    speed = np.sqrt(x / np.tanh(x) * (1 - 0.75 * x**2 / (x**2 + 3)))
    (said,) = waves_missed(one, one.cell_size)
    told = re.fullmatch(r"numerics.vertical_order = 1 misses .* by (\S+)%: an order of (\d) holds them", said)
    assert float(told[1]) / 100 == pytest.approx(speed - 1, abs=1e-3)
    enough = on_a_slope(2.0, vertical_order=int(told[2]))
    assert not [*waves_missed(enough, enough.cell_size)]


def test_the_shortest_waves_are_told_though_most_are_held():
    """Of two as strong in one motion, T = 1.6 s and 0.5 s, the longer ones have just over half of the power."""
    motion = {"type": "formula", "position": "1e-4 * (1.05 * sin(2*pi*t/1.6) / 1.25 + sin(4*pi*t) / 4)", "ramp": 2.0}
    one = scene(tank=BASIN, wall={"type": "piston", "motion": motion}, duration=32.0, numerics={"cell_size": 0.4})
    (said,) = waves_missed(resolved(one), 0.4)
    found = re.search(r"nodes to the shortest 10% of the paddle's waves, T = (\S+) s, (\S+) m long", said)
    assert np.array(found.groups(), dtype=float) == pytest.approx([0.5, 0.39], rel=0.03)


@pytest.mark.parametrize(
    ("numerics", "off"),
    [({"integrator": "stormer-verlet", "dt": 0.08}, True), ({}, False), (None, False)],
    ids=["long steps", "usual", "still water"],
)
def test_an_energy_balance_that_is_off_is_said(numerics, off):
    """However few rows of it are recorded."""
    initial = {} if numerics is None else {"initial": {"type": "standing-wave", "wave_amplitude": 0.1}}
    chosen = {"cells": 2, "vertical_order": 3, **(numerics or {})}
    one = scene(tank={"length": 2.0, "depth": 1.0}, duration=6.0, numerics=chosen, **initial)
    run, waves = build_run(one, MPI.COMM_SELF)
    energy = Memory()
    budget, *_ = build_observers(one, waves, Records(Memory(), energy, None), sinks=run.sinks)
    seldom = EnergyBudget(waves, record=Memory(), every=50, sinks=run.sinks)
    run.diagnostics += [budget, seldom]
    run.execute()
    said = budget.verdict()
    assert len(said) == off and seldom.verdict() == said
    if off:
        balance, total = np.abs(energy.array()[:, 6]).max(), energy.array()[:, 3].max()
        assert float(said[0].split()[6]) == pytest.approx(balance / total, rel=0.05)  # of two digits


def test_a_warning_is_printed_once():
    """Those that come as the run goes on then, and first in the manifest; the others at its end, as they were found."""
    said = StringIO()
    warnings = Warnings(RunLog(Console(file=said, width=200)))
    warnings.add("at the end")
    warnings.at_once("now")
    warnings.show()
    assert said.getvalue() == "warning: now\nwarning: at the end\n"
    assert [*map(str, warnings.records)] == ["now", "at the end"]


def test_a_run_says_so_before_it_at_its_end_and_in_its_manifest(wavetank, tmp_path):
    case, out = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(
        "[tank]\nlength = 2.0\ndepth = 1.0\n[initial]\ntype = 'standing-wave'\nwave_amplitude = 0.1\n"
        "[run]\nduration = 6.0\n"
        "[numerics]\ncells = 2\nvertical_order = 3\ndt = 0.08\nintegrator = 'stormer-verlet'\n"
    )
    result = wavetank("run", str(case), "--no-plots", "--out", str(out))
    assert result.returncode == 0, result.stderr
    worst, *_, sentence = map(str, RunDirectory(out).warnings)
    assert sentence.startswith("the energy balance is off by 0.0")
    assert f"\nwarning: {sentence}\nhighest crest: " in result.stdout
    before, _ = result.stdout.split("\nt = ", maxsplit=1)
    assert before.endswith(f"\nwarning: {worst}")
    assert f" of the energy; 2 warnings, the worst: {worst}\n" in result.stdout


# ------------------------------------------------------------------------------------------------ what is not named
def test_a_case_without_numerics_gets_the_plan_for_one_per_cent():
    parts = {"tank": {"length": 8.0, "depth": 1.0}, "wall": piston(0.67), "duration": 6.0}
    plain, asking = scene(**parts), scene(**parts, numerics={"accuracy": 1e-2})
    chosen = planned(plain, MPI.COMM_SELF).scene
    assert chosen == planned(asking, MPI.COMM_SELF).scene
    assert chosen.numerics.cells > 40 and plain.cells == 40  # k d = 8.9
    again = Case.model_validate(plain.model_dump(mode="json"))
    assert again == plain and again.numerics.open


def test_water_whose_velocities_are_recorded_is_nonlinear():
    """Linear water, which would do, has none."""
    for output, physics in (({}, "linear"), ({"velocity_every": 1.0}, "nonlinear")):
        assert requirements(scene(wall=piston(2.0), output=output), 1e-2).physics == physics


def test_what_is_named_is_kept():
    one = scene(wall=piston(0.67), duration=10.0, numerics={"cells": 50, "vertical_order": 4})
    assert planned(one, MPI.COMM_SELF).scene == one


@pytest.mark.parametrize("period", [0.5, 0.67, 3.0])
def test_in_a_basin_cells_follow_the_shortest_wave(period):
    """Three in a wave length of linear theory, but none larger than half a depth."""
    chosen = resolved(scene(tank=BASIN, wall=piston(period), duration=20.0))
    length = 2 * np.pi / float(wave_number(2 * np.pi / period, 1.0, 9.81))
    assert 0.75 * min(0.5, length / 3) < chosen.cell_size <= min(0.5, length / 3)  # the ramp has shorter waves yet
    assert chosen.numerics.vertical_order == {0.5: 9, 0.67: 8, 3.0: 8}[period]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_cells_follow_the_order_that_is_named(order):
    """The frequency of the paddle's waves on them, against that on very fine ones, by the discrete dispersion."""
    chosen = resolved(scene(wall=piston(0.5), duration=20.0, numerics={"order": order}))
    k = float(wave_number(4 * np.pi, 1.0, 9.81))
    on_these, on_fine = (
        float(Mesh(cells=cells, vertical_order=8, depth=1.0, gravity=9.81).frequency(k))
        for cells in (Cells(order, chosen.cell_size), Cells(8, 0.05))
    )
    assert 2e-5 < on_these / on_fine - 1 < 3e-4


def test_cells_follow_bed_and_start():
    bed = resolved(scene(tank=SLICE | RIPPLES, wall=piston(1.8)))
    start = resolved(scene(tank=BASIN, initial={"type": "formula", "eta": "0.001 * cos(4 * pi * x) * cos(3 * pi * y)"}))
    assert bed.cell_size == pytest.approx(2 * np.pi / 200 / 3 * 5 / 3, rel=0.01)  # of order 4
    assert start.cell_size == pytest.approx(2 * np.pi / (5 * np.pi) / 3, rel=0.3)  # looked at along x and along y


def test_order_over_a_bed_is_4_in_a_slice_and_3_in_a_basin():
    """Measured: the cheaper one (docs/plan.md, tests/test_plan_measured.py). What a case names is kept."""
    bar, others = {"depth": 0.4} | BAR, {"integrator": "third-order", "vertical_order": 6}
    chosen = [resolved(scene(tank={"length": 27.0} | bar, wall=piston(2.02))), resolved(scene(tank=BASIN | BAR))]
    assert [(one.numerics.order, one.cell_size) for one in chosen] == [(4, pytest.approx(27 / 202)), (3, 0.5)]
    kept = [{"order": 3}, {"order": 5}, {"cell_size": 0.2}, {"cells": 135}, others]
    numerics = [resolved(scene(tank={"length": 27.0} | bar, wall=piston(2.02), numerics=one)).numerics for one in kept]
    assert [one.order for one in numerics] == [3, 5, 3, 3, 4]
    assert [one.cell_size for one in numerics[:4]] == [None, None, 0.2, None]  # 0.2 depths


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
    potential = amplitude * np.sqrt(9.81 / (np.pi / 2))
    start = {"eta": f"{amplitude} * {TRAIN}", "psi": f"{potential} * {AHEAD}"}
    start = {"type": "formula", "eta": "0"} | {key: start[key] for key in keys}
    one = scene(tank={"type": "ring", "length": 32.0, "depth": 8.0}, initial=start)
    assert resolved(one).cell_size == pytest.approx(4.0 / harmonics / 3, rel=0.02)
    assert rule_summary(one).endswith(f"; the shortest wave, {4 / harmonics:.3g} m, is that of the initial surface")
    linear = one.model_copy(update={"water": LinearWater()})
    assert resolved(linear).cell_size == pytest.approx(4.0 / 3, rel=0.02)  # it has no bound harmonics


def noisy(folder, *, noise=1e-4):
    """Return a piston of 20 mm at 1.8 s, at rest until 3 s, as it is measured: at 50 Hz, to 0.1 mm."""
    t = 0.02 * np.arange(1001)
    x = 0.02 * np.clip((t - 3) / 3, 0.0, 1.0) ** 2 * np.sin(2 * np.pi * (t - 3) / 1.8)
    measured = x + noise * np.random.default_rng(1).standard_normal(t.size)
    np.savetxt(folder / "paddle.dat", np.column_stack([t, measured]))
    return {"type": "piston", "motion": {"type": "recorded", "position": str(folder / "paddle.dat")}}


@pytest.mark.parametrize("duration", [0.3, 15.0])
@pytest.mark.parametrize("tank", [SLICE, BASIN], ids=["slice", "basin"])
def test_cells_do_not_follow_the_noise_of_a_record(tmp_path, tank, duration):
    """They are those of the same record without noise."""
    numerics = {"dt": 0.02}
    chosen = [
        resolved(scene(tank=tank, wall=noisy(tmp_path, noise=noise), duration=duration, numerics=numerics)).numerics
        for noise in (0.0, 1e-4)
    ]
    assert chosen[0] == chosen[1]


def by_simpson(motion, dt, steps):
    """Return what Simpson's rule misses of a motion's displacement, root mean square, relative to it."""
    t = dt * np.arange(steps + 1)
    thirds = motion.velocity(t[:-1]) + 4 * motion.velocity(t[:-1] + dt / 2) + motion.velocity(t[1:])
    positions = motion.position(t)
    off = positions[0] + np.cumsum(dt / 6 * thirds) - positions[1:]
    return float(np.sqrt(np.mean(off**2)) / np.std(positions[:-1]))


@pytest.mark.parametrize("duration", [pytest.param(15.0, marks=pytest.mark.slow), 14.987])
def test_a_planned_step_holds_a_measured_motion(tmp_path, duration):
    """Of a record with noise a long step takes that of single rows for motion that lasts."""
    one = scene(tank={"length": 25.0, "depth": 1.0}, wall=noisy(tmp_path), duration=duration)
    dt = planned(one, MPI.COMM_SELF).scene.numerics.dt
    assert by_simpson(one.motion(), dt, int(np.ceil(duration / dt - 1e-9))) < 0.01 / 3
    assert dt <= 0.02 / 2  # two steps a row at least: longer ones hold it by chance
    assert by_simpson(one.motion(), duration / 121, 121) > 0.05  # which the waves alone would need


@pytest.mark.slow
def test_a_planned_step_holds_the_waves_of_a_noisy_record(tmp_path):
    """Against a quarter of the step, on the same cells: by less than the 1 % asked, noise and all."""
    named = scene(tank={"length": 8.0, "depth": 1.0}, wall=noisy(tmp_path), duration=12.0, gauges=[2.0, 4.0])
    chosen, records = planned(named, MPI.COMM_SELF).scene, list[np.ndarray]()
    for dt in (chosen.numerics.dt, chosen.numerics.dt / 4):
        one = chosen.model_copy(update={"numerics": chosen.numerics.model_copy(update={"dt": dt})})
        run, waves = build_run(one, MPI.COMM_SELF)
        gauges = Memory()
        run.diagnostics += build_observers(one, waves, Records(gauges, Memory(), None), sinks=run.sinks)
        run.execute()
        records.append(gauges.array()[:, 1:])
    coarse, fine = records[0], records[1][::4][: len(records[0])]
    missed = np.sqrt(np.mean((coarse - fine) ** 2, axis=0) / np.mean(fine**2, axis=0))
    print(missed)
    assert missed.max() < 0.01


def test_what_a_step_misses_of_a_measured_motion_is_said(tmp_path):
    coarse = {"cells": 10, "vertical_order": 4}
    for dt, off in ((0.125, True), (0.04, False)):
        one = scene(wall=noisy(tmp_path), duration=15.0, numerics={**coarse, "dt": dt})
        missed = by_simpson(one.motion(), dt, round(15.0 / dt))
        said = [sentence for sentence in said_of(one) if "misses the paddle's motion" in sentence]
        assert len(said) == off == (missed > 0.01)
        if off:
            assert float(re.search(r"motion by (\S+) of it", said[0])[1]) == pytest.approx(missed, rel=0.05)


@pytest.mark.parametrize(("integrator", "place"), [("simpson-4", "IN_JUMP"), ("gauss-legendre-4", "IN_ELEVATION")])
def test_a_measured_paddle_s_own_noise_is_no_growth(tmp_path, monkeypatch, integrator, place):
    """A record of 1 µm of noise: its short waves are the highest there are; counted as growth, they would warn."""
    t = 0.02 * np.arange(201)
    x = 1e-6 * np.random.default_rng(3).standard_normal(t.size) + 2e-5 * t**2
    np.savetxt(tmp_path / "paddle.dat", np.column_stack([t, x]))
    motion = {"type": "recorded", "position": str(tmp_path / "paddle.dat")}
    numerics = {"cells": 25, "vertical_order": 6, "dt": 0.04, "integrator": integrator}
    wall, tank = {"type": "piston", "motion": motion}, {"length": 5.0, "depth": 1.0}
    driven = scene(tank=tank, wall=wall, duration=1.6, numerics=numerics)
    said = {}
    look = getattr(stability, place)
    for known in (look.driven, 0.0):
        monkeypatch.setattr(f"wavetank.simulation.build.{place}", replace(look, driven=known))
        run, waves = build_run(driven, MPI.COMM_WORLD)
        said[known] = []
        run.diagnostics += build_watch(driven, run, waves, said[known].append)
        run.execute()
    assert [len(sentences) for sentences in said.values()] == [0, 1]


def test_the_exact_wave_of_a_start_is_computed_once(monkeypatch):
    """However often plan, start and warnings ask for it."""
    begun, begin = list[float](), stream_function._cnoidal_wave
    monkeypatch.setattr(stream_function, "_cnoidal_wave", lambda *of: (begun.append(of[0]), begin(*of))[1])
    tank, initial = {"type": "ring", "length": 6.0, "depth": 1.0}, {"type": "stream-function", "height": 0.1234}
    asked, _ = planned(scene(tank=tank, initial=initial), MPI.COMM_SELF)
    said_of(asked)
    assert len(begun) == 1
