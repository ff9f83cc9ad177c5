"""Plans against what happens: predicted errors and costs against measured ones, and against a search.

References are runs refined in all directions, or the exact wave. Errors are those a plan speaks of: the root mean
square of the elevation's error over that of the elevation, at the farthest gauge over the run, of standing waves in the
last period, of waves in a ring at the end.
"""

import time
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
import pytest
from case_builders import build_case, moving, piston
from conftest import needs_marin
from mpi4py import MPI
from records import gauge_rows, with_numerics
from scipy.interpolate import CubicSpline

from benchmarks.costs import calibrate
from wavetank.base.errors import WavetankError
from wavetank.case import Case
from wavetank.case.reading import read_case
from wavetank.planning.cost import CONSTANTS
from wavetank.planning.plan import Plan, make_plan
from wavetank.planning.prediction import Settings
from wavetank.planning.resolution import resolved
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.diagnostics import HighestCrest
from wavetank.simulation.records import Memory, Records
from wavetank.waves.airy import angular_frequency

CHECKOUT = Path(__file__).resolve().parents[1]
GROUP = ("run.duration=18.0", "wall.motion.focus_time=16.0", "wall.motion.focus_x=7.0", "gauges=[7.0]")
GROUP += ("tank.length=14.0",)
ABSORBING = {"type": "piston", "motion": {"type": "at-rest"}, "absorb": {"type": "active"}}
FLAP = {"type": "flap", "hinge": 0.0}
MARIN = ("run.duration=40.0", "tank.length=20.0", "gauges=[6.0]")


def case(name: str, *overrides: str) -> Case:
    return read_case(CHECKOUT / "cases" / f"{name}.toml", overrides)


def ring(kd: float, steepness: float, periods: int) -> Case:
    """Waves of permanent form that go round a ring of one wave length, whole times."""
    tank = {"type": "ring", "length": 2 * np.pi / kd, "depth": 1.0}
    parts = {"initial": {"type": "stream-function", "steepness": steepness}, "gauges": [0.0]}
    one = build_case(tank, **parts)
    return build_case(tank, duration=periods * (one.tank.length / one.initial.wave(one.tank).speed), **parts)


def steep_standing(steepness: float, periods: int) -> Case:
    """A standing wave of k a in k d = pi / 2, for so many periods of linear theory."""
    initial = {"type": "standing-wave", "wave_amplitude": steepness / (np.pi / 2)}
    duration = periods * (2 * np.pi / float(angular_frequency(np.pi / 2, 1.0, 9.81)))
    return build_case({"length": 2.0, "depth": 1.0}, duration=duration, gauges=[0.0], initial=initial)


SCENES = {  # scene and accuracy
    "linear": (lambda: case("wavemaker"), 1e-2),
    "steep": (lambda: case("standing-wave", "gauges=[0.0]"), 1e-2),
    "steeper": (lambda: steep_standing(0.3, periods=5), 1e-3),
    "shallow": (lambda: ring(0.5, 0.3, 5), 1e-2),
    "deep": (lambda: ring(3.0, 0.5, 10), 1e-3),
    "group": (lambda: case("focusing", *GROUP), 1e-2),
    "marin": (lambda: case("marin-202002", *MARIN), 5e-2),
}


class Measured(NamedTuple):
    """Times [s] and elevations [m] at the farthest gauge, the surface's error at the end, and CPU seconds."""

    t: np.ndarray
    eta: np.ndarray
    at_the_end: float
    cpu: float


def run(case: Case) -> Measured:
    gauges = Memory()
    running, waves = build_run(case, MPI.COMM_SELF)
    running.diagnostics += build_observers(case, waves, Records(gauges, Memory(), None), sinks=running.sinks)
    began = time.process_time()
    running.execute()
    cpu, rows = time.process_time() - began, gauges.array()
    exact, _ = case.initial.surface(case.tank, *waves.plane.places.T)
    error = waves.elevation(running.state.q, running.state.p, running.t) - exact
    size = exact @ waves.mass.apply(exact) or 1.0
    return Measured(rows[:, 0], rows[:, -1], float(np.sqrt(error @ waves.mass.apply(error) / size)), cpu)


def with_settings(scene: Case, plan: Plan, settings: Settings, **changes) -> Case:
    return with_numerics(replace(plan, settings=settings).applied_to(scene), **changes)


class Trial:
    """A scene with its plan; settings are tried against its reference."""

    def __init__(self, name: str):
        make, self.accuracy = SCENES[name]
        self.case = make()
        self.plan = make_plan(self.case, self.accuracy)
        self._tried: dict[Settings, tuple[float, float]] = {}

    @cached_property
    def reference(self) -> Measured:
        best = self.plan.settings
        cells, n = round(1.5 * best.cells), min(12, best.vertical_order + 4)
        finer = Settings(order=5, cells=cells, vertical_order=n, dt=best.dt / 4, integrator="simpson-4")
        return run(with_settings(self.case, self.plan, finer, tolerance=1e-9))

    def measure(self, settings: Settings) -> tuple[float, float]:
        """Return error and CPU seconds; infinite where the run breaks down."""
        if settings not in self._tried:
            try:
                found = run(with_settings(self.case, self.plan, settings))
                self._tried[settings] = (self._error(found), found.cpu)
            except WavetankError:
                self._tried[settings] = (np.inf, np.inf)
        return self._tried[settings]

    def measure_in_turn(self, *several: Settings) -> None:
        """Take the least CPU seconds of two more runs of each: what else a machine does only adds to them."""
        for one in several * 2:
            error, cpu = self.measure(one)
            again = run(with_settings(self.case, self.plan, one)).cpu
            self._tried[one] = (error, min(cpu, again))

    def _error(self, found: Measured) -> float:
        if self.case.tank.type == "ring":
            return found.at_the_end
        late = found.t >= (0.9 * found.t[-1] if self.case.initial.type == "standing-wave" else 0.0)
        exact = np.interp(found.t, self.reference.t, self.reference.eta)[late]
        return float(np.sqrt(np.mean((found.eta[late] - exact) ** 2) / np.mean(exact**2)))

    def search(self) -> None:
        """Try steps downhill from the plan's settings."""
        now, cost = self.plan.settings, self.measure(self.plan.settings)[1]
        for _ in range(3):
            tried = [(self.measure(one), one) for one in self._neighbours(now)]
            good = [(cpu, one) for (error, cpu), one in tried if error <= self.accuracy and cpu < 0.95 * cost]
            if not good:
                break
            cost, now = min(good, key=lambda one: one[0])

    def cheapest(self, error: float) -> Settings:
        """Return the cheapest of all settings tried that have at most this error."""
        good = (one for one, (found, _) in self._tried.items() if found <= error)
        return min(good, key=lambda one: self._tried[one][1])

    def row(self, name: str) -> str:
        """Return the scene's row of the table."""
        plan, (error, cpu) = self.plan, self.measure(self.plan.settings)
        chosen = plan.settings
        numerics = f"{chosen.order} | {chosen.cells} | {chosen.vertical_order} | {plan.cost.steps}"
        figures = f"{plan.error:.1e} | {error:.1e} | {plan.cost.cpu:.2g} | {cpu:.2g}"
        return f"| {name} | {plan.physics} | {self.accuracy:g} | {numerics} | {figures} |"

    def _neighbours(self, now: Settings) -> list[Settings]:
        fewer = max(self.case.tank.fewest_cells, int(0.8 * now.cells))
        other = {"simpson-4": "gauss-legendre-4", "gauss-legendre-4": "simpson-4"}.get(now.integrator, "simpson-4")
        steps = np.ceil(self.case.run.duration / now.dt / 1.25)
        changes = [
            {"dt": self.case.run.duration / steps},
            {"cells": fewer},
            {"vertical_order": max(1, now.vertical_order - 2)},
            {"order": now.order - 1} if now.order > 2 else {},
            {"order": now.order + 1, "cells": fewer},
            {"integrator": other},
            {"integrator": other, "dt": self.case.run.duration / steps},
        ]
        return [replace(now, **change) for change in changes if change]


@cache
def this_machine() -> dict[str, tuple[float, ...]]:
    """Measured now: a machine that is busy with other work is slower at some times than at others."""
    return calibrate()


@pytest.mark.parametrize(
    "name", [*(pytest.param(name, marks=pytest.mark.slow) for name in ("linear", "steep", "deep")), "shallow"]
)
def test_error_of_a_plan_is_the_predicted_one(name):
    """Within a factor of three, and what is promised; settings are those for the rounded costs of one machine."""
    trial = Trial(name)
    error, _ = trial.measure(trial.plan.settings)
    assert 1 / 3 < trial.plan.error / error < 3
    assert error <= trial.accuracy


def sinusoidal(kd: float) -> Case:
    """Waves of k a = 0.02 at two wave lengths from a piston, for twelve periods, two of them its ramp."""
    period, length = 2 * np.pi / float(angular_frequency(kd, 1.0, 9.81)), 2 * np.pi / kd
    tank, wall = (
        {"length": round(8 * max(1.0, kd / 6)) * length, "depth": 1.0},
        piston(period, 0.02 / kd, ramp=2 * period),
    )
    return build_case(tank, duration=12 * period, gauges=[2 * length], wall=wall)


def solitary(height: float) -> Case:
    """A solitary wave that travels 25 m."""
    initial = {"type": "solitary-wave", "height": height, "x": 15.0}
    return build_case({"length": 60.0, "depth": 1.0}, duration=8.0, gauges=[40.0], initial=initial)


def packet(kind: str, length: float, duration: float, **shape) -> Case:
    """A wave packet of k d = 2 between a paddle and a fixed wall."""
    wall = moving(kind, "formula", position="0.004*sin(5.6*(t-3.4))*exp(-((t-3.4)/1.4)**2)") | shape
    return build_case({"length": length, "depth": 0.6}, duration=duration, gauges=[0.75 * length], wall=wall)


def absorbing_flap() -> Case:
    """Shallow waves from a flap to another that absorbs: of all paddles these answer a step most."""
    depth, k = 0.6, 0.7 / 0.6
    period = 2 * np.pi / float(angular_frequency(k, depth, 9.81))
    ends = {"wall": piston(period, 0.01 / k) | FLAP, "far_wall": ABSORBING | FLAP}
    return build_case({"length": 6 * np.pi / k, "depth": depth}, duration=20 * period, gauges=[4 * np.pi / k], **ends)


def absorbing_paddles() -> Case:
    """Regular waves between two paddles that absorb."""
    ends = {"wall": ABSORBING | piston(1.3, 0.02), "far_wall": ABSORBING}
    return build_case({"length": 6.0, "depth": 0.6}, duration=30.0, gauges=[4.0], **ends)


NAMED_NOTHING = {  # scenes that plans once missed by 1.2 to 1.9 times, in closed tanks by up to 9 times
    "steep": SCENES["steep"][0],
    "group": SCENES["group"][0],
    "piston, kd 3": lambda: sinusoidal(3.0),
    "piston, kd 9": lambda: sinusoidal(9.0),
    "solitary, 0.3": lambda: solitary(0.3),
    "solitary, 0.5": lambda: solitary(0.5),
    "closed, piston, 2 m": lambda: packet("piston", 2.0, 120.0),
    "closed, flap, 3 m": lambda: packet("flap", 3.0, 45.0, hinge=0.0),
    "absorbing paddles": absorbing_paddles,
    "absorbing flap": absorbing_flap,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMED_NOTHING)
def test_default_numerics_are_accurate_to_a_percent(name, monkeypatch):
    """Against refined runs."""
    monkeypatch.setitem(SCENES, name, (NAMED_NOTHING[name], 1e-2))
    trial = Trial(name)
    error, _ = trial.measure(trial.plan.settings)
    print(f"{trial.row(name)} not searched |")
    assert error <= 1e-2


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_error_and_cost_are_the_predicted_ones_and_hardly_anything_is_cheaper(name):
    """Errors within a factor of three, CPU seconds of two; nothing found as accurate is 1.5 times as cheap.

    A plan aims at a third of the accuracy. What is found within the whole of it may have steps 3^(1/4) as long and
    cells 3^(1/5) as large, by the orders of the scheme and of most plans' elements, 1.64 together; it is not twice as
    cheap. Prints the rows of the table of docs/plan.md.
    """
    if name == "marin":
        needs_marin()
    with patch.dict(CONSTANTS, this_machine()):
        trial = Trial(name)
    error, _ = trial.measure(trial.plan.settings)
    trial.search()
    trial.measure_in_turn(trial.plan.settings, trial.cheapest(error), trial.cheapest(trial.accuracy))
    as_accurate, accurate = trial.cheapest(error), trial.cheapest(trial.accuracy)
    cpu, least = (trial.measure(one)[1] for one in (trial.plan.settings, accurate))
    print(f"{trial.row(name)} {least:.2g} | {cpu / least:.2f} | {accurate}")
    assert 1 / 3 < trial.plan.error / error < 3
    assert 1 / 2 < trial.plan.cost.cpu / cpu < 2
    assert cpu < 1.5 * trial.measure(as_accurate)[1]
    assert cpu < 2 * least


REFINED = {"cells": 270, "order": 5, "vertical_order": 8, "dt": 0.0125, "tolerance": 1e-7, "integrator": "simpson-4"}
STEEP_WAVES = ("wall.motion.ramp=6.06",)
LONG_WAVES = ("wall.motion.period=2.02", "wall.motion.paddle_amplitude=0.01493", "wall.motion.ramp=4.04")


@pytest.mark.slow
@pytest.mark.parametrize(("waves", "gain"), [(LONG_WAVES, 1.5), (STEEP_WAVES, 0.6)], ids=["2.02 s", "1.01 s"])
def test_default_order_over_a_bar_is_more_accurate_for_the_same_unknowns(waves, gain):
    """Oracle: a refined run. The largest error at gauges is 1.3 %, of order 3 on more unknowns ``gain`` times that.

    Measured (50 s): waves of 2.02 s 0.9 and 2.3 %, of 1.01 s, which nearly break, 1.1 and 0.85 %, in 0.85 of the time.
    The latter with a ramp of six periods: of a ramp of two the first crests sharpen with the cells (docs/plan.md).
    """
    asked = case("bar", "run.duration=36.0", 'run.on_breaking="ignore"', *waves)
    chosen = resolved(asked)
    assert chosen.numerics.order * chosen.cells < 0.81 * 3 * 337
    settings = REFINED, {}, {"cells": 337, "order": 3, "vertical_order": 8}
    exact, default, lower = (gauge_rows(chosen, **one) for one in settings)
    errors = [worst(one, exact) for one in (default, lower)]
    assert errors[0] < 0.013 and errors[1] > gain * errors[0]


@pytest.mark.slow
def test_default_cells_of_a_modulated_train_are_fine_enough():
    """Oracle: a refined run. The highest crest of 40 s to 3 %; with three cells a wave it is 16 % too high."""
    surface = "0.025 * (1 + 0.1 * cos(pi * x / 4)) * cos(2 * pi * x)"
    potential = "0.025 * sqrt(9.81 / (2 * pi)) * (1 + 0.1 * cos(pi * x / 4)) * sin(2 * pi * x)"
    initial, tank = {"type": "formula", "eta": surface, "psi": potential}, {"type": "ring", "length": 8.0, "depth": 2.0}
    chosen = resolved(build_case(tank, duration=40.0, gauges=[0.0], initial=initial))
    settings = {"cells": 144, "order": 4, "vertical_order": 12, "tolerance": 1e-7}, {}, {"cells": 24}
    exact, default, coarse = (highest(chosen, one) for one in settings)
    assert default == pytest.approx(exact, rel=0.03) and coarse > 1.1 * exact


def highest(scene: Case, settings: dict) -> float:
    """Return the highest crest of a run with changed numerics [m]."""
    running, waves = build_run(with_numerics(scene, **settings), MPI.COMM_SELF)
    running.diagnostics += [crest := HighestCrest(waves)]
    running.execute()
    return crest.state.height


def worst(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest relative error (rms) of gauges."""
    splined = CubicSpline(found[:, 0], found[:, 1:])(exact[:, 0])
    return float(np.max(np.linalg.norm(splined - exact[:, 1:], axis=0) / np.linalg.norm(exact[:, 1:], axis=0)))
