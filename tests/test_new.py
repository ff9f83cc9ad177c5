"""`wavetank new`: each kind of case is a case as it is written, runs, and is never written over another."""

import pytest
from case_builders import warnings_before
from conftest import commanded, recorded
from mpi4py import MPI

from wavetank.base.errors import InputError
from wavetank.case.new import KINDS, SCHEMA, write_case
from wavetank.case.reading import read_case
from wavetank.output.directory import RunDirectory
from wavetank.planning.plan import planned

TWICE = ("run.duration=0.02", "numerics={dt=0.01, cell_size=1.0, vertical_order=4}")


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_case_names_the_schema_and_its_title_and_runs(kind, tmp_path):
    name = tmp_path / f'my "{kind}"'
    said = commanded("new", str(name), "--kind", kind)
    path = tmp_path / f'my "{kind}".toml'
    assert (said.returncode, said.stderr) == (0, "") and said.stdout.startswith(f"wrote {path}; now: wavetank run ")
    assert path.read_text().startswith(f"#:schema {SCHEMA}\n#")
    case = read_case(path)
    places = [(gauge.x, gauge.y) for gauge in case.all_gauges]
    assert case.title == f'my "{kind}"' and len({*places}) == len(places)  # one on another is drawn over it
    recorded(path, TWICE, tmp_path / "run")
    assert RunDirectory(tmp_path / "run").manifest["status"] == "finished"


@pytest.mark.parametrize("kind", [pytest.param(one, marks=[pytest.mark.slow] * (one == "basin")) for one in KINDS])
def test_new_case_has_no_warning_before_its_run(kind, tmp_path):
    case, warnings = planned(read_case(write_case(f"{tmp_path}/waves.toml", kind)), MPI.COMM_SELF)
    assert [*warnings, *warnings_before(case)] == []


def test_existing_case_is_not_overwritten(tmp_path):
    path = write_case(f"{tmp_path}/waves.toml", "ring")
    path.write_text("mine")
    with pytest.raises(InputError, match=r"waves\.toml: is there already; give another name\."):
        write_case(f"{tmp_path}/waves", "slice")
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["x", "--kind", "rnig"], "--kind rnig received; did you mean 'ring'? allowed are: slice, basin, ring, focus."),
        (["/"], "'/' received; a name for the case is needed, such as waves."),
        (["/proc/nothing/x"], "/proc/nothing/x.toml: cannot be written (No such file or directory)."),
    ],
)
def test_case_that_cannot_be_written_is_refused(arguments, sentence):
    said = commanded("new", *arguments)
    assert (said.returncode, said.stderr) == (2, f"wavetank: {sentence}\n")
