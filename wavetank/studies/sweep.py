"""Combinations of settings of a case: which are run, which reference they need, and their runs.

Each combination is run by ``python -m wavetank run`` in its own process, several at a time. The reference of a study is
its finest combination refined once more: dt/2, twice the cells (order p + 1 on a mesh file), n + 2, a tenth of the
tolerance; it records its gauges at every step and snapshots at the steps of the finest combination.
"""

import ctypes
import os
import re
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple
from urllib.parse import quote

from wavetank.case import BasinTank, Case
from wavetank.case.numerics import HIGHEST_ORDER, HIGHEST_VERTICAL_ORDER
from wavetank.case.reading import contents, read_case
from wavetank.errors import InputError, RunError
from wavetank.integrators import INTEGRATORS
from wavetank.mesh import MeshFile
from wavetank.output.checkpoint import last_checkpoint
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.manifest import MANIFEST
from wavetank.values.case_model import CaseModel
from wavetank.values.python_file import is_trusting

SHORT_NAMES = {
    "dt": "numerics.dt",
    "dx": "numerics.cell_size",
    "cells": "numerics.cells",
    "n": "numerics.vertical_order",
    "p": "numerics.order",
    "order": "numerics.order",
    "integrator": "numerics.integrator",
    "tolerance": "numerics.tolerance",
}
UNITS = {"dt": "s", "dx": "m"}
NUMERICAL = ("numerics", "output")  # tables of the case that change nothing of the water
MOST = 1000  # values of FIRST..LAST
READABLE = "=,.+-"  # characters a folder's name may have besides letters and digits; the others are escaped


@dataclass(frozen=True)
class Axis:
    """A key of the case and the values it takes, as given.

    Attributes
    ----------
    key
        Dotted key of the case, e.g. ``numerics.vertical_order``.
    values
        All different.
    """

    key: str
    values: tuple[str, ...]

    @classmethod
    def of(cls, name: str, *values: str) -> "Axis":
        """Return the axis of a dotted key or a short name."""
        return cls(SHORT_NAMES.get(name, name), values)

    @property
    def name(self) -> str:
        """The key's short name if it has one, e.g. ``n``."""
        return next((name for name, key in SHORT_NAMES.items() if key == self.key), self.key)

    @property
    def label(self) -> str:
        """The name with its unit, e.g. ``dt [s]``."""
        return f"{self.name} [{UNITS[self.name]}]" if self.name in UNITS else self.name

    @property
    def physical(self) -> bool:
        """Whether it changes what is modelled, not how it is computed."""
        return self.key.partition(".")[0] not in NUMERICAL

    @property
    def seeds(self) -> bool:
        """Whether its values are seeds: of the same sea, others."""
        return self.key.rpartition(".")[2] == "seed"


@dataclass(frozen=True)
class Combination:
    """One run of a study.

    Attributes
    ----------
    name
        Of its run directory.
    values
        By the names of the axes, as given.
    overrides
        All that changes the case, ``KEY=VALUE``; of two for one key the later one holds.
    scene
        What is run.
    """

    name: str
    values: dict[str, str]
    overrides: tuple[str, ...]
    scene: Case


@dataclass(frozen=True)
class Refused:
    """A combination that cannot be run, and why; see ``Combination``."""

    name: str
    values: dict[str, str]
    cause: str


def unit(scene: Case, key: str) -> str:
    """Return the unit of a dotted key as its description tells it, e.g. ``"m"``; "" where it tells none."""
    *path, last = key.split(".")
    noun: object = scene
    for part in path:
        noun = getattr(noun, part, None)
    field = type(noun).model_fields.get(last) if isinstance(noun, CaseModel) else None
    match = re.search(r"\[([^\]]+)\]", (field.description if field else None) or "")
    return match[1] if match else ""


def parse_axis(text: str) -> Axis:
    """Return the axis of ``KEY=VALUE,VALUE,...``; KEY is dotted or short, ``1..20`` all from 1 to 20.

    Raises ``InputError``.
    """
    name, _, values = text.partition("=")
    given = tuple(one for value in values.split(",") for one in _values_of(value.strip()))
    if not name.strip() or not all(given):
        raise InputError(f"sweep {text!r} received; allowed is KEY=VALUE,VALUE,..., such as dt=0.02,0.04.")
    if len(set(given)) < len(given):
        raise InputError(f"sweep {text!r} received; its values must be different.")
    return Axis.of(name.strip(), *given)


def _values_of(value: str) -> list[str]:
    """Return all whole numbers of ``FIRST..LAST``, or the value as it is."""
    if (ends := re.fullmatch(r"(\d{1,9})\.\.(\d{1,9})", value)) is None:
        return [value]
    first, last = int(ends[1]), int(ends[2])
    if not first <= last < first + MOST:
        raise InputError(f"sweep of {value} received; allowed is FIRST..LAST, at most {MOST} whole numbers.")
    return [str(one) for one in range(first, last + 1)]


def parse_axes(texts: Sequence[str], overrides: Sequence[str] = ()) -> list[Axis]:
    """Return the axes of a study; raises ``InputError`` if there is none, or for a key that is given twice."""
    if not texts:
        names = ", ".join(SHORT_NAMES)
        raise InputError(f"no sweep received; give one or more KEY=VALUE,VALUE,...; short names are {names}.")
    axes = [parse_axis(text) for text in texts]
    fixed = {override.partition("=")[0].strip() for override in overrides}
    count = Counter([*(axis.key for axis in axes), *fixed])
    twice = [key for key, times in count.items() if times > 1]
    if twice:
        raise InputError(f"{twice[0]} received twice; it must be swept or set once.")
    return axes


def combinations(case: Path, axes: Sequence[Axis], overrides: Sequence[str] = ()) -> list[Combination]:
    """Return every combination that can be run; see ``swept``."""
    return swept(case, axes, overrides)[0]


def swept(case: Path, axes: Sequence[Axis], overrides: Sequence[str] = ()) -> tuple[list[Combination], list[Refused]]:
    """Return every combination, the last axis varying fastest, and those that are refused.

    Raises ``InputError`` where all are, and for two combinations that are the same run.
    """
    runnable, refused = list[Combination](), list[Refused]()
    for values in product(*(axis.values for axis in axes)):
        settings = dict(zip(axes, values, strict=True))
        try:
            runnable.append(combination(case, settings, overrides))
        except InputError as error:
            named = {axis.name: value for axis, value in settings.items()}
            refused.append(Refused(_named(named), named, "; ".join(str(error).splitlines())))
            if len(refused) == 1:
                first = error
    if not runnable:
        raise first
    for n, one in enumerate(runnable):
        same = next((other for other in runnable[:n] if other.scene == one.scene), None)
        if same:
            raise InputError(f"the combinations {same.name} and {one.name} are the same run; values must be different.")
    return runnable, refused


def _named(values: dict[str, str]) -> str:
    return quote(",".join(f"{key}={value}" for key, value in values.items()), safe=READABLE)


def combination(case: Path, values: dict[Axis, str], overrides: Sequence[str] = ()) -> Combination:
    """Return one combination, validated; raises ``InputError``."""
    changes = (*overrides, *(f"{axis.key}={value}" for axis, value in values.items()))
    named = {axis.name: value for axis, value in values.items()}
    return Combination(_named(named), named, changes, read_case(case, changes))


def marked_combination(case: Path, settings: Sequence[str], overrides: Sequence[str] = ()) -> Combination:
    """Return a combination beside the swept ones from ``KEY=VALUE`` each, keys dotted or short; raises ``InputError``.

    Settings go before overrides of the same key.
    """
    values = {axis: value for axis in map(parse_axis, settings) for value in axis.values}
    one = combination(case, values, overrides)
    return replace(one, name=f"plan,{one.name}")


TIGHTEST = 1e-12  # tolerance; round-off is near
MOST_SNAPSHOTS = 2000


def same_but_numerics(combinations: Iterable[Combination]) -> list[list[Combination]]:
    """Return combinations in groups of scenes that differ in nothing but numerics: a group has one reference."""
    groups: dict[str, list[Combination]] = {}
    for one in combinations:
        groups.setdefault(one.scene.model_dump_json(exclude={"numerics", "output"}), []).append(one)
    return list(groups.values())


def finest(group: Iterable[Combination]) -> Combination:
    """Return the combination with the smallest step, the most cells, the highest orders and the tightest tolerance."""
    return min(group, key=lambda one: _coarseness(one.scene))


def _coarseness(scene: Case) -> tuple[float, ...]:
    numerics = scene.numerics
    order = INTEGRATORS[numerics.integrator].order
    return (numerics.dt or 0.0, scene.cell_size, -numerics.order, -numerics.vertical_order, -order, numerics.tolerance)


def refined(case: Path, coarse: Combination, *, dt: float, name: str) -> Combination:
    """Return a combination refined once more, given its step [s], which the case may leave open."""
    scene, numerics = coarse.scene, coarse.scene.numerics
    if isinstance(scene.tank, BasinTank) and isinstance(scene.tank.layout, MeshFile):
        cells = f"order={min(numerics.order + 1, HIGHEST_ORDER)}"
    else:
        by_size = numerics.cells is None
        cells = f"cell_size={scene.cell_size / 2!r}" if by_size else f"cells={2 * scene.cells}"
    changes = (
        f"numerics.dt={dt / 2!r}",
        f"numerics.{cells}",
        f"numerics.vertical_order={min(numerics.vertical_order + 2, HIGHEST_VERTICAL_ORDER)}",
        f"numerics.tolerance={min(numerics.tolerance, max(numerics.tolerance / 10, TIGHTEST))!r}",
        f"output.surface_every={max(dt, scene.run.duration / MOST_SNAPSHOTS)!r}",
        "output.gauges_every=1",
    )
    overrides = (*coarse.overrides, *changes)
    return replace(coarse, name=name, overrides=overrides, scene=read_case(case, overrides))


CAN_GO_ON = ("killed", "stopped", "failed", "unknown")  # what has broken down would do so again
PARENT_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG of Linux's prctl
LIBC = ctypes.CDLL(None)


class Outcome(NamedTuple):
    """How a run ended.

    Attributes
    ----------
    status
        ``"finished"``; ``"refused"``: it never began, e.g. because dt is unstable; else what its directory says,
        ``"broke down"``, say, and ``"failed"`` where it left none.
    cause
        The run's own sentence if it is not finished.
    again
        Whether it was run now; else it had been finished before.
    """

    status: str
    cause: str = ""
    again: bool = True


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def status_of(directory: Path, combination: Combination) -> str | None:
    """Return how the run of that very scene which a directory holds has ended, or None if it holds no such run."""
    try:
        run = RunDirectory(directory)
    except InputError:
        return None
    scene, files = run.manifest.get("scene"), run.manifest.get("files", {})
    same = scene == combination.scene.model_dump(mode="json") and files == contents(combination.scene)
    return run.status if same else None


class Runner:
    """Runs combinations of a case into folders of ``out``.

    Parameters
    ----------
    at_once
        How many at a time; each on one core.
    yes
        Whether those that need days, or more memory than there is, are run, too.
    """

    def __init__(self, case: Path, out: Path, *, at_once: int, yes: bool = False):
        self._case, self._out, self._at_once = case, out, at_once
        given = {"--no-plots": True, "--yes": yes, "--trust": is_trusting()}
        self._options = [name for name, there in given.items() if there]
        self._directories: dict[str, Path] = {}
        self._processes = set[subprocess.Popen[str]]()

    def directory(self, combination: Combination) -> Path:
        """Return where a combination is run: in a folder of its name, numbered where that holds another scene's run."""
        if (name := combination.name) not in self._directories:
            numbered = OutputPath(self._out / name, numbered=True).candidates
            fitting = (path for path in numbered if not (path / MANIFEST).exists() or status_of(path, combination))
            self._directories[name] = next(fitting)
        return self._directories[name]

    def run(self, combinations: Sequence[Combination]) -> Iterator[tuple[Combination, Outcome]]:
        """Yield each combination as soon as it has ended, those that had been finished before first.

        Raises ``RunError`` after Ctrl-C or SIGTERM, which end the runs between two steps.
        """
        finished = [one for one in combinations if status_of(self.directory(one), one) == "finished"]
        yield from ((one, Outcome("finished", again=False)) for one in finished)
        waiting = [one for one in combinations if one not in finished]
        with ExitStack() as stack:
            stack.enter_context(_termination_as_interrupt())
            pool = stack.enter_context(ThreadPoolExecutor(self._at_once))
            futures = {pool.submit(self._ended, one): one for one in waiting}
            try:
                for future in as_completed(futures):
                    yield futures[future], future.result()
            except BaseException as error:
                pool.shutdown(wait=False, cancel_futures=True)
                for process in tuple(self._processes):
                    process.terminate()
                if isinstance(error, KeyboardInterrupt):
                    raise RunError("interrupted; the same command goes on with the runs that are missing.") from None
                raise

    def _ended(self, combination: Combination) -> Outcome:
        """Run a combination, and return how it has ended: where it failed, by the word that its directory has."""
        outcome = self._run(combination)
        status = status_of(self.directory(combination), combination) if outcome.status == "failed" else None
        return outcome if status in (None, "finished") else outcome._replace(status=status)

    def _run(self, combination: Combination) -> Outcome:
        changes = [word for change in combination.overrides for word in ("--set", change)]
        out = self.directory(combination)
        if status_of(out, combination) in CAN_GO_ON and last_checkpoint(out) is not None:
            outcome = self._called([*changes, "--out", str(out), "--resume"])
            if outcome.status != "refused":
                return outcome  # else its checkpoint is of another version of this program, say
        again = ["--overwrite"] if (out / MANIFEST).exists() else []  # of this very scene, and not finished
        return self._called([*changes, "--out", str(out), *again])

    def _called(self, arguments: Sequence[str]) -> Outcome:
        """Return how a ``wavetank run`` with these arguments has ended."""
        with start_command(["run", str(self._case), *self._options, *arguments]) as process:
            self._processes.add(process)
            _, errors = process.communicate()
            self._processes.discard(process)
        return _outcome(process.returncode, errors)


def start_command(words: Sequence[str]) -> subprocess.Popen[str]:
    """Return a new process of a command of ``wavetank``; on Linux it gets SIGTERM when this process dies."""
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "wavetank", *words],  # no module of the current directory
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
        env={**os.environ, "OMP_NUM_THREADS": "1"},  # without what MPI has set for this process alone
        preexec_fn=_end_with_parent if sys.platform == "linux" else None,
    )


def _end_with_parent() -> None:
    LIBC.prctl(PARENT_DEATH_SIGNAL, signal.SIGTERM)


def _outcome(code: int, errors: str) -> Outcome:
    if code == 0:
        return Outcome("finished")
    lines = [line for line in errors.splitlines() if line.strip()] or [f"ended with code {code}"]
    status = "refused" if code == InputError.exit_code else "failed"
    return Outcome(status, lines[-1].removeprefix("wavetank: "))


@contextmanager
def _termination_as_interrupt() -> Iterator[None]:
    """Let SIGTERM do what Ctrl-C does, so that no run is left behind."""
    former = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, former)
