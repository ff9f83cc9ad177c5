"""Pictures of analyses, one function for each kind."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from xarray import DataArray, Dataset

from wavetank.analysis.calibration import GaugeCorrections
from wavetank.analysis.reflection import WaveFit
from wavetank.analysis.results import Result
from wavetank.analysis.statistics import exceedance, forristall_heights, rayleigh_crests, rayleigh_heights
from wavetank.plots import style
from wavetank.waves.airy import Array, wave_number

FEW = (style.BLUE, style.VERMILION, style.GREEN, style.ORANGE, style.PURPLE, style.INK)
ONE = (9, 5.4)  # size of a picture of one panel [inch]
MARGIN = 0.1  # relative extension of the frequency range of linear waves
MAX_GAUGES = 12  # largest number of gauges in a panel; of more gauges, evenly distributed ones
DRAWN = 0.99  # part of the variance within the frequency range of a spectrum


def _colours(number: int) -> list[tuple[float, ...] | str]:
    """Return colours for a number of overlapping lines."""
    return list(FEW[:number]) if number <= len(FEW) else [*colormaps["viridis"](np.linspace(0, 0.93, number))]


def _chosen(number: int, most: int = MAX_GAUGES) -> dict[int, Any]:
    """Return which gauges are drawn, with their colours, by their number."""
    shown = sorted({round(n) for n in np.linspace(0, number - 1, min(number, most))})
    return dict(zip(shown, _colours(len(shown)), strict=True))


def _label(eta: DataArray) -> str:
    """Return the label of a gauge in a legend."""
    name, x = str(eta.gauge.values), float(eta.x)
    return f"gauge {name}" if np.isnan(x) or name == f"{x:g}" else f"gauge {name}, x = {x:g} m"


def _highest(S: DataArray) -> float:
    """Return the frequency [Hz] below which nearly all of the variance lies."""
    total = S.sum([dim for dim in S.dims if dim != "frequency"]).cumsum("frequency")
    return 1.5 * float(S.frequency[int(np.argmax(total.values > DRAWN * float(total[-1])))])


def spectrum_figure(S: DataArray, path: Path, *, title: str) -> Path:
    """Draw the spectra S [m²/Hz] of gauges over frequency; return ``path``."""
    with style.panels(path, size=ONE, title=style.titled(title, "spectra"), xlabel="frequency [Hz]") as ((axes,),):
        for n, colour in _chosen(S.sizes["gauge"]).items():
            axes.plot(S.frequency, style.CM**2 * S[n], color=colour, label=_label(S[n]))
        axes.set(ylabel="variance density [cm²/Hz]", xlim=(0, _highest(S)), ylim=(0, None))
    return path


def heights_figure(
    waves: Sequence[tuple[DataArray, Dataset]],
    states: Dataset,
    second: Callable[[Array], Array] | None,
    path: Path,
    *,
    title: str,
) -> Path:
    """Draw the exceedance of heights and crests over Hm0 with those of Rayleigh and Forristall; return ``path``.

    ``waves`` are gauges with their waves, ``states`` their sea states, ``second`` is Forristall's exceedance of crests
    over Hm0, if the depth is known.
    """
    theories: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array] | None]] = {
        "height": (lambda height: rayleigh_heights(height, 1.0), lambda height: forristall_heights(height, 1.0)),
        "crest": (lambda crest: rayleigh_crests(crest, 1.0), second),
    }
    title, least = style.titled(title, "heights of waves"), 0.5 / (1 + max(result.begin.size for _, result in waves))
    with style.panels(path, 1, 2, size=(11, 5.6), title=title, sharex=False, sharey=True) as (axes,):
        for panel, (name, (rayleigh, forristall)) in zip(axes, theories.items(), strict=True):
            largest = 1.0
            for n, colour in _chosen(len(waves)).items():
                gauge, result = waves[n]
                part = exceedance(result[name] / float(states.hm0[n]))
                largest = max(largest, float(part.value.max()))
                panel.plot(part.value, part, ".", ms=5, color=colour, label=_label(gauge))
            values = np.linspace(0, 1.02 * largest, 200, dtype=np.float64)
            panel.plot(values, rayleigh(values), "--", color=style.INK, label="Rayleigh")
            if forristall:
                panel.plot(values, forristall(values), "-", color=style.INK, label="Forristall")
            panel.set_xlabel(f"{name} over Hm0 [-]")
        axes[0].set(yscale="log", ylim=(least, 1.1), ylabel="exceedance [-]")
    return path


def harmonics_figure(result: Dataset, path: Path, *, title: str) -> Path:
    """Draw the amplitudes of harmonics along x, or over their number for at most two gauges; return ``path``."""
    along = result.sizes["gauge"] > 2 and not np.isnan(result.x.values).any()
    result = result.sortby("x") if along else result
    component, numbers = style.CM * np.abs(result.component), result.harmonic.values
    title = style.titled(title, f"harmonics of T = {1 / result.attrs['frequency']:.4g} s")
    with style.panels(path, size=ONE, title=title, xlabel="x [m]" if along else "harmonic [-]") as ((axes,),):
        if along:
            for n, colour in enumerate(_colours(numbers.size)):
                axes.plot(result.x, component[:, n], "o-", ms=4, color=colour, label=f"harmonic {numbers[n]}")
            axes.plot(result.x, style.CM * result.rest, ":", color=style.INK, label="rest (rms)")
        else:
            for one, colour in zip(component, _colours(result.sizes["gauge"]), strict=True):
                axes.plot(numbers, one, "o-", color=colour, label=_label(one))
            axes.set_xticks(numbers)
        axes.set(ylabel="amplitude [cm]", ylim=(0, None))
    return path


def along_figure(
    component: DataArray, names: Sequence[str], fit: WaveFit, path: Path, *, kind: str, title: str
) -> Path:
    """Draw the amplitude of a harmonic along x with the fitted waves; return ``path``.

    ``component`` [m] is over gauge; names are those of the fitted waves.
    """
    x = np.asarray(component.x.values, dtype=float)
    fine = np.linspace(x.min(), x.max(), 1000)
    total = np.abs(np.exp(1j * np.outer(fine, fit.wave_numbers)) @ fit.amplitudes)
    with style.panels(path, size=ONE, title=style.titled(title, kind), xlabel="x [m]") as ((axes,),):
        axes.plot(x, style.CM * np.abs(component.values), "o", ms=5, color=style.COMPUTED, label="at the gauges")
        axes.plot(fine, style.CM * total, "-", color=style.COMPUTED, lw=1, label="all waves")
        for name, a, colour in zip(names, fit.amplitudes, FEW[1:], strict=False):
            size = style.CM * abs(a)
            axes.plot(fine, np.full_like(fine, size), "--", color=colour, label=f"{name}: {size:.3g} cm")
        axes.set(ylabel="amplitude [cm]", ylim=(0, None))
    return path


def groups_figure(eta: DataArray, envelope: DataArray, groupiness: DataArray, path: Path, *, title: str) -> Path:
    """Draw records with their envelopes, one panel per gauge; return ``path``."""
    shown, number = _chosen(eta.sizes["gauge"], 8), eta.sizes["gauge"]
    some = f", {len(shown)} of {number} gauges (--gauges)" * (len(shown) < number)
    title, rows = style.titled(title, f"elevation η and its groups{some}"), len(shown)
    with style.panels(path, rows, size=(10, 1.4 + 1.5 * rows), title=title, sharey=True) as axes:
        for n, panel in zip(shown, axes[:, 0], strict=True):
            about = eta[n] - eta[n].mean("time")
            style.draw_series(
                panel, eta.time, style.CM * about, color=style.COMPUTED, lw=0.8, label="elevation about its mean"
            )
            panel.plot(eta.time, style.CM * envelope[n], color=style.VERMILION, label="envelope")
            panel.set_title(f"{_label(eta[n])};  groupiness {float(groupiness[n]):.2f}", pad=2, parse_math=False)
            panel.set_ylabel("η [cm]")
    return path


def reflection_figure(result: Dataset, path: Path, *, title: str) -> Path:
    """Draw incident and reflected spectra, and their amplitude ratio at counted frequencies; return ``path``."""
    density = result.incident.fillna(0.0) + result.reflected.fillna(0.0)
    ratio = np.sqrt(result.reflected / result.incident.where(result.incident > 0)).where(result.counted)
    title = style.titled(title, f"reflection {result.attrs['coefficient']:.3g}")
    with style.panels(path, 2, size=(9, 7), title=title, xlabel="frequency [Hz]", height_ratios=(2, 1)) as axes:
        spectra, below = axes[:, 0]
        spectra.plot(result.frequency, style.CM**2 * result.incident, color=style.BLUE, label="incident")
        spectra.plot(result.frequency, style.CM**2 * result.reflected, color=style.VERMILION, label="reflected")
        spectra.set(ylabel="variance density [cm²/Hz]", ylim=(0, None), xlim=(0, _highest(density)))
        below.plot(result.frequency, ratio, ".-", color=style.GREEN, label="reflected over incident amplitude")
        below.set(ylabel="reflection [-]", ylim=(0, None))
    return path


def speed_figure(
    speed: Array, pairs: Sequence[str], frequencies: Array, path: Path, *, title: str, depth: float, gravity: float
) -> Path:
    """Draw phase speeds [m/s] between gauges over frequency [Hz] with the dispersion relation; return ``path``.

    They have shape (pairs, frequencies), not numbers where undefined.
    """
    drawn = frequencies[np.isfinite(speed).any(axis=0)]
    f = np.linspace((1 - MARGIN) * drawn.min(), (1 + MARGIN) * drawn.max(), 200)
    linear = 2 * np.pi * f / wave_number(2 * np.pi * f, depth, gravity)
    with style.panels(path, size=ONE, title=style.titled(title, "speed between gauges"), xlabel="frequency [Hz]") as (
        (axes,),
    ):
        for n, colour in _chosen(len(pairs)).items():
            axes.plot(frequencies, speed[n], ".", color=colour, label=f"gauges {pairs[n]}")
        axes.plot(f, linear, "-", color=style.INK, lw=1, label="linear waves")
        axes.set_ylabel("phase speed [m/s]")
    return path


def calibration_figure(
    result: GaugeCorrections, names: Sequence[str], reference: str, path: Path, *, title: str
) -> Path:
    """Draw amplitude ratios and phases of cross spectra over frequency with their fit; return ``path``.

    Phases are those without that of linear waves between the places; names are those of the other gauges.
    """
    title = style.titled(title, f"cross spectra with gauge {reference}, 95 % bands of the fit")
    with style.panels(path, 2, size=(9, 8), title=title, xlabel="frequency [Hz]") as axes:
        amplitude, phase = axes[:, 0]
        for n, colour in _chosen(len(names)).items():
            (real, imaginary), fit = result.band[..., n], result.fit[:, n]
            amplitude.plot(
                result.frequency, np.exp(result.ratio[:, n].real), ".", color=colour, label=f"gauge {names[n]}"
            )
            amplitude.plot(result.frequency, np.exp(fit.real), "-", color=colour, lw=1)
            amplitude.fill_between(
                result.frequency, *np.exp([fit.real - real, fit.real + real]), color=colour, alpha=0.15, lw=0
            )
            phase.plot(result.frequency, result.ratio[:, n].imag, ".", color=colour)
            phase.plot(result.frequency, fit.imag, "-", color=colour, lw=1)
            phase.fill_between(
                result.frequency, fit.imag - imaginary, fit.imag + imaginary, color=colour, alpha=0.15, lw=0
            )
        amplitude.set_ylabel("amplitude ratio [-]")
        phase.set_ylabel("phase - k (x - x_r) [rad]")
    return path


FIGURES: dict[str, Callable[..., Path]] = {
    "spectrum": spectrum_figure,
    "heights": heights_figure,
    "harmonics": harmonics_figure,
    "along": along_figure,
    "groups": groups_figure,
    "reflection": reflection_figure,
    "speed": speed_figure,
    "calibration": calibration_figure,
}


def result_figure(result: Result, path: Path) -> Path:
    """Draw the figure of an analysis; return ``path``."""
    return FIGURES[result.figure](path=path, **result.arguments)
