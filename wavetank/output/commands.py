"""``wavetank status`` and ``wavetank export``, which read run directories only."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from wavetank.base.console import console
from wavetank.base.errors import InputError, write_errors
from wavetank.output.directory import RunDirectory
from wavetank.output.files import OutputPath
from wavetank.output.status import runs, status_line


def status(
    paths: Annotated[
        list[Path] | None,
        typer.Argument(help="run directories, or folders of some; default runs/", metavar="RUN...", readable=False),
    ] = None,
) -> None:
    """Print the status of runs: progress, speed, cause of failure.

    It is read from their directories, during and after the runs, also on other machines.
    """
    terminal = console()
    for path in runs(paths or [Path("runs")]):
        terminal.print(status_line(path), highlight=False)


class Program(StrEnum):
    """A program that reads the files."""

    OPENFAST = "openfast"
    OPENFOAM = "openfoam"


def export(
    run: Annotated[Path, typer.Argument(help="run directory", metavar="RUN", readable=False)],
    windows: Annotated[
        list[str], typer.Argument(help="name of a window; for a grid of OpenFAST several", metavar="WINDOW...")
    ],
    program: Annotated[Program, typer.Option("--to", help="program that reads the files")],
    out: Annotated[
        Path | None, typer.Option(help="folder; default: next to the run, RUN-WINDOW-PROGRAM, numbered if it exists")
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace files that are there")] = False,
    every: Annotated[
        float | None, typer.Option(metavar="SECONDS", help="interval of the rows; default: that of the window")
    ] = None,
    width: Annotated[
        float | None,
        typer.Option(help="width of a slice [m]; default 1, of OpenFAST the length of the window", min=1e-6),
    ] = None,
    patch: Annotated[str, typer.Option(help="OpenFOAM: name of the patch")] = "inlet",
    spacing: Annotated[
        float | None, typer.Option(help="OpenFOAM: height of the cells at the surface, or less [m]; needed", min=1e-6)
    ] = None,
    origin: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="OpenFOAM: origin of the coordinates in the tank [m]")
    ] = "0,0,0",
) -> None:
    """Export a window of a run to OpenFAST or OpenFOAM.

    OpenFAST: external waves of SeaState, WaveMod 5 and 6, from columns along x. OpenFOAM: tables of
    timeVaryingMappedFixedValue for a patch. Each folder has a text file with the settings of the program.
    """
    from wavetank.output.openfast import check_kinematics, seastate_grid, write_openfast
    from wavetank.output.openfoam import patch_of, write_openfoam
    from wavetank.output.water_columns import water_columns

    if program == Program.OPENFOAM and len(windows) > 1:
        one = "allowed is one window, as several can have points at equal places"
        raise InputError(f"{len(windows)} windows received; a patch of openfoam: {one}.")
    columns = water_columns(RunDirectory(run), windows, every)
    name = windows[0]
    path = run if run.name.strip(".") else run.resolve()  # . and .. have no name
    default = path.with_name(f"{path.name}-{name}-{program}")
    place = OutputPath.of(out, default, overwrite=overwrite)
    if program == Program.OPENFAST:
        grid = None
        if len(columns.x) > 1:
            grid = seastate_grid(columns, width)
            check_kinematics(columns)
        with write_errors(folder := place.folder()):
            files = write_openfast(folder, name, columns, grid)
    else:
        if not patch.replace("-", "").replace("_", "").isalnum():
            raise InputError(f"--patch {patch!r} received; allowed are letters, digits, - and _.")
        if spacing is None:
            raise InputError(
                "--spacing: needed by openfoam; allowed is at most the height of the cells at the surface."
            )
        plane = patch_of(columns, patch, spacing=spacing, width=width, origin=_point(origin))
        with write_errors(folder := place.folder()):
            files = write_openfoam(folder, columns, plane)
    rows = f"{len(columns.elevation)} rows, one every {columns.dt:.6g} s; time 0 is {columns.begin:.6g} s of the run"
    console().print(f"{rows}\nwrote {', '.join(map(str, files))}", highlight=False, markup=False)


def _point(text: str) -> tuple[float, float, float]:
    """Return the coordinates in a text [m]; raise ``InputError`` for other texts."""
    try:
        x, y, z = map(float, text.split(","))
        return x, y, z
    except ValueError:
        raise InputError(f"--origin {text!r} received; allowed is X,Y,Z in m: 3,0,-0.5.") from None
