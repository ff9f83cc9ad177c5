"""What a run costs: CPU seconds from a few timed steps on this machine, and memory.

A step costs (a + b S + c E) + (a' + b' S + c' E) dt omega_max seconds, S = p cells + 1 values of the surface and
E = S (n+1) (p+2): what Python costs whatever the mesh, what goes with the surface, and what goes with the entries of
the operator; longer steps need more iterations. The constants of each kind of waves (linear; nonlinear; nonlinear and
driven by a piston) and scheme are fitted to timed runs of waves of k a = 0.1 with all that is recorded of a run
(``calibrate``). They have five cells each, as those of plans do: where a wave has more, the same dt omega_max is a
smaller part of its period, from step to step less is new, and Gauss-Legendre's stages take half of the solves. Steeper
waves need more solves a step, by the factor 1 + ``STEEPER`` (s² - 0.01) with s = k times the crest's height: so
measured, to 25 %, of standing waves up to k a = 0.3, at the tolerance of plans for a percent.

The schemes have the constants of one machine (``costs``): a choice needs ratios only, and is then the same everywhere.
They are made by ``python -m benchmarks --only costs``. Another machine's are kept in its user's cache, for its seconds.
"""

import json
import platform
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import scipy
from mpi4py import MPI

from wavetank.arrays import Vector
from wavetank.cache import places, writable
from wavetank.case import Scene
from wavetank.integrators import INTEGRATORS
from wavetank.planning.defaults import LOOSEST
from wavetank.planning.error_model import Settings
from wavetank.planning.kinds import entries_of, undearer
from wavetank.planning.looks import NOWHERE, Looks
from wavetank.planning.trial import STEPS, WARM_UP, Stopwatch
from wavetank.simulation.build import Records, build_filters, build_observers, initial_state
from wavetank.simulation.clock import Clock
from wavetank.simulation.energy import Sink
from wavetank.simulation.record import Memory
from wavetank.simulation.run import Run
from wavetank.simulation.waters import AnyWaves, build_waves

FILE = "cost.json"  # of the cache
FITTED, STEEPER = 0.1, 3.0  # the steepness that constants are fitted at, and what steeper waves cost
VERSION = 10  # of what is kept there
CELLS_PER_WAVE = 5.0
ROUNDS = 3  # of timing all
TANKS = tuple(product((40, 280), ((2, 3), (3, 8), (4, 14))))  # cells, (p, n): few (p, n), each compiles forms
KINDS = {"linear": ("linear", False), "nonlinear": ("nonlinear", False), "driven": ("nonlinear", True)}
BASE = 185e6  # bytes: Python with dolfinx and PETSc, and a tank of ten cells; largest resident size, x86-64
PER_ENTRY = {"linear": 130.0, "nonlinear": 185.0, "driven": 185.0}  # bytes per E, from (p, n) = (3, 8) and (5, 5)


class Cost(NamedTuple):
    """The cost of a run on one core: CPU time [s] and memory [bytes]."""

    cpu: float
    memory: float


def _features(order: int, cells: int, vertical_order: int, dt_omega_max: float) -> Vector:
    sizes = [1.0, order * cells + 1, entries_of(order, cells, vertical_order)]
    return np.asarray(np.outer([1.0, dt_omega_max], sizes).ravel(), dtype=np.float64)


@dataclass(frozen=True)
class CostModel:
    """Constants measured on a machine.

    Attributes
    ----------
    machine
        Which machine.
    constants
        (a, b, c, a', b', c') [s] by kind of waves and integrator, e.g. ``"linear simpson-4"``.
    version
        Of the model.
    """

    machine: str
    constants: dict[str, tuple[float, ...]]
    version: int = VERSION

    def step(self, kind: str, settings: Settings, dt_omega_max: float, *, steepness: float = FITTED) -> float:
        """Return the CPU seconds of a step in waves of a steepness k times the crest's height."""
        kind, dearer = undearer(kind)
        steeper = 1.0 if kind == "linear" else 1.0 + STEEPER * (steepness**2 - FITTED**2)
        features = _features(settings.order, settings.cells, settings.vertical_order, dt_omega_max)
        return dearer * steeper * float(features @ np.array(self.constants[f"{kind} {settings.integrator}"]))

    def run(
        self,
        kind: str,
        settings: Settings,
        *,
        duration: float,
        dt_omega_max: float,
        steepness: float = FITTED,
        looks: Looks = NOWHERE,
    ) -> Cost:
        """Return the cost of a run of ``duration`` seconds that looks at its water."""
        steps = Clock.covering(duration, settings.dt).steps
        entries = entries_of(settings.order, settings.cells, settings.vertical_order)
        more = looks.in_slice(entries) + looks.answering(entries)
        cpu = steps * self.step(kind, settings, dt_omega_max, steepness=steepness) + more
        return Cost(float(cpu), BASE + looks.waters * PER_ENTRY[undearer(kind)[0]] * entries)


def machine() -> str:
    """Return what tells one machine from another."""
    return f"{platform.node()} {platform.machine()} {platform.processor()}".strip()


BUILT_IN = CostModel(
    "the machine that the cost model was made on",
    {f"{kind} {name}": getattr(scheme.costs, kind) for kind in KINDS for name, scheme in INTEGRATORS.items()},
)


def known_costs() -> CostModel:
    """Return this machine's constants from the cache, or those built in."""
    for folder in places():
        try:
            kept = json.loads((folder / FILE).read_text())
            known = kept["constants"].keys() == BUILT_IN.constants.keys()
            if kept["machine"] == machine() and kept["version"] == VERSION and known:
                return CostModel(**kept)
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            continue  # nothing kept, or nothing that can be read
    return BUILT_IN


def measured_costs() -> CostModel:
    """Return this machine's constants, measured now, and keep them."""
    model = calibrate()
    (writable(private=True) / FILE).write_text(json.dumps(asdict(model), indent=1))
    return model


def calibrate() -> CostModel:
    """Return constants from a few timed steps, after the compilation of forms the first time; each the least of all."""
    times = _times()
    for _ in range(ROUNDS - 1):  # one after the other: what else a machine does comes in spells
        times = {key: np.minimum(spent, times[key]) for key, spent in _times().items()}
    return CostModel(machine(), {key: _fit(timed(key.split()[1]), spent) for key, spent in times.items()})


def _times() -> dict[str, Vector]:
    """Return the CPU seconds of a step in each tank, by kind and scheme, as ``timed`` has them."""
    times: dict[str, list[float]] = {}
    for (cells, (order, n)), kind in product(TANKS, KINDS):
        scene = _scene(kind, cells, order, n)
        waves = build_waves(scene, MPI.COMM_SELF)
        for name in INTEGRATORS:
            spent = [_time_a_step(scene, waves, name, x) for x in INTEGRATORS[name].costs.products]
            times.setdefault(f"{kind} {name}", []).extend(spent)
    return {key: np.array(spent) for key, spent in times.items()}


def timed(name: str) -> Vector:
    """Return what the timed steps of a scheme are multiplied by in their cost, a row each, shape (N, 6)."""
    return np.array(
        [_features(order, cells, n, x) for cells, (order, n) in TANKS for x in INTEGRATORS[name].costs.products]
    )


def _fit(rows: Vector, spent: Vector) -> tuple[float, ...]:
    """Return non-negative constants of least relative error."""
    return tuple(map(float, scipy.optimize.nnls(rows / spent[:, None], np.ones(spent.size))[0]))


def _scene(kind: str, cells: int, order: int, n: int) -> Scene:
    """Return standing waves of k a = 0.1, k d = 2, with gauges, and with a paddle that would make waves 2/3 as high.

    It starts as gently as paddles do, over two periods: short waves of a start within one take iterations of their own.
    """
    physics, driven = KINDS[kind]
    halves = round(2 * cells / CELLS_PER_WAVE)
    length = halves * np.pi / 2
    motion = {"type": "sinusoid", "paddle_amplitude": 0.02, "period": 1.44, "ramp": 2.88}
    return Scene.model_validate(
        {
            "tank": {"length": length, "depth": 1.0},
            "wall": {"type": "piston", "motion": motion} if driven else {"type": "fixed"},
            "water": {"type": physics},
            "initial": {"type": "standing-wave", "wave_amplitude": 0.05, "mode": halves},
            "gauges": [0.3 * length, 0.6 * length],
            "run": {"duration": 100.0},
            "numerics": {"cells": cells, "order": order, "vertical_order": n, "tolerance": LOOSEST},
        }
    )


def _time_a_step(scene: Scene, waves: AnyWaves, name: str, dt_omega_max: float) -> float:
    """Return the CPU seconds of a step; the start values of the solves need some steps of history first."""
    dt, watch = dt_omega_max / waves.largest_frequency, Stopwatch()
    filters, records = build_filters(scene, waves, dt), Records(Memory(), Memory(), None)
    sinks = [one for one in filters if isinstance(one, Sink)]
    observers = [*build_observers(scene, waves, records, sinks=sinks), watch]
    scheme: Any = INTEGRATORS[name]()
    start = initial_state(scene, waves)
    Run(waves, scheme, observers, start=start, clock=Clock(dt, WARM_UP + STEPS), filters=filters).execute()
    return watch.per_step(after=WARM_UP).cpu
