"""Checkpoints of a run and its records, written at intervals and where it ends."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.errors import RecordError, RunError
from wavetank.base.mpi import on_first, raise_on_all_ranks
from wavetank.base.run_warning import RunWarning
from wavetank.base.state import StateTree, serialize
from wavetank.case import Case
from wavetank.fem.by_place import gathered
from wavetank.output.checkpoint import FORMAT, Checkpoint
from wavetank.output.fields import VtuSeries
from wavetank.output.writer import RunWriter
from wavetank.simulation.checkpoints import Checkpoints
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.run import Run
from wavetank.simulation.summary import Parts


class CompletedStep(NamedTuple):
    """The end of a step that all observers have recorded: a restart without the history of the solvers.

    Attributes
    ----------
    step, t
        Its number and time [s].
    q, p
        Coordinates and momenta; later steps have others.
    tree
        Returns the state of the run, without its solves.
    records
        How far the tables and snapshots of the first rank had grown; nothing on others.
    fields
        How far the series had that all ranks write, by their names.
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
    """Writes checkpoints of a run and its records; all methods are collective.

    Attributes
    ----------
    requested, computed
        The scene as requested, and with the planned numerics.
    run, waves
        The run and its waves.
    fields
        The series that all ranks write, by their names.
    parts
        Of the run, so far.
    writer
        Of the run directory; None on all ranks but the first.
    warnings
        For whoever reads the results, so far: one may be added.
    observers
        The names of a user's own.
    files
        Checksums of the files of the case.
    """

    requested: Case
    computed: Case
    run: Run
    waves: AnyWaves
    fields: Mapping[str, VtuSeries]
    parts: Parts
    writer: RunWriter | None
    warnings: list[RunWarning]
    observers: Sequence[str]
    files: dict[str, str]
    _written: int = -1  # the last step of which there is one
    _reached: CompletedStep | None = None
    _missed: RunWarning | None = None  # that the last one could not be written, and why

    def control(self, every: float | None) -> Checkpoints:
        """Return the control that writes checkpoints."""
        return Checkpoints(self.waves.plane.comm, self.write, note=self._note, every=every)

    def _note(self) -> None:
        """Store the present step, which all observers have recorded; collective."""
        run, fields = self.run, {name: series.extent() for name, series in self.fields.items()}
        records = {} if self.writer is None else self.writer.extents()
        self._reached = CompletedStep(run.step, run.t, run.state.q, run.state.p, run.snapshot(), records, fields)

    def write(self) -> None:
        """Write the whole state of the run, unless there is a checkpoint of this step; collective."""
        self._note()
        self._write_first_possible(True)

    def write_last(self) -> None:
        """Write it at the last step, or before a signal makes it the last, or else as ``save``; collective."""
        self._note()
        self._write_first_possible(True, False)

    def save(self) -> None:
        """Write the state of a run that fails, unless there is a checkpoint of it; collective.

        It is that of the step before, or, if an observer fails within a step, of the last step that was noted. The
        history of the solvers is left out, since the failed step has altered it. On a full disk the checkpoint replaces
        the one before the last.
        """
        if self.run.recorded:
            self._note()
        self._write_first_possible(False)

    def _write_first_possible(self, *histories: bool) -> None:
        """Write the step that was noted, with the history of the solvers or without: the first that can be written.

        If there is none, a warning of it replaces that of an earlier step.
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
                return  # the directory is another's, by which the run ends
            except TypeError as error:  # what somebody's own part holds
                failure = error
                break
            except RunError as error:
                failure = error
        if self._missed in self.warnings:
            self.warnings.remove(self._missed)
        self._missed = None
        if failure is not None:
            self._missed = RunWarning("not-resumable", details={"reason": str(failure).removesuffix(".")})
            self.warnings.append(self._missed)

    def _write(self, reached: CompletedStep, *, with_history: bool) -> None:
        waves, clock = self.waves, self.run.clock
        if not waves.plane.comm.allreduce(bool(np.isfinite([reached.q, reached.p]).all()), op=MPI.LAND):
            return  # nothing could go on from there, as the run will say
        surface = self._surface(reached)
        tree = reached.tree()
        text, arrays = serialize({"surface": surface, "run": self.run.tree() if with_history else tree})
        least = len(serialize({"surface": surface, "run": tree})[1])
        values, places = gathered(waves.plane, arrays)
        about = {
            "format": FORMAT,
            "t": reached.t,
            "step": reached.step,
            "clock": {"dt": clock.dt, "begin": clock.begin, "first": clock.first},
            "whole": with_history,
            "mass": waves.total_mass(reached.q),
            "scene": self.requested.model_dump(mode="json"),
            "chosen": self.computed.model_dump(mode="json"),
            "files": self.files,
            "observers": [*self.observers],
            "parts": self.parts.so_far(reached.step),
            "warnings": [one.as_json() for one in self.warnings if one != self._missed],
            "records": reached.records,
            "fields": reached.fields,
        }

        def put() -> None:
            if self.writer is not None:
                checkpoint = Checkpoint(about, text, values, places)
                self.writer.checkpoint(
                    checkpoint, last_size=(least + 3) * places.nbytes // 3, at_any_price=not with_history
                )

        for series in self.fields.values():
            raise_on_all_ranks(waves.plane.comm, series.sync)
        on_first(waves.plane.comm, put)

    def _surface(self, reached: CompletedStep) -> dict[str, Any]:
        """Return elevation [m] and potential [m²/s] of the surface, and where that is in the laboratory [m]."""
        waves = self.waves
        waves.set_time(reached.t)
        elevation = waves.elevation(reached.q, reached.p, reached.t)
        x, y = np.ascontiguousarray(waves.wall.to_physical(waves.plane.places, elevation).T)
        return {"x": x, "y": y, "elevation": elevation, "potential": np.array(reached.p)}
