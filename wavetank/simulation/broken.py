"""The surface of a state from which a run could not go on: where it is steep, and how fast its water moves."""

from typing import Any, NamedTuple

import numpy as np

from wavetank.arrays import Vector
from wavetank.errors import RunError
from wavetank.simulation.run import Run
from wavetank.tank.breaking import BreakingAlarm, BreakingDissipation
from wavetank.tank.crests import SteepCrest
from wavetank.tank.surface_flow import SurfaceFlow
from wavetank.tank.waves import NonlinearWaves

PLACES, VALUES = ("x [m]", "y [m]"), ("elevation [m]", "slope [-]", "velocity [m/s]")


class BrokenSurface(NamedTuple):
    """A surface that was computed last.

    Attributes
    ----------
    t
        The time [s].
    columns
        Places and values there by their names with units, shape (N,) each: along a slice or ring between the nodes,
        too; of a basin the highest elevation, the largest slope and velocity in each cell, at its middle.
    crests
        The steep ones, along a slice or ring where breaking is looked for.
    """

    t: float
    columns: dict[str, Vector]
    crests: list[SteepCrest]

    @classmethod
    def of(cls, run: Run, waves: NonlinearWaves) -> "BrokenSurface | None":
        """Return that of a run's state, the same on all ranks; None of one that has left the numbers; collective."""
        state, flow = run.state, waves.surface
        try:
            flow.update(state.q, state.p, run.t)
        except RunError:
            return None
        if isinstance(flow, SurfaceFlow):
            x, height, slope, psi_x = flow.profile
            values = x, height, np.abs(slope), np.abs(psi_x) / (1 + slope**2)
            columns = dict(zip((PLACES[0], *VALUES), values, strict=True))
        else:
            columns = _by_cell(waves)
        if not all(np.isfinite(column).all() for column in columns.values()):
            return None
        return cls(run.t, columns, _crests(run))

    @property
    def figures(self) -> dict[str, Any]:
        """What a manifest says of it: when, and where it is steepest; crests with B = u/c."""
        steepest = int(np.argmax(self.columns["slope [-]"]))
        there = {name.partition(" ")[0]: float(column[steepest]) for name, column in self.columns.items()}
        crests = [{"x": one.x, "height": one.height, "speed_ratio": one.overtaking} for one in self.crests]
        return {"broke_down": {"t": self.t, "steepest": there, "crests": crests}}


def _crests(run: Run) -> list[SteepCrest]:
    lookers = (one for one in run.filters if isinstance(one, BreakingAlarm | BreakingDissipation))
    return [crest for one in lookers for crest in one.watch.crests]


def _by_cell(waves: NonlinearWaves) -> dict[str, Vector]:
    """Return a row a cell, ordered by places; collective."""
    plane, flow = waves.plane, waves.surface
    dofs = plane.V.dofmap.list[: flow.speeds.size]
    eta = plane.function("elevation")
    eta.set(flow.elevation)
    places = plane.chart.places(plane.V.tabulate_dof_coordinates())
    x, y = waves.wall.to_physical(places, eta.rows[:, 0])[dofs].mean(axis=1).T
    own = np.column_stack([x, y, eta.rows[dofs, 0].max(axis=1), flow.slopes, flow.speeds])
    rows = np.concatenate(plane.comm.allgather(own))
    return dict(zip((*PLACES, *VALUES), rows[np.lexsort(rows.T[:2])].T, strict=True))
