"""The reference that a study makes for itself: its finest combination, refined once more.

dt/2, twice the cells (order p + 1 if they are those of a mesh file), n + 2, a tenth of the tolerance. It keeps its
gauges at every step and snapshots at the steps of the finest combination, so that they can be interpolated in time.
"""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from wavetank.case import BasinTank, Scene
from wavetank.case.numerics import HIGHEST_ORDER, HIGHEST_VERTICAL_ORDER
from wavetank.case.reading import read_case
from wavetank.integrators import INTEGRATORS
from wavetank.mesh import MeshFile
from wavetank.studies.sweep import Combination

TIGHTEST = 1e-12  # tolerance; round-off is near
MOST_SNAPSHOTS = 2000


def same_but_numerics(combinations: Iterable[Combination]) -> list[list[Combination]]:
    """Return combinations in groups of scenes that differ in nothing but numerics: a group has one reference."""
    groups: dict[str, list[Combination]] = {}
    for one in combinations:
        groups.setdefault(one.scene.model_dump_json(exclude={"numerics", "output"}), []).append(one)
    return list(groups.values())


def finest(group: Iterable[Combination]) -> Combination:
    """Return the combination with the smallest step, the most cells, the highest orders and the tightest tolerance."""
    return min(group, key=lambda one: _coarseness(one.scene))


def _coarseness(scene: Scene) -> tuple[float, ...]:
    numerics = scene.numerics
    order = INTEGRATORS[numerics.integrator].order
    return (numerics.dt or 0.0, scene.cell_size, -numerics.order, -numerics.vertical_order, -order, numerics.tolerance)


def refined(case: Path, coarse: Combination, *, dt: float, name: str) -> Combination:
    """Return a combination refined once more, given its step [s], which the case may leave open."""
    scene, numerics = coarse.scene, coarse.scene.numerics
    if isinstance(scene.tank, BasinTank) and isinstance(scene.tank.layout, MeshFile):
        cells = f"order={min(numerics.order + 1, HIGHEST_ORDER)}"
    else:
        by_size = numerics.cells is None
        cells = f"cell_size={scene.cell_size / 2!r}" if by_size else f"cells={2 * scene.cells}"
    changes = (
        f"numerics.dt={dt / 2!r}",
        f"numerics.{cells}",
        f"numerics.vertical_order={min(numerics.vertical_order + 2, HIGHEST_VERTICAL_ORDER)}",
        f"numerics.tolerance={min(numerics.tolerance, max(numerics.tolerance / 10, TIGHTEST))!r}",
        f"output.surface_every={max(dt, scene.run.duration / MOST_SNAPSHOTS)!r}",
        "output.gauges_every=1",
    )
    overrides = (*coarse.overrides, *changes)
    return replace(coarse, name=name, overrides=overrides, scene=read_case(case, overrides))
