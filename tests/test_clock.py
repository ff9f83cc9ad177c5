"""When steps are: they end where the duration, or a record of the paddle, ends. The oracle is arithmetic."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI
from ranks import CHECKOUT

from wavetank.base.errors import InputError
from wavetank.case.reading import read_case
from wavetank.integrators import INTEGRATORS
from wavetank.simulation.build import build_clock, build_run, end_message
from wavetank.simulation.clock import Clock

times = st.floats(1e-3, 1e3)


@given(duration=times, part=st.floats(1e-4, 3.0))
def test_default_steps_divide_the_duration(duration, part):
    clock = Clock.dividing(duration, part * duration)
    assert clock.end == pytest.approx(duration, rel=1e-12)
    assert clock.dt <= part * duration * (1 + 1e-8)
    assert clock.steps == 1 or duration / (clock.steps - 1) > part * duration  # none fewer would do


@given(duration=times, part=st.floats(1e-4, 3.0))
def test_given_steps_cover_the_duration(duration, part):
    clock = Clock.covering(duration, part * duration)
    assert clock.dt == part * duration
    assert duration * (1 - 1e-8) <= clock.end < duration + clock.dt


@given(steps=st.integers(1, 100_000), dt=times)
def test_a_step_that_divides_the_duration_does_so_despite_rounding(steps, dt):
    assert Clock.covering(steps * dt, dt, until=steps * dt).steps == steps


def test_an_end_beyond_the_duration_is_told():
    scene = read_case(CHECKOUT / "cases" / "standing-wave.toml", ["run.duration=22.0"])
    said = "the run ends at 22.01 s, with a whole step of 0.03 s, not at 22 s"
    assert end_message(scene, Clock(0.03, 1067, 20.0, 1000)) == said
    assert end_message(scene, Clock.covering(22.0, 0.04)) == ""


@pytest.mark.parametrize(("scheme", "most"), [("simpson-4", 1.4 * 1.6930043715), ("gauss-legendre-4", 2.8)])
def test_a_default_step_is_one_for_the_surface_as_it_moves_at_the_start(scheme, most):
    scene, still = read_case(CHECKOUT / "cases" / "standing-wave.toml", ["run.duration=100.0"]), 10.0
    clocks = {part: build_clock(scene, still, INTEGRATORS[scheme](), moving=part * still) for part in (1.1, 8.0)}
    assert 0.98 * most < 8.0 * still * clocks[8.0].dt <= most
    assert clocks[1.1] == build_clock(scene, still, INTEGRATORS[scheme]())  # as still water is


def recorded(folder, *, first=0.0, last=10.0, **numerics):
    """A short tank of linear waves, ten seconds long, whose paddle follows a record."""
    t = np.linspace(first, last, 101)
    np.savetxt(folder / "paddle.dat", np.column_stack([t, 0.01 * np.sin(t - first) ** 2]), fmt="%.17g")
    case = folder / "case.toml"
    case.write_text(
        "[tank]\nlength = 2.0\ndepth = 1.0\n[wall]\ntype = 'piston'\n"
        "motion = { type = 'recorded', position = 'paddle.dat' }\n[water]\ntype = 'linear'\n[run]\nduration = 10.0\n"
        "[numerics]\ncells = 4\norder = 2\nvertical_order = 3\n"
        + "".join(f"{key} = {value!r}\n" for key, value in numerics.items())
    )
    return case


@pytest.mark.parametrize("integrator", sorted(INTEGRATORS))
@pytest.mark.parametrize(("numerics", "end"), [({}, 10.0), ({"dt": 0.03}, 9.99)], ids=["default", "given"])
def test_a_run_as_long_as_its_record_gets_to_its_end(tmp_path, integrator, numerics, end):
    """A given step is kept, and the one that the record does not cover left out."""
    scene = read_case(recorded(tmp_path, integrator=integrator, **numerics))
    run, _ = build_run(scene, MPI.COMM_SELF)
    run.execute()
    assert run.t == pytest.approx(end, rel=1e-12)


@pytest.mark.parametrize(("numerics", "end"), [({}, ""), ({"dt": 2.5}, ""), ({"dt": 6.0}, "6"), ({"dt": 0.03}, "9.99")])
def test_a_run_that_ends_before_its_duration_is_said_to(tmp_path, numerics, end):
    scene = read_case(recorded(tmp_path, integrator="gauss-legendre-4", **numerics))
    run, _ = build_run(scene, MPI.COMM_SELF)
    step = f"a whole step of {run.clock.dt:.4g} s"
    beyond = "one more step would end beyond the recorded motion"
    expected = f"the run ends at {end} s, with {step}, not at 10 s: {beyond}" if end else ""
    assert end_message(scene, run.clock) == expected


def test_a_step_beyond_the_whole_record_is_refused_before_the_run(tmp_path):
    scene = read_case(recorded(tmp_path, dt=11.0, integrator="gauss-legendre-4"))
    with pytest.raises(InputError, match=r"a step of 11 s: must be at most 10 s, where the recorded motion ends"):
        build_run(scene, MPI.COMM_SELF)


def test_a_record_of_another_time_is_refused(wavetank, tmp_path):
    case = recorded(tmp_path, first=100.0, last=103.0)
    result = wavetank("run", str(case), "--out", str(tmp_path / "run"))
    assert result.returncode == 2 and not (tmp_path / "run").exists()
    line = f"{case}, line 10: run.duration = 10.0: must be more than 100 s, where the recorded motion begins."
    assert result.stderr.strip() == f"wavetank: {line}"
