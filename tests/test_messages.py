"""Messages for input that cannot be used or is doubtful: each names the key or file and what is allowed."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from rich.console import Console

from wavetank.case.reading import read_case
from wavetank.cli import main
from wavetank.output.directory import RunDirectory
from wavetank.planning.checks import too_long
from wavetank.recording import record_run

SLICE = "[tank]\nlength = 4.0\ndepth = 1.0\n[run]\nduration = {duration}\n[numerics]\ncells = 8\nvertical_order = 4\n"
RING = SLICE.replace("length = 4.0", 'type = "ring"\nlength = 63.0')
RECORD = '[wall]\ntype = "piston"\nmotion = {{type = "recorded", position = "paddle.txt"}}\n'
GROUP = (
    '[wall]\ntype = "piston"\nmotion = {{type = "focused", focus_x = 2.0, focus_time = 0.5, linear_crest = 0.01, '
    'spectrum = {{type = "jonswap", peak_period = 1.0}}, ramp = 0.1}}\n'
)
SEA = '[wall]\ntype = "piston"\nmotion = {{type = "irregular", significant_height = 0.02, '
SEA += 'spectrum = {{type = "jonswap", peak_period = 1.0}}, ramp = 0.1}}\n'


@pytest.fixture
def case(tmp_path):
    """Return what writes a case, whose parts may have a duration, and a record of a paddle."""

    def write(text: str, record: str = "", duration: float = 1.0) -> Path:
        (tmp_path / "paddle.txt").write_text(record)
        (tmp_path / "case.toml").write_text(text.format(duration=duration))
        return tmp_path / "case.toml"

    return write


REFUSED = {
    "a standing wave above its breaking limit": (  # 0.218 tanh(k d) of its length of 8 m, over 2
        SLICE + '[initial]\ntype = "standing-wave"\nwave_amplitude = 0.9\n',
        {},
        "initial.wave_amplitude = 0.9: must be at most 0.5719 m, where standing waves of this length break",
    ),
    "a group that more components than allowed would not repeat": (  # 9999 / (2.0 - 0.5) Hz
        SLICE + GROUP,
        {"duration": 1e7},
        "run.duration = 10000000.0: must be at most 6666 s: 10000 components, the most, repeat the waves after it",
    ),
    "an irregular sea that more components than allowed would not repeat": (
        SLICE + SEA,
        {"duration": 1e7},
        "run.duration = 10000000.0: must be at most 3999.6 s: 10000 components, the most, repeat the waves after it",
    ),
    "decimal commas with semicolons": (
        SLICE + RECORD,
        {"record": "0,00;0,001\n1;0,002\n2,0;0,003\n3,0;0,004\n"},
        "paddle.txt, line 1: '0,00;0,001' received: decimal commas; allowed are decimal points",
    ),
    "decimal commas with blanks": (
        SLICE + RECORD,
        {"record": "0 0\n0,5\t1,2e-3\n2,0 0,003\n3,0 0,004\n"},
        "paddle.txt, line 2: '0,5\\t1,2e-3' received: decimal commas; allowed are decimal points",
    ),
    "a paddle beyond its reach": (
        SLICE + '[wall]\ntype = "piston"\nmotion = {{type = "sinusoid", paddle_amplitude = 5.0, period = 2.0}}\n',
        {"duration": 9.0},
        "line 11: wall.motion.paddle_amplitude = 5.0: takes the paddle 5 m from rest; it must stay below 3 m",
    ),
    "a window outside the tank after the run": (  # all of its problems appear at once
        '[[windows]]\nname = "a"\nstart = [5.0, 0.0]\nevery = 0.1\nbegin = 2.0\nuntil = 1.5\n' + SLICE,
        {},
        "start = [5.0, 0.0]: must be inside the tank, 0 to 4 m.\n"
        "CASE, line 5: windows.0.begin = 2.0: must be before the end of the run, 1 s.\n"
        "CASE, line 6: windows.0.until = 1.5: must be from 2 s on, its begin.",
    ),
    "files of both walls": (
        SLICE + RECORD + RECORD.replace("[wall]", "[far_wall]").replace("paddle", "other"),
        {"record": "0 0\n1 1\n"},
        "2 rows received; at least 4 are needed for a cubic spline.\nCASE, line 14: far_wall.motion.position",
    ),
    "positions in centimetres by their header": (
        SLICE + RECORD,
        {"record": "t [s] position [cm]\n0 0\n1 1\n2 0\n3 1\n"},
        "its columns are t [s], position [cm] (wall.motion.column names another one, wall.motion.gain converts",
    ),
    "times in milliseconds by their header": (
        SLICE + RECORD.replace("}}", ', column = "X"}}'),
        {"record": "t [ms],X\n0,0\n1,1\n2,0\n3,1\n"},
        "its first column is 't [ms]'; allowed are times in seconds",
    ),
    "positions in millimetres without a header": (
        SLICE + RECORD,
        {"record": "0 0\n1 10\n2 0\n3 10\n"},
        "its times must be in s, its values in m or m/s (wall.motion.gain converts them)",
    ),
    "gauges below a table": (
        SLICE + "gauges = [1.0]\n",
        {},
        "; gauges of the case belongs above the first [table].",
    ),
    "two tables of one name": (SLICE + 2 * RECORD, {}, "CASE, line 12: [wall] received twice; allowed is one such"),
    "a steady wave that cannot be computed": (
        RING + '[initial]\ntype = "stream-function"\nsteepness = 0.97\n',
        {},
        "line 10: initial: height = 0.783418 m: no wave of length 63 m in a depth of 1 m could be computed",
    ),
}


@pytest.mark.parametrize("which", REFUSED)
def test_a_case_that_cannot_be_run_is_refused_with_key_and_limit(which, case, capsys):
    text, parts, said = REFUSED[which]
    path = str(case(text, **parts))
    assert main(["plan", path]) == 2
    assert said in capsys.readouterr().err.replace(path, "CASE")


def test_times_in_milliseconds_are_suspected(case):
    """Oracle: the waves of T = 2 s that the record has in seconds, of which there is no warning."""
    for unit, count in ((1.0, 0), (1e3, 1)):
        record = "".join(f"{unit * n / 10} {0.02 * np.sin(np.pi * n / 10)}\n" for n in range(200))
        assert [one.code for one in too_long(read_case(case(SLICE + RECORD, record)))] == ["waves-too-long"] * count


def formula(position: str) -> str:
    return '[wall]\ntype = "piston"\nmotion = {{type = "formula", position = "' + position + '"}}\n'


def test_probes_without_water_at_any_time_are_named(case, tmp_path):
    """Also of a run that goes on; a probe that was wet once, before or after, is not."""
    probes = "probes = [{{x = 0.0, z = 0.05}}, {{x = 1.0, z = 0.5}}, {{x = 2.0, z = -0.3}}, {{x = 4.0, z = 0.05}}]\n"
    text = probes + SLICE + '[initial]\ntype = "standing-wave"\nwave_amplitude = 0.1\nmode = 1\n'
    # A crest at x = 0 until 0.47 s, half a period of 2.8 s later at x = 4.
    for duration, dry in ((0.6, "; x = 4, y = 0, z = 0.05 m"), (1.2, "")):
        out = tmp_path / "run"
        scene = read_case(case(text, duration=duration))
        record_run(scene, out, comm=MPI.COMM_SELF, console=Console(quiet=True), resume=out.exists())
        (said,) = (one for one in map(str, RunDirectory(out).warnings) if "probes" in one)
        assert said == f"probes without water at any time, their columns are empty: x = 1, y = 0, z = 0.5 m{dry}"
