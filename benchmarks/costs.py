"""Constants of the cost of a step, fitted to timed runs, which integrators contain (``costs``).

Measure them on a quiet machine and replace the built-in values when the code has become faster.
"""

from itertools import product
from typing import Any

import numpy as np
import scipy
from mpi4py import MPI
from rich.console import Console

from wavetank.base.arrays import Vector
from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.planning.cost import CONSTANTS, KINDS, features, step_costs
from wavetank.planning.resolution import MAX_TOLERANCE
from wavetank.planning.timing import STEPS, WARM_UP, step_time
from wavetank.simulation.build import initial_state
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.clock import Clock
from wavetank.simulation.construction import AnyWaves, build_filters, build_waves
from wavetank.simulation.records import Memory, Records
from wavetank.simulation.run import Run
from wavetank.tank.dissipation import Smoothing

CELLS_PER_WAVE = 5.0
ROUNDS = 3  # of all timings
TANKS = tuple(product((40, 280), ((2, 3), (3, 8), (4, 14))))  # cells, (p, n): few (p, n), each compiles forms


def report(console: Console) -> None:
    """Print each kind's constants, and the seconds of the timed steps by them over those by the ones built in."""
    for key, fitted in calibrate().items():
        steps = timed(key.split()[1])
        rounded = [float(f"{constant:.2g}") for constant in fitted]
        ratios = (steps @ rounded) / (steps @ np.array(CONSTANTS[key]))
        constants = ", ".join(f"{constant:.2g}".replace("e-0", "e-") for constant in rounded)
        console.print(
            f'"{key}": ({constants}),  # {ratios.min():.2f} to {ratios.max():.2f} times',
            soft_wrap=True,
            highlight=False,
        )


def calibrate() -> dict[str, tuple[float, ...]]:
    """Return constants from a few timed steps, the least of ``ROUNDS`` times, after the compilation of forms."""
    times = _times()
    for _ in range(ROUNDS - 1):  # one after the other: other load of a machine varies slowly
        times = {key: np.minimum(spent, times[key]) for key, spent in _times().items()}
    return {key: _fit(timed(key.split()[1]), spent) for key, spent in times.items()}


def _times() -> dict[str, Vector]:
    """Return the CPU seconds of a step in each tank, by kind and scheme, as ``timed`` has them."""
    times: dict[str, list[float]] = {}
    for (cells, (order, n)), kind in product(TANKS, KINDS):
        case = _case(kind, cells, order, n)
        waves = build_waves(case, MPI.COMM_SELF)
        for name in INTEGRATORS:
            spent = [_time_a_step(case, waves, name, x) for x in step_costs(name).products]
            times.setdefault(f"{kind} {name}", []).extend(spent)
    return {key: np.array(spent) for key, spent in times.items()}


def timed(name: str) -> Vector:
    """Return the factors of the constants of a scheme in the cost of the timed steps, shape (N, 6)."""
    return np.array([features(order, cells, n, x) for cells, (order, n) in TANKS for x in step_costs(name).products])


def _fit(rows: Vector, spent: Vector) -> tuple[float, ...]:
    """Return non-negative constants of least relative error."""
    return tuple(map(float, scipy.optimize.nnls(rows / spent[:, None], np.ones(spent.size))[0]))


def _case(kind: str, cells: int, order: int, n: int) -> Case:
    """Return standing waves of k a = 0.1, k d = 2, with gauges, and with a paddle for waves 2/3 as high.

    Its ramp is two periods: short waves of a faster start need additional iterations.
    """
    physics, driven = KINDS[kind]
    halves = round(2 * cells / CELLS_PER_WAVE)
    length = halves * np.pi / 2
    motion = {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.44, "ramp": 2.88}
    return Case.model_validate(
        {
            "tank": {"length": length, "depth": 1.0},
            "wall": {"type": "piston", "motion": motion} if driven else {"type": "fixed"},
            "water": {"type": physics},
            "initial": {"type": "standing-wave", "wave_amplitude": 0.05, "mode": halves},
            "gauges": [0.3 * length, 0.6 * length],
            "run": {"duration": 100.0},
            "numerics": {"cells": cells, "order": order, "vertical_order": n, "tolerance": MAX_TOLERANCE},
        }
    )


def _time_a_step(case: Case, waves: AnyWaves, name: str, dt_omega_max: float) -> float:
    """Return the CPU seconds of a step, after some for the initial guesses of solves."""
    dt = dt_omega_max / waves.largest_frequency
    filters, records = build_filters(case, waves, dt), Records(Memory(), Memory(), None)
    sinks = [one for one in filters if isinstance(one, Smoothing)]
    observers = build_observers(case, waves, records, sinks=sinks)
    scheme: Any = INTEGRATORS[name]()
    start, clock = initial_state(case, waves), Clock(dt, WARM_UP + STEPS)
    return step_time(Run(waves, scheme, observers, start=start, clock=clock, filters=filters))[0]
