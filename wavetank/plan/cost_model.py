"""What a run costs: CPU seconds from a few timed steps on this machine, and memory.

A step costs a + b S + c S (n+1) (p+2) seconds, S = p cells + 1 values of the surface: what Python costs whatever the
mesh, what goes with the surface, and what goes with the entries of the operator. The constants of each kind of waves
and scheme hold its solves per step; they are fitted to tanks with waves of k a = 0.1 (``calibrate``) and kept in the
user's cache. The tanks have fixed walls: with a piston a nonlinear step was measured to cost 1.6 to 1.7 times as much.
"""

import json
import platform
import time
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pooch
from mpi4py import MPI
from scipy.optimize import nnls

from wavetank.fe.plane import Plane
from wavetank.hamiltonian.contract import Vector
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.plan.error_model import Settings
from wavetank.reference import airy
from wavetank.water.linear_waves import LinearWaves
from wavetank.water.plan_view import Slice
from wavetank.water.walls import FixedWall
from wavetank.water.waves import NonlinearWaves

VERSION = 1  # of what is kept in the cache
TANKS = tuple(product((80, 800), ((2, 4), (3, 8), (5, 5))))  # cells, (p, n): few (p, n), each compiles forms
WARM_UP, STEPS = 5, 8
BASE = 155e6  # bytes: Python with dolfinx and PETSc, and a tank of ten cells; largest resident size, x86-64
PER_ENTRY = {"linear": 130.0, "nonlinear": 185.0}  # bytes per S (n+1) (p+2), from (p, n) = (3, 8) and (5, 5)


class Cost(NamedTuple):
    """The cost of a run on one core: CPU time [s] and memory [bytes]."""

    cpu: float
    memory: float


def _features(order: int, cells: int, vertical_order: int) -> Vector:
    surface = order * cells + 1
    return np.array([1.0, surface, surface * (vertical_order + 1) * (order + 2)], dtype=np.float64)


@dataclass(frozen=True)
class CostModel:
    """Constants measured on a machine.

    Attributes
    ----------
    machine
        Which machine.
    constants
        (a, b, c) [s] by "physics integrator", e.g. ``"linear third-order"``.
    version
        Of the model.
    """

    machine: str
    constants: dict[str, tuple[float, float, float]]
    version: int = VERSION

    def step(self, physics: str, settings: Settings) -> float:
        """Return the CPU seconds of a step."""
        constants = self.constants[f"{physics} {settings.integrator}"]
        return float(_features(settings.order, settings.cells, settings.vertical_order) @ np.array(constants))

    def run(self, physics: str, settings: Settings, duration: float) -> Cost:
        """Return the cost of a run of ``duration`` seconds."""
        entries = _features(settings.order, settings.cells, settings.vertical_order)[-1]
        steps = np.ceil(duration / settings.dt * (1 - 1e-9))
        return Cost(float(steps * self.step(physics, settings)), BASE + PER_ENTRY[physics] * float(entries))


def machine() -> str:
    """Return what tells one machine from another."""
    return f"{platform.node()} {platform.machine()} {platform.processor()}".strip()


def cache_file() -> Path:
    """Return where constants are kept."""
    return Path(pooch.os_cache("wavetank")) / "cost.json"


def cost_model() -> CostModel:
    """Return this machine's constants, from the cache, or measured now and kept there."""
    try:
        kept = json.loads(cache_file().read_text())
        if kept["machine"] == machine() and kept["version"] == VERSION:
            return CostModel(**kept)
    except (OSError, ValueError, KeyError, TypeError):
        pass  # nothing kept, or nothing that can be read: it is measured anew
    model = calibrate()
    cache_file().parent.mkdir(parents=True, exist_ok=True)
    cache_file().write_text(json.dumps(asdict(model), indent=1))
    return model


def calibrate() -> CostModel:
    """Return constants from a few timed steps: seconds, and the compilation of forms the first time."""
    rows = np.array([_features(order, cells, n) for cells, (order, n) in TANKS])
    times: dict[str, list[float]] = {}
    for cells, (order, n) in TANKS:
        plane = Plane(Slice(0.25 * cells, cells, comm=MPI.COMM_SELF).mesh, order)
        for physics, kind in (("linear", LinearWaves), ("nonlinear", NonlinearWaves)):
            waves = kind(plane, depth=1.0, wall=FixedWall(), vertical_order=n)
            for name in INTEGRATORS:
                times.setdefault(f"{physics} {name}", []).append(_time_a_step(waves, name))
    return CostModel(machine(), {name: _fit(rows, np.array(spent)) for name, spent in times.items()})


def _fit(rows: Vector, spent: Vector) -> tuple[float, float, float]:
    """Return non-negative constants of least relative error."""
    a, b, c = nnls(rows / spent[:, None], np.ones(spent.size))[0]
    return float(a), float(b), float(c)


def _time_a_step(waves: Any, name: str) -> float:
    """Return the CPU seconds of a step of travelling waves of k a = 0.1, k d = 2."""
    scheme: Integrator[Any] = INTEGRATORS[name]()
    k = 2.0
    x = waves.plane.x
    omega = float(airy.angular_frequency(k, waves.depth, waves.gravity))
    packet = 0.1 / k * np.exp(-(((x - x.max() / 2) / (x.max() / 5)) ** 2))
    eta, psi = packet * np.cos(k * x), waves.gravity / omega * packet * np.sin(k * x)
    state, dt = scheme.start(*waves.state(eta, psi)), 0.4 * min(scheme.stability_limit, 2.0) / waves.largest_frequency
    for step in range(WARM_UP + STEPS):
        if step == WARM_UP:  # the start values of the solves need some steps of history
            began = time.process_time()
        state = scheme.step(waves, state, step * dt, dt)
    return (time.process_time() - began) / STEPS
