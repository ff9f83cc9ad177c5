"""(23) reported at the mean of its traces, in the tank: fourth order with a moving paddle, at (23)'s cost."""

import numpy as np
import pytest
from conftest import CHECKOUT, fitted_slope
from mpi4py import MPI

from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Gauges
from wavetank.simulation.records import Memory, Records

SINUSOID = {"type": "sinusoid", "paddle_amplitude": 0.03, "period": 1.6, "ramp": 1.6}
SLICE = {
    "tank": {"length": 6.0, "depth": 1.0},
    "wall": {"type": "piston", "motion": SINUSOID},
    "gauges": [0.5, 2.0],
    "run": {"duration": 1.6},
    "numerics": {"cells": 6, "vertical_order": 4, "tolerance": 1e-10},
}
BASIN = {
    "tank": {
        "type": "basin",
        "depth": 0.5,
        "layout": {"type": "rectangle", "length": 3.0, "width": 1.0},
        "bed": {"type": "formula", "depth": "0.5 - 0.05 * x + 0.05 * y"},
    },
    "wall": {
        "type": "segmented-piston",
        "motion": {"type": "oblique-wave", "wave_amplitude": 0.02, "period": 1.6, "angle": 25.0, "ramp": 1.6},
    },
    "gauges": [{"x": 0.5, "y": 0.2}, {"x": 1.0, "y": 0.9}],
    "run": {"duration": 2.4},
    "numerics": {"cell_size": 1.0, "vertical_order": 4, "tolerance": 1e-10},
}


def built(case, **numerics):
    """Return the run of a case with other numerics, nothing observed yet, and the waves in it."""
    return build_run(Case.model_validate({**case, "numerics": {**case["numerics"], **numerics}}), MPI.COMM_WORLD)


class Recorded:
    """A run with its gauges, energies and mass.

    Attributes
    ----------
    eta, surface
        At the gauges [m], shape (steps + 1, 2); in the end at the degrees of freedom [m].
    balance
        The largest balance of the energy over the largest energy.
    mass
        How far the mass goes from its start, relative.
    solves
        Of interior problems.
    """

    def __init__(self, integrator, dt, case=SLICE):
        scene = Case.model_validate({**case, "numerics": {**case["numerics"], "integrator": integrator, "dt": dt}})
        run, waves = build_run(scene, MPI.COMM_WORLD)
        gauges, energy = Memory(), Memory()
        run.diagnostics += build_observers(scene, waves, Records(gauges, energy, None), sinks=run.sinks)
        run.execute()
        self.eta, rows = gauges.array()[:, 1:], energy.array()
        self.surface = waves.elevation(run.state.q, run.state.p, run.t)
        self.balance = np.abs(rows[:, 6]).max() / rows[:, 3].max()
        self.mass = np.ptp(rows[:, 7]) / rows[0, 7]
        self.solves = waves.potential.counters.solves


@pytest.mark.parametrize(
    ("case", "nearer"),
    [(SLICE, (5.4, 12.5)), pytest.param(BASIN, (1.6, 3.4), marks=pytest.mark.slow)],
    ids=["piston", "segments"],
)
def test_gauges_surfaces_and_energies_beside_a_moving_paddle_are_of_fourth_order_in_time(case, nearer):
    """Against Gauss-Legendre's scheme at half the smallest step, whose error is a fortieth.

    Gauges are so many times nearer than (23)'s, as docs/trade.md has it.
    """
    steps, smallest = (0.08, 0.04), 0.02
    reference = Recorded("gauss-legendre-4", smallest, case)

    def error(run, dt):
        return np.abs(run.eta - reference.eta[:: round(dt / smallest)]).max()

    runs = [Recorded("simpson-4", dt, case) for dt in steps]
    errors = [error(one, dt) for one, dt in zip(runs, steps, strict=True)]
    assert fitted_slope(steps, errors) == pytest.approx(4, abs=0.2)
    surfaces = [np.abs(one.surface - reference.surface).max() for one in runs]
    assert fitted_slope(steps, surfaces) == pytest.approx(4, abs=0.2)
    assert fitted_slope(steps, [one.balance for one in runs]) == pytest.approx(4, abs=0.2)
    assert max(one.mass for one in runs) < 1e-13
    theirs = [error(Recorded("third-order", dt, case), dt) for dt in steps]
    assert np.divide(theirs, errors) == pytest.approx(nearer, rel=0.1)


def test_what_is_recorded_costs_no_solve():
    """Both traces are evaluated anyway, at times that t_n + dt misses by its last bits."""
    bare, waves = built(SLICE, integrator="simpson-4", dt=0.04)
    bare.execute()
    assert Recorded("simpson-4", 0.04).solves <= waves.potential.counters.solves + 2  # of the first and last states


def rms_above(frequency, eta, dt):
    """Return the rms of what a record has above a frequency, by a Hann window."""
    window = np.hanning(eta.size)
    spectrum = np.fft.rfft(window / np.sqrt((window**2).mean()) * (eta - eta.mean()))
    short = spectrum[np.fft.rfftfreq(eta.size, dt) > frequency]
    return np.sqrt(2 * (np.abs(short) ** 2).sum()) / eta.size


def noise_over_the_bar(duration, integrator):
    """Return what is above 10 Hz over the bar and behind it, in windows of 5 s from 20 s on [m], and the last waves."""
    numerics = ["cell_size=0.11", "vertical_order=6", "dt=0.03", f"integrator={integrator}"]
    changes = [f"run.duration={duration}", *(f"numerics.{one}" for one in numerics)]
    run, waves = build_run(read_case(CHECKOUT / "cases" / "bar.toml", changes), MPI.COMM_SELF)
    record = Memory()
    places = [(x, 0.0) for x in (12.5, 13.5, 14.5, 15.7)]
    run.diagnostics.append(Gauges(waves, places, record=record, schedule=EverySteps()))
    run.execute()
    begins = np.rint(np.arange(20.0, duration, 5.0) / 0.03).astype(int)
    windows = np.split(record.array()[:, 1:], begins)[1:]
    return [max(rms_above(10.0, eta, 0.03) for eta in window.T) for window in windows], np.ptp(windows[-1])


@pytest.mark.slow
def test_waves_over_a_bar_stay_clean_where_those_of_the_paper_s_scheme_do_not():
    """On coarse cells and long steps, for a minute and more with the default scheme; with (23) for half of that."""
    default = read_case(CHECKOUT / "cases" / "bar.toml").numerics.integrator
    noise, waves = noise_over_the_bar(65.0, default)
    assert max(noise) < 1e-4 and waves > 0.03
    theirs, _ = noise_over_the_bar(45.0, "third-order")
    assert theirs[-1] > 5e-4 and theirs[-1] > 5 * theirs[0]
