"""Test cases of the breaking criteria: waves that must not be detected, and breaking waves that must be detected.

Each case is as a user would write it.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI
from scipy.integrate import solve_ivp

from examples.paper.report import Report
from examples.paper.steepness import case_of as ring
from wavetank.base.errors import RunError
from wavetank.case import Case, RingTank
from wavetank.planning.plan import planned
from wavetank.simulation.build import build_run
from wavetank.tank.breaking import STEEP, BreakingAlarm, BreakingDissipation, BreakingWatch
from wavetank.tank.crests import SteepCrest
from wavetank.tank.dissipation import EdgePenalty
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves
from wavetank.waves.solitary_wave import solitary_wave

SOLITARY = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)  # H/d


class BreakingCase(NamedTuple):
    """A case, and whether its waves break."""

    name: str
    breaks: bool
    case: Case


class Row(NamedTuple):
    """Result of a case with ``run.on_breaking = "stop"``.

    Attributes
    ----------
    name, breaks
        Of the case.
    cells, dt
        Number of cells and step [s].
    largest, t, x
        The largest B of a coherent crest with a steep front, when and where.
    alarm
        When the first alarm began [s]; NaN without one.
    outrun
        The largest part of a crest's upper half that water outran during an alarm.
    end
        When the run ended [s].
    stopped
        Why, if before its duration.
    """

    name: str
    breaks: bool
    cells: int
    dt: float
    largest: float
    t: float
    x: float
    alarm: float
    outrun: float
    end: float
    stopped: str


class Dissipated(NamedTuple):
    """Energy dissipated in a case with ``run.on_breaking = "dissipate"``.

    Attributes
    ----------
    name
        Of the case.
    cells, dt
        Number of cells and step [s].
    alarm, alarms
        When the first began [s], and how many there were.
    viscosity, penalty
        Energy removed by eddy viscosity and gradient-jump penalty [m^4/s²].
    """

    name: str
    cells: int
    dt: float
    alarm: float
    alarms: int
    viscosity: float
    penalty: float


def dissipated(case: BreakingCase) -> Dissipated:
    """Run a case with the eddy viscosity of breaking waves."""
    planned_case, _ = planned(case.case, MPI.COMM_SELF)
    dissipating = planned_case.run.model_copy(update={"on_breaking": "dissipate"})
    run, waves = build_run(planned_case.model_copy(update={"run": dissipating}), MPI.COMM_SELF)
    run.execute()
    (sink,) = (one for one in run.sinks if isinstance(one, BreakingDissipation))
    penalty = sum(one.energy_taken for one in run.sinks if isinstance(one, EdgePenalty))
    alarms = sink.watch.alarms
    first = alarms[0].t if alarms else float("nan")
    return Dissipated(case.name, waves.plane.cells, run.clock.dt, first, len(alarms), sink.energy_taken, penalty)


class BreakingMeasure(BreakingWatch):
    """Breaking monitor that records the largest B and the largest part with u > c.

    Attributes
    ----------
    found
        (B, t [s], x [m]) of the crest with the largest B.
    outrun
        Of crests in alarm.
    """

    found = (0.0, 0.0, 0.0)
    outrun = 0.0

    def follow(self, crests: Sequence[SteepCrest], t: float) -> list[SteepCrest]:
        """See ``BreakingWatch``."""
        steep = [(crest.overtaking, t, crest.x) for crest in crests if crest.front > STEEP]
        self.found = max([self.found, *steep])
        in_alarm = super().follow(crests, t)
        self.outrun = max([self.outrun, *(crest.outrun for crest in in_alarm)])
        return in_alarm


def row(case: BreakingCase) -> Row:
    """Run a case until it stops, as it does at breaking."""
    planned_case, _ = planned(case.case, MPI.COMM_SELF)
    tank, stopping = planned_case.tank, planned_case.run.model_copy(update={"on_breaking": "stop"})
    run, waves = build_run(planned_case.model_copy(update={"run": stopping}), MPI.COMM_SELF)
    (stop,) = (one for one in run.filters if isinstance(one, BreakingAlarm))
    assert isinstance(waves, NonlinearWaves) and isinstance(waves.surface, SurfaceFlow)
    watch = BreakingMeasure(waves, waves.surface, length=tank.length if isinstance(tank, RingTank) else None)
    stop.watch, stopped = watch, ""
    try:
        run.execute()
    except RunError as error:
        stopped = str(error)
    alarm = watch.alarms[0].t if watch.alarms else float("nan")
    numbers = (waves.plane.cells, run.clock.dt, *watch.found, alarm, watch.outrun, run.t)
    return Row(case.name, case.breaks, *numbers, stopped)


def write(report: Report) -> None:
    """Write breaking.csv, of all cases with their cells, half and twice as many, and dissipation.csv.

    That is of those that break: with their cells and steps, half and a quarter of the steps, and twice the cells.
    """
    rows = (row(refined(case, times)) for times in (1.0, 0.5, 2.0) for case in cases(report.folder))
    report.table("breaking", Row._fields, rows)
    breaking = [case for case in cases(report.folder) if case.breaks]
    fine = ((1.0, 1.0), (1.0, 2.0), (1.0, 4.0), (2.0, 1.0))
    found = (dissipated(refined(case, times, steps=steps)) for case in breaking for times, steps in fine)
    report.table("dissipation", Dissipated._fields, found)


def refined(case: BreakingCase, times: float, *, steps: float = 1.0) -> BreakingCase:
    """Return a case with so many times its cells, and its step over ``times``, if more, and over ``steps``.

    Finer cells need a higher vertical order.
    """
    if times == steps == 1.0:
        return case
    planned_case, _ = planned(case.case, MPI.COMM_SELF)
    run, waves = build_run(planned_case, MPI.COMM_SELF)
    given = case.case.numerics.model_dump(exclude_unset=True)
    numerics: dict[str, Any] = {name: value for name, value in given.items() if name != "cell_size"}
    numerics["cells"] = max(2, round(times * waves.plane.cells))
    if times > 1.0 or steps > 1.0:
        numerics["dt"] = run.clock.dt / max(times, 1.0) / steps
        numerics["vertical_order"] = waves.vertical.n if times == 1.0 else max(waves.vertical.n, 8)
    case_file = case.case.model_dump(exclude_unset=True) | {"numerics": numerics}
    return case._replace(name=f"{case.name} x {times:g}, / {steps:g}", case=Case.model_validate(case_file))


def cases(folder: Path) -> Iterator[BreakingCase]:
    """Yield all cases; files of recorded motions are written to the folder."""
    for kd in (0.5, 1.0, 3.0, 8.0):
        for steepness in (0.5, 0.8, 0.95):
            yield BreakingCase(f"ring-{kd:g}-{100 * steepness:.0f}", False, steady(kd, steepness))
    for height in SOLITARY:
        yield BreakingCase(f"run-up-{height:g}", False, run_up(height))
    for jump in (0.1, 0.2, 0.3):
        yield BreakingCase(f"bore-{100 * jump:.0f}", False, bore(jump, duration=12.0))
    for k_a in (0.3, 0.4, 0.5):
        yield BreakingCase(f"release-{k_a:g}", False, release(k_a))
    for periods in (1, 2, 3, 4, 6):
        yield BreakingCase(f"luth-c-{periods}", False, luth_c(periods))
    yield BreakingCase("bar-2.02", False, bar(height=0.02, period=2.02, duration=16.0))
    yield BreakingCase("bar-1.01", False, bar(height=0.041, period=1.01, duration=16.0))
    yield BreakingCase("piston-solitary", False, piston_solitary(0.27, folder))
    yield BreakingCase("current-with", False, current(0.5, steepness=0.25))
    yield BreakingCase("current-against", False, current(-0.5, steepness=0.25))
    yield BreakingCase("ripples", False, current(0.5, steepness=0.02))
    yield BreakingCase("standing", False, standing(0.3))
    yield BreakingCase("collision", False, collision(0.4))
    yield BreakingCase("coarse", False, coarse())
    for crest, breaks in ((0.12, False), (0.14, False), (0.16, True)):
        yield BreakingCase(f"group-{crest:g}", breaks, group(crest))
    for jump, duration in ((0.5, 10.9), (0.7, 9.6)):
        yield BreakingCase(f"surge-{100 * jump:.0f}", True, surge(jump, duration=duration))
    for height, duration in ((0.2, 7.5), (0.4, 6.5)):
        yield BreakingCase(f"beach-{height:g}", True, beach(height, duration=duration))
    for amplitude in (0.077, 0.1):
        yield BreakingCase(f"piston-{amplitude:g}", True, piston_regular(amplitude))
    for steepness in (0.5, 0.6):
        yield BreakingCase(f"over-steep-{steepness:g}", True, over_steep(steepness))
    yield BreakingCase("bar-steep", True, bar(height=0.16, period=2.02, duration=16.0))


def _case(**parts: Any) -> Case:
    numerics = {"vertical_order": 5, **parts.pop("numerics", {})}
    return Case.model_validate({**parts, "numerics": numerics})


def steady(kd: float, steepness: float) -> Case:
    """Return an exact wave round a ring for one period, with the cells of ``steepness.py`` and the default step.

    The step of that study exceeds the stability limit under a crest of 95 % (docs/extremes.md).
    """
    case = ring(kd, steepness, periods=1.0).model_dump(exclude_unset=True)
    del case["numerics"]["dt"]
    return Case.model_validate(case)


def run_up(height: float) -> Case:
    """Return a solitary wave that runs up a wall and comes back."""
    initial = {"type": "solitary-wave", "height": height, "x": 10.0}
    return _case(tank={"length": 20.0, "depth": 1.0}, initial=initial, run={"duration": 6.0})


def bore(jump: float, *, duration: float) -> Case:
    """Return a bore from a smooth step of so many depths, the water behind it moving."""
    h_1 = 1.0 + jump
    speed = np.sqrt(9.81 * (h_1 + 1.0) / (2.0 * h_1)) * jump
    step = {"z": "(x - 25) / 5"}
    initial = {
        "type": "formula",
        "where": step,
        "eta": f"{jump / 2:.16g} * (1 - tanh(z))",
        "psi": f"{speed / 2:.16g} * 5 * (z - log(cosh(z)))",
    }
    return _case(tank={"length": 80.0, "depth": 1.0}, initial=initial, run={"duration": duration})


def surge(jump: float, *, duration: float) -> Case:
    """Return a long hump of so many depths that travels to the right, a bore at its front, until it meets the wall."""
    speed = np.sqrt(9.81 * (jump + 2.0) / (2.0 * (jump + 1.0))) * jump
    where = {"a": "(x - 10) / 5", "b": "(x - 35) / 5"}
    initial = {
        "type": "formula",
        "where": where,
        "eta": f"{jump / 2:.16g} * (tanh(a) - tanh(b))",
        "psi": f"{speed / 2:.16g} * 5 * (log(cosh(a)) - log(cosh(b)))",
    }
    return _case(
        tank={"length": 80.0, "depth": 1.0}, initial=initial, run={"duration": duration}, numerics={"dt": 0.0125}
    )


def bar(*, height: float, period: float, duration: float) -> Case:
    """Return regular waves over a bar from 0.4 m to 0.1 m of depth, as Beji and Battjes had them."""
    omega = 2 * np.pi / period
    kd = _kd(omega**2 * 0.4 / 9.81)
    transfer = 2 * np.sinh(kd) ** 2 / (np.sinh(kd) * np.cosh(kd) + kd)  # H / stroke
    motion = {"type": "sinusoid", "paddle_amplitude": height / transfer / 2, "period": period}
    bed = {"type": "formula", "depth": "0.4 - 0.3 * clip((x - 6) / 6, 0, 1) + 0.3 * clip((x - 14) / 3, 0, 1)"}
    return _case(
        tank={"length": 25.0, "depth": 0.4, "bed": bed},
        wall={"type": "piston", "motion": motion},
        sponge={"type": "end", "length": 5.0},
        run={"duration": duration},
        numerics={"cell_size": 0.1},
    )


def release(k_a: float, *, duration: float = 10.0) -> Case:
    """Return a focused group (NewWave) of k_p a, at rest at the wall of a tank of 40 m, that disperses.

    f_p = 0.7 Hz, depth 1 m, weights of a Gaussian of 0.35 k_p.
    """
    k_p, modes = 2.039767547832318, np.arange(1, 103)
    weights = np.exp(-0.5 * ((modes * np.pi / 40.0 - k_p) / (0.35 * k_p)) ** 2)
    heights = k_a / k_p * weights / weights.sum()
    parts = [f"{height:.14g} * cos({mode} * z)" for mode, height in zip(modes, heights, strict=True) if height > 1e-13]
    initial = {"type": "formula", "where": {"z": "pi * x / 40"}, "eta": " + ".join(parts)}
    return Case.model_validate(
        {"tank": {"length": 40.0, "depth": 1.0}, "initial": initial, "run": {"duration": duration}}
    )


def luth_c(periods: float, *, duration: float = 24.0) -> Case:
    """Return ``cases/bar.toml``, case C of Luth, Klopman and Kitou, with a ramp of so many periods."""
    bed = {"type": "formula", "depth": "0.4 - 0.3 * clip((x - 6) / 6, 0, 1) + 0.3 * clip((x - 14) / 3, 0, 1)"}
    motion = {"type": "sinusoid", "paddle_amplitude": 0.0135, "period": 1.01, "ramp": 1.01 * periods}
    return Case.model_validate(
        {
            "tank": {"length": 27.0, "depth": 0.4, "bed": bed},
            "wall": {"type": "piston", "motion": motion},
            "sponge": {"type": "end", "length": 5.0},
            "run": {"duration": duration},
        }
    )


def _kd(deep: float) -> float:
    """Return kd with kd tanh kd = omega² d / g."""
    kd = max(deep, np.sqrt(deep))
    for _ in range(60):
        kd -= (kd * np.tanh(kd) - deep) / (np.tanh(kd) + kd / np.cosh(kd) ** 2)
    return float(kd)


def piston_solitary(height: float, folder: Path) -> Case:
    """Return a solitary wave from a piston with Goring's motion from a file."""
    wave = solitary_wave(height, depth=1.0)

    def speed(t: float, position: Any) -> Any:
        eta = wave.elevation(position, t - 3.0)
        return wave.speed * eta / (1.0 + eta)

    t = np.linspace(0.0, 12.0, 1201)
    found = solve_ivp(speed, (0.0, 12.0), [0.0], t_eval=t, rtol=1e-10, atol=1e-12)
    path = folder / f"piston-{height:g}.txt"
    np.savetxt(path, np.column_stack([t, found.y[0]]))
    return _case(
        tank={"length": 30.0, "depth": 1.0},
        wall={"type": "piston", "motion": {"type": "recorded", "position": str(path)}},
        run={"duration": 9.0},
    )


def current(speed: float, *, steepness: float) -> Case:
    """Return a group of deep-water waves on a stretch of water that moves [m/s]."""
    k = 4.0
    omega, a = np.sqrt(9.81 * k * np.tanh(k)), steepness / k
    envelope = "exp(-((x - 15) / 3)**2)"
    plateau = f"{speed / 2:.16g} * (5 * (log(cosh((x - 7) / 5)) - log(cosh((x - 33) / 5))))"
    initial = {
        "type": "formula",
        "eta": f"{a:.16g} * {envelope} * cos({k} * x)",
        "psi": f"{plateau} + {a * 9.81 / omega:.16g} * {envelope} * sin({k} * x)",
    }
    return _case(
        tank={"length": 40.0, "depth": 1.0}, initial=initial, run={"duration": 6.0}, numerics={"cell_size": 0.15}
    )


def standing(steepness: float) -> Case:
    """Return a steep standing wave with a crest in the middle of its tank."""
    initial = {"type": "standing-wave", "wave_amplitude": steepness / np.pi, "mode": 4}
    return _case(tank={"length": 4.0, "depth": 1.0}, initial=initial, run={"duration": 4.0})


def collision(height: float) -> Case:
    """Return two solitary-like waves that meet in the middle."""
    wave = solitary_wave(height, depth=1.0)
    k = np.sqrt(0.75 * height)
    eta = f"{height} * (1 / cosh({k} * (x - 10))**2 + 1 / cosh({k} * (x - 20))**2)"
    psi = f"{wave.speed * height / k / (1 + height / 2):.16g} * (tanh({k} * (x - 10)) - tanh({k} * (x - 20)))"
    initial = {"type": "formula", "eta": eta, "psi": psi}
    return _case(tank={"length": 30.0, "depth": 1.0}, initial=initial, run={"duration": 4.0})


def coarse() -> Case:
    """Return regular waves over cells of a quarter of a wave."""
    wall = {"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": 0.0242, "period": 1.0, "ramp": 4.0}}
    return _case(
        tank={"length": 10.0, "depth": 0.45},
        wall=wall,
        sponge={"type": "end", "length": 3.5},
        run={"duration": 10.0},
        numerics={"cell_size": 0.4, "order": 4, "vertical_order": 4, "dt": 0.04},
    )


def group(linear_crest: float) -> Case:
    """Return the focused group of ``cases/focusing.toml`` with another linear crest [m]."""
    motion = {
        "type": "focused",
        "linear_crest": linear_crest,
        "focus_x": 10.0,
        "focus_time": 20.0,
        "lowest_frequency": 0.4,
        "highest_frequency": 1.3,
        "spectrum": {"type": "jonswap", "peak_frequency": 0.65, "gamma": 3.3},
    }
    return _case(
        tank={"length": 24.0, "depth": 1.0},
        wall={"type": "piston", "motion": motion},
        run={"duration": 22.0},
        numerics={"cell_size": 0.2, "dt": 0.02, "vertical_order": 6},
    )


def piston_regular(amplitude: float) -> Case:
    """Return regular waves of 1.3 s in 0.6 m of water by a piston of an amplitude [m]; from 0.075 m on they break."""
    return _case(
        tank={"length": 10.0, "depth": 0.6},
        wall={"type": "piston", "motion": {"type": "sinusoid", "paddle_amplitude": amplitude, "period": 1.3}},
        sponge={"type": "end", "length": 4.0},
        run={"duration": 9.0},
        numerics={"cell_size": 0.12, "vertical_order": 8, "dt": 0.02},
    )


def beach(height: float, *, duration: float) -> Case:
    """Return a solitary wave on a beach of 1:15, up to a shelf, until it meets the wall."""
    bed = {"type": "formula", "depth": "1 - clip((x - 14) / 15, 0, 0.88)"}
    return _case(
        tank={"length": 32.0, "depth": 1.0, "bed": bed},
        initial={"type": "solitary-wave", "height": height, "x": 8.0},
        run={"duration": duration},
        numerics={"cell_size": 0.1},
    )


def over_steep(steepness: float) -> Case:
    """Return a sine in a ring, steeper than any steady wave, with the speed of linear theory."""
    omega = np.sqrt(9.81 * np.tanh(1.0 * np.pi) * np.pi)
    a = steepness / np.pi
    initial = {
        "type": "formula",
        "eta": f"{a:.16g} * cos(pi * x)",
        "psi": f"{a * 9.81 / omega:.16g} * sin(pi * x)",
    }
    return _case(
        tank={"type": "ring", "length": 2.0, "depth": 1.0},
        initial=initial,
        run={"duration": 3.0},
        numerics={"cells": 32, "dt": 0.005, "tolerance": 1e-8},
    )
