"""Pictures of analyses, one function for each kind."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from xarray import DataArray, Dataset

from wavetank.analysis.reflection import Reflection, WaveFit
from wavetank.analysis.results import Result
from wavetank.analysis.statistics import exceedance, forristall_heights, rayleigh_crests, rayleigh_heights
from wavetank.plots.style import BLUE, CM, COMPUTED, GREEN, INK, ORANGE, PURPLE, VERMILION, picture
from wavetank.waves.airy import wave_number
from wavetank.waves.wave import Array

FEW = (BLUE, VERMILION, GREEN, ORANGE, PURPLE, INK)
BESIDE = 0.1  # of frequencies: how far beyond them linear waves are drawn
MOST = 12  # gauges in one panel; of more, some between are left out
SHARE = 0.99  # of the variance that a spectrum is drawn up to
LEGEND = {"loc": "outside lower center", "ncols": 4}


def _colours(number: int) -> list[tuple[float, ...] | str]:
    """Return a colour for each of so many lines that are drawn one over the other."""
    return list(FEW[:number]) if number <= len(FEW) else [*colormaps["viridis"](np.linspace(0, 0.93, number))]


def _shown(number: int, most: int = MOST) -> list[int]:
    """Return which of so many gauges are drawn."""
    return sorted({round(n) for n in np.linspace(0, number - 1, min(number, most))})


def _label(eta: DataArray) -> str:
    """Return what a gauge is called in a legend."""
    name, x = str(eta.gauge.values), float(eta.x)
    return f"gauge {name}" if np.isnan(x) or name == f"{x:g}" else f"gauge {name}, x = {x:g} m"


def _highest(S: DataArray) -> float:
    """Return the frequency [Hz] below which nearly all of the variance is."""
    total = S.sum([dim for dim in S.dims if dim != "frequency"]).cumsum("frequency")
    return 1.5 * float(S.frequency[int(np.argmax(total.values > SHARE * float(total[-1])))])


def spectrum_figure(S: DataArray, path: Path, *, title: str) -> Path:
    """Draw the spectra S [m²/Hz] of gauges over frequency; return ``path``."""
    with picture(path, 9, 5.4) as figure:
        axes, shown = figure.subplots(), _shown(S.sizes["gauge"])
        for n, colour in zip(shown, _colours(len(shown)), strict=True):
            axes.plot(S.frequency, CM**2 * S[n], color=colour, label=_label(S[n]))
        axes.set(xlabel="frequency [Hz]", ylabel="variance density [cm²/Hz]", xlim=(0, _highest(S)), ylim=(0, None))
        figure.legend(**LEGEND)
        figure.suptitle(f"{title}: spectra", fontsize=12, parse_math=False)
    return path


def heights_figure(
    waves: Sequence[tuple[DataArray, Dataset]],
    states: Dataset,
    second: Callable[[Array], Array] | None,
    path: Path,
    *,
    title: str,
) -> Path:
    """Draw how often heights and crests are exceeded, over Hm0, beside Rayleigh's and Forristall's; return ``path``.

    ``waves`` are gauges with their waves, ``states`` their sea states, ``second`` is how often crests over Hm0 are
    exceeded by Forristall, where that is known.
    """
    with picture(path, 11, 5.6) as figure:
        panels, shown = figure.subplots(1, 2, sharey=True), _shown(len(waves))
        for n, colour in zip(shown, _colours(len(shown)), strict=True):
            gauge, result = waves[n]
            for panel, values in zip(panels, (result.height, result.crest), strict=True):
                told = exceedance(values / float(states.hm0[n]))
                label = _label(gauge) if panel is panels[0] else None
                panel.plot(told.value, told, ".", ms=5, color=colour, label=label)
        heights, crests = (np.linspace(0, 1.02 * _largest(panel), 200, dtype=np.float64) for panel in panels)
        panels[0].plot(heights, rayleigh_heights(heights, 1.0), "--", color=INK, label="Rayleigh")
        panels[0].plot(heights, forristall_heights(heights, 1.0), "-", color=INK, label="Forristall")
        panels[1].plot(crests, rayleigh_crests(crests, 1.0), "--", color=INK)
        if second:
            panels[1].plot(crests, second(crests), "-", color=INK)
        least = 0.5 / (1 + max(result.begin.size for _, result in waves))
        panels[0].set(yscale="log", ylim=(least, 1.1), xlabel="height over Hm0 [-]", ylabel="share that is higher [-]")
        panels[1].set(xlabel="crest over Hm0 [-]")
        figure.legend(**LEGEND)
        figure.suptitle(f"{title}: heights of waves", fontsize=12, parse_math=False)
    return path


def _largest(panel: Axes) -> float:
    return max(float(np.max(line.get_xdata(), initial=1.0)) for line in panel.lines)


def harmonics_figure(found: Dataset, path: Path, *, title: str) -> Path:
    """Draw the amplitudes of harmonics along x, or of two gauges and fewer over their number; return ``path``."""
    component, numbers = CM * np.abs(found.component), found.harmonic.values
    with picture(path, 9, 5.4) as figure:
        axes = figure.subplots()
        if found.sizes["gauge"] > 2 and not np.isnan(found.x.values).any():
            order = np.argsort(found.x.values)
            for n, colour in zip(range(numbers.size), _colours(numbers.size), strict=True):
                axes.plot(found.x[order], component[order, n], "o-", ms=4, color=colour, label=f"harmonic {numbers[n]}")
            axes.plot(found.x[order], CM * found.rest[order], ":", color=INK, label="rest (rms)")
            axes.set(xlabel="x [m]")
        else:
            for one, colour in zip(component, _colours(found.sizes["gauge"]), strict=True):
                axes.plot(numbers, one, "o-", color=colour, label=_label(one))
            axes.set(xlabel="harmonic [-]", xticks=numbers)
        axes.set(ylabel="amplitude [cm]", ylim=(0, None))
        figure.legend(**LEGEND)
        period = 1 / found.attrs["frequency"]
        figure.suptitle(f"{title}: harmonics of T = {period:.4g} s", fontsize=12, parse_math=False)
    return path


def along_figure(
    component: DataArray, wave_numbers: Sequence[float], names: Sequence[str], found: WaveFit, path: Path, *, title: str
) -> Path:
    """Draw a harmonic's amplitude along x with the waves that it is told to be the sum of; return ``path``.

    ``component`` [m] is over gauge; wave numbers [rad/m] and names are those of ``found.amplitudes``.
    """
    x = np.asarray(component.x.values, dtype=float)
    fine = np.linspace(x.min(), x.max(), 1000)
    total = np.abs(np.exp(1j * np.outer(fine, wave_numbers)) @ found.amplitudes)
    with picture(path, 9, 5.4) as figure:
        axes = figure.subplots()
        axes.plot(x, CM * np.abs(component.values), "o", ms=5, color=COMPUTED, label="at the gauges")
        axes.plot(fine, CM * total, "-", color=COMPUTED, lw=1, label="all waves")
        for name, a, colour in zip(names, found.amplitudes, FEW[1:], strict=False):
            axes.plot(fine, np.full_like(fine, CM * abs(a)), "--", color=colour, label=f"{name}: {CM * abs(a):.3g} cm")
        axes.set(xlabel="x [m]", ylabel="amplitude [cm]", ylim=(0, None))
        figure.legend(**LEGEND)
        figure.suptitle(title, fontsize=12, parse_math=False)
    return path


def groups_figure(eta: DataArray, envelope: DataArray, groupiness: DataArray, path: Path, *, title: str) -> Path:
    """Draw records with their envelopes, a panel a gauge; return ``path``."""
    shown = _shown(eta.sizes["gauge"], 8)
    with picture(path, 10, 1.4 + 1.5 * len(shown)) as figure:
        panels = figure.subplots(len(shown), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
        for n, panel in zip(shown, panels, strict=True):
            about = eta[n] - eta[n].mean("time")
            panel.plot(eta.time, CM * about, color=COMPUTED, lw=0.8, label="elevation about its mean")
            panel.plot(eta.time, CM * envelope[n], color=VERMILION, label="envelope")
            panel.set_title(f"{_label(eta[n])};  groupiness {float(groupiness[n]):.2f}", pad=2, parse_math=False)
            panel.margins(x=0)
        panels[-1].set_xlabel("time [s]")
        for panel in panels:
            panel.set_ylabel("η [cm]")
        figure.legend(*panels[0].get_legend_handles_labels(), **LEGEND)
        some = f", {len(shown)} of {eta.sizes['gauge']} gauges (--gauges)" * (len(shown) < eta.sizes["gauge"])
        figure.suptitle(f"{title}: elevation η and its groups{some}", fontsize=12, parse_math=False)
    return path


def reflection_figure(found: Dataset, path: Path, *, title: str) -> Path:
    """Draw incident and reflected spectra, and the ratio of their amplitudes where the waves are; return ``path``."""
    density = found.incident.fillna(0.0) + found.reflected.fillna(0.0)
    ratio = np.sqrt(found.reflected / found.incident.where(found.incident > 0)).where(found.counted)
    with picture(path, 9, 7) as figure:
        spectra, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        spectra.plot(found.frequency, CM**2 * found.incident, color=BLUE, label="incident")
        spectra.plot(found.frequency, CM**2 * found.reflected, color=VERMILION, label="reflected")
        spectra.set(ylabel="variance density [cm²/Hz]", ylim=(0, None), xlim=(0, _highest(density)))
        below.plot(found.frequency, ratio, ".-", color=GREEN, label="reflected over incident amplitude")
        below.set(xlabel="frequency [Hz]", ylabel="reflection [-]", ylim=(0, None))
        figure.legend(**LEGEND)
        text = f"{title}: reflection {found.attrs['coefficient']:.3g}"
        figure.suptitle(text, fontsize=12, parse_math=False)
    return path


def regular_reflection_figure(component: DataArray, found: Reflection, path: Path, *, title: str) -> Path:
    """Draw a regular wave's amplitude along x and the beat of what comes and goes back; return ``path``."""
    told = WaveFit(np.array([found.incident, found.reflected]), found.rest, found.condition)
    text = f"{title}: reflection {found.coefficient:.3g}"
    return along_figure(component, [found.k, -found.k], ["incident", "reflected"], told, path, title=text)


def speed_figure(
    speed: Array, pairs: Sequence[str], frequencies: Array, path: Path, *, title: str, depth: float, gravity: float
) -> Path:
    """Draw phase speeds [m/s] between gauges over frequency [Hz] beside the dispersion relation's; return ``path``.

    They are of shape (pairs, frequencies), not numbers where the records do not tell them.
    """
    with picture(path, 9, 5.4) as figure:
        axes, shown = figure.subplots(), _shown(len(pairs))
        for n, colour in zip(shown, _colours(len(shown)), strict=True):
            axes.plot(frequencies, speed[n], ".", color=colour, label=f"gauges {pairs[n]}")
        told = frequencies[np.isfinite(speed).any(axis=0)]
        f = np.linspace((1 - BESIDE) * told.min(), (1 + BESIDE) * told.max(), 200)
        k = wave_number(2 * np.pi * f, depth, gravity)
        axes.plot(f, 2 * np.pi * f / k, "-", color=INK, lw=1, label="linear waves")
        axes.set(xlabel="frequency [Hz]", ylabel="phase speed [m/s]")
        figure.legend(**LEGEND)
        figure.suptitle(f"{title}: speed between gauges", fontsize=12, parse_math=False)
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
