"""The last lines of a run: what has come out, how true it is, what it has cost, where it is, and what to do next."""

import shlex
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

from wavetank.output.directory import BROKEN, BROKEN_PICTURE, CHECKPOINT
from wavetank.output.files import summarise_warnings
from wavetank.simulation.crest import Crest, HighestCrest
from wavetank.simulation.energy import EnergyBudget
from wavetank.simulation.run import Run
from wavetank.simulation.stability import StabilityWatch
from wavetank.tank.breaking import ONSET
from wavetank.tank.linear_waves import LinearWaves

ANEW = "anew from the start, as the case has to be another"


class Outcome(NamedTuple):
    """What the observers of a run know when it ends.

    Attributes
    ----------
    crest
        The highest.
    mass, energy
        By how much the water's mass changed, and the energy balance was off, of what there was [-].
    untrue
        From when on short waves grew that are none of the water's [s]; None: never.
    follows
        Whether the mass is that beyond the rest position of paddles, whom it follows: of linear waves.
    """

    crest: Crest
    mass: float
    energy: float
    untrue: float | None = None
    follows: bool = False

    @classmethod
    def of(cls, run: Run) -> "Outcome":
        """Return what a run's observers know; collective."""
        budget = next(one for one in run.observers if isinstance(one, EnergyBudget))
        crest = next(one for one in run.observers if isinstance(one, HighestCrest))
        untrue = next((one.since for one in run.observers if isinstance(one, StabilityWatch)), None)
        waves = run.system
        follows = isinstance(waves, LinearWaves) and bool(waves.wall.paddles)
        return cls(crest.highest(), budget.mass_error, budget.energy_error, untrue, follows)

    @property
    def figures(self) -> dict[str, Any]:
        """The same for a manifest; nothing of a run that nobody has looked at, or that has left the numbers."""
        if not all(map(isfinite, (*self.crest, self.mass, self.energy))):
            return {}
        return {"highest_crest": self.crest._asdict(), "errors": {"mass": self.mass, "energy_balance": self.energy}}


def closing(
    outcome: Outcome, spent: dict[str, Any], *, warnings: Sequence[str], path: Path, flat: bool, drawn: bool = True
) -> list[str]:
    """Return the lines.

    Parameters
    ----------
    outcome
        What has come out.
    spent
        What the manifest says of the scene, ranks, time, steps, solves and costs.
    warnings
        The worst first.
    path
        The run directory.
    flat
        Whether the tank has no width.
    drawn
        Whether there are to be pictures.
    """
    crest, timings, steps = outcome.crest, spent["timings"], spent["numerics"]["steps_taken"]
    x, y = (f"{round(one, 6) + 0.0:.4g} m" for one in (crest.x, crest.y))  # nobody asks for less than a micrometre
    place = f"x = {x}" if flat else f"x = {x}, y = {y}"
    simulated = spent["t"]
    follows = " (linear theory: what paddles displace)" if outcome.follows else ""
    costs = [
        f"{timings['stepping_cpu_s']:.3g} CPU s on {_ranks(spent)}",
        f"{steps} steps",
        f"{spent['counters']['interior_solves'] / max(steps, 1):.1f} interior solves a step",
        f"{timings['stepping_s'] / simulated if simulated else 0.0:.2g} s for a second of waves",
    ]
    directory, warned = shlex.quote(str(path)), summarise_warnings(warnings)
    broken = _of_breakdown(spent, path, untrue=outcome.untrue, drawn=drawn)
    return [
        f"highest crest: {crest.height:.4g} m, at the node {place}, t = {crest.t:.4g} s",
        f"errors: {outcome.mass:.1g} of the mass{follows}, {outcome.energy:.1g} of the energy; {warned}",
        f"cost: {', '.join(costs)}",
        f"records: {path}",
        *(broken or [f"next: {'; '.join(_next(spent, directory))}"]),
    ]


def _next(spent: dict[str, Any], directory: str) -> list[str]:
    """Return what serves next: a run that was stopped may go on, unless only another case gets farther."""
    if spent.get("anew"):
        return [ANEW]
    if spent["t"] < (1 - 1e-9) * spent["scene"]["run"]["duration"]:
        once = ", once it can be written there again" if spent.get("unwritten") else ""
        if not spent["checkpoints"]:
            return [f"anew from the start{once}: there is no checkpoint"]
        return [f"wavetank resume {directory}{once}"]
    return [f"wavetank view {directory}", f"wavetank compare {directory} --with DATA"]


def _of_breakdown(spent: dict[str, Any], path: Path, *, untrue: float | None, drawn: bool) -> list[str]:
    """Return where the state is that a run broke down from, and where it may go on; nothing of another run."""
    if "broke_down" not in spent:
        return []
    kept, crests = spent["checkpoints"], spent["broke_down"]["crests"]
    dissipates = spent["scene"]["run"].get("on_breaking") == "dissipate"
    breaks = not dissipates and any(crest["speed_ratio"] > ONSET for crest in crests)
    half = "" if breaks else f"numerics.dt={0.5 * spent['numerics']['dt']:.3g}"
    other = " --set ".join(filter(None, ["run.on_breaking=dissipate" if breaks else "", spent.get("cure") or half]))
    files = ", ".join(str(path / file) for file in (BROKEN, *([BROKEN_PICTURE] if drawn else [])))
    lines = [f"the surface it broke down from, t = {spent['t']:.6g} s: {files}"]
    sound = [t for t in kept if untrue is None or t < untrue]
    good = "good " if kept[:1] == sound[:1] else ""
    if kept:
        before = "".join(f"; the one before, t = {t:.6g} s: --at {t:.6g}" for t in kept[1:])
        lines.append(f"the last {good}checkpoint, t = {kept[0]:.6g} s: {path / CHECKPOINT}{before}")
    if spent.get("anew"):
        return [*lines, f"next: {ANEW}"]
    if not sound:
        none = "no checkpoint is older than the warning" if kept else "there is no checkpoint"
        return [*lines, f"next: anew from the start with --set {other}: {none}"]
    at = "" if good else f" --at {sound[0]:.6g}"
    return [*lines, f"next: wavetank resume {shlex.quote(str(path))}{at} --set {other}"]


def _ranks(spent: dict[str, Any]) -> str:
    """Return on how many ranks a run has been, in each of its parts."""
    *others, last = dict.fromkeys([part["ranks"] for part in spent["parts"]])
    return f"{', '.join(map(str, others))}{' and ' if others else ''}{last} {'ranks' if others or last > 1 else 'rank'}"
