"""Diagnostics of a run: those of its case, and those of a user."""

from collections.abc import Callable, Sequence

from wavetank.case import Case
from wavetank.output.fields import VtuSeries
from wavetank.output.files import RunLog
from wavetank.output.writer import RunWriter
from wavetank.recording.log import (
    Warnings,
)
from wavetank.simulation.case_diagnostics import build_observers, build_watch
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.contract import Diagnostic
from wavetank.simulation.monitoring import BreakingNews
from wavetank.simulation.own import own_observers
from wavetank.simulation.records import DeferredErrors, RecordCheck, records_of
from wavetank.simulation.run import Run
from wavetank.tank.breaking import BreakingDissipation

Observers = Sequence[Callable[[AnyWaves], Diagnostic]]
"""Functions of the waves that return a user's diagnostics."""


def add_diagnostics(
    run: Run,
    scene: Case,
    waves: AnyWaves,
    writer: RunWriter | None,
    *,
    warnings: Warnings,
    log: RunLog,
    observers: Observers,
) -> dict[str, VtuSeries]:
    """Add diagnostics to a run, and return the series of fields that they write; collective.

    Parameters
    ----------
    run, scene, waves, writer
        The run, its case and waves, and its writer on the first rank.
    warnings, log
        Where warnings and messages go.
    observers
        Functions of the waves that return a user's diagnostics.
    """
    comm, out = waves.plane.comm, waves.plane.comm.bcast(None if writer is None else writer.path)
    series: dict[str, VtuSeries] = {}

    def fields(name: str) -> VtuSeries:
        series[name] = VtuSeries(out, name, comm=comm)
        return series[name]

    records = records_of(scene, waves.plane.mesh.topology.dim, writer)
    run.diagnostics += build_observers(scene, waves, records._replace(fields=fields), sinks=run.sinks)
    parts = (*records, *records.paddles, *records.windows)
    run.diagnostics.append(RecordCheck(comm, [one for one in parts if isinstance(one, DeferredErrors)]))
    run.diagnostics += build_watch(scene, run, waves, warnings.at_once)
    run.diagnostics += [BreakingNews(one, log.say) for one in run.filters if isinstance(one, BreakingDissipation)]
    of_user = own_observers(observers, waves)
    run.diagnostics += of_user
    if of_user and scene.absorbing:
        run.longest_block = 1  # they may evaluate the waves, whose paddles with feedback move as in the last step
    return series
