"""The command line as a user meets it: exit codes, one clear sentence for bad input, ranks."""

import re
import signal
import subprocess
import sys
import time
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from ranks import CHECKOUT, begun, launch
from records import refusal

from wavetank.__main__ import main as start
from wavetank.cli import COMMANDS, app, main
from wavetank.output.directory import RunDirectory

COARSE = ["numerics.vertical_order=4", "numerics.tolerance=1e-11", "numerics.cells=12"]
DRIVEN = ["wall.motion.paddle_amplitude=0.05", "wall.motion.ramp=0.5", "gauges=[0.5, 3.0]", "tank.length=3.5"]
DRIVEN += ["run.duration=0.15", "numerics.dt=0.03", *COARSE[:2]]


def run(wavetank, case, out, changes, **options):
    """Return how the run of a case with changes ends, without pictures."""
    words = [word for change in changes for word in ("--set", change)]
    return wavetank("run", f"cases/{case}.toml", *words, "--no-plots", "--out", str(out), **options)


def test_the_main_job_focuses_a_wave_that_does_not_break_on_larger_cells_too(wavetank, tmp_path):
    """Oracle: linear theory's crest at 10 m, 20 s; nonlinearity raises and delays it a little."""
    changes = ["numerics.cell_size=0.5", "numerics.vertical_order=4", "numerics.dt=0.06"]
    assert run(wavetank, "focusing", tmp_path, changes).returncode == 0
    surface = RunDirectory(tmp_path).snapshots()
    highest = surface.isel(surface.elevation.argmax(...))
    assert RunDirectory(tmp_path).status == "finished" and 0.10 < highest.elevation < 0.13
    assert float(highest.x) == pytest.approx(10.0, abs=1.0)
    assert float(highest.time) == pytest.approx(20.0, abs=0.6)


def test_the_main_job_leaves_its_pictures(tmp_path):
    """As it is typed, cut short."""
    path = tmp_path / "run"
    assert launch(["sh", "-c", f"make run 'RUN={path} --set run.duration=0.2'"]).returncode == 0
    assert all((path / picture).exists() for picture in ("surface.png", "gauges.png", "energy.png"))
    assert RunDirectory(path).manifest["case"]["numerics"]["cell_size"] == 0.2


def test_gauges_are_the_same_on_any_number_of_ranks_and_progress_is_seen(wavetank, tmp_path):
    records = []
    for ranks in (1, 2):
        out = tmp_path / str(ranks)
        result = run(wavetank, "wavemaker", out, DRIVEN, ranks=ranks)
        assert result.returncode == 0, result.stderr
        records.append(RunDirectory(out).gauges.values)
        assert RunDirectory(out).manifest["ranks"] == ranks
        assert re.search(r"\nt = .*s left, .*iterations per step\n", result.stdout), result.stdout
    alone, together = records
    assert np.abs(alone).max() > 1e-3
    assert np.abs(together - alone).max() < 1e-9 * np.abs(alone).max()


# ---------------------------------------------------------------- what it says of itself
def commands(group=None, path=()):
    """Yield all commands with the words that call them, groups before theirs."""
    group = typer.main.get_command(app) if group is None else group
    yield path, group
    for name in group.list_commands(None) if hasattr(group, "commands") else ():
        yield from commands(group.commands[name], (*path, name))


def test_every_command_has_an_example_that_it_takes():
    """Its options are those of the command, its arguments as many as needed, its files those of the checkout."""
    known = dict(commands())
    for path, command in known.items():
        words = command.epilog.removeprefix("Example: wavetank ").partition(" > ")[0].split()
        called = max((one for one in known if tuple(words[: len(one)]) == one), key=len)
        assert called[: len(path)] == path and len(command.epilog) < 78
        known[called].make_context("wavetank", words[len(called) :])
        assert all((CHECKOUT / word).exists() for word in words if word.startswith("cases/"))


def test_commands_are_listed_in_the_order_of_use_each_with_a_whole_sentence(wavetank):
    listed = wavetank("--help").stdout.partition("Commands:")[2].splitlines()
    names = [command.__name__ for command in COMMANDS]
    assert [line.split()[0] for line in listed if line[:3].strip()] == [*names, "data", "verify", "Example:"]
    for group in ("--help", "verify --help", "data --help"):
        assert "..." not in wavetank(*group.split()).stdout.partition("Commands:")[2]


def test_the_version_is_the_package_s(wavetank):
    version = tomllib.loads((CHECKOUT / "pyproject.toml").read_text())["project"]["version"]
    said = wavetank("--version")
    assert (said.returncode, said.stdout) == (0, f"wavetank {version}\n")


def test_run_without_a_case_lists_those_at_hand(monkeypatch, capsys, tmp_path):
    """Those of the present folder and of the checkout, by their titles, and no other TOML file; nothing is run."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text('title = "My [own] waves"\n[tank]\nlength = 2.0\ndepth = 1.0\n[run]\n')
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / "broken.toml").write_text("[[[")
    assert main(["run"]) == 2
    lines = [line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:]]
    assert lines[-1] == ["mine.toml", "My [own] waves"]
    titles = {path: tomllib.loads(path.read_text())["title"] for path in sorted((CHECKOUT / "cases").glob("*.toml"))}
    assert lines[:-1] == [[str(path), title] for path, title in titles.items()]
    assert list(tmp_path.glob("runs*")) == []


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("run nothing.toml", r"nothing.toml: cannot be read .* a case file in TOML is needed.\n"),
        ("run focussing", r"focussing: cannot be read \(No such .*; did you mean cases/focusing.toml\?"),
        ("run cases/focusing.toml --out OUT --set numerics.dt=3", r"overridden: numerics\.dt = 3\.0: must be"),
        ("run cases/focusing.toml --out OUT --set tank.depth=-1", r"tank\.depth = -1.*greater than or equal to"),
        ("run cases/focusing.toml --out tests", "no run directory"),
        ("compare nowhere --with marin-202002", "nowhere: is no run directory"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(words, sentence, tmp_path):
    assert re.search(sentence, refusal(*words.replace("OUT", str(tmp_path / "out")).split()))


def test_bad_input_is_one_sentence_on_two_ranks(wavetank, tmp_path):
    result = run(wavetank, "focusing", tmp_path / "out", ["tank.dept=1"], ranks=2)
    assert result.returncode == 2 and "Traceback" not in result.stderr
    assert re.search("'?tank.dept'?.*depth", result.stderr) and result.stderr.count("wavetank:") == 1


def test_a_run_that_breaks_down_keeps_everything_before_and_says_why(wavetank, tmp_path):
    """A standing wave of k a = 0.47 released from rest jets up at the walls and breaks."""
    result = run(wavetank, "standing-wave", tmp_path, ["initial.wave_amplitude=0.3", COARSE[0], COARSE[2]])
    assert result.returncode == 1
    assert re.search(r"wavetank: t = [\d.]+ s.*(steep|break)", result.stderr)
    broken = RunDirectory(tmp_path)
    assert broken.status == "broke down" and broken.manifest["cause"] in result.stderr
    status = f"{tmp_path}: broke down, t {float(broken.gauges.time[-1]):.5g} of 16.8 s, speed "
    assert wavetank("status", str(tmp_path)).stdout.startswith(status)
    assert broken.gauges.time.size > 20 and np.all(np.isfinite(broken.gauges))


def test_an_interrupted_run_keeps_everything_before_and_says_so(tmp_path):
    out = tmp_path / "run"
    longer = ["--set", "run.duration=130", "--no-plots", "--out", str(out)]
    command = [sys.executable, "-m", "wavetank", "run", "cases/focusing.toml", *longer]
    with begun(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        while not ((out / "gauges.csv").exists() and (out / "gauges.csv").stat().st_size > 1000):
            assert process.poll() is None
            time.sleep(0.05)
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate()
    assert process.returncode == 1
    assert re.search(r"wavetank: t = [\d.]+ s: interrupted by SIGINT", errors), errors
    assert RunDirectory(out).manifest["status"] == "stopped"
    assert RunDirectory(out).gauges.time.size > 5


def interrupt(*_):
    raise KeyboardInterrupt


@pytest.mark.parametrize("when", ["while it is imported", "while it is set up"])
def test_what_is_interrupted_before_it_begins_ends_as_what_is_later(when, monkeypatch, capsys):
    """One line, and a run's exit code."""
    if when == "while it is imported":
        monkeypatch.delitem(sys.modules, "wavetank.cli")
        monkeypatch.setattr(sys, "meta_path", [SimpleNamespace(find_spec=interrupt), *sys.meta_path])
    else:
        monkeypatch.setattr("wavetank.cli.cases_at_hand", interrupt)
    monkeypatch.setattr(sys, "argv", ["wavetank", "run"])
    assert start() == 1
    assert capsys.readouterr().err == "wavetank: interrupted by SIGINT\n"


ALONE = """
import sys
from mpi4py import MPI
from wavetank import cli
from wavetank.base.errors import InputError

def app(arguments):
    if MPI.COMM_WORLD.rank == 1:
        raise InputError("known to this rank alone")
    MPI.COMM_WORLD.barrier()

cli.app, cli.LAST_RANK = app, 0.5
sys.exit(cli.main([]))
"""


def test_a_rank_that_ends_alone_says_why_and_ends_the_others():
    """Which wait for it: none hangs, whatever they wait in."""
    done = launch([sys.executable, "-c", ALONE], ranks=2)
    assert "wavetank: rank 1: known to this rank alone" in done.stderr
    assert done.returncode == 2
