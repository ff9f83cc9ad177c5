"""Which states survive a change of numerics, or a step that has failed, which leaves memories of it in solves."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from wavetank.base.state import restore, typed
from wavetank.simulation.energy import EnergyBudget, EnergyTotals
from wavetank.simulation.stability import StabilityWatch
from wavetank.tank.breaking import BasinBreakingWatch

SURVIVING = (
    "paddle",  # with feedback, and the work of these
    "Breaking",
    "EnergyBudget",
    "HighestCrest",
    "PaddleLimits",
    "Probes",
    "StabilityWatch",
    "SurfaceSnapshots",
)
MAY_BE_NEW = ("Probes", "water")  # in a resumed run: probes and other diagnostics below the surface


def survives(name: str) -> bool:
    """Return whether the state of a part of a run survives a change of numerics."""
    return name.partition(" ")[0] in SURVIVING


def restore_surviving(parts: Mapping[str, Any], trees: Mapping[str, Any], *, renewed: bool = False) -> None:
    """Restore the states that survive; collective.

    A stability watch keeps since when the run is not to be trusted. An energy budget keeps its totals; what filters and
    the sponge took before stays dissipated, whatever dissipates now. A search for breaking crests in a basin
    forgets the surface of another mesh, and paddles with feedback the times of the preconditioner.

    Parameters
    ----------
    parts, trees
        Objects and states by their names, filters before diagnostics.
    renewed
        Whether the numerics have changed.
    """
    for name, part in parts.items():
        if name not in trees or not survives(name):
            continue
        tree = trees[name]
        if isinstance(part, StabilityWatch):
            part.state = replace(part.state, since=typed(float | None, tree["since"], f"{name}.since"))
        elif isinstance(part, EnergyBudget):
            part.change_numerics(typed(EnergyTotals, tree, name), renewed=renewed)
        elif name == "Breaking" and renewed and isinstance(part.watch, BasinBreakingWatch):
            restore(part, tree | {"watch": tree["watch"] | {"surface": None}}, name)
        elif "motion" in tree:
            restore(part, tree | {"motion": tree["motion"] | {"retained": {}}}, name)
        else:
            restore(part, tree, name)
