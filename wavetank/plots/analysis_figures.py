"""Pictures of analyses, one function for each kind."""

from collections.abc import Callable, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from xarray import DataArray, Dataset

from wavetank.analysis.reflection import Reflection, WaveFit
from wavetank.analysis.results import Result
from wavetank.analysis.statistics import exceedance, forristall_heights, rayleigh_crests, rayleigh_heights
from wavetank.plots.style import (
    BLUE,
    CM,
    COMPUTED,
    GREEN,
    INK,
    ORANGE,
    PURPLE,
    VERMILION,
    common_legend,
    picture,
    titled,
)
from wavetank.waves.airy import Array, wave_number

FEW = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, INK)
MARGIN = 0.1  # of frequencies: how far beyond them linear waves are drawn
MOST = 12  # gauges in one panel; of more, some between are left out
DRAWN = 0.99  # of the variance: part that a spectrum is drawn up to


def _colours(number: int) -> list[tuple[float, ...] | str]:
    """Return a colour for each of so many lines that are drawn one over the other."""
    return list(FEW[:number]) if number <= len(FEW) else [*colormaps["viridis"](np.linspace(0, 0.93, number))]


def _chosen(number: int, most: int = MOST) -> dict[int, Any]:
    """Return which of so many gauges are drawn, with their colours."""
    shown = sorted({round(n) for n in np.linspace(0, number - 1, min(number, most))})
    return dict(zip(shown, _colours(len(shown)), strict=True))


def _label(eta: DataArray) -> str:
    """Return a gauge's label in a legend."""
    name, x = str(eta.gauge.values), float(eta.x)
    return f"gauge {name}" if np.isnan(x) or name == f"{x:g}" else f"gauge {name}, x = {x:g} m"


def _highest(S: DataArray) -> float:
    """Return the frequency [Hz] below which nearly all of the variance is."""
    total = S.sum([dim for dim in S.dims if dim != "frequency"]).cumsum("frequency")
    return 1.5 * float(S.frequency[int(np.argmax(total.values > DRAWN * float(total[-1])))])


@contextmanager
def _one_panel(path: Path, title: str) -> Any:
    """Give the axes of a picture of one panel with a legend below."""
    with picture(path, 9, 5.4, title=title) as figure:
        yield figure.subplots()
        common_legend(figure)


def spectrum_figure(S: DataArray, path: Path, *, title: str) -> Path:
    """Draw the spectra S [m²/Hz] of gauges over frequency; return ``path``."""
    with _one_panel(path, titled(title, "spectra")) as axes:
        for n, colour in _chosen(S.sizes["gauge"]).items():
            axes.plot(S.frequency, CM**2 * S[n], color=colour, label=_label(S[n]))
        axes.set(xlabel="frequency [Hz]", ylabel="variance density [cm²/Hz]", xlim=(0, _highest(S)), ylim=(0, None))
    return path


def heights_figure(
    waves: Sequence[tuple[DataArray, Dataset]],
    states: Dataset,
    second: Callable[[Array], Array] | None,
    path: Path,
    *,
    title: str,
) -> Path:
    """Draw the exceedance of heights and crests over Hm0 with Rayleigh's and Forristall's; return ``path``.

    ``waves`` are gauges with their waves, ``states`` their sea states, ``second`` is Forristall's exceedance of crests
    over Hm0, if the depth is known.
    """
    with picture(path, 11, 5.6, title=titled(title, "heights of waves")) as figure:
        panels = figure.subplots(1, 2, sharey=True)
        for n, colour in _chosen(len(waves)).items():
            gauge, result = waves[n]
            for panel, values in zip(panels, (result.height, result.crest), strict=True):
                part = exceedance(values / float(states.hm0[n]))
                panel.plot(part.value, part, ".", ms=5, color=colour, label=_label(gauge))
        heights, crests = (np.linspace(0, 1.02 * _largest(panel), 200, dtype=np.float64) for panel in panels)
        panels[0].plot(heights, rayleigh_heights(heights, 1.0), "--", color=INK, label="Rayleigh")
        panels[0].plot(heights, forristall_heights(heights, 1.0), "-", color=INK, label="Forristall")
        panels[1].plot(crests, rayleigh_crests(crests, 1.0), "--", color=INK)
        if second:
            panels[1].plot(crests, second(crests), "-", color=INK)
        least = 0.5 / (1 + max(result.begin.size for _, result in waves))
        panels[0].set(yscale="log", ylim=(least, 1.1), xlabel="height over Hm0 [-]", ylabel="exceedance [-]")
        panels[1].set(xlabel="crest over Hm0 [-]")
        common_legend(figure)
    return path


def _largest(panel: Axes) -> float:
    return max(float(np.max(line.get_xdata(), initial=1.0)) for line in panel.lines)


def harmonics_figure(result: Dataset, path: Path, *, title: str) -> Path:
    """Draw the amplitudes of harmonics along x, or of two gauges and fewer over their number; return ``path``."""
    component, numbers = CM * np.abs(result.component), result.harmonic.values
    with _one_panel(path, titled(title, f"harmonics of T = {1 / result.attrs['frequency']:.4g} s")) as axes:
        if result.sizes["gauge"] > 2 and not np.isnan(result.x.values).any():
            order = np.argsort(result.x.values)
            for n, colour in zip(range(numbers.size), _colours(numbers.size), strict=True):
                label = f"harmonic {numbers[n]}"
                axes.plot(result.x[order], component[order, n], "o-", ms=4, color=colour, label=label)
            axes.plot(result.x[order], CM * result.rest[order], ":", color=INK, label="rest (rms)")
            axes.set(xlabel="x [m]")
        else:
            for one, colour in zip(component, _colours(result.sizes["gauge"]), strict=True):
                axes.plot(numbers, one, "o-", color=colour, label=_label(one))
            axes.set(xlabel="harmonic [-]", xticks=numbers)
        axes.set(ylabel="amplitude [cm]", ylim=(0, None))
    return path


def along_figure(
    component: DataArray, wave_numbers: Sequence[float], names: Sequence[str], fit: WaveFit, path: Path, *, title: str
) -> Path:
    """Draw a harmonic's amplitude along x with the waves that are fitted to it; return ``path``.

    ``component`` [m] is over gauge; wave numbers [rad/m] and names are those of ``fit.amplitudes``.
    """
    x = np.asarray(component.x.values, dtype=float)
    fine = np.linspace(x.min(), x.max(), 1000)
    total = np.abs(np.exp(1j * np.outer(fine, wave_numbers)) @ fit.amplitudes)
    with _one_panel(path, title) as axes:
        axes.plot(x, CM * np.abs(component.values), "o", ms=5, color=COMPUTED, label="at the gauges")
        axes.plot(fine, CM * total, "-", color=COMPUTED, lw=1, label="all waves")
        for name, a, colour in zip(names, fit.amplitudes, FEW[1:], strict=False):
            axes.plot(fine, np.full_like(fine, CM * abs(a)), "--", color=colour, label=f"{name}: {CM * abs(a):.3g} cm")
        axes.set(xlabel="x [m]", ylabel="amplitude [cm]", ylim=(0, None))
    return path


def groups_figure(eta: DataArray, envelope: DataArray, groupiness: DataArray, path: Path, *, title: str) -> Path:
    """Draw records with their envelopes, a panel a gauge; return ``path``."""
    shown, number = _chosen(eta.sizes["gauge"], 8), eta.sizes["gauge"]
    some = f", {len(shown)} of {number} gauges (--gauges)" * (len(shown) < number)
    title = titled(title, f"elevation η and its groups{some}")
    with picture(path, 10, 1.4 + 1.5 * len(shown), title=title) as figure:
        panels = figure.subplots(len(shown), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for n, panel in zip(shown, panels, strict=True):
            about = eta[n] - eta[n].mean("time")
            panel.plot(eta.time, CM * about, color=COMPUTED, lw=0.8, label="elevation about its mean")
            panel.plot(eta.time, CM * envelope[n], color=VERMILION, label="envelope")
            panel.set_title(f"{_label(eta[n])};  groupiness {float(groupiness[n]):.2f}", pad=2, parse_math=False)
            panel.set_ylabel("η [cm]")
            panel.margins(x=0)
        panels[-1].set_xlabel("time [s]")
        common_legend(figure)
    return path


def reflection_figure(result: Dataset, path: Path, *, title: str) -> Path:
    """Draw incident and reflected spectra, and the ratio of their amplitudes where it counts; return ``path``."""
    density = result.incident.fillna(0.0) + result.reflected.fillna(0.0)
    ratio = np.sqrt(result.reflected / result.incident.where(result.incident > 0)).where(result.counted)
    with picture(path, 9, 7, title=titled(title, f"reflection {result.attrs['coefficient']:.3g}")) as figure:
        spectra, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        spectra.plot(result.frequency, CM**2 * result.incident, color=BLUE, label="incident")
        spectra.plot(result.frequency, CM**2 * result.reflected, color=VERMILION, label="reflected")
        spectra.set(ylabel="variance density [cm²/Hz]", ylim=(0, None), xlim=(0, _highest(density)))
        below.plot(result.frequency, ratio, ".-", color=GREEN, label="reflected over incident amplitude")
        below.set(xlabel="frequency [Hz]", ylabel="reflection [-]", ylim=(0, None))
        common_legend(figure)
    return path


def regular_reflection_figure(component: DataArray, result: Reflection, path: Path, *, title: str) -> Path:
    """Draw a regular wave's amplitude along x with its incident and reflected wave; return ``path``."""
    fit = WaveFit(np.array([result.incident, result.reflected]), result.rest, result.condition)
    title = titled(title, f"reflection {result.coefficient:.3g}")
    return along_figure(component, [result.k, -result.k], ["incident", "reflected"], fit, path, title=title)


def speed_figure(
    speed: Array, pairs: Sequence[str], frequencies: Array, path: Path, *, title: str, depth: float, gravity: float
) -> Path:
    """Draw phase speeds [m/s] between gauges over frequency [Hz] with the dispersion relation's; return ``path``.

    They are of shape (pairs, frequencies), not numbers where the records have none.
    """
    with _one_panel(path, titled(title, "speed between gauges")) as axes:
        for n, colour in _chosen(len(pairs)).items():
            axes.plot(frequencies, speed[n], ".", color=colour, label=f"gauges {pairs[n]}")
        drawn = frequencies[np.isfinite(speed).any(axis=0)]
        f = np.linspace((1 - MARGIN) * drawn.min(), (1 + MARGIN) * drawn.max(), 200)
        k = wave_number(2 * np.pi * f, depth, gravity)
        axes.plot(f, 2 * np.pi * f / k, "-", color=INK, lw=1, label="linear waves")
        axes.set(xlabel="frequency [Hz]", ylabel="phase speed [m/s]")
    return path


FIGURES: dict[str, Callable[..., Path]] = {
    "spectrum": spectrum_figure,
    "heights": heights_figure,
    "harmonics": harmonics_figure,
    "bound-free": along_figure,
    "groups": groups_figure,
    "reflection": reflection_figure,
    "regular-reflection": regular_reflection_figure,
    "speed": speed_figure,
}


def result_figure(result: Result, path: Path) -> Path:
    """Draw the figure of an analysis; return ``path``."""
    return FIGURES[result.figure](path=path, **result.arguments)
