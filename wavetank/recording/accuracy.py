"""Runs that reach a requested accuracy: planned, certified, and repeated with finer numerics.

A run whose numerical uncertainty exceeds the accuracy is followed by one whose numerics follow from the parts of the
uncertainty (``planning/refinement.py``), at most ``MAX_RUNS`` in all. Each has its run directory. A limit of the CPU
time makes the first run coarser, by the measured time of some steps, and ends the sequence before a run that would
exceed it.
"""

import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from mpi4py import MPI
from rich.console import Console

from wavetank.base.errors import InputError, RunError
from wavetank.case import Case, Numerics
from wavetank.output.directory import LOG
from wavetank.output.files import OutputPath
from wavetank.planning.companion import companion, needs_vertical_companion
from wavetank.planning.cost import needs_of
from wavetank.planning.plan import planned
from wavetank.planning.refinement import MAX_RATIO, finer, refined_grid
from wavetank.planning.requirements import unplanned
from wavetank.planning.resolution import DEFAULT
from wavetank.planning.timing import time_steps
from wavetank.recording import record_run
from wavetank.simulation.build import stability_limit

if TYPE_CHECKING:
    from wavetank.recording.certify import Certificate  # imports xarray, which is slow

MAX_RUNS = 3
COARSE = 2.0  # ratio of cells after a run whose uncertainty is not resolved
COMPANION = 0.65  # CPU time of a companion over that of the run's steps
FIRST = 1 / 3  # predicted error of the first run over the accuracy
MISSING = {"crest": ", or fewer than 16 samples a period", "harmonics": ": too few samples a period"}  # causes
GRID = {"cells", "cell_size", "order", "dt"}  # keys that determine the grid
RATIOS = np.geomspace(1.1, 4.0, 16)  # sizes of cells over those of the plan within a budget


def record_to_accuracy(
    case: Case,
    place: OutputPath,
    *,
    comm: MPI.Comm,
    console: Console,
    budget: float | None = None,
    resume: bool = False,
    **options: Any,
) -> Path:
    """Run a case, until its accuracy is reached if it requests that of a quantity; return the best run's directory.

    Collective. A resumed run is not repeated. Raises the errors of ``record_run``, which takes the other options, and
    ``InputError`` if no run is possible within the budget. A failure of a later run leaves the earlier ones.

    Parameters
    ----------
    case, place
        The case, and the run directory of the first run; later ones have numbers.
    comm, console, resume, options
        As in ``record_run``.
    budget
        Largest CPU time of all runs [s].
    """
    options |= {"comm": comm, "console": console, "resume": resume}
    if resume or case.numerics.accuracy_of is None and budget is None:
        return record_run(case, place, **options)[0]
    if not case.all_gauges:
        raise InputError("--budget: the case needs a gauge, whose uncertainty it limits")
    accuracy, quantity = case.numerics.accuracy or DEFAULT, case.numerics.accuracy_of or "gauges"
    start, results = time.process_time(), list["Certificate"]()
    attempt = case.model_copy(update={"numerics": case.numerics.model_copy(update={"accuracy_of": quantity})})
    if budget is not None:
        attempt = _within(attempt, comm, budget)
    elif unplanned(case) and not case.on_mesh_file and not GRID & case.numerics.model_fields_set:
        with suppress(RunError, InputError), console.status("pilot runs"):
            attempt = _measured_start(attempt, comm, accuracy)
    spent = comm.allreduce(time.process_time() - start)
    while True:
        try:
            _, result = record_run(attempt, place, **options)
        except RunError:
            if results:
                console.print(
                    f"{_stated(results[-1], quantity)}: {results[-1].path}, the last run before", highlight=False
                )
            raise
        assert result is not None
        results.append(result)
        spent += result.cpu
        try:
            numerics = _next_numerics(results, accuracy, quantity, case.numerics)
        except InputError as error:
            outcome = str(error)
            break
        attempt = result.case.model_copy(update={"numerics": numerics})
        cost = result.cpu * _relative_cost(result.case, attempt)
        if budget is not None and spent + cost > budget:
            outcome = f"not reached: a finer run needs about {cost:.2g} CPU s more, the budget is {budget:g} CPU s"
            break
        changes = (
            f"{_stated(result, quantity)} exceeds {100 * accuracy:.3g} %: running with {_changes(result, numerics)}"
        )
        console.print(changes, highlight=False)
        first, overwrite = results[0].path, place.overwrite
        later = first.with_name(f"{first.name}-{len(results) + 1}") if overwrite else first
        place = OutputPath(later, numbered=not overwrite, overwrite=overwrite)
    best = min(results, key=lambda one: one.relative.get(quantity, np.inf))
    lines = [
        f"accuracy of {quantity}, {100 * accuracy:.3g} % requested: {outcome}",
        f"{_stated(best, quantity)}: {best.path}; {spent:.3g} CPU s in all",
    ]
    console.print(*lines, sep="\n", highlight=False)
    if comm.rank == 0:
        with (best.path / LOG).open("a") as file:
            file.writelines(f"{line}\n" for line in lines)
    return best.path


def _measured_start(case: Case, comm: MPI.Comm, accuracy: float) -> Case:
    """Return a case that has no plan with the cells that two pilot runs show for an accuracy; collective."""
    from wavetank.planning.trade import measure_trade  # imports xarray, which is slow

    trade = measure_trade(planned(case, comm).case, comm)
    ratio = float(np.clip(trade.ratio(FIRST * accuracy) or 1.0, 1.0 / MAX_RATIO, max(trade.pilots)))
    return trade.case.model_copy(update={"numerics": trade.numerics(ratio)})


def _next_numerics(results: "Sequence[Certificate]", accuracy: float, quantity: str, requested: Numerics) -> Numerics:
    """Return the numerics of a further run; raises ``InputError`` with the outcome if there is none."""
    last = results[-1]
    if last.reason and not last.coarse:
        raise InputError(f"not resolved, as {last.reason}")
    value = last.relative.get(quantity)
    if not last.coarse and value is None:
        raise InputError(f"not resolved: the records have no {quantity}{MISSING.get(quantity, '')}")
    if value is not None and value <= accuracy:
        raise InputError("reached")
    if len(results) == MAX_RUNS:
        raise InputError(f"not reached in {MAX_RUNS} runs")
    if value is None:
        if named := [key for key in ("cells", "cell_size") if key in requested.model_fields_set]:
            raise InputError(f"not resolved, as {last.reason}; numerics.{named[0]} must be left out")
        numerics = refined_grid(last.case, last.dt, COARSE)
    else:
        parts = {name: value * part for name, part in last.parts.items()}
        numerics = finer(last.case, last.dt, parts, accuracy, requested)
    return numerics.model_copy(update={"accuracy": None})


def _stated(result: "Certificate", quantity: str) -> str:
    value = result.relative.get(quantity)
    return "an uncertainty that is not resolved" if value is None else f"an uncertainty of {100 * value:.2g} % (95 %)"


def _changes(result: "Certificate", numerics: Numerics) -> str:
    """Return the changed numerics."""
    before = result.case.numerics.model_copy(update={"dt": result.dt})
    keys = ("cells", "cell_size", "order", "vertical_order", "dt", "tolerance")
    changed = {key: getattr(numerics, key) for key in keys if getattr(numerics, key) != getattr(before, key)}
    return ", ".join(f"{key} = {value:.4g}" for key, value in changed.items() if value is not None)


def _relative_cost(case: Case, other: Case) -> float:
    """Return the cost of a run over that of another one, by the table of costs."""
    one, two = needs_of(case, 1), needs_of(other, 1)
    return two.cpu / one.cpu


def _within(case: Case, comm: MPI.Comm, budget: float) -> Case:
    """Return a case whose run and companion need at most a CPU time [s], by the time of its first steps; collective."""
    chosen = planned(case, comm).case
    run, waves, clock, step, _, below = time_steps(chosen, comm)
    limit = stability_limit(chosen, run.integrator) / waves.largest_frequency
    companions = COMPANION * (1 + needs_vertical_companion(chosen))
    needed = (1.0 + companions) * (clock.steps * step + below) * comm.size
    if needed <= budget:
        return case
    if named := [f"numerics.{key}" for key in ("cells", "cell_size", "dt") if key in case.numerics.model_fields_set]:
        raise InputError(f"--budget {budget:g}: the run needs about {needed:.2g} CPU s with {' and '.join(named)}")
    for ratio in RATIOS:
        coarse = chosen.model_copy(update={"numerics": companion(chosen, clock.dt, limit, ratio).numerics})
        least = needed * _relative_cost(chosen, coarse)
        if least <= budget:
            return coarse
    raise InputError(f"--budget {budget:g}: the coarsest run needs about {least:.2g} CPU s, with its companion")
