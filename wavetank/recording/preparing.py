"""The stored case of a run, and a run that is planned, checked and built before anything is written."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from wavetank.base.errors import InputError
from wavetank.case import Case
from wavetank.case.reading import changed_case
from wavetank.integrators import INTEGRATORS
from wavetank.integrators.contract import Integrator
from wavetank.output.directory import RunDirectory
from wavetank.output.manifest import MANIFEST
from wavetank.planning.checks import run_warnings
from wavetank.planning.cost import check_affordable
from wavetank.planning.plan import planned
from wavetank.planning.resolution import check_stable
from wavetank.recording.log import Warnings
from wavetank.recording.restart import Restart
from wavetank.simulation.build import build_run
from wavetank.simulation.construction import AnyWaves
from wavetank.simulation.run import Run

SIZES = {"cells": "cell_size", "cell_size": "cells"}  # of which there is one


def prepared(
    requested: Case,
    comm: MPI.Comm,
    *,
    warnings: Warnings,
    integrator: Integrator[Any] | None,
    restart: Restart | None,
    unasked: bool,
) -> tuple[Case, Run, AnyWaves]:
    """Return the case with its numerics, its run and its waves; collective.

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
    return scene, run, waves


def stored_scene(run: Path | str, changes: Sequence[str] = (), *, extend: float | None = None) -> Case:
    """Return the scene stored in a run directory, with ``KEY=VALUE`` changes, longer by ``extend`` [s].

    Raises ``InputError`` where none is, and for a scene that cannot be.
    """
    directory = RunDirectory(run)
    content = directory.manifest.get("scene")
    if not isinstance(content, dict) or not isinstance(content.get("run"), dict):
        raise InputError(f"{directory.path}: its {MANIFEST} tells no scene to go on with.")
    if extend is not None:
        if not extend > 0:
            raise InputError(f"--extend {extend:g} received; must be more than 0 s.")
        if any(change.partition("=")[0].strip() == "run.duration" for change in changes):
            raise InputError("--extend and run.duration: give one of them; the one is added, the other is all of it.")
        changes = [*changes, f"run.duration={float(content['run']['duration']) + extend!r}"]
    content = _without_none(content)
    for key, other in SIZES.items():
        if any(change.partition("=")[0].strip() == f"numerics.{key}" for change in changes):
            content.get("numerics", {}).pop(other, None)
    return changed_case(directory.path / MANIFEST, content, changes)


def _without_none(content: dict[str, Any]) -> dict[str, Any]:
    """Return the content of a scene without keys whose value is None."""
    items = ((key, _without_none(value) if isinstance(value, dict) else value) for key, value in content.items())
    return {key: value for key, value in items if value is not None}
