"""Bad input: whatever a case says, it is a case or a sentence; never another error, never for long."""

import math
import pickle
import re
import subprocess
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Annotated, NamedTuple, get_args

import numpy as np
import pytest
from case_builders import build_case
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import BaseModel, TypeAdapter
from records import gauge

from wavetank import data
from wavetank.analysis import results
from wavetank.analysis.record import WaveRecord
from wavetank.analysis.signals import common_clock
from wavetank.base.case_model import CaseError, Problem
from wavetank.base.errors import InputError, OutsideError, WavetankError
from wavetank.base.python_file import load
from wavetank.case import Case
from wavetank.case.initial import FileSurface
from wavetank.case.reading import MAX_LISTED, read_case
from wavetank.cli import main
from wavetank.mesh.bathymetry import read_bed
from wavetank.motion.recorded import read_record

pytestmark = pytest.mark.usefixtures("trusted")

CHECKOUT = Path(__file__).resolve().parents[1]
TANK = "[tank]\nlength = 8.0\ndepth = 1.0\n[run]\nduration = 1.0\n"
SHALLOW = TANK.replace("8", "-8")
LINE = "start = [1, 0]\nend = [2, 0]\ncount = 2\n"


def refused(tmp_path, text, *overrides):
    """Return the message of the refusal of a case."""
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_case(tmp_path / "case.toml", overrides)
    return str(error.value)


# ---------------------------------------------------------------- errors
def error_classes(error):
    return {error, *(kind for one in error.__subclasses__() for kind in error_classes(one))}


@pytest.mark.parametrize("kind", sorted(error_classes(WavetankError), key=lambda kind: kind.__name__))
def test_errors_survive_pickling(kind):
    """An error goes from rank to rank pickled, with its class, text and attributes."""
    arguments = {CaseError: ([Problem(("tank", "depth"), -1, "must be positive")],), OutsideError: ("a point", 3)}
    error = kind(*arguments.get(kind, ("a sentence.",)))
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), str(copy), vars(copy)) == (kind, str(error), vars(error))


# ---------------------------------------------------------------- what is no case
MANY = TANK + "".join(f"[[gauges]]\nx = {n}.5\n" for n in range(8, 3008))
GAUGE = TANK + "[[gauges]]\nx = 1.0\n"
SEVERAL = "allowed is one value, without lines of others"
SPACES = "title = '''\n" + 20_000 * " " + "\n'''\n"
NO_TOML = [  # file, overrides, a part of the sentence
    pytest.param("x = " + 5000 * "[" + 5000 * "]", [], "not valid TOML: nested too deeply", id="nested"),
    pytest.param("x = " + 100_000 * "7", [], "not valid TOML: Exceeds the limit", id="digits"),
    pytest.param("x = 0x" + 100_000 * "f", [], "x = int of no sensible size: is an unknown key", id="hexadecimal"),
    pytest.param(SPACES + SHALLOW, [], "line 5: tank.length = -8.0: must", id="spaces"),
    pytest.param("\ufeff" + SHALLOW, [], "line 2: tank.length = -8.0: must be", id="byte-order mark"),
    pytest.param(MANY, [], "line 7: gauges.0.x = 8.5: must be inside the tank, 0 to 8 m.", id="many, the first"),
    pytest.param(MANY, [], f"and {3000 - MAX_LISTED} more mistakes.", id="many, the rest"),
    pytest.param(GAUGE, ["numerics.dt=0.01\nnumerics.order=2"], SEVERAL, id="two keys"),
    pytest.param(GAUGE, ["numerics.dt=0.01\n[tank]"], SEVERAL, id="a table"),
    pytest.param(GAUGE, ["numerics.dt=" + 5000 * "["], "nested too deeply", id="nested override"),
    pytest.param(GAUGE, [f"gauges.{9 * '9'}.x=1"], "override", id="large index"),
    pytest.param(GAUGE, [f"gauges.{5000 * '9'}.x=1"], "gauges", id="absurd index"),
]


@pytest.mark.parametrize(("text", "overrides", "said"), NO_TOML)
def test_absurd_toml_is_refused_in_few_sentences(tmp_path, text, overrides, said):
    lines = refused(tmp_path, text, *overrides).splitlines()
    assert len(lines) <= MAX_LISTED + 1 and any(said in line for line in lines)


def test_byte_order_mark_is_accepted(tmp_path):
    (tmp_path / "case.toml").write_text(TANK, encoding="utf-8-sig")
    assert read_case(tmp_path / "case.toml").tank.length == 8.0


CONTROLS = [
    ('[[gauges]]\nname = "a,b\\nc"\nx = 1.0\n', r'gauges.0.name = "a,b\nc": must be one line, without control'),
    (f'[[gauge_lines]]\nname = "\\u001b[2J"\n{LINE}', r'gauge_lines.0.name = "\u001b[2J": must be one line'),
    ('[output]\n"\\u0000\\u009b\\n" = 1\n', r"output.\x00\x9b\n = 1: is an unknown key"),
    ('[water]\ntype = "a\\u0007"\n', r"water.type = "),
]


@pytest.mark.parametrize(("text", "said"), CONTROLS, ids=["gauge", "row", "key", "type"])
def test_control_characters_are_refused_and_shown_escaped(tmp_path, text, said, capsys):
    (tmp_path / "case.toml").write_text(TANK + text)
    assert main(["run", str(tmp_path / "case.toml")]) == 2
    shown = capsys.readouterr().err
    assert said in shown and shown.replace("\n", "").isprintable() and shown.count("\n") == 1


@pytest.mark.parametrize("position", ["sqrt(t)", "log(t - 1)", "t**1.5"])
@pytest.mark.parametrize("wall", ["wall", "far_wall"])
def test_non_finite_motion_names_its_key(tmp_path, wall, position, capsys):
    """Its acceleration is a column of paddle.csv."""
    motion = f"[{wall}]\ntype = 'piston'\n[{wall}.motion]\ntype = 'formula'\nposition = '{position}'\n"
    (tmp_path / "case.toml").write_text(TANK + motion)
    for command in ("plan", "run"):
        assert main([command, str(tmp_path / "case.toml")]) == 2
        out, error = capsys.readouterr()
        assert f"case.toml, line 10: {wall}.motion.position: formula '{position}': " in error and not out
        assert error.endswith(" at t = 0; must be finite.\n")


@pytest.mark.parametrize("position", ["1e-4*sqrt((t-0.25)**2-1e-9)", "1e-4*abs(t-0.25)**1.5"])
def test_non_finite_motion_at_unchecked_time_names_its_key(tmp_path, position, capsys):
    """Before the run, whose steps are tried; of the second it is the acceleration."""
    case, out = tmp_path / "case.toml", tmp_path / "run"
    case.write_text(f"{TANK}[wall]\ntype = 'piston'\nmotion = {{ type = 'formula', position = '{position}' }}\n")
    changes = "run.duration=0.75", "numerics={dt=0.125, cells=8, vertical_order=4}"
    changed = [word for change in changes for word in ("--set", change)]
    assert main(["run", str(case), *changed, "--no-plots", "--out", str(out)]) == 2
    sentence = f"wall.motion.position: formula '{position}': nan at t = 0.25; must be finite."
    assert capsys.readouterr().err == f"wavetank: {case}, line 8: {sentence}\n" and not out.exists()


def test_motion_may_be_nan_after_the_last_step(tmp_path):
    """A motion is analysed beyond the end of a short run if it is finite there."""
    formula = "type = 'formula'\nposition = '1e-4*sin(t)**2*sqrt(1.001 - t)'\n"
    (tmp_path / "case.toml").write_text(f"{TANK}[wall]\ntype = 'piston'\n[wall.motion]\n{formula}")
    case = read_case(tmp_path / "case.toml")
    finite = read_case(tmp_path / "case.toml", ['wall.motion.position="1e-4*sin(t)"'])
    assert case.ends[0].analysed_duration == 1.0 and finite.ends[0].analysed_duration > 10.0
    assert finite.ends[0].period == pytest.approx(2 * np.pi, rel=0.2)  # longer than the run
    with pytest.raises(CaseError, match=r"wall.motion.position: .* nan at t = 1\.02; must be finite"):
        case.motion().velocity(np.array([0.96, 0.99, 1.02]))


# ---------------------------------------------------------------- what a case refers to
@pytest.mark.parametrize("file", ["../../../etc/passwd", "/etc/passwd", "a/../../x", "./x", "a//x", "x\0", ""])
def test_data_reference_outside_its_folder_is_refused(tmp_path, monkeypatch, file):
    monkeypatch.setenv("WAVETANK_DATA", str(tmp_path))
    for name in ("marin-202002", "..", "."):
        with pytest.raises(InputError, match=r"allowed is data:NAME/FILE"):
            data.resolve(f"data:{name}/{file}", tmp_path)


@pytest.mark.parametrize(("begin", "line"), [("", 1), ("def depth(x, y):\n    ", 2)], ids=["file", "function"])
def test_bed_that_exits_is_an_input_error(tmp_path, begin, line):
    """Of a file when the case is read, of its function when the bed is evaluated."""
    (tmp_path / "bed.py").write_text(f"{begin}import sys; sys.exit(0)\n")
    (tmp_path / "case.toml").write_text(TANK.replace("1.0\n[", "1.0\nbed = {type = 'python', file = 'bed.py'}\n["))
    place = (
        rf"bed\.py, function 'depth', line {line}" if begin else rf"line 4: tank\.bed\.file = .*bed\.py, line {line}"
    )
    with pytest.raises(InputError, match=f"{place}: SystemExit: 0"):
        read_case(tmp_path / "case.toml").tank.bed.build(1.0)(*2 * [np.zeros(3)])


READERS = pytest.mark.parametrize(
    ("read", "name"),
    [
        (read_case, "case.toml"),
        (read_record, "paddle.txt"),
        (partial(load, name="depth"), "bed.py"),
        *((read_bed, f"bed.{end}") for end in ("csv", "xyz", "nc")),
    ],
    ids=["case", "record", "python", "csv", "xyz", "netcdf"],
)


@pytest.mark.parametrize("size", ["endless", "3 GB"])
@READERS
def test_file_without_end_or_of_gigabytes_is_refused(tmp_path, read, name, size):
    """The device gives zeros for ever; the file takes no room on the disk."""
    if size == "endless":
        (tmp_path / name).symlink_to("/dev/zero")
    else:
        with (tmp_path / name).open("wb") as file:
            file.truncate(3 * 10**9)
    reason = {"endless": "not a regular file", "3 GB": r"3 GB; at most (0\.1|2) are read"}[size]
    with pytest.raises(InputError, match=rf"{name}: cannot be read \({reason}\)"):
        read(tmp_path / name)


def spectrum(path):
    """Read a case whose spectrum is in a file."""
    (path.parent / "case.toml").write_text(EVERY["table"].replace("spectrum.txt", path.name))
    read_case(path.parent / "case.toml")


def surface(path, kind="slice", length=4.0):
    """Read an initial surface at the ends of a slice or a ring."""
    tank = build_case({"type": kind, "length": length, "depth": 1.0}).tank
    FileSurface(file=str(path)).surface(tank, np.array([0.5, 4.0]), np.zeros(2))


in_ring = partial(surface, kind="ring", length=6.0)
FREQUENCY = "frequency 0.4 received after 0.5; frequencies must ascend"
POSITIVE = "-0.5 1 received; allowed are two finite numbers, a positive frequency"
BAD_FILES = [  # reader, content, a pattern of the sentence
    (read_record, "0 1\n1 1\n2 1\n", r"bad\.csv: 3 rows received; at least 4"),
    (read_record, "0 1\n1 1\n# c\n1 1\n2 2\n", r"bad\.csv, line 4: time 1 received after 1; times must ascend"),
    (read_record, "0 1\n1 1\nx 1\n2 2\n", r"bad\.csv, line 3: 'x 1' received; allowed are two finite numbers"),
    (read_record, "0 1\n1 1 1\n2 1\n3 2\n", r"bad\.csv, line 2: '1 1 1' received; allowed are two finite numbers"),
    (read_record, "0 1\n1 nan\n2 1\n3 2\n", r"bad\.csv, line 2: '1 nan' received; allowed are two finite numbers"),
    (read_record, "0 1\n1 1\n2 1\ninf 2\n", r"bad\.csv, line 4: 'inf 2' received; allowed are two finite numbers"),
    (read_record, "0 1 2\n1 1 2\n2 1 2\n3 1 2\n", "3 columns received; allowed are two finite numbers"),
    (read_record, "t [s],depth [m]\n0,1\n1,1\n", r"no column 'position \[m\]'; its columns are t \[s\], depth \[m\]"),
    (spectrum, "0.5 1\n0.4 1\n", rf"line 15: wall\.motion\.spectrum\.file = .*bad\.csv, line 2: {FREQUENCY}"),
    (spectrum, "-0.5 1\n0.4 1\n", f"line 1: {POSITIVE}"),
    (spectrum, "0.5 0\n0.6 0\n", "2 rows received; at least 2 are needed, and a density that is not 0"),
    (spectrum, "0.5 x\n0.6 0\n", "line 1: '0.5 x' received; allowed are two finite numbers"),
    (surface, "0 0\n1 0\n2 0\n", "3 rows of 2 columns received"),
    (surface, "0 0 0 0 0\n" * 9, "9 rows of 5 columns received"),
    (surface, "0 0\n1 0\n1 0\n2 0\n", "line 3: x = 1 received after 1; places must ascend"),
    (surface, "0 0\n1 0\n2 0\n3 0\n", "does not reach x = 4 m, where there is water"),
    (in_ring, "0 0\n1 0\n2 0\n3 0\n", "x from 0 to 3 m received; 3 m of a ring of 6 m"),
]


@pytest.mark.parametrize(("read", "text", "said"), BAD_FILES)
def test_bad_file_is_refused_with_its_line(tmp_path, read, text, said):
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        read(tmp_path / "bad.csv")


def environment(*words):
    """Run ``env`` with words of the shell's ``env`` before it."""
    command = ["env", "-u", "WAVETANK_INSIDE", *words]
    return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, check=False)


def test_the_environment_needs_no_home():
    done = environment("-u", "HOME", "./env", "sh", "-c", 'test -d "$HOME"')
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("variable", "cache"), [("WAVETANK_CACHE", ""), ("XDG_CACHE_HOME", "/wavetank"), ("HOME", "/.cache/wavetank")]
)
def test_an_environment_that_cannot_be_written_names_the_variable_of_its_place(variable, cache):
    done = environment("-u", "WAVETANK_CACHE", "-u", "XDG_CACHE_HOME", f"{variable}=/proc/nothing", "./env", "true")
    assert done.returncode == 2
    said = f"env: the environment is to be in /proc/nothing{cache}, as {variable} says, and cannot be written there;"
    assert done.stderr.startswith(said) and done.stderr.count("\n") == 1


# ---------------------------------------------------------------- records of one's own
RECORDS = {
    "still": lambda x, t: 0 * t,
    "at a level": lambda x, t: 0 * t + 0.3,
    "still at one gauge": lambda x, t: np.sin(3 * t - x) * (x > 1),
    "a step": lambda x, t: 1.0 * (t > 5 + x),
    "a ramp": lambda x, t: 1.0 * t,
    "a pulse": lambda x, t: 1.0 * (np.abs(t - 10 - x) < 0.06),
    "in phase": lambda x, t: np.sin(3 * t),
    "steep": lambda x, t: 100 * np.sin(3 * t - x),
    "of 1e-300 m": lambda x, t: 1e-300 * np.sin(3 * t - x),
    "of 1e150 m": lambda x, t: 1e150 * np.sin(3 * t - x),
    "as fast as its steps": lambda x, t: (-1.0) ** np.round(10 * t),
    "noise": lambda x, t: np.random.default_rng(int(x)).standard_normal(t.size),
}


@pytest.mark.parametrize(
    ("name", "x", "y"),
    [
        *((name, (1.0, 2.0, 3.0), 0.0) for name in RECORDS),
        ("noise", (1.0,), 0.0),
        ("noise", (1.0, math.nan), 0.0),
        ("noise", (1.0, 1.0), 5.0),
    ],
)
def test_any_record_is_analysed_or_refused_in_one_sentence(name, x, y):
    """No other error, and no warning, which would be one here."""
    t = np.arange(0, 20, 0.1)
    gauges = [gauge(f"{n}", at, t, RECORDS[name](n + 1, t), "made", n * y) for n, at in enumerate(x)]
    for kind in results.KINDS:
        for period in (None, 2.0):
            try:
                found = results.analysed(kind, WaveRecord(common_clock(gauges), "made", period, 1.0))
                assert len({np.size(column) for column in found.columns.values()}) == 1
            except InputError as error:
                assert str(error).endswith(".") and "\n" not in str(error)


# ---------------------------------------------------------------- every key, with every kind of nonsense
RUN = "[run]\nduration = 20.0\n[numerics]\ncells = 8\n"
UNCUT = RUN.replace("cells = 8\n", "")
SLICE = "gauges = [{x = 1.0}]\n[tank]\nlength = 20.0\ndepth = 1.0\n"
BASIN = "[tank]\ntype = 'basin'\ndepth = 1.0\n[tank.layout]\n"
RECTANGLE = BASIN + "type = 'rectangle'\nlength = 20.0\nwidth = 10.0\nsponge_length = 3.0\n"
FOCUS = "linear_crest = 0.05\nfocus_x = 8.0\nfocus_time = 19.5\nspectrum = {type = 'jonswap', peak_frequency = 0.6}\n"
SEGMENTS = "[wall]\ntype = 'segmented-piston'\nsegment = 0.5\n[wall.motion]\n"
IRREGULAR = "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'irregular'\nsignificant_height = 0.05\ncomponents = 40\n"
EVERY = {  # cases that have each model of a case somewhere
    "slice": SLICE + "bed = {type = 'formula', depth = '1 - x*s', where = {s = 0.02}}\n"
    "[initial]\ntype = 'formula'\neta = '0.01*cos(x)'\n[sponge]\ntype = 'end'\nlength = 4.0\n"
    "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'sinusoid'\npaddle_amplitude = 0.01\nperiod = 2.0\n" + RUN,
    "group": "gauge_lines = [{name = 'A', start = [1.0, 0.0], end = [2.0, 0.0], count = 3}]\n" + SLICE + RUN
    + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'focused'\ncomponents = 32\n" + FOCUS
    + "[sponge]\ntype = 'formula'\ngamma = '0.1*x'\n[water]\ntype = 'linear'\n[output]\nenergy_every = 2\n",
    "gaussian": SLICE + RUN + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'focused'\ncomponents = 32\n"
    + FOCUS.replace("'jonswap'", "'gaussian', bandwidth = 0.05") + "[water]\ntype = 'nonlinear'\n",
    "regular": "probes = [{x = 1.0, z = -0.5}]\nloads = [{on = 'far wall', about = [0.0, 0.0, -1.0]}]\n"
    "windows = [{name = 'inlet', start = [1.0, 0.0], every = 0.5}]\n"
    + SLICE + RUN + "[wall]\ntype = 'piston'\nlimits = {stroke = 1.0, speed = 1.0, acceleration = 3.0}\n"
    "[wall.motion]\ntype = 'regular'\nheight = 0.05\nperiod = 2.0\ngeneration = 'second-order'\n",
    "flap": SLICE + RUN + "[wall]\ntype = 'flap'\nhinge = 0.1\nstroke_height = 1.2\nmotion_as = 'angle'\n"
    "[wall.motion]\ntype = 'sinusoid'\npaddle_amplitude = 0.01\nperiod = 2.0\n",
    "absorbing": SLICE + RUN + "[wall]\ntype = 'piston'\nabsorb = {type = 'active', shortest = 1.2, longest = 3.0}\n"
    "[wall.motion]\ntype = 'sinusoid'\npaddle_amplitude = 0.01\nperiod = 2.0\n",
    "spring": SLICE + RUN + "[far_wall]\ntype = 'piston'\nmotion = {type = 'at-rest'}\n"
    "absorb = {type = 'spring-damper', mass = 100.0, stiffness = 9000.0, damping = 3000.0}\n",
    "profile": SLICE + RUN + "[wall]\ntype = 'profile'\nshape = '1 + z/d'\nwhere = {d = 1.0}\n"
    "[wall.motion]\ntype = 'sinusoid'\npaddle_amplitude = 0.01\nperiod = 2.0\n",
    "bichromatic": SLICE + RUN + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'bichromatic'\n"
    "heights = [0.05, 0.04]\nfrequencies = [0.5, 0.6]\ngeneration = 'second-order'\n",
    "irregular": SLICE + RUN + IRREGULAR + "spectrum = {type = 'pierson-moskowitz', peak_period = 2.0}\n",
    "tma": SLICE + RUN + IRREGULAR + "spectrum = {type = 'tma', peak_frequency = 0.5}\nrandom_amplitudes = true\n",
    "table": SLICE + RUN + IRREGULAR + "spectrum = {type = 'table', file = 'spectrum.txt'}\n",
    "components": SLICE + RUN + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'components'\nfile = 'waves.txt'\n"
    "generation = 'second-order'\n",
    "crest": SLICE + RUN + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'focused'\ncomponents = 32\n" + FOCUS
    + "[target]\ntype = 'crest'\nheight = 0.1\nx = 5.0\ntime = 10.0\n",
    "linear": SLICE + RUN + "[target]\ntype = 'components'\nx = 5.0\n",
    "wanted": SLICE + RUN + "[target]\ntype = 'record'\nx = 5.0\nfile = 'eta.txt'\nstart = 1.0\nend = 4.0\n",
    "surface": SLICE + RUN + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'surface'\nfile = 'eta.txt'\nx = 4.0\n"
    "delay = 16.0\n",
    "solitary": SLICE.replace("x = 1.0", "x = 2.0") + RUN  # the paddle goes 1.1 m
    + "[wall]\ntype = 'piston'\nmotion = {type = 'solitary-wave', height = 0.2}\n",
    "formula": SLICE + RUN + "[wall]\ntype = 'piston'\n[wall.motion]\ntype = 'formula'\nposition = 'a*sin(t)'\n"
    "where = {a = 0.02}\n[far_wall]\ntype = 'flap'\nhinge = 0.1\nlimits = {stroke = 1.0}\n"
    "motion = {type = 'regular', height = 0.02, period = 2.0}\n",
    "record": SLICE + RUN + "[initial]\ntype = 'solitary-wave'\nheight = 0.2\nx = 8.0\n"
    "[wall]\ntype = 'piston'\nmotion = {type = 'recorded', position = 'paddle.txt'}\n",
    "going on": SLICE + "[initial]\ntype = 'run'\ndirectory = 'earlier'\nt = 2.0\n" + RUN,
    "ring": SLICE.replace("[tank]", "[tank]\ntype = 'ring'") + RUN
    + "[initial]\ntype = 'stream-function'\nsteepness = 0.1\nwaves = 4\n",
    "ring sea": SLICE.replace("[tank]", "[tank]\ntype = 'ring'") + RUN + "[initial]\ntype = 'irregular'\n"
    "significant_height = 0.05\nspectrum = {type = 'jonswap', peak_period = 2.0}\n",
    "newwave": SLICE + RUN + "[initial]\ntype = 'focused'\nlinear_crest = 0.05\nx = 10.0\n"
    "spectrum = {type = 'jonswap', peak_period = 2.0}\n",
    "kept surface": SLICE + RUN + "[initial]\ntype = 'file'\nfile = 'start.txt'\n",
    "beds": SLICE + "bed = {type = 'gridded', file = 'bed.csv'}\n[initial]\ntype = 'standing-wave'\n"
    "wave_amplitude = 0.1\n[wall]\ntype = 'piston'\nmotion = {type = 'at-rest'}\n" + RUN,
    "python": SLICE + "bed = {type = 'python', file = 'bed.py'}\n[wall]\ntype = 'fixed'\n"
    "[initial]\ntype = 'still-water'\n" + RUN,
    "beach": SLICE + "bed = {type = 'beach', start = 12.0, slope = 0.2, minimum_depth = 0.05}\n[initial]\n"
    "type = 'still-water'\n" + RUN,
    "written": SLICE + "[wall]\ntype = 'piston'\nmotion = {type = 'python', file = 'paddle.py'}\n" + RUN,
    "rectangle": RECTANGLE + "[tank.layout.refine]\nx = [2.0, 4.0]\nfactor = 0.5\n[sponge]\ntype = 'group'\n"
    + SEGMENTS + "type = 'oblique-wave'\nwave_amplitude = 0.01\nperiod = 1.6\nangle = 20.0\n" + UNCUT,
    "directional": RECTANGLE + SEGMENTS + "type = 'directional-focus'\nfocus_y = 5.0\nlargest_angle = 20.0\n"
    "components = 32\ndirections = 5\n" + FOCUS + UNCUT,
    "reflected": RECTANGLE + SEGMENTS + "type = 'reflected-focus'\nfocus_y = 5.0\ncomponents = 32\ndirections = 5\n"
    + FOCUS + UNCUT,
    "sea": RECTANGLE + SEGMENTS + "type = 'directional-irregular'\nsignificant_height = 0.05\ndeviation = 20.0\n"
    "components = 40\nhighest_frequency = 0.9\nspectrum = {type = 'jonswap', peak_period = 2.0}\n" + UNCUT,
    "snake": RECTANGLE + SEGMENTS.replace("piston'", "flap'\nhinge = 0.2\nstroke_height = 1.1")
    + "type = 'oblique-wave'\nwave_amplitude = 0.01\nperiod = 1.6\nangle = 20.0\n" + UNCUT,
    "sent": RECTANGLE + SEGMENTS.replace("0.5", "2.0") + "type = 'components'\nfile = 'waves.txt'\ny = 5.0\n" + UNCUT,
    "sent surface": RECTANGLE + SEGMENTS.replace("0.5", "1.0") + "type = 'surface'\nfile = 'eta.txt'\nx = 4.0\n"
    + "delay = 16.0\nangle = 20.0\nlowest_frequency = 0.7\nhighest_frequency = 0.9\n" + UNCUT,
    "cylinder": BASIN + "type = 'cylinder'\nlength = 20.0\nwidth = 10.0\ncentre = [8.0, 5.0]\nradius = 1.0\n"
    + UNCUT,
    "bend": BASIN + "type = 'bend'\nwidth = 2.0\nfirst = 5.0\nsecond = 5.0\nangle = 90.0\nradius = 3.0\n"
    + UNCUT,
    "harbour": BASIN + "type = 'harbour'\nlength = 9.0\nwidth = 3.0\narm_length = 6.0\narm_width = 3.0\n"
    + UNCUT,
    "file": BASIN + "type = 'file'\nfile = 'layout.msh'\n" + UNCUT,
}  # fmt: skip
NONSENSE = ["true", '"deep"', '""', "[]", "[1, 2, 3]", "{}", "{a = 1}", "nan", "inf", "-inf", "1979-05-27", "[[[]]]"]
EXTREME = ["-1", "0", "5e-324", "-1e-300", "1e300", "1" + 40 * "0", "1.5", "1e9", "1e-5"]


class Entry(NamedTuple):
    """A key that a case may have, and the field it is."""

    key: str
    model: type[BaseModel]
    field: str


def entries(table: BaseModel, key: str = "") -> Iterator[Entry]:
    """Yield all keys that a case could have with the models that are in it."""
    yield from (Entry(f"{key}{name}", type(table), name) for name in type(table).model_fields)
    for part, at in table.models_inside():
        yield from entries(part, f"{key}{'.'.join(map(str, at))}.")


@pytest.fixture(scope="module")
def every(tmp_path_factory):
    """Return the path of each case."""
    folder = tmp_path_factory.mktemp("every")
    (folder / "paddle.txt").write_text("".join(f"{t} {0.01 * t / 30}\n" for t in range(31)))
    (folder / "spectrum.txt").write_text("0.3 0.0\n0.5 1.0\n1.5 0.0\n")
    (folder / "waves.txt").write_text("0.5 0.02 1.0\n0.6 0.01 2.0\n")
    (folder / "eta.txt").write_text("".join(f"{t / 5} {0.01 * math.sin(t)}\n" for t in range(99)))
    (folder / "start.txt").write_text("".join(f"{x} {0.01 * math.cos(x)}\n" for x in range(31)))
    (folder / "bed.csv").write_text("x,depth\n" + "".join(f"{x},1.0\n" for x in range(31)))
    (folder / "bed.py").write_text("def depth(x, y):\n    return 1 + 0 * x\n")
    (folder / "paddle.py").write_text("def motion(t, order):\n    return 0 * t\n")
    for name, text in EVERY.items():
        (folder / f"{name}.toml").write_text(text)
    return {name: folder / f"{name}.toml" for name in EVERY}


def models(annotation: object) -> set[type[BaseModel]]:
    """Return all models that can stand in a place, and in theirs."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        inside = (models(field.annotation) for field in annotation.model_fields.values())
        return {annotation}.union(*inside)
    return set().union(*(models(one) for one in get_args(annotation)))


def test_cases_have_every_model(every):
    """A model that is new needs a case here, so that its keys are tried with nonsense, too."""
    missing = models(Case) ^ {entry.model for path in every.values() for entry in entries(read_case(path))}
    assert not missing, f"{missing}: add a case of each to EVERY of tests/test_bad_input.py"


@cache
def limits(entry: Entry) -> list[tuple[float, float]]:
    """Return from where to where a number may be there, by the schema; nothing where no number stands."""
    field = entry.model.model_fields[entry.field]
    schema = TypeAdapter(Annotated[field.annotation, field]).json_schema()
    numbers = [one for one in schema.get("anyOf", [schema]) if one.get("type") in ("number", "integer")]
    numbers = [one for one in numbers if "enum" not in one]
    lowest = (one.get("minimum", one.get("exclusiveMinimum", -math.inf)) for one in numbers)
    highest = (one.get("maximum", one.get("exclusiveMaximum", math.inf)) for one in numbers)
    return list(zip(lowest, highest, strict=True))


@pytest.fixture(scope="module")
def first(every):
    """Return the first case that has each key of each model."""
    return {entry: name for name in reversed(every) for entry in entries(read_case(every[name], trust=True))}


def tried(path: Path, entry: Entry, texts: list[str]) -> None:
    """Override a key of a case by each text: a case comes of it, or a sentence that names the key."""
    sentence = re.compile(rf"{re.escape(str(path))}, (overridden|line \d+): [\w.\-]+( = .*)?: ?.*\.")
    allowed = limits(entry)
    assert all(math.isfinite(low) and math.isfinite(high) for low, high in allowed), f"{entry} has no range"
    for text in texts:
        try:
            case = read_case(path, [f"{entry.key}={text}"])
        except InputError as error:
            assert all(sentence.fullmatch(line) for line in str(error).splitlines()), str(error)
            continue
        assert isinstance(case, Case)
        if allowed:
            number = float(text)  # nothing else may stand there
            assert any(low <= number <= high for low, high in allowed), f"{entry.key} = {text} is accepted"


@pytest.mark.parametrize("name", EVERY)
def test_nonsense_gives_a_case_or_names_its_key(every, first, name):
    """Each in the first case that has it: what is of no right kind is so whatever else is in a case.

    Where no number may be, any two stand for all.
    """
    for entry in entries(read_case(every[name])):
        if first[entry] == name:
            tried(every[name], entry, NONSENSE + (EXTREME if limits(entry) else EXTREME[:2]))


@pytest.mark.slow  # some of these, and other numbers, are tried below
@pytest.mark.parametrize("name", EVERY)
def test_extreme_numbers_give_a_case_or_a_sentence_in_every_case(every, first, name):
    for entry in entries(read_case(every[name])):
        if first[entry] != name and limits(entry):
            tried(every[name], entry, EXTREME)


@cache
def numbers_of(path: Path) -> list[Entry]:
    """Return the keys of a case that may be numbers, but for those that take long: 10^4 components."""
    return [one for one in entries(read_case(path)) if limits(one) and one.field != "components"]


@st.composite
def changes(draw, every):
    """Return a case and some of its keys with other values: any numbers, and the ends of what is allowed."""
    path = every[draw(st.sampled_from(sorted(every)))]
    keys = numbers_of(path)
    changed = []
    for entry in draw(st.lists(st.sampled_from(keys), min_size=1, max_size=4)):
        ends = [end for pair in limits(entry) for end in pair]
        value = draw(st.one_of(st.sampled_from(ends), st.floats(*ends[:2]), st.floats(-20, 20), st.integers(1, 10**12)))
        changed.append(f"{entry.key}={value}")
    return path, changed


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_random_numbers_give_a_case_or_a_sentence(every, data):
    path, changed = data.draw(changes(every))
    try:
        case = read_case(path, changed)
    except InputError as error:
        assert all(line.startswith(str(path)) and line.endswith(".") for line in str(error).splitlines())
        return
    assert np.isfinite(case.ends[0].max_displacement)
