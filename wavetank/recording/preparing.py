"""Preparation of a run with its diagnostics: planned, checked and built before any file is written."""

from typing import Any

from mpi4py import MPI

from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.output.fields import VtuSeries
from wavetank.output.files import RunLog
from wavetank.output.writer import RunWriter
from wavetank.planning.checks import run_warnings
from wavetank.planning.cost import check_affordable
from wavetank.planning.plan import planned
from wavetank.planning.resolution import check_stable
from wavetank.recording.log import RecordedRun, Warnings, case_content
from wavetank.recording.restart import Restart
from wavetank.simulation.build import build_run
from wavetank.simulation.case_diagnostics import build_observers, build_watch, surface_points
from wavetank.simulation.monitoring import BreakingNews
from wavetank.simulation.own import Observers, called, own_observers
from wavetank.simulation.records import Memory, records_of
from wavetank.simulation.summary import Parts
from wavetank.tank.breaking import BreakingDissipation


def prepare(
    requested: Case,
    comm: MPI.Comm,
    writer: RunWriter | None,
    *,
    log: RunLog,
    warnings: Warnings,
    content: dict[str, Any],
    start_time: float,
    integrator: Integrator[Any] | None,
    observers: Observers,
    restart: Restart | None,
    accept_cost: bool,
) -> RecordedRun:
    """Return a new or resumed run with its diagnostics; collective.

    Raises ``InputError`` for a case that cannot be run.

    Parameters
    ----------
    requested, comm
        The case, and the communicator.
    writer, log, warnings, content
        See ``RecordedRun``; planned water and numerics are added to the content.
    start_time
        Start of the preparation, ``time.monotonic`` [s].
    integrator
        Integrator in place of the case's.
    observers
        Functions of the waves that return a user's observer.
    restart
        Restart of a resumed run, or None.
    accept_cost
        Whether a run of days, or one that needs more memory than available, is accepted.
    """
    case, plan_warnings = restart.planned(requested) if restart else planned(requested, comm)
    if not accept_cost:
        check_affordable(case, comm)
    check_stable(case, integrator or INTEGRATORS[case.numerics.integrator](), comm)
    run, waves = build_run(case, comm, integrator, beginning=restart.beginning if restart else None)
    accuracy = requested.numerics.accuracy
    for warning in (*plan_warnings, *run_warnings(case, run.clock, waves, own=integrator, accuracy=accuracy)):
        warnings.add(warning)
    chosen = {key: case_content(case, integrator)[key] for key in ("water", "numerics")}
    if any(content["case"][key] != value for key, value in chosen.items()):
        content["planned"] = chosen
    out, series = comm.bcast(writer and writer.path), dict[str, VtuSeries]()

    def fields(name: str) -> VtuSeries:
        series[name] = VtuSeries(out, name, comm=comm)
        return series[name]

    records = records_of(case, waves.plane, writer)._replace(fields=fields)
    run.diagnostics += build_observers(case, waves, records, sinks=run.sinks)
    surface = Memory()
    run.diagnostics += surface_points(case, waves, surface)
    run.diagnostics += build_watch(run, waves, warnings.at_once)
    run.diagnostics += [BreakingNews(one, log.say) for one in run.filters if isinstance(one, BreakingDissipation)]
    of_user = own_observers(observers, waves)
    run.diagnostics += of_user
    if of_user and case.absorbing:
        run.longest_block = 1  # observers may evaluate the waves, whose feedback motions are those of the last step
    names = [*map(called, observers)]
    if restart:
        log.say(restart.restore(run, waves, case=case, fields=series))
        restart.warn_of_missing_observers(names)
    earlier, counters_continue = (restart.about["parts"], restart.counters_continue) if restart else ([], False)
    parts = Parts(run, waves, start_time=start_time, earlier=earlier, counters_continue=counters_continue)
    return RecordedRun(requested, case, run, waves, parts, series, writer, log, warnings, content, names, surface, out)
