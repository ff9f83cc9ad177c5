"""What probes and loads have recorded against time, a row a probe or wall."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from wavetank.output.directory import RunDirectory
from wavetank.plots.style import BLUE, GREEN, VERMILION, picture

COLOURS = {"x": BLUE, "y": GREEN, "z": VERMILION}
PANELS = 8  # probes; of more every second, third ... is drawn
KILO = 1e3  # Pa, N, N m


def probes_figure(run: RunDirectory, path: Path) -> Path:
    """Draw a run's probes, gaps where they are dry; return ``path``. Raises ``InputError`` where there are none."""
    probes = run.probes
    shown = probes.isel(probe=slice(None, None, -(-probes.sizes["probe"] // PANELS)))
    rows, tank = shown.sizes["probe"], run.manifest.get("scene", {}).get("tank", {})
    weight = tank.get("density", 1000.0) * tank.get("gravity", 9.81)
    beyond = shown.pressure - weight * np.maximum(0.0, -shown.z)
    scale, kilo = _scale(beyond)
    with picture(path, 13, 1.1 + 1.6 * rows) as figure:
        axes = figure.subplots(rows, 3, sharex=True, sharey="col", squeeze=False)
        for n, (velocity, acceleration, pressure) in enumerate(axes):
            probe = shown.isel(probe=n)
            place = ", ".join(f"{axis} = {float(probe[axis]):g} m" for axis in "xyz" if axis != "y" or float(probe.y))
            velocity.set_title(f"probe {probe.probe.item()}, {place}", pad=2, parse_math=False)
            _draw_vector(velocity, probe, "velocity")
            _draw_vector(acceleration, probe, "acceleration")
            _draw(pressure, probe.time, beyond.isel(probe=n) / scale, color=BLUE)
        said = ("velocity [m/s]", "acceleration [m/s²]", f"pressure beyond still water's [{kilo}Pa]")
        for panel, what in zip(axes[0], said, strict=True):
            panel.set_title(what, loc="right", pad=2)
        _finish(figure, axes, f"{run.title}: probes".lstrip(": "))
    return path


def loads_figure(run: RunDirectory, path: Path) -> Path:
    """Draw forces and moments on a run's walls, less what they are at its start; return ``path``.

    Raises ``InputError`` where there are none.
    """
    loads = run.loads
    rows, beyond = loads.sizes["wall"], loads - loads.isel(time=0)
    scale, kilo = _scale(beyond[["force_x", "moment_y"]].to_array())
    units = {"force": loads.force_x.units, "moment": loads.moment_y.units}
    with picture(path, 11, 1.1 + 1.9 * rows) as figure:
        axes = figure.subplots(rows, 2, sharex=True, squeeze=False)
        for n, panels in enumerate(axes):
            for panel, name in zip(panels, units, strict=True):
                _draw_vector(panel, beyond.isel(wall=n) / scale, name)
            panels[0].set_title(str(loads.wall[n].item()), pad=2, parse_math=False)
        for panel, (name, unit) in zip(axes[0], units.items(), strict=True):
            panel.set_title(f"{name} beyond that at the start [{kilo}{unit}]", loc="right", pad=2)
        _finish(figure, axes, f"{run.title}: loads".lstrip(": "))
    return path


def _scale(values: Any) -> tuple[float, str]:
    """Return what values are shown over, and the prefix of their unit."""
    return (KILO, "k") if float(np.abs(values).max()) > KILO else (1.0, "")


def _draw_vector(panel: Axes, data: Any, name: str) -> None:
    """Draw the components of a vector that are there and are not all 0."""
    for axis, colour in COLOURS.items():
        if f"{name}_{axis}" in data and (values := data[f"{name}_{axis}"]).any():
            what = f"about {axis}" if name == "moment" else f"along {axis}"
            _draw(panel, data.time, values, label=what, color=colour)


def _draw(panel: Axes, t: Any, values: Any, **look: Any) -> None:
    panel.plot(t, values, **look)
    panel.axhline(0.0, color="#888888", lw=0.6, zorder=0)
    panel.margins(x=0)


def _finish(figure: Any, axes: Any, title: str) -> None:
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    each = (panel.get_legend_handles_labels() for panel in axes.flat)
    found = {label: handle for handles, labels in each for handle, label in zip(handles, labels, strict=True)}
    if found:
        figure.legend(found.values(), found.keys(), loc="outside upper right", ncols=len(found))
    figure.suptitle(title, fontsize=13, parse_math=False)
