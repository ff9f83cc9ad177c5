"""Cases that several tests need, as Python builds them, and their warnings."""

from types import SimpleNamespace

from mpi4py import MPI

from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.planning.checks import run_warnings
from wavetank.planning.resolution import still_mesh
from wavetank.simulation.build import build_clock, build_run

SLICE = {"length": 20.0, "depth": 1.0}


def build_case(tank=SLICE, *, duration=20.0, **parts):
    """Return the case of a tank, a duration [s] and other tables."""
    return Case.model_validate({"tank": tank, "run": {"duration": duration}} | parts)


def moving(kind, motion, **more):
    """Return the table of a wall: its type, the type of its motion and the keys of that."""
    return {"type": kind, "motion": {"type": motion, **more}}


def piston(period, amplitude=0.005, **more):
    """Return the table of a piston with a sinusoidal motion."""
    return moving("piston", "sinusoid", paddle_amplitude=amplitude, period=period, **more)


def warnings_before(case):
    """Return the warnings before a run; of a slice or ring from its discrete dispersion, without compiled kernels."""
    if case.tank.type == "basin":
        run, waves = build_run(case, MPI.COMM_SELF)
        return run_warnings(case, run.clock, waves)
    largest = still_mesh(case, case.cell_size).largest_frequency
    waves = SimpleNamespace(plane=SimpleNamespace(cell_size=case.cell_size), largest_frequency=largest)
    return run_warnings(case, build_clock(case, largest, INTEGRATORS[case.numerics.integrator]()), waves)
