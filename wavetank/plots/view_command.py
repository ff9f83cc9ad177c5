"""``wavetank view RUN``: the pictures and films of the command line, one after the other."""

import re
from pathlib import Path
from typing import Annotated

import typer

from wavetank.base.console import console
from wavetank.base.errors import InputError
from wavetank.output.directory import RunDirectory
from wavetank.output.files import check_new


def view(
    run: Annotated[Path, typer.Argument(help="run directory", metavar="RUN")],
    time: Annotated[float | None, typer.Option(help="a still at this time [s]; default: at the highest crest")] = None,
    out: Annotated[Path | None, typer.Option(help="the still's file (PNG); default: view.png in RUN")] = None,
    film: Annotated[Path | None, typer.Option(help="a film of the whole run (MP4 or GIF)", metavar="FILE")] = None,
    diagram: Annotated[
        bool, typer.Option("--diagram", help="the space-time diagram, or maps of a basin: surface.png in RUN")
    ] = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="replace files that are there")] = False,
    size: Annotated[str | None, typer.Option(help="of the pictures [pixels]", metavar="WIDTHxHEIGHT")] = None,
) -> None:
    """View a run: a still (the default), a film, a diagram.

    A resumed run removes view.png, view.mp4 and view.gif of its directory; files of other names stay as they are.
    """
    directory, terminal = RunDirectory(run), console()
    check_new(*(file for file in (out, film) if file is not None), overwrite=overwrite)
    given = {} if size is None else {"size": _pixels(size)}
    try:
        from wavetank.plots import view as drawing
    except ImportError as error:
        raise InputError(f"to view a run the package {error.name} is needed: pip install 'wavetank[view]'.") from None
    if time is not None or out is not None or not (film or diagram):
        terminal.print(f"wrote {drawing.still(directory, out or run / 'view.png', t=time, **given)}", highlight=False)
    if film is not None:
        terminal.print(f"wrote {drawing.film(directory, film, console=terminal, **given)}", highlight=False)
    if diagram:
        terminal.print(f"wrote {drawing.diagram(directory)}", highlight=False)


def _pixels(size: str) -> tuple[int, int]:
    """Return width and height of e.g. ``1600x900``; raise ``InputError`` for anything else."""
    if (result := re.fullmatch(r"(\d{1,6})x(\d{1,6})", size)) is None:
        raise InputError(f"size {size!r} received; allowed is WIDTHxHEIGHT in pixels, such as 1600x900.")
    return int(result[1]), int(result[2])
