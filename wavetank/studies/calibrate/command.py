"""``wavetank calibrate``: light to import; what it needs is loaded when it is called."""

from pathlib import Path
from typing import Annotated

import typer


def calibrate(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    out: Annotated[Path | None, typer.Option(help="folder; default runs/, the case's name, -calibration")] = None,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
    most: Annotated[int, typer.Option(min=1, help="runs, at most")] = 10,
    yes: Annotated[bool, typer.Option("--yes", help="also runs of days, or of more memory than there is")] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="replace another target's calibration there, but for its runs")
    ] = False,
) -> None:
    """Find the paddle's motion for a wanted wave, by runs.

    What is wanted is the case's [target]: a crest, components at a place, or a record there; without one the crest of
    focused waves, or the record of a surface, that its motion means by linear theory. Runs, each corrected by what the
    ones before came to, are kept: the same command goes on.
    """
    from mpi4py import MPI

    from wavetank.console import console
    from wavetank.errors import InputError
    from wavetank.studies.calibrate.calibration import Calibration

    if MPI.COMM_WORLD.size > 1:
        raise InputError(f"{MPI.COMM_WORLD.size} ranks received; a calibration starts its runs itself, without mpirun.")
    Calibration(
        case,
        out=Path("runs") / f"{case.stem}-calibration" if out is None else out,
        overrides=overrides or [],
        most=most,
        yes=yes,
        overwrite=overwrite,
        console=console(),
    ).execute()
