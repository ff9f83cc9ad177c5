"""``wavetank study``, ``calibrate``, ``validate``. Imports are inside the commands, so that this module loads fast."""

from pathlib import Path
from typing import Annotated

import typer

ATLAS = Path("cases/validation/atlas.toml")


def study(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    sweep: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUE,VALUE,...", help="values of a setting; several: all combinations"),
    ] = None,
    reference: Annotated[
        str | None,
        typer.Option(
            metavar="fine|exact|none|RUN",
            help="what errors are measured against; default: fine, or none where only what is modelled is swept",
        ),
    ] = None,
    below: Annotated[
        float | None, typer.Option(min=1e-9, help="count errors of gauges below this frequency [Hz]; default: all")
    ] = None,
    response: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[NAME=]EXPRESSION",
            help="a column: crest, run_up, reflection, or at the gauge named 5 hm0@5, hm0@5/hm0@1 ...",
        ),
    ] = None,
    start: Annotated[float | None, typer.Option(help="evaluate responses from this time on [s]")] = None,
    out: Annotated[Path | None, typer.Option(help="folder; default runs/ and the case's name with -study")] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
    mark: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=VALUE", help="a setting of one more combination, drawn as the plan's choice"),
    ] = None,
    at_once: Annotated[int | None, typer.Option(min=1, help="runs at a time; default: one a core")] = None,
    yes: Annotated[bool, typer.Option("--yes", help="also runs of days, or of more memory than is free")] = False,
) -> None:
    """Run all combinations of some settings: error against cost.

    Each combination is a run in its own process, as many at a time as there are cores. If a key changes the physical
    case, such as a wave height, the results are the highest crest and deepest trough over that key, or each --response;
    for seeds (wall.motion.seed=1..20) means, their confidence, and quantiles. Finished runs are not repeated, and no
    run of another case is replaced. Keys are those of the case, or short: dt, dx, cells, n, p, order, integrator,
    tolerance.
    """
    from mpi4py import MPI

    from wavetank.base.console import console
    from wavetank.base.errors import InputError
    from wavetank.studies.study import run_study

    if MPI.COMM_WORLD.size > 1:
        raise InputError(f"{MPI.COMM_WORLD.size} ranks received; a study starts its runs itself, without mpirun.")
    run_study(
        case,
        sweep or [],
        out=Path("runs") / f"{case.stem}-study" if out is None else out,
        overrides=overrides or [],
        marked=mark or [],
        reference=reference,
        below=below,
        requested=response or [],
        start=start,
        at_once=at_once,
        yes=yes,
        console=console(),
    )


def calibrate(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    out: Annotated[Path | None, typer.Option(help="folder; default runs/, the case's name, -calibration")] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
    most: Annotated[int, typer.Option(min=1, help="runs, at most")] = 10,
    yes: Annotated[bool, typer.Option("--yes", help="also runs of days, or of more memory than is free")] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="replace a calibration of another target there, except its runs")
    ] = False,
) -> None:
    """Find the paddle motion that generates a target wave, by runs.

    The target is the case's [target]: a crest, components at a position, or a record there. Without it the target is
    the crest of focused waves, or the record of a surface, of the motion by linear theory. Each run is corrected by the
    results of earlier ones. No run is deleted: the same command continues.
    """
    from mpi4py import MPI

    from wavetank.base.console import console
    from wavetank.base.errors import InputError
    from wavetank.studies.calibrate.calibration import Calibration

    if MPI.COMM_WORLD.size > 1:
        raise InputError(f"{MPI.COMM_WORLD.size} ranks received; a calibration starts its runs itself, without mpirun.")
    Calibration(
        case,
        out=Path("runs") / f"{case.stem}-calibration" if out is None else out,
        overrides=overrides or [],
        yes=yes,
        overwrite=overwrite,
        console=console(),
    ).execute(most)


def validate(
    sets: Annotated[
        list[str] | None, typer.Argument(help="cases of the atlas; default: all", metavar="[CASE ...]")
    ] = None,
    atlas: Annotated[Path, typer.Option(help="file of the cases and their expected misfits")] = ATLAS,
    out: Annotated[
        Path | None, typer.Option(help="output folder; default runs/validation, with a number if it exists")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace the results of an earlier command")] = False,
) -> None:
    """Run cases of measured waves, and check their misfits.

    Cases whose data are not available are named and omitted. Exit code 1 if a misfit leaves its range.
    """
    from mpi4py import MPI

    from wavetank.base.errors import InputError
    from wavetank.output.files import OutputPath
    from wavetank.studies.validation_page import run_atlas

    if MPI.COMM_WORLD.size > 1:
        raise InputError(f"{MPI.COMM_WORLD.size} ranks received; validate runs without mpirun.")
    run_atlas(sets or [], atlas, OutputPath.of(out, Path("runs/validation"), overwrite=overwrite))
