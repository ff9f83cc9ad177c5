"""The standard pictures of a run, drawn into its directory."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from wavetank.analysis.still_water import still_water
from wavetank.case.tank import FormulaSponge
from wavetank.errors import InputError
from wavetank.output.directory import BROKEN, GAUGES, LOADS, PROBES, SURFACE, RunDirectory
from wavetank.output.fields import Surface, index_file
from wavetank.plots.broken_figure import broken_figure
from wavetank.plots.figures import energy_figure, gauges_overview, surface_figure
from wavetank.plots.in_water_figures import loads_figure, probes_figure
from wavetank.plots.style import DAMPED
from wavetank.plots.within_cells import within_cells


def draw_run(run: RunDirectory) -> list[Path]:
    """Draw the standard pictures of a run into its directory; return the paths of those drawn.

    What a run that was killed early did not come to record is left out, and so are a basin's maps where pyvista, which
    reads its surface, is not installed. Raises ``InputError`` for missing files.
    """
    gauges, energy = run.gauge_series(), run.budget()
    pictures = [broken_figure(run)] if (run.path / BROKEN).exists() else []
    if _snapshots(run) > 1:
        pictures.append(draw_surface(run))
    if any(gauge.t.size > 1 for gauge in gauges):
        pictures.append(gauges_overview(gauges, run.path / "gauges.png", title=run.title))
    pictures += _in_the_water(run)
    if all(column.size > 1 for column in energy.values()) and energy:
        pictures.append(
            energy_figure(energy, run.path / "energy.png", title=f"{run.title}: energy budget".lstrip(": "))
        )
    return pictures


def _in_the_water(run: RunDirectory) -> list[Path]:
    """Draw probes and loads, where there are rows of them; return the paths."""
    pictures = list[Path]()
    if (run.path / PROBES).exists() and run.probes.sizes["time"] > 1:
        pictures.append(probes_figure(run, run.path / "probes.png"))
    if (run.path / LOADS).exists() and run.loads.sizes["time"] > 1:
        pictures.append(loads_figure(run, run.path / "loads.png"))
    return pictures


def _snapshots(run: RunDirectory) -> int:
    """Return how many snapshots of the surface can be drawn."""
    if (run.path / SURFACE).exists():
        return int(run.snapshots().t.size)
    return len(run.fields("surface")) if index_file(run.path, "surface").exists() and find_spec("pyvista") else 0


PADDLE = "from the paddle's rest position"
ORIGINS = {"ring": "along the ring", "fixed": "from the wall", **dict.fromkeys(("piston", "flap", "profile"), PADDLE)}


def draw_surface(run: RunDirectory) -> Path:
    """Draw the surface as the run's scene asks for, ``surface.png``: a basin's from above, else over x and t.

    Return the picture's path; raises ``InputError`` for less than two snapshots.
    """
    scene, path = run.manifest.get("scene", {}), run.path / "surface.png"
    tank, wall = scene.get("tank", {}), scene.get("wall", {})
    if not (run.path / SURFACE).exists():
        from wavetank.plots.basin_figures import basin_figure

        return basin_figure(run, path)
    ring, surface = tank.get("type") == "ring", run.snapshots()
    if surface.t.size < 2:
        raise InputError(f"{path}: {surface.t.size} snapshots of the surface received; at least 2 are needed to draw.")
    origin = ORIGINS.get("ring" if ring else wall.get("type"), "along the tank")
    shown = _closed(surface, tank["length"]) if ring else surface
    numerics = (run.manifest.get("planned") or scene).get("numerics", {})
    shown = within_cells(shown, numerics.get("order", 1))
    depth = still_water(run) or tank.get("depth", np.inf)
    gauges, sponge = run.gauge_series() if (run.path / GAUGES).exists() else [], _sponge(scene, shown)
    return surface_figure(shown, path, title=run.title, depth=depth, origin=origin, gauges=gauges, sponge=sponge)


def _sponge(scene: dict[str, Any], surface: Surface) -> tuple[float, float] | None:
    """Return from where to where [m] a slice's sponge damps; None where there is none."""
    noun = scene.get("sponge")
    if noun is None:
        return None
    x = surface.x[0]
    if noun["type"] == "formula":
        rate = FormulaSponge.model_validate(noun).build()(x, 0 * x)
        inside = x[rate > DAMPED * rate.max(initial=0.0)]
        return (float(inside.min()), float(inside.max())) if inside.size else None
    return float(x[-1]) - noun["length"], float(x[-1])


def _closed(surface: Surface, length: float) -> Surface:
    """Return the surface of a ring [m] with its first point once more at the end."""
    x, eta, psi = (np.column_stack([field, field[:, 0]]) for field in (surface.x, surface.eta, surface.psi))
    x[:, -1] += length
    return Surface(surface.t, x, eta, psi)
