"""The surface from which a run could not go on: how high, how steep, how fast, and where that is most."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from wavetank.output.directory import BROKEN_PICTURE, RunDirectory
from wavetank.plots.style import CM, COMPUTED, INK, ORANGE, VERMILION, picture

Columns = dict[str, NDArray[np.float64]]
LABELS = {"elevation": "elevation [cm]", "slope": "slope [-]", "velocity": "velocity u [m/s]"}
AROUND, NEAR = 20.0, 0.1  # waves' heights, at most, and parts of the tank shown enlarged on either side of a place
PANEL = 3e4  # points² that cells of a basin fill
STEEPEST = 0.58  # slope of the steepest progressive wave


def broken_figure(run: RunDirectory) -> Path:
    """Draw the surface of a run that broke down, ``broken.png``; return its path.

    Of a slice or ring whole and around its steepest place, of a basin from above. Raises ``InputError`` where none is
    kept.
    """
    columns, told = run.broken(), run.manifest["broke_down"]
    path = run.path / BROKEN_PICTURE
    steepest, basin = told["steepest"], "y" in columns
    with picture(path, 11, 8.5) as figure:
        panels = figure.subplots(3, 2, sharex="col", width_ratios=(2, 1) if not basin else (1, 1), squeeze=False)
        for row, name in zip(panels, LABELS, strict=True):
            values = columns[name] * (CM if name == "elevation" else 1.0)
            (_draw_map if basin else _draw_profile)(row, columns, values, LABELS[name], steepest)
        if not basin:
            _mark(panels, told["crests"], steepest)
        what = f"{run.title}: " if run.title else ""
        where = f"x = {steepest['x']:.4g} m" + (f", y = {steepest['y']:.4g} m" if basin else "")
        figure.suptitle(
            f"{what}t = {told['t']:.5g} s, from where the run could not go on\n"
            f"steepest at {where}: slope {steepest['slope']:.2g}, u = {steepest['velocity']:.3g} m/s",
            fontsize=12,
            parse_math=False,
        )
    return path


def _draw_profile(
    row: NDArray[Any], columns: Columns, values: NDArray[np.float64], label: str, steepest: dict[str, float]
) -> None:
    whole, near = row
    x = columns["x"]
    half = min(AROUND * float(np.ptp(columns["elevation"])), NEAR * float(np.ptp(x)))
    there = np.abs(x - steepest["x"]) <= half
    for axes, part in ((whole, slice(None)), (near, there)):
        axes.plot(x[part], values[part], color=COMPUTED, lw=1.2, marker="." if part is there else "", ms=3)
        axes.axvline(steepest["x"], color=VERMILION, lw=0.8)
        axes.margins(x=0)
    if label == LABELS["slope"]:
        for axes in row:
            axes.axhline(STEEPEST, color=INK, lw=0.8, ls=":")
    whole.set_ylabel(label)


def _mark(panels: NDArray[Any], crests: list[dict[str, float]], steepest: dict[str, float]) -> None:
    """Write u/c at the steep crests, and what is what."""
    elevation: Axes = panels[0, 0]
    for crest in crests:
        for axes in panels[0]:
            axes.axvline(crest["x"], color=ORANGE, lw=0.8, ls="--")
        text, at = f"u/c = {crest['speed_ratio']:.2f}", ("data", "axes fraction")
        elevation.annotate(text, (crest["x"], 0.97), xycoords=at, color=ORANGE, fontsize=8, rotation=90, va="top")
    panels[0, 0].set_title("whole", fontsize=10)
    panels[0, 1].set_title("around the steepest place", fontsize=10, color=VERMILION)
    panels[1, 1].set_title("dotted: the steepest progressive wave", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("x [m]")


def _draw_map(
    row: NDArray[Any], columns: Columns, values: NDArray[np.float64], label: str, steepest: dict[str, float]
) -> None:
    """Draw the cells from above, and those around the steepest."""
    whole, near = row
    x, y = columns["x"], columns["y"]
    half = NEAR * max(float(np.ptp(x)), float(np.ptp(y)))
    there = (np.abs(x - steepest["x"]) <= half) & (np.abs(y - steepest["y"]) <= half)
    limits = {"vmin": float(values.min()), "vmax": float(values.max())}
    for axes, part in ((whole, np.ones_like(there)), (near, there)):
        size = PANEL / int(part.sum())
        shown = axes.scatter(x[part], y[part], c=values[part], s=size, marker="s", cmap="viridis", lw=0, **limits)
        axes.plot(steepest["x"], steepest["y"], "o", ms=12, mfc="none", mec=VERMILION)
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(False)
    whole.figure.colorbar(shown, ax=list(row), label=label)
    whole.set_ylabel("y [m]")
    if label == LABELS["velocity"]:
        for axes in row:
            axes.set_xlabel("x [m]")
