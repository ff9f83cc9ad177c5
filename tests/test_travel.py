"""How long waves travel in tanks that reflect: against mirror images and closed formulas."""

import numpy as np
import pytest
from case_builders import build_case, piston

from wavetank.planning import travel
from wavetank.planning.plan import make_plan
from wavetank.planning.prediction import ErrorModel, Settings
from wavetank.planning.requirements import absorption_error, requirements, stokes_harmonics
from wavetank.waves import airy
from wavetank.waves.wavemaker import Flap

GRAVITY = 9.81
PACKET = {"type": "formula", "position": "0.01*sin(6*(t-3))*exp(-(t-3)**2)"}  # k d = 2, generated at t = 3 s
ABSORBING = {"type": "piston", "motion": {"type": "at-rest"}, "absorb": {"type": "active"}}


def closed(duration, *, motion=PACKET, **parts):
    """Return a tank of 2 m with a piston, a gauge and, unless named, a fixed wall."""
    usual = {"tank": {"length": 2.0, "depth": 0.55}, "wall": {"type": "piston", "motion": motion}, "gauges": [1.5]}
    return build_case(**usual | parts, duration=duration)


def mean_age(case):
    waves = requirements(case, 1e-2).waves
    energy = waves.amplitude**2
    return float(np.sqrt(energy @ waves.age**2 / energy.sum())), waves


def test_age_of_a_packet_between_walls_is_that_of_the_run():
    """Recorded at all ages from 0 to T - 3 s alike: their root mean square is (T - 3 s) / 3^(1/2)."""
    assert mean_age(closed(120.0))[0] == pytest.approx(117.0 / np.sqrt(3), rel=0.03)


@pytest.mark.parametrize("duration", [120.0, 1e8])
def test_continuous_waves_between_walls_are_younger_than_a_packet(duration):
    """Generated at a constant rate, ages have the density T - a: their root mean square is T / 6^(1/2)."""
    motion = {"type": "sinusoid", "paddle_amplitude": 0.001, "period": 1.05, "ramp": 1.0}
    found = mean_age(closed(duration, motion=motion))[0]
    assert found == pytest.approx(duration / np.sqrt(6), rel=0.1)  # the motion is tapered at its end


def test_waves_before_a_sponge_pass_once():
    _, waves = mean_age(closed(120.0, sponge={"type": "end", "length": 0.4}, water={"type": "linear"}))
    speed = airy.group_velocity(waves.k, 0.55, GRAVITY)
    assert waves.age == pytest.approx(1.5 / speed, rel=1e-6)


def test_free_harmonics_are_generated_as_the_squared_envelope():
    """The stroke halves at t = 20 s of 40 s: 16/17 of their energy, and 4/5 of that of the waves, is generated before.

    A gauge at 20 s of travel records that part of them.
    """
    motion = {"type": "formula", "position": "0.01*sin(6*t)*(0.75-0.25*tanh(t-20))"}
    parts = {"tank": {"length": 40.0, "depth": 0.55}, "sponge": {"type": "end", "length": 5.0}}
    far = 20 * float(airy.group_velocity(airy.wave_number(12.0, 0.55, GRAVITY), 0.55, GRAVITY))
    near, late = (
        requirements(closed(40.0, motion=motion, gauges=[x], water={"type": "nonlinear"}, **parts), 1e-2).waves
        for x in (0.1, far)
    )
    assert late.amplitude[-1] ** 2 / near.amplitude[-1] ** 2 == pytest.approx(16 / 17, rel=0.03)


def test_absorbing_paddle_ends_the_propagation():
    """The age is that of the first passage but for what the filter reflects, a few per cent."""
    age, waves = mean_age(closed(120.0, far_wall=ABSORBING, water={"type": "linear"}))
    first = 1.5 / airy.group_velocity(waves.k, 0.55, GRAVITY)
    assert np.all(waves.age > first) and age < 3 * first.mean()


def test_each_reflection_multiplies_the_energy_by_its_square():
    """All energy is generated at t = 0: passages at 1.5, 2.5, 5.5, 6.5 and 9.5 s, at the speed 1 m/s in 2 m."""
    rates, reflected = np.array([[1.0, 0.0, 0.0, 0.0]]), np.array([[0.5], [0.8]])
    parts = {"sampled": 4e-6, "length": 2.0, "reflected": reflected, "duration": 10.0}
    found = travel.travel(np.array([1.5]), np.array([1.0]), rates, **parts)
    energy = np.array([1.0, 0.8**2, 0.4**2, 0.4**2 * 0.8**2, 0.4**4])
    ages = np.array([1.5, 2.5, 5.5, 6.5, 9.5])
    assert found.fraction == pytest.approx(energy.sum())
    assert found.reflected == pytest.approx(energy[1:].sum())
    assert found.age == pytest.approx(np.sqrt(energy @ ages**2 / energy.sum()))


def test_recorded_energy_is_relative_to_that_of_the_run():
    """A constant rate for 8 s, of which the run has 4 s: a gauge at 1 s of travel records 3/4."""
    parts = {"sampled": 8.0, "length": 2.0, "reflected": np.zeros((2, 1)), "duration": 4.0}
    assert travel.travel(np.ones(1), np.ones(1), np.ones((1, 8)), **parts).fraction == pytest.approx(0.75)


def test_response_is_the_sum_of_all_mirror_images():
    length, duration, k = 3.0, 40.0, np.array([1.1, 2.3, 4.0])
    speed = airy.group_velocity(k, 1.0, GRAVITY)
    reflected = np.array([[1.0, 0.9, 0.5], [1.0, 0.7, 0.2]])
    x = np.array([0.0, 1.2, 3.0])
    expected = np.zeros((3, 3), dtype=complex)
    for n in range(60):
        for first, factor in ((x, 1.0), (2 * length - x, reflected[1])):
            path = np.add.outer(first, 2 * n * length * np.ones(3))
            image = factor * (reflected[0] * reflected[1]) ** n * np.exp(-1j * k * path)
            expected += np.where(path <= speed * duration, image, 0.0)
    found = travel.response(x, k, speed, length=length, reflected=reflected, duration=duration)
    assert np.allclose(found, expected, atol=1e-6)


def test_longer_run_of_a_closed_tank_has_a_larger_error():
    """The plan of a single passage misses such a run by 9 % (docs/plan.md)."""
    coarse = Settings(order=3, cells=6, vertical_order=5, dt=0.066, integrator="simpson-4")
    short, long = (requirements(closed(T), 1e-2) for T in (6.0, 120.0))
    assert ErrorModel(short).predict(coarse) < 0.015 < 0.05 < ErrorModel(long).predict(coarse)


def test_bound_harmonics_between_walls_are_those_of_one_direction():
    """A wall doubles the crest, not the waves of either direction (their harmonics were predicted 0.8 of the first)."""
    found = requirements(closed(20.0, wall=piston(1.2, 0.01, ramp=2.0), water={"type": "nonlinear"}), 1e-2)
    ratios, _ = stokes_harmonics(found.k * found.crest / 2, found.k * 0.55)
    assert found.form.harmonics[1] == pytest.approx(ratios[1])


def test_harmonics_of_steep_standing_waves_decay_as_measured():
    """Against a refined run of k a = 0.2, k d = 2: r_4 = 0.0057, r_5 = 0.0017, without the free ones of its start."""
    parts = {"initial": {"type": "standing-wave", "wave_amplitude": 0.1}, "water": {"type": "nonlinear"}}
    case = build_case({"length": np.pi / 2, "depth": 1.0}, duration=10.0, **parts)
    ratios = requirements(case, 1e-3).form.harmonics[3:5] / (0.0057, 0.0017)
    assert np.all((ratios > 0.5) & (ratios < 2.0))


@pytest.mark.parametrize(
    ("wall", "kd", "measured"),
    [("piston", 0.7, 2.2e-2), ("piston", 1.5, 8.2e-3), ("flap", 0.7, 4.7e-2), ("flap", 1.5, 2.6e-2)],
)
def test_absorption_once_a_step_is_part_of_the_error(wall, kd, measured):
    """Regular waves between a paddle and one that absorbs, 28 steps a period, against steps of a sixth."""
    depth, k = 0.6, kd / 0.6
    period = 2 * np.pi / float(airy.angular_frequency(k, depth, GRAVITY))
    ends = {"wall": piston(period, 0.01 / k) | {"type": wall}, "far_wall": ABSORBING | {"type": wall}}
    tank = {"length": 6 * np.pi / k, "depth": depth}
    case = build_case(tank, duration=20 * period, gauges=[2 * np.pi / k], water={"type": "linear"}, **ends)
    model = ErrorModel(requirements(case, 1e-2))
    mesh = model.mesh(order=5, cells=200, vertical_order=16)
    assert 0.5 < model.total(mesh, model.time("simpson-4", period / 28)) / measured < 2.0


def test_error_of_absorption_counts_while_its_waves_are_at_the_farthest_gauge():
    """Of two paddles that absorb the one counts whose error is larger, a flap's."""
    driven, flap = piston(2.0, 0.01), ABSORBING | {"type": "flap"}

    def error(gauges, wall, far_wall):
        case = build_case({"length": 10.0, "depth": 1.0}, gauges=gauges, wall=wall, far_wall=far_wall)
        return float(absorption_error(case, np.array([1.5]))[0])

    both = error([5.0], driven | {"absorb": {"type": "active"}}, flap)
    least = float(Flap(0.0).transfer(1.5, 1.0)) ** -1.5
    back = 15.0 / float(airy.group_velocity(1.5, 1.0, GRAVITY)) / 20.0
    found = [error([5.0], driven, flap), error([1.0, 5.0], driven, flap), both]
    assert found == pytest.approx([2.5 * least * np.sqrt(1 - back)] * 3)
    assert error([5.0], driven, ABSORBING) < both


def test_absorbing_paddle_has_a_vertical_order_for_evanescent_modes():
    """A flap of k d = 0.7 misses 1.1 % with n = 2, which the waves alone need, 0.24 % with n = 4 (docs/plan.md)."""
    flap, parts = {"type": "flap", "hinge": 0.0}, {"tank": {"length": 6 * np.pi / 0.7, "depth": 1.0}, "duration": 40.0}
    fixed, absorbing = (
        make_plan(build_case(**parts, wall=piston(3.08, 0.01) | flap, **far), 1e-2).settings.vertical_order
        for far in ({}, {"far_wall": ABSORBING | flap})
    )
    assert fixed < 4 <= absorbing
