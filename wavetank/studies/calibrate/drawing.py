"""Figure of an attempt: target and record, spectrum of the generated waves, misfits of all attempts."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from wavetank.plots.style import BLUE, CM, GREY, INK, PALE_GREY, VERMILION, number_logarithms, picture
from wavetank.studies.calibrate.aims import Aim, Attempt, scale
from wavetank.waves.plane_waves import PlaneWaves

PERIODS = 6.0  # shown on either side of a crest
LINE = 70  # characters
BELOW: Any = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 2}  # the panel: waves fill it


def draw(attempts: Sequence[Attempt], aim: Aim, path: Path, *, shown: Attempt, title: str) -> None:
    """Draw one of the attempts and the misfits of all."""
    with picture(path, 13.0, 4.2) as figure:
        records, spectrum, misfits = figure.subplots(1, 3, width_ratios=(2.2, 1.2, 1.0))
        _draw_records(records, shown, aim)
        _draw_spectrum(spectrum, aim.waves(shown.setting), aim.waves(aim.start))
        _draw_misfits(misfits, attempts)
        figure.suptitle(f"{title}{': ' if title else ''}attempt {shown.number}", fontsize=12, parse_math=False)


def _draw_records(panel: Axes, one: Attempt, aim: Aim) -> None:
    """Draw record and target."""
    wanted, alone = aim.wanted, aim.wanted.t.size == 1
    style = {"ls": "", "marker": "o", "ms": 9, "mfc": "none", "mew": 1.8} if alone else {"lw": 2.4}
    panel.plot(wanted.t, CM * wanted.eta, color=VERMILION if alone else PALE_GREY, label="target", **style)
    if not one.cause:
        panel.plot(one.result.elevation.t, CM * one.result.elevation.eta, color=BLUE, label="run")
    else:
        panel.axhline(0.0, color=GREY, lw=0.8)
        why = panel.text(0.02, 0.5, fill(one.cause, LINE), transform=panel.transAxes, va="center", fontsize=9)
        why.set_in_layout(False)
    if alone:
        half = PERIODS * scale(aim.waves(one.setting)).period
        last = np.inf if one.cause else one.result.elevation.t[-1]
        panel.set_xlim(max(0.0, wanted.t[0] - half), min(wanted.t[0] + half, last))
    highest = f"; the highest crest is at {one.result.x:.4g} m" if alone and not one.cause else ""
    panel.set(xlabel="t [s]", ylabel="elevation [cm]", title=f"at x = {aim.x:g} m{highest}")
    panel.legend(**BELOW)


def _draw_spectrum(panel: Axes, waves: PlaneWaves, first: PlaneWaves) -> None:
    """Draw the amplitudes of the generated waves."""
    for one, colour, label in ((first, PALE_GREY, "at first"), (waves, INK, "now")):
        panel.plot(one.omega / (2 * np.pi), 1e3 * np.abs(one.amplitudes), color=colour, label=label)
    panel.set(xlabel="f [Hz]", ylabel="amplitude of components [mm]", title="generated waves")
    panel.legend(**BELOW)


def _draw_misfits(panel: Axes, attempts: Sequence[Attempt]) -> None:
    """Draw the misfits; the target is reached at the line."""
    numbers, misfits = [one.number for one in attempts], np.array([one.result.misfit for one in attempts])
    misfits[np.isinf(misfits)] = np.nan
    panel.plot(numbers, misfits, "-", color=BLUE)
    for numerics in dict.fromkeys(one.numerics for one in attempts):
        face = "white" if numerics == "cheap" else BLUE
        these = [one.numerics == numerics for one in attempts]
        marks = np.where(these, misfits, np.nan)
        panel.plot(numbers, marks, "o", color=BLUE, mfc=face, label=f"{numerics} numerics")
    if broken := [one.number for one in attempts if one.cause]:
        (crosses,) = panel.plot(broken, np.ones(len(broken)), "x", color=VERMILION, mew=1.8, label="broke down")
        crosses.set(transform=panel.get_xaxis_transform(), clip_on=False)
    panel.axhline(1.0, color=GREY, lw=0.8, ls="--")
    panel.set(xlabel="attempt", title="misfit over tolerance", yscale="log")
    panel.set_xticks(numbers)
    panel.set_xlim(0.7, numbers[-1] + 0.3)
    panel.set_ylim(*(np.nanmin(np.append(misfits, 0.5)) / 1.5, np.nanmax(np.append(misfits, 2.0)) * 1.5))
    number_logarithms(panel.yaxis)
    panel.legend(**BELOW)
