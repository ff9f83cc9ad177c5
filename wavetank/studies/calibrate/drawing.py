"""The picture of an attempt: what is wanted and what was found, what the paddle was told, how the misfit went."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from wavetank.plots.style import BLUE, CM, GREY, INK, PALE_GREY, VERMILION, number_logarithms, picture
from wavetank.studies.calibrate.aim import Aim, Tried
from wavetank.studies.calibrate.waves import scale
from wavetank.waves.plane_waves import PlaneWaves

PERIODS = 6.0  # shown on either side of a crest
LINE = 70  # characters
BELOW: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 2}  # the panel: waves fill it


def draw(tried: Sequence[Tried], aim: Aim, path: Path, *, shown: Tried, title: str) -> None:
    """Draw one of the attempts, and the misfits of all."""
    with picture(path, 13.0, 4.2) as figure:
        records, spectrum, misfits = figure.subplots(1, 3, width_ratios=(2.2, 1.2, 1.0))
        _draw_records(records, shown, aim)
        _draw_spectrum(spectrum, aim.waves(shown.setting), aim.waves(aim.start))
        _draw_misfits(misfits, tried)
        figure.suptitle(f"{title}{': ' if title else ''}attempt {shown.number}", fontsize=12, parse_math=False)


def _draw_records(panel: Axes, one: Tried, aim: Aim) -> None:
    """Draw the elevation where the target is, and what is wanted of it."""
    wanted, alone = aim.wanted, aim.wanted.t.size == 1
    look = {"ls": "", "marker": "o", "ms": 9, "mfc": "none", "mew": 1.8} if alone else {"lw": 2.4}
    panel.plot(wanted.t, CM * wanted.eta, color=VERMILION if alone else PALE_GREY, label="wanted", **look)
    if not one.cause:
        panel.plot(one.found.elevation.t, CM * one.found.elevation.eta, color=BLUE, label="found")
    else:
        panel.axhline(0.0, color=GREY, lw=0.8)
        why = panel.text(0.02, 0.5, fill(one.cause, LINE), transform=panel.transAxes, va="center", fontsize=9)
        why.set_in_layout(False)
    if alone:
        half = PERIODS * scale(aim.waves(one.setting)).period
        last = np.inf if one.cause else one.found.elevation.t[-1]
        panel.set_xlim(max(0.0, wanted.t[0] - half), min(wanted.t[0] + half, last))
    highest = f"; the highest crest is at {one.found.x:.4g} m" if alone and not one.cause else ""
    panel.set(xlabel="t [s]", ylabel="elevation [cm]", title=f"at x = {aim.x:g} m{highest}")
    panel.legend(**BELOW)


def _draw_spectrum(panel: Axes, waves: PlaneWaves, first: PlaneWaves) -> None:
    """Draw amplitudes of what the paddle is told."""
    for one, colour, label in ((first, PALE_GREY, "at first"), (waves, INK, "now")):
        panel.plot(one.omega / (2 * np.pi), 1e3 * np.abs(one.amplitudes), color=colour, label=label)
    panel.set(xlabel="f [Hz]", ylabel="amplitude of components [mm]", title="what the paddle is told to make")
    panel.legend(**BELOW)


def _draw_misfits(panel: Axes, tried: Sequence[Tried]) -> None:
    """Draw the misfits so far; the line is where the target is reached."""
    numbers, misfits = [one.number for one in tried], np.array([one.found.misfit for one in tried])
    misfits[np.isinf(misfits)] = np.nan
    panel.plot(numbers, misfits, "-", color=BLUE)
    for numerics, face in dict.fromkeys((one.numerics, "white" if one.numerics == "cheap" else BLUE) for one in tried):
        these = [one.numerics == numerics for one in tried]
        marks = np.where(these, misfits, np.nan)
        panel.plot(numbers, marks, "o", color=BLUE, mfc=face, label=f"{numerics} numerics")
    if broken := [one.number for one in tried if one.cause]:
        (crosses,) = panel.plot(broken, np.ones(len(broken)), "x", color=VERMILION, mew=1.8, label="broke down")
        crosses.set(transform=panel.get_xaxis_transform(), clip_on=False)
    panel.axhline(1.0, color=GREY, lw=0.8, ls="--")
    panel.set(xlabel="attempt", title="misfit, of what is allowed", yscale="log")
    panel.set_xticks(numbers)
    panel.set_xlim(0.7, numbers[-1] + 0.3)
    panel.set_ylim(*(np.nanmin(np.append(misfits, 0.5)) / 1.5, np.nanmax(np.append(misfits, 2.0)) * 1.5))
    number_logarithms(panel.yaxis)
    panel.legend(**BELOW)
