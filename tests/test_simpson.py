"""(23) reported at the mean of its traces, in the tank: fourth order with a moving paddle, at (23)'s cost."""

import numpy as np
import pytest
from conftest import CHECKOUT, fitted_slope
from mpi4py import MPI

from wavetank.build import Records, build_observers, build_run
from wavetank.observers.gauges import Gauges
from wavetank.observers.record import Memory
from wavetank.observers.schedule import EverySteps
from wavetank.scene import Scene

SCENE = {
    "tank": {"length": 6.0, "depth": 1.0},
    "wall": {"type": "piston", "motion": {"type": "sinusoid", "amplitude": 0.03, "period": 1.6, "ramp": 1.6}},
    "gauges": [0.5, 2.0],
    "run": {"duration": 2.4},
    "numerics": {"cells": 6, "vertical_order": 4, "tolerance": 1e-10},
}


class Recorded:
    """A run with its gauges, energies and mass.

    Attributes
    ----------
    eta, balance
        At the gauges [m], shape (steps + 1, 2), and the largest balance of the energy over the largest energy.
    mass
        How far the mass goes from its start, relative.
    """

    def __init__(self, integrator, dt):
        numerics = {**SCENE["numerics"], "integrator": integrator, "dt": dt}
        scene = Scene.model_validate({**SCENE, "numerics": numerics})
        run, waves = build_run(scene, MPI.COMM_WORLD)
        gauges, energy = Memory(), Memory()
        run.observers += build_observers(scene, waves, Records(gauges, energy, None), sinks=run.sinks)
        run.execute()
        self.eta, rows = gauges.array()[:, 1:], energy.array()
        self.balance = np.abs(rows[:, 6]).max() / rows[:, 3].max()
        self.mass = np.ptp(rows[:, 7]) / rows[0, 7]


def test_gauges_and_energies_beside_a_moving_paddle_are_of_fourth_order_in_time():
    """Against Gauss-Legendre's scheme at half the smallest step, whose error is a fortieth; (23) is worse."""
    steps, smallest = (0.08, 0.04, 0.02), 0.01
    reference = Recorded("gauss-legendre-4", smallest).eta

    def error(run, dt):
        return np.abs(run.eta - reference[:: round(dt / smallest)]).max()

    runs = [Recorded("simpson-4", dt) for dt in steps]
    errors = [error(one, dt) for one, dt in zip(runs, steps, strict=True)]
    assert fitted_slope(steps, errors) == pytest.approx(4, abs=0.2)
    assert fitted_slope(steps, [one.balance for one in runs]) == pytest.approx(4, abs=0.2)
    assert max(one.mass for one in runs) < 1e-13
    plus = Recorded("third-order", steps[2])
    assert errors[2] < error(plus, steps[2]) / 3 and runs[2].balance < plus.balance / 2


def rms_above(frequency, eta, dt):
    """Return the rms of what a record has above a frequency, by a Hann window."""
    window = np.hanning(eta.size)
    spectrum = np.fft.rfft(window / np.sqrt((window**2).mean()) * (eta - eta.mean()))
    short = spectrum[np.fft.rfftfreq(eta.size, dt) > frequency]
    return np.sqrt(2 * (np.abs(short) ** 2).sum()) / eta.size


@pytest.mark.slow
def test_waves_over_a_bar_stay_clean():
    """On coarse cells and long steps, from 40 to 45 s; with (23) as it is what is above 10 Hz grows to 2 mm there."""
    numerics = ["cell_size=0.11", "vertical_order=6", "dt=0.03", "integrator='simpson-4'"]
    changes = ["run.duration=45.0", *(f"numerics.{one}" for one in numerics)]
    run, waves = build_run(Scene.from_toml(CHECKOUT / "cases" / "bar.toml", changes), MPI.COMM_SELF)
    record = Memory()
    places = [(x, 0.0) for x in (12.5, 13.5, 14.5, 15.7)]
    run.observers.append(Gauges(waves, places, record=record, schedule=EverySteps()))
    run.execute()
    late = record.array()[-round(5.0 / 0.03) :, 1:].T
    assert max(rms_above(10.0, eta, 0.03) for eta in late) < 1e-4
    assert max(np.ptp(eta) for eta in late) > 0.03  # the waves are there
