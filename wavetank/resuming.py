"""A run's checkpoints: written from time to time, and gone on from, on any number of ranks."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from wavetank.case import Scene
from wavetank.errors import InputError, RunError
from wavetank.fe.agreed import agreed, on_first
from wavetank.fe.by_place import found, gathered
from wavetank.fe.plane import Plane
from wavetank.observers.checkpoints import Checkpoints
from wavetank.records.checkpoint import Checkpoint, read_checkpoint
from wavetank.records.directory import RunDirectory
from wavetank.records.writer import RunWriter
from wavetank.runs.run import Run
from wavetank.stateful import Stateful, apart, give_back, held_by, together
from wavetank.values.noun import Problem, SceneError

FREE = {("title",), ("run", "duration"), ("run", "checkpoint_every"), ("numerics", "dt")}  # the step itself is compared


class KeptRun:
    """A run with its records; all methods are collective.

    Parameters
    ----------
    scene, planned
        What was asked for, and with what has been planned of it.
    beside
        What remembers something beside the run, by name, no arrays: the series that all ranks write, say.
    writer
        Of the run directory; None on all ranks but the first.
    warn
        Takes a sentence for whoever reads the results.
    """

    def __init__(
        self,
        scene: Scene,
        planned: Scene,
        *,
        run: Run,
        plane: Plane,
        beside: Mapping[str, Stateful],
        writer: RunWriter | None,
        warn: Callable[[str], None],
    ):
        self._scene, self._chosen = (one.model_dump(mode="json") for one in (scene, planned))
        self._run, self._plane, self._beside, self._writer, self._warn = run, plane, beside, writer, warn

    def from_time_to_time(self, every: float) -> Checkpoints:
        """Return the observer that writes a checkpoint every so many seconds of computing; the last to observe."""
        return Checkpoints(self._plane.comm, self.write, every=every)

    def write(self) -> None:
        """Write a checkpoint; one that cannot be written is warned of, for the run's records are there."""
        try:
            self._write()
        except (RunError, TypeError) as error:  # the latter: what somebody's own part holds
            self._warn(f"the run cannot be resumed from here on: {str(error).removesuffix('.')}")

    def _write(self) -> None:
        text, arrays = apart(self._run.held())
        whole, places = gathered(self._plane, arrays)
        stands = {"t": self._run.t, "step": self._run.step, "dt": self._run.clock.dt}
        about = stands | {"scene": self._scene, "chosen": self._chosen, "beside": held_by(self._beside)}

        def put() -> None:
            if self._writer is not None:
                self._writer.checkpoint(text, whole, places=places, about=about)

        on_first(self._plane.comm, put)

    def go_on(self) -> float:
        """Take back what the last checkpoint has, and return its time [s].

        Raises ``InputError`` where there is none, ``SceneError`` where it is another scene's.
        """
        comm = self._plane.comm
        kept = on_first(comm, self._read)
        about, text = comm.bcast((kept.about, kept.held) if kept else None)
        arrays, places = (kept.arrays, kept.places) if kept else ([], self._plane.coordinates())
        try:
            agreed(comm, lambda: self._check(about))
            self._run.take(together(text, found(self._plane, arrays, places)))
            agreed(comm, lambda: self._take_records(about))
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(
                f"the checkpoint is of another run, or another version of this program: {error!r}."
            ) from None
        return self._run.t

    def _read(self) -> Checkpoint:
        assert self._writer is not None
        kept, damaged = read_checkpoint(self._writer.path)
        for sentence in (*RunDirectory(self._writer.path).manifest.get("warnings", []), *damaged):
            self._warn(sentence)
        return kept

    def _take_records(self, about: dict[str, Any]) -> None:
        give_back(self._beside, about["beside"])
        if self._writer is not None:
            self._writer.take(about["records"])
            before = RunDirectory(self._writer.path).manifest.get("resumed", [])
            self._writer.note({"resumed": [*before, about["t"]]})

    def _check(self, about: dict[str, Any]) -> None:
        """Raise ``SceneError`` unless the run is that of the checkpoint; it may be longer."""
        changes = {
            path: (now, f"must be {before!r}, as in the run that is to go on")
            for mine, its in ((self._scene, about["scene"]), (self._chosen, about["chosen"]))
            for path, before, now in differences(its, mine)
            if path not in FREE
        }
        if self._run.clock.dt != about["dt"]:
            changes["numerics", "dt"] = (self._run.clock.dt, f"must be {about['dt']!r}, as in the run that is to go on")
        if self._run.clock.steps < about["step"]:
            changes["run", "duration"] = (
                self._run.clock.end,
                f"must be {about['t']:g} s or more: the run has come there",
            )
        if changes:
            raise SceneError([Problem(path, now, allowed) for path, (now, allowed) in changes.items()])


def differences(before: Any, now: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any, Any]]:
    """Yield where two scenes differ, and what they have there."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*before, *now]):
            yield from differences(before.get(key), now.get(key), (*path, key))
    elif before != now:
        yield path, before, now
