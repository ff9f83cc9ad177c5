"""Pictures of a run: the surface, the gauges, the energy budget, and the comparison with measurements."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from numpy.typing import NDArray

from postprocess.compare import compare_gauge
from wavetank.rundir import RunDirectory, Surface
from wavetank.series import GaugeSeries

matplotlib.use("Agg")

from matplotlib import pyplot as plt  # noqa: E402  the backend first: there may be no display

STYLE = {
    "font.size": 10,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.constrained_layout.use": True,
    "savefig.dpi": 130,
}
MEASURED, COMPUTED, PUBLISHED = "#222222", "#0072b2", "#e69f00"  # distinct also to colour-blind eyes
WATER, BED = "#9ecae1", "#8c6d46"
SKY = "#f7fbff"
FOCUS = 4.0  # s shown on either side of the largest crest


def _save(figure: Any, path: Path) -> Path:
    figure.savefig(path)
    plt.close(figure)
    return path


# ---------------------------------------------------------------- the surface
def surface_figure(surface: Surface, path: Path, *, title: str = "", depth: float = 1.0) -> Path:
    """Draw the highest crest, the surface before and after it, and all snapshots in the (x, t) plane."""
    with plt.rc_context(STYLE):
        figure, (profile, diagram) = plt.subplots(2, 1, figsize=(10, 8), height_ratios=(1, 1.35), sharex=True)
        _draw_profile(profile, surface, depth)
        _draw_diagram(figure, diagram, surface)
        figure.suptitle(title or "Surface elevation", fontsize=13)
        return _save(figure, path)


def _draw_profile(axes: Any, surface: Surface, depth: float) -> None:
    crest = int(np.argmax(surface.eta.max(axis=1)))
    x, eta = surface.x[crest], 100 * surface.eta[crest]
    largest = max(float(np.abs(eta).max()), 1e-6)
    axes.set_facecolor(SKY)
    axes.fill_between(x, eta, -2.2 * largest, color=WATER, lw=0)
    for shift, alpha in ((-2, 0.35), (-1, 0.6), (1, 0.6), (2, 0.35)):
        other = crest + shift * max(1, len(surface.t) // 100)
        if 0 <= other < len(surface.t):
            style = "--" if shift < 0 else ":"
            label = f"t = {surface.t[other]:.2f} s"
            axes.plot(surface.x[other], 100 * surface.eta[other], style, color="#08519c", lw=1, alpha=alpha, label=label)
    axes.plot(x, eta, color="#08306b", lw=2, label=f"t = {surface.t[crest]:.2f} s, the highest crest")
    top = int(np.argmax(eta))
    axes.annotate(
        f"{eta[top]:.1f} cm at x = {x[top]:.2f} m",
        (x[top], eta[top]),
        xytext=(12, 6),
        textcoords="offset points",
        va="bottom",
    )
    axes.set(ylim=(-2.2 * largest, 2.1 * largest), ylabel="elevation [cm]", xlim=(float(surface.x.min()), float(x.max())))
    box = axes.get_position()
    scale = (x[-1] - x[0]) / (0.043 * largest) * (box.height * 8 / (box.width * 10))
    axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=8.5, title=f"vertical scale {scale:.0f} : 1")


def _draw_diagram(figure: Any, axes: Any, surface: Surface) -> None:
    largest = 100 * max(float(np.abs(surface.eta).max()), 1e-9)
    t = np.broadcast_to(surface.t[:, None], surface.x.shape)
    mesh = axes.pcolormesh(
        surface.x, t, 100 * surface.eta, cmap="RdBu_r", vmin=-largest, vmax=largest, shading="gouraud", rasterized=True
    )
    axes.grid(False)
    if np.ptp(surface.x[:, 0]) > 0:
        axes.plot(surface.x[:, 0], surface.t, color="black", lw=1.2, label="paddle")
        axes.legend(loc="upper left", frameon=False)
    axes.set(xlabel="distance from the paddle's rest position, x [m]", ylabel="time, t [s]")
    figure.colorbar(mesh, ax=axes, label="elevation [cm]", orientation="horizontal", fraction=0.05, aspect=60, pad=0.03)


# ---------------------------------------------------------------- gauges
def _grid(rows: int, columns: int, width: float) -> tuple[Any, NDArray[Any]]:
    ratios = (3, 1) if columns == 2 else (1,)
    figure, axes = plt.subplots(rows, columns, figsize=(width, 1.2 + 1.55 * rows), width_ratios=ratios, squeeze=False)
    return figure, axes


def gauges_overview(gauges: Sequence[GaugeSeries], path: Path, *, title: str = "") -> Path:
    """Draw every gauge's record."""
    with plt.rc_context(STYLE):
        figure, axes = _grid(len(gauges), 1, 9)
        for gauge, panel in zip(gauges, axes[:, 0], strict=True):
            panel.plot(gauge.t, 100 * gauge.eta, color=COMPUTED, lw=1)
            panel.set(ylabel="elevation [cm]", xlim=(gauge.t[0], gauge.t[-1]))
            panel.set_title(f"gauge {gauge.name}, x = {gauge.x:g} m", loc="left", fontsize=10)
        axes[-1, 0].set_xlabel("time [s]")
        figure.suptitle(title or "Wave gauges", fontsize=13)
        return _save(figure, path)


def gauges_figure(
    measured: Sequence[GaugeSeries], computed: Sequence[GaugeSeries], published: Sequence[GaugeSeries], path: Path
) -> Path:
    """Draw measured, computed and published records of the same gauges, whole and zoomed at the largest crest."""
    with plt.rc_context(STYLE):
        pairs = [(one, other) for one in measured for other in computed if abs(one.x - other.x) < 1e-3]
        figure, axes = _grid(len(pairs), 2, 13)
        for (one, other), (whole, zoom) in zip(pairs, axes, strict=True):
            records = [(one, MEASURED, 1.3), *((p, PUBLISHED, 1.0) for p in published if abs(p.x - one.x) < 1e-3)]
            _draw_gauge(whole, zoom, [*records, (other, COMPUTED, 1.0)])
            nrms = compare_gauge(other, one).nrms
            whole.set_title(f"gauge {one.name}, x = {one.x:g} m, nrms {nrms:.3f}", loc="left", fontsize=10)
        axes[0, 1].set_title("at the largest crest", loc="left", fontsize=10)
        for panel in axes[-1]:
            panel.set_xlabel("time [s]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=3, frameon=False)
        return _save(figure, path)


def _draw_gauge(whole: Any, zoom: Any, records: Sequence[tuple[GaugeSeries, str, float]]) -> None:
    reference = records[0][0]
    common = reference.t <= min(record.t[-1] for record, _, _ in records)
    focus = reference.t[common][int(np.argmax(reference.eta[common]))]
    for record, colour, width in records:
        for panel in (whole, zoom):
            panel.plot(record.t, 100 * record.eta, color=colour, lw=width, label=record.source)
    whole.set(ylabel="elevation [cm]", xlim=(reference.t[0], reference.t[common][-1]))
    zoom.set_xlim(focus - FOCUS, focus + FOCUS)
    near = [100 * r.eta[np.abs(r.t - focus) < FOCUS] for r, _, _ in records]
    reach = 1.15 * max(float(np.abs(part).max(initial=0.0)) for part in near)
    zoom.set_ylim(-reach, reach)


# ---------------------------------------------------------------- energy
def energy_figure(energy: dict[str, NDArray[np.float64]], path: Path, *, title: str = "") -> Path:
    """Draw the energy budget and, on an axis of its own, what does not balance."""
    columns = {name.split(" [")[0]: values for name, values in energy.items()}
    t, unit = columns["t"], "[m⁴/s²]"
    with plt.rc_context(STYLE):
        figure, (budget, rest) = plt.subplots(2, 1, figsize=(9, 6), height_ratios=(2, 1), sharex=True)
        start = columns["total"][0]
        rest_energy = columns["potential"].min() if start == 0 else 0.0
        for name, colour in (("kinetic", "#d55e00"), ("potential", "#009e73"), ("total", "#0072b2")):
            budget.plot(t, columns[name] - rest_energy, color=colour, lw=1.2, label=name)
        work = start + columns["paddle_work"]
        budget.plot(t, work - rest_energy, "--", color="black", lw=1, label="start + paddle work")
        budget.set(ylabel=f"energy {unit}")
        budget.legend(frameon=False, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
        rest.plot(t, columns["balance"], color="#0072b2", lw=1)
        rest.set(xlabel="time [s]", ylabel=f"total - start - work\n{unit}", xlim=(t[0], t[-1]))
        figure.suptitle(title or "Energy budget, per density and width", fontsize=13)
        return _save(figure, path)


# ---------------------------------------------------------------- all of a run
def draw_run(run: RunDirectory) -> list[Path]:
    """Draw the standard pictures of a run into its directory; return their paths."""
    depth = float(run.manifest["scene"]["tank"]["depth"])
    pictures = [surface_figure(run.surface(), run.path / "surface.png", title=run.title, depth=depth)]
    if gauges := run.gauges():
        pictures.append(gauges_overview(gauges, run.path / "gauges.png", title=run.title))
    pictures.append(energy_figure(run.energy(), run.path / "energy.png"))
    return pictures
