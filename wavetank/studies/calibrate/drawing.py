"""Figure of an attempt: target and record, spectrum of the generated waves, misfits of all attempts."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from wavetank.plots.style import BLUE, CM, GREY, INK, ORANGE, PALE_GREY, VERMILION, number_logarithms, panels, titled
from wavetank.studies.calibrate.aims import Aim, Attempt, scale

PERIODS = 6.0  # range drawn on either side of a crest
LINE = 70  # characters
LAYOUT: Any = {"width_ratios": (2.2, 1.2, 1.0), "sharex": False}


def draw(attempts: Sequence[Attempt], aim: Aim, path: Path, *, shown: Attempt, title: str) -> None:
    """Draw one attempt and the misfits of all."""
    title, waves = titled(title, f"attempt {shown.number}"), {"by linear theory": aim.start, "now": shown.setting}
    with panels(path, 1, 3, size=(13.0, 4.2), title=title, **LAYOUT) as ((records, spectrum, misfits),):
        _draw_records(records, shown, aim)
        for (label, setting), colour in zip(waves.items(), (PALE_GREY, INK), strict=True):
            one = aim.waves(setting)
            f, mm = one.omega / (2 * np.pi), 1e3 * np.abs(one.amplitudes)
            spectrum.plot(f, mm, color=colour, label=f"waves {label}")
        spectrum.set(xlabel="f [Hz]", ylabel="amplitude of components [mm]", title="generated waves")
        _draw_misfits(misfits, attempts)


def _draw_records(panel: Axes, one: Attempt, aim: Aim) -> None:
    """Draw record and target."""
    wanted, record, crest = aim.wanted, one.result.record, aim.wanted.size == 1
    style = {"ls": "", "marker": "o", "ms": 9, "mfc": "none", "mew": 1.8} if crest else {"lw": 2.4}
    panel.plot(wanted.time, CM * wanted, color=ORANGE, label="target", **style)
    title = f"at x = {aim.x:g} m"
    if one.cause:
        panel.axhline(0.0, color=GREY, lw=0.8)
        why = panel.text(0.02, 0.5, fill(one.cause, LINE), transform=panel.transAxes, va="center", fontsize=9)
        why.set_in_layout(False)
    else:
        panel.plot(record.time, CM * record, color=BLUE, label="run")
        title += f"; the highest crest is at {one.result.crest.x:.4g} m" if crest else ""
    if crest:
        around, half = float(wanted.time[0]), PERIODS * scale(aim.waves(one.setting)).period
        last = np.inf if one.cause else float(record.time[-1])
        panel.set_xlim(max(0.0, around - half), min(around + half, last))
    panel.set(ylabel="elevation [cm]", title=title)


def _draw_misfits(panel: Axes, attempts: Sequence[Attempt]) -> None:
    """Draw the misfits, and a line at which the target is reached."""
    numbers, misfits = [one.number for one in attempts], np.array([one.result.misfit for one in attempts])
    misfits[np.isinf(misfits)] = np.nan
    panel.plot(numbers, misfits, "-", color=BLUE)
    for numerics in dict.fromkeys(one.numerics for one in attempts):
        marks = np.where([one.numerics == numerics for one in attempts], misfits, np.nan)
        face = "white" if numerics == "cheap" else BLUE
        panel.plot(numbers, marks, "o", color=BLUE, mfc=face, label=f"{numerics} numerics")
    if broken := [one.number for one in attempts if one.cause]:
        (crosses,) = panel.plot(broken, np.ones(len(broken)), "x", color=VERMILION, mew=1.8, label="broke down")
        crosses.set(transform=panel.get_xaxis_transform(), clip_on=False)
    panel.axhline(1.0, color=GREY, lw=0.8, ls="--")
    panel.set(xlabel="attempt", title="misfit over tolerance", yscale="log", xticks=numbers)
    panel.set_xlim(0.7, numbers[-1] + 0.3)
    panel.set_ylim(np.nanmin([*misfits, 0.5]) / 1.5, np.nanmax([*misfits, 2.0]) * 1.5)
    number_logarithms(panel.yaxis)
