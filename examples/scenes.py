"""Random cases of eight classes, for tests of predictions and estimates, and reference runs on refined numerics.

All classes have k d between 0.5 and 5 and depths between 0.3 and 3 m. The cases name no numerics.
"""

import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.case import BasinTank, Case
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers
from wavetank.simulation.records import Memory, Records
from wavetank.waves import airy

HIGHEST_VERTICAL_ORDER, GRAVITY = 16, 9.81
PER_CLASS = 8  # cases of each class
FAR_WALL = [{"on": "far wall"}]


Row = TypeVar("Row")


class Waves(NamedTuple):
    """Random regular waves: depth d [m], k d, period T [s], length [m] and amplitude [m]."""

    d: float
    kd: float
    T: float
    length: float
    amplitude: float

    @classmethod
    def draw(cls, rng: np.random.Generator, lowest: float = 0.6, highest: float = 5.0) -> "Waves":
        """Return waves of a k d between two limits, with k a from 0.02 to 0.12 and a up to 0.08 d."""
        d, kd = (float(np.exp(rng.uniform(*np.log(ends)))) for ends in ((0.3, 3.0), (lowest, highest)))
        T = 2 * np.pi / float(airy.angular_frequency(kd / d, d, GRAVITY))
        return cls(d, kd, T, 2 * np.pi * d / kd, min(float(rng.uniform(0.02, 0.12)) * d / kd, 0.08 * d))


def _case(tank: dict[str, Any], duration: float, **parts: Any) -> Case:
    return Case.model_validate({"tank": tank, "run": {"duration": float(duration)}, **parts})


def ring(rng: np.random.Generator) -> Case:
    """Return a wave of permanent form, 10 to 60 % of the maximum height, in a ring."""
    w, initial = Waves.draw(rng), {"type": "stream-function", "steepness": float(rng.uniform(0.1, 0.6))}
    tank = {"type": "ring", "length": w.length, "depth": w.d}
    one = _case(tank, 1.0, initial=initial)
    duration = float(rng.uniform(4, 12)) * w.length / one.initial.wave(one.tank).speed
    return _case(tank, duration, initial=initial, gauges=[0.0, float(rng.uniform(0.2, 0.8)) * w.length])


def sloshing(rng: np.random.Generator) -> Case:
    """Return a standing wave of mode 1 to 3."""
    w, mode = Waves.draw(rng), int(rng.integers(1, 4))
    initial = {"type": "standing-wave", "wave_amplitude": min(float(rng.uniform(0.03, 0.2)) * w.d / w.kd, 0.12 * w.d)}
    length = mode * w.length / 2
    gauges = [0.0, float(rng.uniform(0.1, 0.9)) * length]
    tank, duration = {"length": length, "depth": w.d}, w.T * float(rng.uniform(4, 12))
    return _case(tank, duration, initial=initial | {"mode": mode}, gauges=gauges, loads=FAR_WALL)


def _paddle(rng: np.random.Generator, kind: str, w: Waves, **wall: Any) -> Case:
    """Return regular or irregular waves of a paddle before a wall or a sponge."""
    height, ramp = 2 * w.amplitude, 2 * w.T
    motion: dict[str, Any] = {"type": "regular", "height": height, "period": w.T, "ramp": ramp}
    if rng.integers(3) == 1:
        spectrum = {"type": "jonswap", "peak_period": w.T}
        motion = {"type": "irregular", "significant_height": height, "spectrum": spectrum, "ramp": ramp}
        motion["seed"] = int(rng.integers(100))
    length, sponge = float(rng.uniform(4, 9)) * w.length, {}
    if rng.uniform() < 0.5:
        sponge = {"sponge": {"type": "end", "length": 1.5 * w.length}}
        length += 1.5 * w.length
    gauges = [float(rng.uniform(*ends)) * w.length for ends in ((0.5, 1.5), (2.0, 3.0))]
    wall = {"type": kind, "motion": motion, **wall}
    return _case({"length": length, "depth": w.d}, w.T * float(rng.uniform(10, 18)), wall=wall, gauges=gauges, **sponge)


def piston(rng: np.random.Generator) -> Case:
    """Return waves of a piston."""
    return _paddle(rng, "piston", Waves.draw(rng, highest=3.0))


def flap(rng: np.random.Generator) -> Case:
    """Return waves of a flap."""
    w = Waves.draw(rng, lowest=1.2)
    return _paddle(rng, "flap", w, hinge=float(rng.uniform(0.0, 0.4)) * w.d)


def bar(rng: np.random.Generator) -> Case:
    """Return waves of a piston over a bar."""
    w = Waves.draw(rng, lowest=0.5, highest=1.2)
    height, x, width = (float(rng.uniform(0.3, 0.55)) * w.d, 1.2 * w.length, float(rng.uniform(0.5, 1.0)) * w.length)
    bed = {"type": "formula", "depth": f"{w.d} - {height} * exp(-((x - {x + width}) / {width / 2})**2)"}
    motion = {"type": "regular", "height": float(rng.uniform(0.03, 0.08)) * w.d, "period": w.T, "ramp": 2 * w.T}
    return _case(
        {"length": 4.5 * w.length, "depth": w.d, "bed": bed},
        10 * w.T,
        wall={"type": "piston", "motion": motion},
        gauges=[0.5 * w.length, x + width, x + 2.5 * width],
        sponge={"type": "end", "length": 1.3 * w.length},
    )


def solitary(rng: np.random.Generator) -> Case:
    """Return a solitary wave that travels along the tank, or that runs up its end."""
    d, height, length = Waves.draw(rng).d, float(rng.uniform(0.1, 0.5)), float(rng.uniform(30, 50))
    way = length - 24 if rng.uniform() < 0.5 else length - 4
    duration = way * np.sqrt(d / (GRAVITY * (1 + height)))
    initial = {"type": "solitary-wave", "height": height * d, "x": 12 * d}
    tank, gauges = {"length": length * d, "depth": d}, [0.5 * length * d, length * d]
    return _case(tank, duration, initial=initial, gauges=gauges, loads=FAR_WALL)


def group(rng: np.random.Generator) -> Case:
    """Return a wave group that a piston focuses."""
    w, length = Waves.draw(rng), float(rng.uniform(8, 12))
    x, highest = float(rng.uniform(3, 5)) * w.length, 1.9 / w.T
    focus_time = 1.05 * x * 4 * np.pi * highest / GRAVITY + 3 * w.T
    motion = {
        "type": "focused",
        "linear_crest": min(float(rng.uniform(0.05, 0.16)) * w.d / w.kd, 0.12 * w.d),
        "spectrum": {"type": "jonswap", "peak_period": w.T, "gamma": 3.3},
        "lowest_frequency": 0.6 / w.T,
        "highest_frequency": highest,
        "ramp": w.T,
        "focus_time": focus_time,
        "focus_x": x,
    }
    tank, wall = {"length": length * w.length, "depth": w.d}, {"type": "piston", "motion": motion}
    return _case(tank, focus_time + 4 * w.T, wall=wall, gauges=[0.5 * w.length, x])


def basin(rng: np.random.Generator) -> Case:
    """Return oblique waves of a segmented piston in a rectangle."""
    w, angle = Waves.draw(rng, lowest=0.8, highest=2.5), float(rng.uniform(5, 30))
    layout = {"type": "rectangle", "length": 2 * w.length, "width": 0.8 * w.length}
    motion = {"type": "oblique-wave", "wave_amplitude": w.amplitude, "period": w.T, "angle": angle, "ramp": 2 * w.T}
    return _case(
        {"type": "basin", "depth": w.d, "layout": layout},
        4 * w.T,
        wall={"type": "segmented-piston", "motion": motion},
        gauges=[{"x": w.length, "y": 0.2 * w.length}, {"x": 1.7 * w.length, "y": 0.6 * w.length}],
    )


CLASSES: dict[str, Callable[[np.random.Generator], Case]] = {
    one.__name__: one for one in (ring, sloshing, piston, flap, bar, solitary, group, basin)
}


def scene(name: str, seed: int) -> Case:
    """Return a case of a class by a seed."""
    return CLASSES[name](np.random.default_rng([seed, list(CLASSES).index(name)]))


def refined(case: Case, dt: float) -> Case:
    """Return a planned case with a third of the time step dt [s] and about half the distance of nodes, order 5."""
    numerics, basin = case.numerics, isinstance(case.tank, BasinTank)
    order = numerics.order + 1 if basin else 5
    changes: dict[str, Any] = {"accuracy": None, "order": order, "dt": dt / 3, "tolerance": 1e-9}
    changes["vertical_order"] = min(numerics.vertical_order + 3, HIGHEST_VERTICAL_ORDER)
    changes["cell_size"] = case.cell_size / 1.6 if basin else None
    changes["cells"] = None if basin else max(case.tank.fewest_cells, -(-2 * case.cells * numerics.order // 5))
    return case.model_copy(update={"numerics": numerics.model_copy(update=changes)})


def by_class(row: Callable[[str, int, int], Iterable[Row]], seed: int) -> dict[str, list[Row]]:
    """Return the rows of ``PER_CLASS`` cases of each class, and of all.

    ``row`` yields those of a class, a seed, and a number that differs between successive cases of a class, and between
    classes of a seed.
    """
    groups: dict[str, list[Row]] = {kind: [] for kind in CLASSES}
    for n in range(PER_CLASS):
        for number, kind in enumerate(CLASSES):
            groups[kind] += row(kind, seed + n, n + number)
    return groups | {"all": [one for group in groups.values() for one in group]}


class Recorded(NamedTuple):
    """A run in memory: rows of tables, time step and its stability limit [s], CPU time [s].

    ``gauges`` have t [s] and elevations [m], ``energy`` kinetic and potential energy after t, ``loads`` the components
    of a wall.
    """

    gauges: Vector
    energy: Vector
    loads: Vector
    dt: float
    limit: float
    cpu: float


def executed(case: Case) -> Recorded:
    """Return the records of a planned case; raises ``RunError`` if it breaks down."""
    gauges, energy, loads = Memory(), Memory(), Memory()
    run, waves = build_run(case, MPI.COMM_SELF)
    records = Records(gauges, energy, None, loads=loads if case.loads else None)
    run.diagnostics += build_observers(case, waves, records, sinks=run.sinks)
    start = time.process_time()
    run.execute()
    limit = run.integrator.stability_limit / waves.largest_frequency
    tables = gauges.array(), energy.array(), loads.array()
    return Recorded(*tables, run.clock.dt, limit, time.process_time() - start)
