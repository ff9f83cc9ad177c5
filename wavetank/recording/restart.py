"""Restart of a run from a checkpoint, on any number of ranks, also with other numerics; the stored case of a run."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from pydantic import ValidationError

from wavetank.base.case_model import CaseError, Problem
from wavetank.base.errors import InputError
from wavetank.base.mpi import on_first, raise_on_all_ranks
from wavetank.base.run_warning import RunWarning, run_warning
from wavetank.base.state import check_like, deserialize
from wavetank.case import Case, Numerics, StillWater
from wavetank.case.reading import changed_case, contents
from wavetank.fem.by_place import at_dofs
from wavetank.output.checkpoint import Checkpoint, checked_tree
from wavetank.output.directory import RunDirectory
from wavetank.output.fields import VtuSeries
from wavetank.output.manifest import MANIFEST
from wavetank.output.writer import RunWriter
from wavetank.planning.checks import predicted, too_high
from wavetank.planning.plan import PlannedCase, planned
from wavetank.simulation.clock import Clock
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.initial import StoredSurface, differences
from wavetank.simulation.run import Run

UNCHANGING = {"certify"}  # keys of the numerics that do not change the run
FREE = {("title",), ("run", "duration"), ("run", "checkpoint_every"), ("run", "on_breaking")}
ALL_OF = {"gauges": "all_gauges", "probes": "probes", "loads": "loads", "windows": "windows"}  # may be extended
CHANGED = {*Numerics.model_fields, "on_breaking"}
SIZES = {"cells": "cell_size", "cell_size": "cells"}  # keys that exclude each other
RECORDED = {"output", "gauge_lines", *ALL_OF}


class Restart:
    """A restart from a checkpoint.

    With the same numerics it restores the complete state; with others the surface, and sums that do not depend on them.

    Parameters
    ----------
    writer
        Writer of the run directory; None except on the first rank.
    warn
        Function that adds a warning.
    at
        Time of the checkpoint [s]; default: the last.

    Raises ``InputError``, on all ranks, if there is no such checkpoint.

    Attributes
    ----------
    about
        Metadata of the checkpoint.
    anew
        Whether the run continues with other numerics; set by ``planned``.
    """

    def __init__(
        self,
        writer: RunWriter | None,
        comm: MPI.Comm,
        *,
        warn: Callable[[RunWarning | str], None],
        at: float | None = None,
    ):
        self._writer, self._comm, self._warn, self._at = writer, comm, warn, at
        self._checkpoint = last = on_first(comm, self._read)
        parts = (last.about, last.tree_json, len(last.arrays)) if last else None
        self.about, self._text, self._count = comm.bcast(parts)
        self.anew = False
        try:
            self._tree = checked_tree(self.about, self._text, [np.zeros(0)] * self._count)["run"]
            self._before, self._chosen = (Case.model_validate(self.about[name]) for name in ("case", "chosen"))
            self._has_history = bool(self.about["whole"])
        except (LookupError, ValueError, ValidationError) as error:
            raise self._foreign(error) from error

    def _foreign(self, error: Exception) -> InputError:
        """Return the error for a checkpoint with unexpected content."""
        by = f" ({self.about['git']})" if isinstance(self.about, dict) and self.about.get("git") else ""
        reason = f"; {error}" if isinstance(error, ValueError) and not isinstance(error, ValidationError) else ""
        return InputError(
            f"the checkpoint was written by another version of this program{by}, or with an integrator or observer of "
            f"your own, or has been edited: only the version that wrote it can resume it{reason}."
        )

    def _read(self) -> Checkpoint:
        assert self._writer is not None
        checkpoint, useless = self._writer.last_checkpoint(self._at)
        for sentence in useless:
            self._warn(sentence)
        return checkpoint

    # ------------------------------------------------------------------------------------------ the case
    def planned(self, requested: Case) -> PlannedCase:
        """Return the case of the resumed run with its numerics; collective.

        Raises ``CaseError`` for a key that a resumed run cannot change.
        """
        raise_on_all_ranks(self._comm, lambda: self._check(requested))
        water, output = self._chosen.water, requested.output
        if output.surface_every is None:  # by default it follows from the duration
            output = output.model_copy(update={"surface_every": self._chosen.surface_every})
        case = requested.model_copy(update={"water": water, "output": output})
        mine, its = requested.numerics, self._before.numerics
        same = mine.model_dump(exclude=UNCHANGING) == its.model_dump(exclude=UNCHANGING)
        self.anew = not same or requested.run.on_breaking != self._before.run.on_breaking
        if self.anew and requested.run.duration <= self.about["t"] * (1 + 1e-9):
            allowed = f"must be more than {self.about['t']:g} s, the time of the run; --extend SECONDS adds to it"
            raise CaseError([self._duration_problem(requested, allowed)])
        self._warn_again()
        if same or mine.accuracy == its.accuracy and not (mine.open and not its.open):
            result = PlannedCase(case.model_copy(update={"numerics": self._numerics(mine, its)}))
        else:
            result = planned(case, self._comm)
        return result._replace(
            case=result.case.model_copy(update={"initial": StillWater()})
        )  # the run has started already

    def _warn_again(self) -> None:
        """Repeat the warnings of the run, except those that depend on the duration and are made again."""
        obsolete, of_numerics = [*too_high(self._chosen)], [*predicted(self._chosen)]
        if not self.anew and isinstance(self._chosen.initial, StillWater):
            obsolete += of_numerics
        for warning in map(run_warning, self.about.get("warnings", [])):
            if warning not in obsolete:
                past = self.anew and warning in of_numerics
                self._warn(replace(warning, until=self.about["t"]) if past else warning)

    def _numerics(self, mine: Numerics, its: Numerics) -> Numerics:
        """Return the planned numerics of the checkpoint, with the keys that the request changes."""
        named = mine.model_fields_set if its.open else set(Numerics.model_fields)
        changed = {key for key in named if getattr(mine, key) != getattr(its, key)}
        chosen = self._chosen.numerics.model_copy(update={"dt": self.about["clock"]["dt"]})
        return mine.over(chosen, named=changed if its.dt is None else changed | {"dt"})

    def _check(self, requested: Case) -> None:
        """Raise ``CaseError`` if the case differs from that of the checkpoint in a key that must not change."""
        before, now = (one.model_dump(mode="json") for one in (self._before, requested))
        problems = [
            Problem(path, *_required_value(former, value))
            for path, former, value in differences(before, now)
            if path not in FREE and path[0] not in {"numerics", "water", *RECORDED}
        ]
        if requested.water is not None and requested.physics != self._chosen.physics:
            allowed = f"must be {self._chosen.physics!r}, as in the original run"
            problems.append(Problem(("water", "type"), requested.physics, allowed))
        problems += self._removed_records(requested)
        changed = requested.run.duration != self._before.run.duration  # else the last step may end beyond it
        if changed and requested.run.duration < self.about["t"] * (1 - 1e-9):
            allowed = f"must be {self.about['t']:g} s or more, the time of the run"
            problems.append(self._duration_problem(requested, allowed))
        problems += self._changed_files(requested)
        if problems:
            raise CaseError(problems)

    def _duration_problem(self, requested: Case, allowed: str) -> Problem:
        """Return the problem with an elapsed duration: if the request does not change it, the run has finished."""
        if requested.run.duration == self._before.run.duration:
            return Problem(("run",), None, "has finished; --extend SECONDS continues it")
        return Problem(("run", "duration"), requested.run.duration, allowed)

    def _removed_records(self, requested: Case) -> Iterator[Problem]:
        """Yield the gauges, probes, loads and windows of the checkpoint that are no longer requested."""
        for key, name in ALL_OF.items():
            now = getattr(requested, name)
            gone = [one for one in getattr(self._before, name) if one not in now]
            if gone:
                missing = ", ".join(json.dumps(one.model_dump(mode="json", exclude_defaults=True)) for one in gone)
                allowed = f"must contain all of the original run: {missing} is missing or different"
                yield Problem((key,), None, allowed)

    def _changed_files(self, requested: Case) -> list[Problem]:
        """Return the files of the case whose content has changed."""
        now, allowed = contents(requested), "the content of the file must not change after the beginning of the run"
        return [
            Problem(tuple(key.split(".")), name, allowed)
            for key, name in requested.named_files()
            if key in self.about["files"] and now.get(key) != self.about["files"][key]
        ]

    # ------------------------------------------------------------------------------------------ the run
    @property
    def counters_continue(self) -> bool:
        """Whether the counters of solves continue."""
        return not self.anew and self._has_history

    @property
    def beginning(self) -> StoredSurface | None:
        """The surface at which a run with other numerics begins; None for the same numerics."""
        return StoredSurface.of(self._chosen, self.about, self._tree["parts"], self._checkpoint) if self.anew else None

    def restore(self, run: Run, waves: AnyWaves, *, case: Case, fields: Mapping[str, VtuSeries]) -> str:
        """Restore the state of a run and the extents of its records; return a message; collective.

        Raises ``InputError`` for a checkpoint of another run or of another integrator.
        """
        its, mine = self.about["parts"][-1]["numerics"]["integrator"], run.integrator.name
        if its != mine and case.numerics.integrator == self._chosen.numerics.integrator:
            raise InputError(f"integrator {mine!r} received; must be {its!r}, as in the original run.")
        try:
            message = self._restore_surface(run, waves, case) if self.anew else self._restore(run, waves, case)
            for name, series in fields.items():
                if name in self.about["fields"]:
                    check_like(series.extent(), self.about["fields"][name], f"about.fields.{name}", exact=True)
                    series.resume_at(self.about["fields"][name])
            raise_on_all_ranks(self._comm, self._restore_records)
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError) as error:
            raise self._foreign(error) from error
        return message

    def warn_of_missing_observers(self, observers: Sequence[str]) -> None:
        """Warn of observers of the original run that are missing in ``observers``."""
        if gone := [one for one in self.about.get("observers", []) if one not in observers]:
            self._warn(RunWarning("missing-observers", t=self.about["t"], details={"names": ", ".join(gone)}))

    def _restore_records(self) -> None:
        if self._writer is not None:
            mine, its = self._writer.extents(), self.about["records"]
            check_like({name: one for name, one in mine.items() if name in its}, its, "about.records", exact=True)
            self._writer.resume_at(its)

    def _restore(self, run: Run, waves: AnyWaves, case: Case) -> str:
        """Restore the complete state of a run with the same numerics."""
        clock = self.about["clock"]
        remaining, until = case.run.duration - clock["begin"], case.motions_end - clock["begin"]
        run.clock = Clock.covering(remaining, clock["dt"], until=until).after(clock["begin"], clock["first"])
        last = self._checkpoint
        arrays, places = (last.arrays, last.places) if last else ([], np.zeros((0, 3)))
        tree = deserialize(self._text, at_dofs(waves.plane, arrays, places))["run"]
        run.resume(tree, with_solves=self._has_history)
        if run.step != self.about["step"]:
            raise ValueError(f"step {run.step} of the state differs from step {self.about['step']} of its description")
        return f"resuming from t = {run.t:.6g} s"

    def _restore_surface(self, run: Run, waves: AnyWaves, case: Case) -> str:
        """Restore the states that do not depend on the numerics; the run begins at the surface."""
        run.change_numerics(self._tree)
        mass = waves.total_mass(run.state.q) / self.about["mass"] - 1.0
        former, now = (one.model_dump(mode="json", include={"numerics", "run"}) for one in (self._chosen, case))
        former["numerics"]["dt"] = self.about["clock"]["dt"]
        now["numerics"]["dt"] = run.clock.dt
        changes = [
            f"{'.'.join(path)} = {value}"
            for path, _, value in differences(former, now)
            if path[-1] in CHANGED and value is not None
        ]
        return f"resuming from t = {run.t:.6g} s with {', '.join(changes)}; relative change of mass {mass:.1g}"


def _required_value(former: Any, value: Any) -> tuple[Any, str]:
    """Return the received and the required value of a key; without values for lists and tables."""
    if isinstance(former, list | dict) or isinstance(value, list | dict):
        return None, "must be as in the original run"
    return value, f"must be {'left out' if former is None else repr(former)}, as in the original run"


def stored_case(run: Path | str, changes: Sequence[str] = (), *, extend: float | None = None) -> Case:
    """Return the case stored in a run directory, with ``KEY=VALUE`` changes, longer by ``extend`` [s].

    Raises ``InputError`` if no case is stored, or an invalid one.
    """
    directory = RunDirectory(run)
    content = directory.manifest.get("case")
    if not isinstance(content, dict) or not isinstance(content.get("run"), dict):
        raise InputError(f"{directory.path}: its {MANIFEST} has no case to resume.")
    if extend is not None:
        if not extend > 0:
            raise InputError(f"--extend {extend:g} received; must be more than 0 s.")
        if any(change.partition("=")[0].strip() == "run.duration" for change in changes):
            raise InputError("--extend and run.duration exclude each other: an additional and a total duration.")
        changes = [*changes, f"run.duration={float(content['run']['duration']) + extend!r}"]
    content = _without_none(content)
    for key, other in SIZES.items():
        if any(change.partition("=")[0].strip() == f"numerics.{key}" for change in changes):
            content.get("numerics", {}).pop(other, None)
    return changed_case(directory.path / MANIFEST, content, changes)


def _without_none(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a case without keys whose value is None."""
    items = ((key, _without_none(value) if isinstance(value, dict) else value) for key, value in content.items())
    return {key: value for key, value in items if value is not None}
