"""Waves from a piston of small stroke against linear wavemaker theory (Biésel) at three depths."""

import numpy as np
import pytest
from blocks import block_of

from wavetank.integrators import Simpson4
from wavetank.motion import Ramped, Sinusoid
from wavetank.simulation.clock import EverySteps
from wavetank.simulation.diagnostics import Gauges
from wavetank.simulation.records import Memory
from wavetank.waves.airy import angular_frequency, group_velocity
from wavetank.waves.wavemaker import PISTON

GRAVITY, AMPLITUDE = 9.81, 2e-4


@pytest.mark.slow  # test_linear_model.py: of linear waves all three hold, and small nonlinear ones become linear
@pytest.mark.parametrize("kd", [0.6, 1.5, 3.0])
def test_height_to_stroke_is_biesels(make_tank, kd):
    omega = float(angular_frequency(kd, 1.0, GRAVITY))
    period = 2 * np.pi / omega
    gauge = 4.0  # more than three depths from the paddle: the evanescent field is below 1 %
    duration = 4 * period + gauge / float(group_velocity(kd, 1.0, GRAVITY)) + 5 * period
    length = max(10.0, 0.5 * np.sqrt(GRAVITY) * duration + gauge)  # no reflection reaches the gauge
    cell = min(0.5, 2 * np.pi / kd / 8)
    motion = Ramped(Sinusoid(AMPLITUDE, period), 3 * period)
    tank = make_tank(length=length, cells=round(length / cell), n=6, motion=motion, tolerance=1e-8)
    record = Memory()
    gauges = Gauges(tank, [(gauge, 0.0)], record=record, schedule=EverySteps())
    steps_per_period = int(np.ceil(period * tank.largest_frequency / 1.0))
    dt = period / steps_per_period
    rest = np.zeros(tank.plane.owned)
    scheme = Simpson4()
    state = scheme.start(*tank.state(rest, rest))
    for step in range(int(duration / dt)):
        state = scheme.step(tank, state, step * dt, dt)
        gauges.record(block_of(tank, (step + 1, (step + 1) * dt, state)))
    t, eta = record.array()[-2 * steps_per_period :].T
    harmonic = 2 / t.size * abs(np.sum(eta * np.exp(-1j * omega * t)))
    assert harmonic / AMPLITUDE == pytest.approx(float(PISTON.transfer(kd, 1.0)), rel=0.01)
