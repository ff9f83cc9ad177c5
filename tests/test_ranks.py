"""The helper of tests on several ranks: it ends all processes that it started, and reports what ended them."""

import ast
import os
import sys
import time
from pathlib import Path

import pytest
from mpi4py import MPI
from ranks import Crew, begun, members

from wavetank.base.mpi import on_first


def wait_for_the_first():
    """Return on the first rank; wait for it on the others."""
    if MPI.COMM_WORLD.rank:
        MPI.COMM_WORLD.Barrier()


def fail_on_the_first():
    if MPI.COMM_WORLD.rank == 0:
        raise ValueError("on one alone")
    MPI.COMM_WORLD.Barrier()


def test_crew_calls_on_every_rank_all_on_one_processor():
    crew = Crew(2)
    assert crew.call(divmod, 7, 2) == [(3, 1), (3, 1)]
    one, other = crew.call(os.sched_getaffinity, 0)
    assert one == other and len(one) == 1
    crew.end()
    assert not crew.at_work and not members(crew.session)


@pytest.mark.parametrize(
    ("function", "message"),
    [(fail_on_the_first, "on rank 0: (.|\n)*ValueError: on one alone"), (wait_for_the_first, "rank 1 has ended")],
)
def test_error_or_deadlock_of_one_rank_ends_the_crew(function, message):
    crew = Crew(2, limit=1)
    with pytest.raises(RuntimeError, match=message):
        crew.call(function)
    assert not crew.at_work and not members(crew.session)


def test_process_in_its_own_group_that_outlives_its_parent_is_ended():
    orphan = "import subprocess; print(subprocess.Popen(['sleep', '1000'], stdout=2, process_group=0).pid)"
    with begun([sys.executable, "-c", orphan], stdout=-1, stderr=-1) as process:
        assert int(process.stdout.readline()) in members(process.pid)
        process.wait()
    assert not members(process.pid)


def test_no_test_starts_a_process_by_itself():
    """What ``subprocess.Popen`` starts goes on, or is waited for, if an assertion fails meanwhile."""
    for file in Path(__file__).parent.glob("*.py"):
        calls = [node.func for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)]
        assert ("Popen" in {getattr(called, "attr", "") for called in calls}) == (file.name == "ranks.py"), file


def cpu_time_of_waiting() -> float:
    """Return the CPU time [s] of two seconds in which only the first rank works, on each."""
    before = time.process_time()
    on_first(MPI.COMM_WORLD, lambda: time.sleep(2.0))
    return time.process_time() - before


def test_ranks_that_wait_for_the_first_one_take_no_processor(on_ranks):
    assert max(on_ranks(cpu_time_of_waiting)) < 0.1
