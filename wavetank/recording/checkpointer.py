"""Checkpoints of a run and its records, at intervals and at its end."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.errors import RecordError, RunError
from wavetank.base.mpi import on_first, raise_on_all_ranks
from wavetank.base.run_warning import RunWarning
from wavetank.base.state import StateTree, serialize
from wavetank.fem.by_place import gathered
from wavetank.output.checkpoint import FORMAT, Checkpoint
from wavetank.recording.log import RecordedRun
from wavetank.simulation.monitoring import Checkpoints


class CompletedStep(NamedTuple):
    """The end of a step that all observers have recorded, for a checkpoint without the history of the solvers.

    Attributes
    ----------
    step, t
        Number of the step, and time [s].
    q, p
        Coordinates and momenta; later steps do not change these arrays.
    tree
        Function that returns the state of the run, without the history of the solvers.
    records
        Extents of tables and snapshots; empty except on the first rank.
    fields
        Extents of the series that all ranks write, by their names.
    """

    step: int
    t: float
    q: Vector
    p: Vector
    tree: Callable[[], StateTree]
    records: StateTree
    fields: dict[str, StateTree]


@dataclass
class Checkpointer:
    """Writer of the checkpoints of a recorded run; all methods are collective."""

    recorded: RecordedRun
    _written: int = -1  # step of the last checkpoint
    _reached: CompletedStep | None = None
    _missed: RunWarning | None = None  # why the last checkpoint could not be written

    def control(self, every: float | None) -> Checkpoints:
        """Return the control that writes checkpoints."""
        return Checkpoints(self.recorded.waves.plane.comm, self.write, note=self._note, every=every)

    def _note(self) -> None:
        """Store the current step, which all observers have recorded; collective."""
        run, writer = self.recorded.run, self.recorded.writer
        fields = {name: series.extent() for name, series in self.recorded.series.items()}
        records = {} if writer is None else writer.extents()
        self._reached = CompletedStep(run.step, run.t, run.state.q, run.state.p, run.snapshot(), records, fields)

    def write(self) -> None:
        """Write the complete state of the run, unless there is a checkpoint of this step; collective."""
        self._note()
        self._write_first_possible(True)

    def write_last(self) -> None:
        """Write the checkpoint of the last step, if possible with the history of the solvers; collective."""
        self._note()
        self._write_first_possible(True, False)

    def save(self) -> None:
        """Write the state of a failing run, unless there is a checkpoint of it; collective.

        The state is that of the previous step or, if an observer fails within a step, of the last stored step. The
        history of the solvers is omitted, since the failed step has changed it. On a full disk the checkpoint replaces
        the one before the last.
        """
        if self.recorded.run.recorded:
            self._note()
        self._write_first_possible(False)

    def _write_first_possible(self, *histories: bool) -> None:
        """Write the stored step: the first version that can be written, with or without the history of the solvers.

        If none can be written, a warning replaces that of an earlier step.
        """
        failure: Exception | None = None
        reached = self._reached
        for with_history in histories:
            if reached is None or reached.step == self._written:
                break
            try:
                self._write(reached, with_history=with_history)
                self._written, failure = reached.step, None
            except RecordError:
                return  # the directory was replaced; the run ends
            except TypeError as error:  # a state of a user's object that cannot be written
                failure = error
                break
            except RunError as error:
                failure = error
        warnings = self.recorded.warnings.records
        if self._missed in warnings:
            warnings.remove(self._missed)
        self._missed = None
        if failure is not None:
            self._missed = RunWarning("not-resumable", details={"reason": str(failure).removesuffix(".")})
            warnings.append(self._missed)

    def _write(self, reached: CompletedStep, *, with_history: bool) -> None:
        of, waves, clock = self.recorded, self.recorded.waves, self.recorded.run.clock
        if not waves.plane.comm.allreduce(bool(np.isfinite([reached.q, reached.p]).all()), op=MPI.LAND):
            return  # the run has broken down
        surface = self._surface(reached)
        tree = reached.tree()
        text, arrays = serialize({"surface": surface, "run": of.run.tree() if with_history else tree})
        least = len(serialize({"surface": surface, "run": tree})[1])
        values, places = gathered(waves.plane, arrays)
        about = {
            "format": FORMAT,
            "t": reached.t,
            "step": reached.step,
            "clock": {"dt": clock.dt, "begin": clock.begin, "first": clock.first},
            "whole": with_history,
            "mass": waves.total_mass(reached.q),
            "case": of.requested.model_dump(mode="json"),
            "chosen": of.case.model_dump(mode="json"),
            "files": of.content["files"],
            "observers": of.observers,
            "parts": of.parts.so_far(reached.step),
            "warnings": [one.as_json() for one in of.warnings.records if one != self._missed],
            "records": reached.records,
            "fields": reached.fields,
        }

        def put() -> None:
            if of.writer is not None:
                checkpoint = Checkpoint(about, text, values, places)
                of.writer.checkpoint(
                    checkpoint, last_size=(least + 3) * places.nbytes // 3, at_any_price=not with_history
                )

        for series in of.series.values():
            raise_on_all_ranks(waves.plane.comm, series.sync)
        on_first(waves.plane.comm, put)

    def _surface(self, reached: CompletedStep) -> dict[str, Any]:
        """Return positions in the laboratory [m], elevation [m] and potential [m²/s] of the surface; collective."""
        waves = self.recorded.waves
        waves.set_time(reached.t)
        elevation = waves.elevation(reached.q, reached.p, reached.t)
        x, y = np.ascontiguousarray(waves.wall.to_physical(waves.plane.places, elevation).T)
        return {"x": x, "y": y, "elevation": elevation, "potential": np.array(reached.p)}
