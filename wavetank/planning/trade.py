"""The error and the cost of a case over the size of its cells, measured by runs on larger cells.

The error of the elevation is C h^q, with q of ``companion.py``. Two pilot runs, with cells 2.8 and 2 times as large as
those of the plan, give C by the difference of their records. Steps on cells of 2, 1 and 1/2 times the size are timed;
their cost is interpolated with powers of the size. The solves add ``SOLVES`` times the tolerance; a third pilot run
shows the error of the vertical order for a paddle whose shape has a kink. No theory of the waves is needed: the tank
may have a bed, and any initial state.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.errors import BreakdownError, InputError, RunError
from wavetank.base.mpi import from_first
from wavetank.case import BasinTank, Case, Numerics
from wavetank.integrators import INTEGRATORS
from wavetank.planning.companion import (
    LEAST_RATIO,
    CompanionCases,
    build_stable,
    grid_order,
    has_kinks,
    vertical_companion,
)
from wavetank.planning.refinement import refined_grid
from wavetank.planning.timing import time_steps
from wavetank.planning.uncertainty import AT_REST, FEWEST, LOW_WAVES, CompanionValues, Estimate, at_times
from wavetank.simulation.case_diagnostics import build_observers, surface_points
from wavetank.simulation.records import Memory, Records
from wavetank.tank.breaking import BreakingFilter

PILOTS = (2.8, 2.0), (2.0, 1.4), (1.0, 0.7)  # sizes of cells over those of the plan; later ones if earlier ones fail
TIMED = 2.0, 0.5  # sizes of cells of further timed steps; not the smaller ones in a basin
SOLVES = 6.0  # error by the solves over the tolerance: random cases over bars, tolerance 1e-5
KINK = 1 / 3  # error by the vertical order over the difference from an order less, for a shape with a kink
HALF = 0.5  # part of an error after a change of its setting
LEAST_FACTOR = 1.01  # least relative cost of such a change


class Pilot(NamedTuple):
    """A pilot run: its case, and rows of t [s] and elevations [m], on the first rank."""

    case: Case
    record: Vector


class Setting(NamedTuple):
    """A setting: its keys, the relative error it causes, and the relative cost of a run with half of this error."""

    name: str
    error: float
    factor: float


class Trade(NamedTuple):
    """Error and cost over the ratio of the cell size to that of the plan.

    Attributes
    ----------
    case, dt
        Case with planned numerics, and its time step [s].
    grid, rest
        Relative error of the elevation (largest rms of the gauges) by the grid at the ratio 1, and of its other parts.
    order
        q.
    pilots
        Ratios of the pilot runs.
    costs
        CPU time of complete runs [s] of each rank by the ratio of timed steps.
    settings
        Settings with their parts of the error.
    failed
        Cells of pilot runs that broke down, and the causes.
    """

    case: Case
    dt: float
    grid: float
    rest: float
    order: int
    pilots: tuple[float, float]
    costs: dict[float, float]
    settings: tuple[Setting, ...]
    failed: tuple[str, ...] = ()

    def error(self, ratio: float) -> float:
        """Return the relative error of the elevation: the largest root mean square of the gauges."""
        return float(np.hypot(self.grid * ratio**self.order, self.rest))

    def cost(self, ratio: float) -> float:
        """Return the CPU time of a run [s] of each rank."""
        return cost_at(self.costs, ratio)

    def ratio(self, error: float) -> float:
        """Return the ratio for an error; 0 if the other parts exceed it."""
        if error <= self.rest:
            return 0.0
        return float((np.sqrt(error**2 - self.rest**2) / self.grid) ** (1.0 / self.order))

    def numerics(self, ratio: float) -> Numerics:
        """Return the numerics for a ratio."""
        return refined_grid(self.case, self.dt, 1.0 / ratio)

    @property
    def best_setting(self) -> Setting:
        """The setting whose change decreases the error most for its cost, by powers of both."""
        total = sum(one.error**2 for one in self.settings)
        return min(
            self.settings,
            key=lambda one: (
                np.log(1.0 - (1.0 - HALF**2) * one.error**2 / total) / np.log(max(one.factor, LEAST_FACTOR))
            ),
        )


def cost_at(costs: dict[float, float], ratio: float) -> float:
    """Return the cost at a ratio, by powers between the costs of other ratios."""
    x, y = np.log(sorted(costs.items())).T
    slopes = np.diff(y) / np.diff(x)
    n = int(np.clip(np.searchsorted(x, np.log(ratio)) - 1, 0, slopes.size - 1))
    return float(np.exp(y[n] + slopes[n] * (np.log(ratio) - x[n])))


def measure_trade(case: Case, comm: MPI.Comm) -> Trade:
    """Return the trade of a planned case; collective.

    Raises ``InputError`` for a mesh file or a basin without gauges, ``RunError`` if the pilot runs break down.
    """
    if case.on_mesh_file:
        raise InputError(
            "the cells of a mesh file cannot be larger: `wavetank study --sweep order=...` measures errors"
        )
    basin = isinstance(case.tank, BasinTank)
    if basin and not case.all_gauges:
        raise InputError("the case needs a gauge, whose error is measured")
    _, _, clock, step, _, below = time_steps(case, comm)
    costs = {1.0: clock.steps * step + below}
    for other in (_resized(case, clock.dt, ratio) for ratio in (TIMED[:1] if basin else TIMED)):
        _, _, its, step, _, below = time_steps(other, comm)
        costs[other.cell_size / case.cell_size] = its.steps * step + below
    failed, why = list[str](), RunError("the pilot runs have the same cells")
    for ratios in PILOTS:
        coarse, fine = (_resized(case, clock.dt, ratio) for ratio in ratios)
        if coarse.cell_size < LEAST_RATIO * fine.cell_size:  # of a few cells
            continue
        cases = coarse, fine, *([vertical_companion(coarse)] if has_kinks(case) else [])
        try:
            pilots = [Pilot(one, pilot_record(one, comm)) for one in cases]
            return from_first(comm, partial(_trade, case, clock.dt, pilots, costs, tuple(failed)))
        except RunError as error:  # a wave breaks
            why = error
            failed.append(f"{coarse.cell_size:.3g} or {fine.cell_size:.3g} m: {error}")
    raise why


def _resized(case: Case, dt: float, ratio: float) -> Case:
    """Return a planned case with cells larger by a ratio, and a step as stable as dt [s]."""
    return case.model_copy(update={"numerics": refined_grid(case, dt, 1.0 / ratio)})


def pilot_record(case: Case, comm: MPI.Comm) -> Vector:
    """Return rows of t [s] and the elevations [m] at the gauges, or along the tank, on the first rank; collective.

    Raises ``RunError`` if the run breaks down.
    """
    record = Memory()
    output = case.output.model_copy(update={"gauges_every": 1, "energy_every": 1})
    case = case.model_copy(update={"probes": (), "windows": (), "loads": (), "output": output})
    run, waves = build_stable(case, comm)
    if case.all_gauges:
        run.diagnostics += build_observers(case, waves, Records(record, Memory(), None), sinks=run.sinks)
    else:
        along = case.numerics.model_copy(update={"accuracy_of": "surface"})
        run.diagnostics += surface_points(case.model_copy(update={"numerics": along}), waves, record)
    run.execute()
    if broken := [one.watch.first for one in run.filters if isinstance(one, BreakingFilter) and one.watch.alarms]:
        raise BreakdownError(f"{broken[0]}: a wave breaks")
    return record.array()


def _trade(
    case: Case, dt: float, pilots: Sequence[Pilot], costs: dict[float, float], failed: tuple[str, ...] = ()
) -> Trade:
    coarse, fine, *lower = pilots
    scheme = INTEGRATORS[case.numerics.integrator]()
    if min(len(one.record) for one in pilots) < FEWEST:
        raise InputError(f"a pilot run has fewer than {FEWEST} steps: a longer duration is needed")
    if np.std(fine.record[:, 1:], axis=0).max() < AT_REST:
        raise InputError("the water is at rest at the gauges")
    differences = _relative(fine.record, coarse.record)
    worst, order = int(np.argmax(differences)), min(grid_order(case.numerics.order), scheme.order)
    larger, smaller = (pilot.case.cell_size / case.cell_size for pilot in (coarse, fine))
    grid = float(differences[worst]) / (larger**order - smaller**order)
    t, values = fine.record[:, 0], fine.record[:, 1 + worst]
    parts = Estimate.of(fine.case, CompanionCases(coarse.case, None), dt).series(t, values, CompanionValues(values))
    time_step, vertical = (
        float(np.sqrt(np.mean(one**2) / 2.0) / np.std(values)) for one in (parts.time_step, parts.parameters)
    )
    if lower:
        vertical = KINK * float(_relative(coarse.record, lower[0].record).max())
    n, tolerance = case.numerics.vertical_order, case.numerics.tolerance
    solves = SOLVES * tolerance
    settings = (
        Setting("cells, with dt", grid, cost_at(costs, HALF ** (1.0 / order)) / cost_at(costs, 1.0)),
        Setting("dt", time_step, HALF ** (-1.0 / scheme.order)),
        Setting("vertical_order", vertical, HALF**-0.5 if lower else (n + 2.0) / (n + 1.0)),
        Setting("tolerance", solves, 1.0 + np.log(HALF) / np.log(tolerance)),
    )
    rest = float(np.hypot(solves, vertical))
    return Trade(case, dt, grid, rest, order, (larger, smaller), costs, settings, failed)


def _relative(record: Vector, other: Vector) -> Vector:
    """Return the difference of each gauge, rms over rms, of rows of t and elevations; 0 for low waves."""
    common = record[record[:, 0] <= other[-1, 0]]
    off = common[:, 1:] - at_times(common[:, 0], other[:, 0], other[:, 1:])
    size = np.std(common[:, 1:], axis=0)
    return np.asarray(np.sqrt(np.mean(off**2, axis=0)) / np.where(size >= LOW_WAVES * size.max(), size, np.inf))
