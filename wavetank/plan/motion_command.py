"""``wavetank motion``: what a case asks of its paddles, and the files that wave boards' controllers read."""

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from wavetank.records.paddle_table import RATES, columns

if TYPE_CHECKING:
    from wavetank.case import Scene
    from wavetank.motions.extent import Extent
    from wavetank.motions.motion import Array

MOST = 10**7  # rows


class Format(StrEnum):
    """How the file is written."""

    CSV = "csv"
    TXT = "txt"


def motion(
    case: Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")],
    out: Annotated[
        Path | None,
        typer.Option(
            help="file to write, never over another; default: the case's name, -paddle.csv; where both walls move, "
            "-far is added to the name of the far one's"
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="rows a second [Hz]", min=1e-3, max=1e6)] = 100.0,
    form: Annotated[
        Format,
        typer.Option("--format", help="csv: t, position, velocity, acceleration; txt: t and position, no names"),
    ] = Format.CSV,
    overrides: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")] = None,
) -> None:
    """Write the paddle's motion as a wave board reads it.

    A case of type "recorded" reads the file back, as its position, and runs the same.
    """
    from mpi4py import MPI

    from wavetank.case.reading import read_case
    from wavetank.console import console
    from wavetank.errors import InputError
    from wavetank.fe.agreed import on_first

    scene = read_case(case, overrides or [])
    moving = [seen for seen in scene.paddles if seen.motion().moves]
    if not moving:
        raise InputError(f"{case}: no paddle moves in it; a wall with a motion is needed.")
    path = Path(f"{case.stem}-paddle.{form}") if out is None else out
    for n, seen in enumerate(moving):
        file = path.with_stem(f"{path.stem}-far") if n else path
        t, told = _times(seen, rate), _told(seen.extent(seen.motion()))
        on_first(MPI.COMM_WORLD, partial(_write, file, seen, t, form, told))
        absorbs = getattr(seen.wall, "absorb", None) is not None
        without = " (without what absorbing adds, which only a run knows)" if absorbs else ""
        whose = f"{seen.key}: " if len(moving) > 1 else ""
        console().print(f"{whose}{told}{without}\nwrote {file}: {t.size} rows, {rate:g} a second", highlight=False)


def _told(needed: "Extent") -> str:
    return f"stroke {needed.stroke:.4g} m, speed {needed.speed:.4g} m/s, acceleration {needed.acceleration:.4g} m/s^2"


def _times(scene: "Scene", rate: float) -> "Array":
    """Return times that cover the run [s], shape (T,), as far as the motion is known."""
    from wavetank.errors import InputError

    rows = int(np.ceil(scene.run.duration * rate * (1 - 1e-12))) + 1
    if rows > MOST:
        raise InputError(f"--rate {rate:g}: must be at most {MOST / scene.run.duration:.4g}, for {MOST} rows.")
    t = np.arange(rows) / rate
    return np.asarray(t[t <= scene.motion().duration])


def _write(path: Path, scene: "Scene", t: "Array", form: Format, told: str) -> None:
    """Write the motion at times [s]; raises ``InputError`` where there is a file, or none can be."""
    from wavetank.errors import InputError
    from wavetank.motions.extent import values

    rates, places = list(RATES) if form is Format.CSV else ["position"], scene.wall.places(scene.tank)
    table = np.column_stack([t, *(values(scene.of_paddle(scene.motion(), name), t) for name in rates)])
    comma, header = (",", ",".join(columns(places))) if form is Format.CSV else (" ", f"# t [s], position [m]; {told}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("xb") as file:
            np.savetxt(file, table, fmt="%.10g", delimiter=comma, header=header, comments="")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror}); --out FILE names another.") from None
