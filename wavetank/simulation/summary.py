"""Summary of a run: cost of its parts, energy and mass, breakdown."""

import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.errors import RunError
from wavetank.base.run_warning import RunWarning, summarise_warnings
from wavetank.output.directory import BROKEN, BROKEN_PICTURE, CHECKPOINT
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.diagnostics import Crest, HighestCrest
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.memory import peak_memory
from wavetank.simulation.run import Run
from wavetank.simulation.stability import StabilityWatch
from wavetank.tank.breaking import ONSET, BreakingFilter
from wavetank.tank.crests import SteepCrest
from wavetank.tank.linear_waves import LinearWaves
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves

Figures = dict[str, Any]


class Parts:
    """Parts of a run, each from its start or a resumption; the last part is in progress.

    Parameters
    ----------
    run, waves
        The run and its waves, before the first step of this part.
    start_time
        Start of the preparation of this part, ``time.monotonic`` [s].
    earlier
        The earlier parts, up to the checkpoint.
    counters_continue
        Whether the counters of solves continue from those of the earlier parts.
    """

    def __init__(
        self,
        run: Run,
        waves: AnyWaves,
        *,
        start_time: float,
        earlier: Sequence[Figures] = (),
        counters_continue: bool = False,
    ):
        self._run, self._waves, self._earlier = run, waves, list(earlier)
        self._start_time, self._built, self._busy = start_time, time.monotonic(), time.process_time()
        self._t, self._step = run.t, run.step
        self._counted = _counters(waves) if counters_continue else {}

    def so_far(self, step: int | None = None) -> list[Figures]:
        """Return the figures of each part for the manifest, up to a step, by default the last; collective."""
        run, comm, now = self._run, self._waves.plane.comm, time.monotonic()
        step = run.step if step is None else step
        this = {
            "from": self._t,
            "to": run.clock.time(step),
            "steps": step - self._step,
            "ranks": comm.size,
            "numerics": _numerics(run, self._waves),
            "counters": {name: n - self._counted.get(name, 0) for name, n in _counters(self._waves).items()},
            "timings": {
                "set_up_s": self._built - self._start_time,
                "stepping_s": now - self._built,
                "stepping_cpu_s": comm.allreduce(time.process_time() - self._busy),
            },
            "memory": {"peak_mib": comm.allreduce(peak_memory() / 2**20, op=MPI.SUM)},
        }
        return [*self._earlier, this]

    def figures(self) -> Figures:
        """Return the figures of the parts and of the run for the manifest; collective."""
        parts, run = self.so_far(), self._run
        return {
            "t": run.t,
            "numerics": {**parts[-1]["numerics"], "steps": run.clock.steps, "steps_taken": run.step},
            "counters": _sum([part["counters"] for part in parts]),
            "timings": _sum([part["timings"] for part in parts]),
            "memory": {"peak_mib": max(part["memory"].get("peak_mib", 0.0) for part in parts)},
            "parts": parts,
        }


def _sum(figures: Sequence[Mapping[str, Any]]) -> Figures:
    """Return the sums of figures by their names."""
    return {name: sum(one.get(name, 0) for one in figures) for name in (figures[-1] if figures else ())}


def _numerics(run: Run, waves: AnyWaves) -> Figures:
    return {
        "integrator": run.integrator.name,
        "dt": run.clock.dt,
        "cells": waves.plane.cells,
        "order": waves.plane.order,
        "vertical_order": waves.vertical.n,
        "degrees_of_freedom": waves.plane.size,
        "largest_frequency": waves.largest_frequency,
    }


def _counters(waves: AnyWaves) -> dict[str, int]:
    stages, solves = waves.stages.counters, waves.potential.counters
    return {
        "interior_solves": solves.solves,
        "interior_iterations": solves.iterations,
        "factorisations": solves.factorisations,
        "stage_solves": stages.solves,
        "stage_evaluations": stages.evaluations,
        "newton_solves": stages.newton_solves,
    }


ANEW = "a new run from the start: the case must be changed"


class RunOutcome(NamedTuple):
    """Highest crest and errors of a finished run.

    Attributes
    ----------
    crest
        The highest crest.
    mass, energy
        Relative errors of mass and energy balance [-].
    untrue
        Time since which the run is inaccurate, by the high-frequency monitor [s], or None.
    follows
        Whether the mass changes with the displacement of paddles, as in linear theory.
    """

    crest: Crest
    mass: float
    energy: float
    untrue: float | None = None
    follows: bool = False

    @classmethod
    def of(cls, run: Run) -> "RunOutcome":
        """Return the outcome of a run from its diagnostics; collective."""
        budget = next(one for one in run.diagnostics if isinstance(one, EnergyBudget))
        crest = next(one for one in run.diagnostics if isinstance(one, HighestCrest))
        untrue = next((one.state.since for one in run.diagnostics if isinstance(one, StabilityWatch)), None)
        waves = run.system
        follows = isinstance(waves, LinearWaves) and bool(waves.wall.paddles)
        return cls(crest.state, budget.mass_error, budget.energy_error, untrue, follows)

    @property
    def figures(self) -> dict[str, Any]:
        """Figures for the manifest; empty without a recorded step, or if a figure is not finite."""
        if not all(map(isfinite, (*astuple(self.crest), self.mass, self.energy))):
            return {}
        return {"highest_crest": asdict(self.crest), "errors": {"mass": self.mass, "energy_balance": self.energy}}


def closing(
    outcome: RunOutcome,
    spent: dict[str, Any],
    *,
    warnings: Sequence[RunWarning],
    path: Path,
    flat: bool,
    drawn: bool = True,
) -> list[str]:
    """Return the last lines of the log of a run.

    Parameters
    ----------
    outcome
        Highest crest and errors.
    spent
        Case, ranks, time, steps, solves and costs as in the manifest; cause and checkpoints of a failed run.
    warnings
        Warnings, the most severe first.
    path
        Run directory.
    flat
        Whether the tank is a slice or a ring.
    drawn
        Whether figures are drawn.
    """
    crest, timings, steps = outcome.crest, spent["timings"], spent["numerics"]["steps_taken"]
    x, y = (f"{round(one, 6) + 0.0:.4g} m" for one in (crest.x, crest.y))  # rounded to micrometres
    place = f"x = {x}" if flat else f"x = {x}, y = {y}"
    simulated = spent["t"]
    follows = " (linear theory: displacement of the paddles)" if outcome.follows else ""
    costs = [
        f"{timings['stepping_cpu_s']:.3g} CPU s on {_ranks(spent)}",
        f"{steps} steps",
        f"{spent['counters']['interior_solves'] / max(steps, 1):.1f} interior solves per step",
        f"{timings['stepping_s'] / simulated if simulated else 0.0:.2g} s per simulated second",
    ]
    directory, warned = shlex.quote(str(path)), summarise_warnings(warnings)
    broken = _of_breakdown(spent, path, untrue=outcome.untrue, drawn=drawn)
    return [
        f"highest crest: {crest.height:.4g} m, at the node {place}, t = {crest.t:.4g} s",
        f"errors: {outcome.mass:.1g} of the mass{follows}, {outcome.energy:.1g} of the energy; {warned}",
        f"cost: {', '.join(costs)}",
        f"records: {path}",
        *(broken or [f"next: {'; '.join(_next(spent, directory))}"]),
    ]


def _next(spent: dict[str, Any], directory: str) -> list[str]:
    """Return the next commands; for a stopped run the command that resumes it, unless another case is needed."""
    if spent.get("anew"):
        return [ANEW]
    if spent["t"] < (1 - 1e-9) * spent["case"]["run"]["duration"]:
        once = ", once the directory can be written" if spent.get("unwritten") else ""
        if not spent["checkpoints"]:
            return [f"a new run from the start{once}: there is no checkpoint"]
        return [f"wavetank resume {directory}{once}"]
    return [f"wavetank view {directory}", f"wavetank compare {directory} --with DATA"]


def _of_breakdown(spent: dict[str, Any], path: Path, *, untrue: float | None, drawn: bool) -> list[str]:
    """Return the files of the surface before a breakdown, and how to resume; empty for other runs."""
    if "broke_down" not in spent:
        return []
    checkpoints, crests = spent["checkpoints"], spent["broke_down"]["crests"]
    dissipates = spent["case"]["run"].get("on_breaking") == "dissipate"
    breaks = not dissipates and any(crest["speed_ratio"] > ONSET for crest in crests)
    half = "" if breaks else f"numerics.dt={0.5 * spent['numerics']['dt']:.3g}"
    other = " --set ".join(filter(None, ["run.on_breaking=dissipate" if breaks else "", spent.get("cure") or half]))
    files = ", ".join(str(path / file) for file in (BROKEN, *([BROKEN_PICTURE] if drawn else [])))
    lines = [f"last surface before the breakdown, t = {spent['t']:.6g} s: {files}"]
    sound = [t for t in checkpoints if untrue is None or t < untrue]
    good = "good " if checkpoints[:1] == sound[:1] else ""
    if checkpoints:
        before = "".join(f"; the previous one, t = {t:.6g} s: --at {t:.6g}" for t in checkpoints[1:])
        lines.append(f"the last {good}checkpoint, t = {checkpoints[0]:.6g} s: {path / CHECKPOINT}{before}")
    if spent.get("anew"):
        return [*lines, f"next: {ANEW}"]
    if not sound:
        none = "no checkpoint precedes the warning" if checkpoints else "there is no checkpoint"
        return [*lines, f"next: a new run from the start with --set {other}: {none}"]
    at = "" if good else f" --at {sound[0]:.6g}"
    return [*lines, f"next: wavetank resume {shlex.quote(str(path))}{at} --set {other}"]


def _ranks(spent: dict[str, Any]) -> str:
    """Return the numbers of ranks of the parts of a run."""
    *first, last = dict.fromkeys([part["ranks"] for part in spent["parts"]])
    return f"{', '.join(map(str, first))}{' and ' if first else ''}{last} {'ranks' if first or last > 1 else 'rank'}"


PLACES, VALUES = ("x [m]", "y [m]"), ("elevation [m]", "slope [-]", "velocity [m/s]")


class BrokenSurface(NamedTuple):
    """The last surface before a breakdown.

    Attributes
    ----------
    t
        Time [s].
    columns
        Positions and values by their names with units, shape (N,) each: along a slice or ring at the nodes and between
        them; in a basin highest elevation, largest slope and velocity of each cell, at its centre.
    crests
        The steep crests, if the run searches for breaking.
    """

    t: float
    columns: dict[str, Vector]
    crests: list[SteepCrest]

    @classmethod
    def of(cls, run: Run, waves: NonlinearWaves) -> "BrokenSurface | None":
        """Return the surface of a run's state, the same on all ranks; None if it is not finite; collective."""
        state, flow = run.state, waves.surface
        try:
            flow.update(state.q, state.p, run.t)
        except RunError:
            return None
        if isinstance(flow, SurfaceFlow):
            x, height, slope, psi_x = flow.profile
            values = x, height, np.abs(slope), np.abs(psi_x) / (1 + slope**2)
            columns = dict(zip((PLACES[0], *VALUES), values, strict=True))
        else:
            columns = _by_cell(waves)
        if not all(np.isfinite(column).all() for column in columns.values()):
            return None
        searches = [one.watch for one in run.filters if isinstance(one, BreakingFilter)]
        return cls(run.t, columns, [crest for one in searches for crest in one.crests])

    @property
    def figures(self) -> dict[str, Any]:
        """Figures for the manifest: the time, the steepest place, and crests with B = u/c."""
        steepest = int(np.argmax(self.columns["slope [-]"]))
        there = {name.partition(" ")[0]: float(column[steepest]) for name, column in self.columns.items()}
        crests = [{"x": one.x, "height": one.height, "speed_ratio": one.overtaking} for one in self.crests]
        return {"broke_down": {"t": self.t, "steepest": there, "crests": crests}}


def _by_cell(waves: NonlinearWaves) -> dict[str, Vector]:
    """Return the columns of a basin, a row for each cell, ordered by position; collective."""
    plane, flow = waves.plane, waves.surface
    dofs = plane.V.dofmap.list[: flow.speeds.size]
    eta = plane.function("elevation")
    eta.set(flow.fields[0].owned)
    places = plane.chart.places(plane.V.tabulate_dof_coordinates())
    x, y = waves.wall.to_physical(places, eta.rows[:, 0])[dofs].mean(axis=1).T
    own = np.column_stack([x, y, eta.rows[dofs, 0].max(axis=1), flow.slopes, flow.speeds])
    rows = np.concatenate(plane.comm.allgather(own))
    return dict(zip((*PLACES, *VALUES), rows[np.lexsort(rows.T[:2])].T, strict=True))
