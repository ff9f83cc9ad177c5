"""``wavetank plan`` and ``wavetank motion``. Imports are inside the commands, so that this module loads fast."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

Case = Annotated[Path, typer.Argument(help="case file (TOML)", metavar="CASE")]
Overrides = Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="change the case")]


class Format(StrEnum):
    """The format of a motion file."""

    CSV = "csv"
    TXT = "txt"


def plan(
    case: Case,
    accuracy: Annotated[
        float | None,
        typer.Option(help="relative error of the elevation; default: the case's numerics.accuracy, or 0.01"),
    ] = None,
    trade: Annotated[
        bool, typer.Option("--trade", help="measure error over CPU time with pilot runs on other cells, and draw it")
    ] = False,
    out: Annotated[
        Path | None, typer.Option(help="file of the picture (--trade), never over another; default: CASE-trade.png")
    ] = None,
    overrides: Overrides = None,
) -> None:
    """Print what a case requires, and the cheapest numerics for it.

    Numerics that a case sets together with numerics.accuracy are not replaced. Without numerics.accuracy, the numerics
    of the case are compared with the proposed ones. A case that sets no numerics runs with the plan. For basins, tanks
    over a bed and initial states by formula there is no plan: some steps are run, also under mpirun, and timed.
    """
    from wavetank.base.errors import InputError
    from wavetank.planning.report import report
    from wavetank.planning.trade_report import report_trade

    if trade and accuracy is not None:
        raise InputError("--trade and --accuracy exclude each other: it has several accuracies")
    if out is not None and not trade:
        raise InputError("--out: needs --trade, whose picture it names")
    if trade:
        report_trade(case, overrides or [], out)
    else:
        report(case, accuracy, overrides or [])


def motion(
    case: Case,
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
    ramp_down: Annotated[
        bool, typer.Option("--ramp-down/--no-ramp-down", help="add rows after the run until the paddle is at rest")
    ] = True,
    overrides: Overrides = None,
) -> None:
    """Write the paddle motion as a file for a wave board.

    A motion of type "recorded" reads the file as its position and gives the same run. The CSV file of a flap also has
    its angle and the height above the bed of the position.
    """
    from wavetank.planning.motion_file import write_motion

    write_motion(case, out, rate, form, overrides or [], ramp_down=ramp_down)
