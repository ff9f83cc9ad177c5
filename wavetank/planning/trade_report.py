"""The report of ``wavetank plan --trade``: a table and a picture of the error over the CPU time."""

import time
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI
from rich.table import Table

from wavetank.base.console import console
from wavetank.base.errors import InputError
from wavetank.base.mpi import on_first
from wavetank.case.reading import located, read_case
from wavetank.planning.plan import planned
from wavetank.planning.trade import Trade, measure_trade
from wavetank.plots.style import BLUE, GREY, INK, VERMILION, entry, number_logarithms, picture

ACCURACIES = 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4
RATIOS = 0.34, 4.0  # sizes of cells over the planned size
DECADE = 10.0
PICTURES = ".png", ".pdf", ".svg"


def report_trade(path: Path, overrides: list[str], out: Path | None) -> None:
    """Print the trade of a case, and draw it into a file that must not exist; collective."""
    comm, terminal, start = MPI.COMM_WORLD, console(), time.process_time()
    file = Path(f"{path.stem}-trade.png") if out is None else out
    on_first(comm, partial(_check_picture, file))
    case = read_case(path, overrides)
    with located(path, overrides), terminal.status("pilot runs"):
        trade = measure_trade(planned(case, comm).case, comm)
    spent = comm.allreduce(time.process_time() - start)
    name, error = case.title or path.stem, trade.error(1.0)
    sizes = " and ".join(f"{ratio * trade.case.cell_size:.3g} m" for ratio in trade.pilots)
    best, tenth = trade.best_setting, trade.ratio(error / DECADE)
    parts = ", ".join(f"{one.name} {_percent(one.error)}" for one in trade.settings)
    further = f"a tenth of this error: {trade.cost(tenth) / trade.cost(1.0):.2g} times the CPU time" if tenth else ""
    lines = (
        f"{name}: error of the elevation, by runs on cells of {sizes} ({spent:.2g} CPU s)",
        _table(trade),
        *(f"not used, runs on cells of {one}" for one in trade.failed),
        f"the case: {_percent(error)}, {trade.cost(1.0):.2g} CPU s; {further or 'cells do not give a tenth of it'}",
        f"parts of its error: {parts}",
        f"pays most: {best.name}; half of its part for {best.factor:.2f} times the CPU time",
    )
    for line in lines:
        terminal.print(line, highlight=False)
    on_first(comm, partial(trade_figure, trade, file, name))
    terminal.print(f"wrote {file}", highlight=False)


def _check_picture(file: Path) -> None:
    """Raise ``InputError`` unless a picture can be written, where there is no file."""
    if file.suffix not in PICTURES:
        raise InputError(f"--out {file}: must end in {', '.join(PICTURES)}.")
    if file.exists() or not file.absolute().parent.is_dir():
        why = "is there already" if file.exists() else "its folder does not exist"
        raise InputError(f"--out {file}: {why}; give another name.")


def _percent(error: float) -> str:
    return f"{100 * error:.2g} %"


def _table(trade: Trade) -> Table:
    """Return the numerics of accuracies within ``RATIOS``, and those of the case."""
    table = Table("error", "cells", "dx [m]", "dt [s]", "CPU time of a rank [s]")
    errors = sorted((*(one for one in ACCURACIES if _within(trade.ratio(one))), trade.error(1.0)), reverse=True)
    for error in errors:
        ratio = 1.0 if error == trade.error(1.0) else trade.ratio(error)
        numerics, label = trade.numerics(ratio), "the case: " if ratio == 1.0 else ""
        tank = trade.case.tank
        size = tank.length / numerics.cells if numerics.cells else numerics.cell_size_in(tank)
        cells = "" if numerics.cells is None else str(numerics.cells)
        table.add_row(
            f"{label}{_percent(error)}", cells, f"{size:.4g}", f"{numerics.dt:.4g}", f"{trade.cost(ratio):.2g}"
        )
    return table


def _within(ratio: float) -> bool:
    return RATIOS[0] <= ratio <= RATIOS[1]


def trade_figure(trade: Trade, path: Path, title: str) -> None:
    """Draw the error over the CPU time, with the case, the pilot runs and some accuracies."""
    with picture(path, 7, 5, title=title) as figure:
        axes = figure.subplots()
        ratios = np.geomspace(*RATIOS, 60)
        axes.loglog([trade.cost(one) for one in ratios], [trade.error(one) for one in ratios], color=BLUE)
        for accuracy in (one for one in ACCURACIES if _within(trade.ratio(one))):
            ratio = trade.ratio(accuracy)
            numerics, place = trade.numerics(ratio), (trade.cost(ratio), accuracy)
            size = f"{ratio * trade.case.cell_size:.2g} m" if numerics.cells is None else f"{numerics.cells} cells"
            axes.plot(*place, "o", color=BLUE, ms=4)
            axes.annotate(f"{_percent(accuracy)}: {size}", place, (6, 3), textcoords="offset points", fontsize=8)
        pilots = [(trade.cost(one), trade.error(one)) for one in trade.pilots]
        axes.plot(*np.transpose(pilots), "s", mfc="white", mec=INK, ms=6)
        axes.plot(trade.cost(1.0), trade.error(1.0), "*", color=VERMILION, ms=14)
        axes.set(xlabel="CPU time of the run [s]", ylabel="error of the elevation, rms over rms [-]")
        number_logarithms(axes.xaxis)
        marks = (
            entry("prediction", color=BLUE),
            entry("pilot runs", marker="s", mfc="white", mec=INK, ls=""),
            entry("the case", marker="*", color=VERMILION, ms=12, ls=""),
        )
        axes.legend(handles=marks, loc="lower left", labelcolor=GREY)
