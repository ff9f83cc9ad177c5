"""The parts of a run, which it goes on in: from when to when each, with what numerics, and what it has cost."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

from mpi4py import MPI

from wavetank.simulation.memory import peak_memory
from wavetank.simulation.run import Run
from wavetank.simulation.waters import AnyWaves

Figures = dict[str, Any]


class Parts:
    """The parts of a run so far, the last of which goes on.

    Parameters
    ----------
    run, waves
        What goes on, where it begins to.
    began
        When that was begun to be set up, ``time.monotonic`` [s].
    earlier
        The parts before, of as many steps as there are records.
    counting_on
        Whether solves have been counted on from theirs.
    """

    def __init__(
        self,
        run: Run,
        waves: AnyWaves,
        *,
        began: float,
        earlier: Sequence[Figures] = (),
        counting_on: bool = False,
    ):
        self._run, self._waves, self._earlier = run, waves, list(earlier)
        self._began, self._built, self._busy = began, time.monotonic(), time.process_time()
        self._t, self._step = run.t, run.step
        self._counted = _counters(waves) if counting_on else {}

    def so_far(self, step: int | None = None) -> list[Figures]:
        """Return what there is to say of each, as a manifest has it, up to a step, by default the last; collective."""
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
                "set_up_s": self._built - self._began,
                "stepping_s": now - self._built,
                "stepping_cpu_s": comm.allreduce(time.process_time() - self._busy),
            },
            "memory": {"peak_mib": comm.allreduce(peak_memory() / 2**20, op=MPI.SUM)},
        }
        return [*self._earlier, this]

    def figures(self) -> Figures:
        """Return what a manifest says of them and of all together; collective."""
        parts, run = self.so_far(), self._run
        return {
            "t": run.t,
            "numerics": {**parts[-1]["numerics"], "steps": run.clock.steps, "steps_taken": run.step},
            "counters": _sum([part["counters"] for part in parts]),
            "timings": _sum([part["timings"] for part in parts]),
            "memory": {"peak_mib": max(part["memory"]["peak_mib"] for part in parts)},
            "parts": parts,
        }


def _sum(figures: Sequence[Mapping[str, Any]]) -> Figures:
    """Return the sums of figures by their names."""
    return {name: sum(one[name] for one in figures) for name in (figures[-1] if figures else ())}


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
