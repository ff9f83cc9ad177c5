"""A run that is planned, checked and built, before anything is written."""

from typing import Any

from mpi4py import MPI

from wavetank.case import Case
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.planning.checks import run_warnings
from wavetank.planning.cost import check_affordable
from wavetank.planning.default_plan import planned
from wavetank.planning.resolution import check_stable
from wavetank.recording.log import Warnings
from wavetank.recording.restart import Restart
from wavetank.simulation.build import build_run
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.run import Run


def prepared(
    requested: Case,
    comm: MPI.Comm,
    *,
    warnings: Warnings,
    integrator: Integrator[Any] | None,
    restart: Restart | None,
    unasked: bool,
) -> tuple[Case, Case, Run, AnyWaves]:
    """Return the case as requested and with its numerics, its run and its waves; collective.

    Raises ``InputError`` for a case that cannot run.

    Parameters
    ----------
    requested, comm
        The case, and the ranks.
    warnings
        Where warnings go.
    integrator
        In place of the case's.
    restart
        The restart of a run that is resumed.
    unasked
        Whether a run that takes days, or more memory than there is, is accepted.
    """
    scene, plan_warnings = restart.planned(requested) if restart else planned(requested, comm)
    if not unasked:
        check_affordable(scene, comm)
    check_stable(scene, integrator or INTEGRATORS[scene.numerics.integrator](), comm)
    run, waves = build_run(scene, comm, integrator, beginning=restart.beginning if restart else None)
    accuracy = requested.numerics.accuracy
    for warning in (*plan_warnings, *run_warnings(scene, run.clock, waves, own=integrator, accuracy=accuracy)):
        warnings.add(warning)
    return requested, scene, run, waves
