"""What probes have recorded: velocity, acceleration and pressure against time, a row a probe."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from wavetank.postprocess.style import BLUE, GREEN, VERMILION, picture
from wavetank.records.directory import RunDirectory

COLOURS = {"x": BLUE, "y": GREEN, "z": VERMILION}
PANELS = 8  # probes; of more every second, third ... is drawn
KILO = 1e3  # Pa


def probes_figure(run: RunDirectory, path: Path) -> Path:
    """Draw a run's probes, gaps where they are dry; return ``path``. Raises ``InputError`` where there are none."""
    probes = run.probes
    shown = probes.isel(probe=slice(None, None, -(-probes.sizes["probe"] // PANELS)))
    rows, tank = shown.sizes["probe"], run.manifest.get("scene", {}).get("tank", {})
    weight = tank.get("density", 1000.0) * tank.get("gravity", 9.81)
    with picture(path, 13, 1.4 + 1.7 * rows) as figure:
        axes = figure.subplots(rows, 3, sharex=True, sharey="col", squeeze=False)
        for n, panels in enumerate(axes):
            _draw_probe(panels, shown.isel(probe=n), weight=weight)
        heads = ("velocity [m/s]", "acceleration of the water there [m/s²]", "pressure above still water's [kPa]")
        for panel, head in zip(axes[0], heads, strict=True):
            panel.annotate(head, (0.5, 1.25), xycoords="axes fraction", ha="center", fontsize=11)
        for panel in axes[-1]:
            panel.set_xlabel("time [s]")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper right", ncols=len(labels))
        figure.suptitle(f"{run.title}: probes".lstrip(": "), fontsize=13, parse_math=False)
    return path


def _draw_probe(panels: Any, probe: Any, *, weight: float) -> None:
    """Draw what one probe has recorded in its three panels, of water of that weight [N/m³]."""
    place = ", ".join(f"{axis} = {float(probe[axis]):g} m" for axis in "xyz" if axis != "y" or float(probe.y))
    velocity, acceleration, pressure = panels
    for axis, colour in COLOURS.items():
        for panel, name in ((velocity, f"velocity_{axis}"), (acceleration, f"acceleration_{axis}")):
            if name in probe:
                _draw(panel, probe.time, probe[name], label=f"along {axis}", color=colour)
    still = weight * np.maximum(0.0, -probe.z)
    _draw(pressure, probe.time, (probe.pressure - still) / KILO, color=BLUE)
    velocity.set_title(f"probe {probe.probe.item()}, {place}", pad=2, parse_math=False)


def _draw(panel: Axes, t: Any, values: Any, **look: Any) -> None:
    panel.plot(t, values, **look)
    panel.axhline(0.0, color="#888888", lw=0.6, zorder=0)
    panel.margins(x=0)
