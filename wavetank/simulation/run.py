"""The time loop of all runs, and the states that a restart restores."""

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from wavetank.base.arrays import Vector
from wavetank.base.errors import RunError, locate
from wavetank.base.state import StateTree, check_like, has_state, hints_of, named, plain, restore, restore_all, typed
from wavetank.integrators.contract import HamiltonianSystem, Integrator, State
from wavetank.integrators.wrappers import Filter, Filtered
from wavetank.simulation.clock import Clock
from wavetank.simulation.contract import Diagnostic, due_steps
from wavetank.simulation.energy import EnergyBudget, EnergyTotals
from wavetank.simulation.stability import StabilityWatch
from wavetank.simulation.supply import PaddleWork
from wavetank.tank.block import Block, Parts, write_sums
from wavetank.tank.breaking import BasinBreakingWatch
from wavetank.tank.dissipation import Smoothing
from wavetank.tank.waves import Solves

LONGEST, FEW, NUMBERS = 256, 16, 5e4  # largest and smallest number of steps of a block; its values that fit into caches
SECONDS = 0.5  # computing time of a block
SURVIVING = (  # parts whose states survive a change of numerics, or a failed step, which changes the history of solves
    "paddle",  # with feedback, also in "paddle work"
    "Breaking",
    "EnergyBudget",
    "HighestCrest",
    "PaddleLimits",
    "Probes",
    "StabilityWatch",
    "SurfaceSnapshots",
)
MAY_BE_NEW = ("Probes", "water")  # in a resumed run: probes and other diagnostics below the surface


class Rows:
    """The current block: a row for each reported state.

    Parameters
    ----------
    system
        System of the states; for waves the rows contain also energies, elevation and kinematics.
    size
        Number of degrees of freedom of this rank.
    most
        Largest number of rows.
    sinks
        Filters that dissipate.
    work
        Work of paddles with feedback.
    """

    def __init__(
        self, system: Any, size: int, most: int, *, sinks: Sequence[Smoothing] = (), work: PaddleWork | None = None
    ):
        self._system, self._sinks, self._work, self._waves = system, sinks, work, hasattr(system, "write_row")
        wall = {}
        if self._waves:
            wall = {"paddles": len(system.wall.rates), "velocities": system.wall.velocities.size}
        self._block = Block.empty(most, owned=size, sinks=len(sinks), **wall)
        self._count = 0
        self._parts = list[Parts]()

    def write(self, state: Any, step: int, t: float) -> None:
        """Write the row of a state; collective."""
        block, row = self._block, self._count
        block.step[row], block.t[row] = step, t
        if self._work is not None:
            block.work[row] = self._work.advance(state, t)
        if self._waves:
            self._parts.append(self._system.write_row(state, t, block, row))
        else:
            block.q[row], block.psi[row] = state.q, state.p
        if self._sinks:
            block.dissipated[row] = [sink.energy_taken for sink in self._sinks]
        self._count += 1

    def take(self, state: Any, dt: float) -> Block | None:
        """Return the block of all rows, with the state of the last row, and begin a new one; None without rows.

        Collective.
        """
        count, parts = self._count, self._parts
        self._count, self._parts = 0, []
        if not count:
            return None
        if parts:
            write_sums(self._system.plane.comm, self._block.at(slice(count)), parts)
        return self._block.read_only(count, dt=dt, state=state)


class Pace:
    """The number of steps of the next block, from the time of the last one; the same on all ranks.

    Parameters
    ----------
    most
        Largest number of steps.
    """

    def __init__(self, comm: MPI.Comm, most: int):
        self._comm, self._most = comm, most
        self._steps, self._start_time = 0, time.monotonic()

    def next(self) -> int:
        """Return the number of steps that take ``SECONDS``, at most twice that of the last block; collective."""
        now = time.monotonic()
        enough = SECONDS * self._steps / max(now - self._start_time, 1e-9)
        steps = max(1, min(self._most, 2 * self._steps, int(enough)))
        self._steps, self._start_time = (steps if self._comm.size == 1 else self._comm.bcast(steps)), now
        return self._steps


class Run:
    """A system, a scheme and diagnostics of their states.

    Parameters
    ----------
    clock
        Times of the steps.
    start
        Coordinates and momenta at the beginning.
    filters
        Filters of the state between steps.

    Attributes
    ----------
    longest_block
        Largest number of steps of a block.
    controls
        Called with each block that all diagnostics have recorded; they may write a checkpoint or end the run.
    paddle_work
        Work of paddles with feedback, or None.
    recorded
        Whether all diagnostics have recorded the current step, and no control has failed there.
    """

    def __init__(
        self,
        system: HamiltonianSystem,
        integrator: Integrator[Any],
        diagnostics: Sequence[Diagnostic],
        *,
        start: tuple[Vector, Vector],
        clock: Clock,
        filters: Sequence[Filter] = (),
    ):
        self.system, self.integrator, self.diagnostics = system, integrator, list(diagnostics)
        self.controls = list[Callable[[Block], None]]()
        self.clock, self.longest_block = clock, LONGEST
        self.paddle_work: PaddleWork | None = None
        self._stepper = Filtered(integrator, filters)
        self.step = clock.first
        self.state = integrator.start(*start)
        self.recorded = False
        self._start_recorded = False  # whether the start has been recorded
        self._rows: Rows | None = None

    @property
    def t(self) -> float:
        """Current time [s]."""
        return self.clock.time(self.step)

    @property
    def filters(self) -> Sequence[Filter]:
        """Filters of the state between steps."""
        return self._stepper.filters

    @property
    def sinks(self) -> list[Smoothing]:
        """Filters that dissipate energy and record it."""
        return [one for one in self.filters if isinstance(one, Smoothing)]

    def execute(self) -> None:
        """Advance to the end; collective.

        Raises ``RunError`` if the run breaks down; all previous steps are recorded.
        """
        plane = getattr(self.system, "plane", None)
        comm = MPI.COMM_SELF if plane is None else plane.comm
        size = self.system.inner(*[np.ones_like(self.state.q)] * 2)
        most = max(1, min(self.longest_block, max(FEW, int(NUMBERS / size))))
        self._rows = Rows(self.system, self.state.q.size, most, sinks=self.sinks, work=self.paddle_work)
        pace, window = Pace(comm, most), -1
        if not self._start_recorded:
            self._start_recorded, self.state = True, self.state.evaluated(self.system, self.t)
            if self.diagnostics:
                self._rows.write(self.state, self.step, self.t)
            self._end_block()
        while self.step < self.clock.steps:
            try:
                if window != self.step // LONGEST:
                    window = self.step // LONGEST
                    self._tabulate(window)
                steps = min(pace.next(), LONGEST - self.step % LONGEST, self.clock.steps - self.step)
                times = self.clock.time(np.arange(self.step, self.step + steps + 1, dtype=np.float64))
                for t, after in itertools.pairwise(map(float, times)):
                    self.advance(t, after)
            except RunError:
                self.flush()
                raise
            self._end_block()

    def _tabulate(self, window: int) -> None:
        """Evaluate the motions of paddles at all times of a window of ``LONGEST`` steps, given its number.

        Windows do not depend on the step at which a run is resumed, so that results are equal bit for bit.
        """
        tabulate, clock = getattr(self.system, "tabulate", None), self.clock
        if tabulate is not None:
            steps = LONGEST * window + np.arange(LONGEST + 1, dtype=np.float64)
            starts = clock.time(steps)
            tabulate(np.unique([starts + c * clock.dt for c in (0.0, *self.integrator.nodes)]))

    def _end_block(self) -> None:
        block = self.flush()
        if block is not None:
            self.recorded = False
            for control in self.controls:
                control(block)
            self.recorded = True

    def advance(self, t: float, after: float) -> None:
        """Take one step, from t to ``after`` [s]; collective."""
        self.state = self._stepper.step(self.system, self.state, t, self.clock.dt)
        self.step += 1
        self.recorded = False
        if self._rows is not None and self.diagnostics:
            self._rows.write(self.state, self.step, after)

    def flush(self) -> Block | None:
        """Pass the current block to the diagnostics, and return it; raises the first error in time; collective."""
        block = self._rows.take(self.state, self.clock.dt) if self._rows else None
        if block is None:
            return None
        failure: RunError | None = None
        for diagnostic in self.diagnostics:
            due = due_steps(diagnostic.schedule, block)
            try:
                if len(due):
                    diagnostic.record(due)
            except RunError as error:
                failure = error if failure is None or error.t < failure.t else failure
                block = block.until(failure.t)
            except Exception as error:
                locate(error, f"the observer {type(diagnostic).__name__}")
                raise
        if failure is not None:
            if block.step[-1] < self.step:  # the run has ended before the current step
                self.step, self.state = int(block.step[-1]), self.integrator.start(block.q[-1], block.psi[-1])
            raise failure
        self.recorded = True
        return block

    @property
    def parts(self) -> dict[str, Any]:
        """Objects whose state belongs to the run, by name, in the order of their restoration.

        Paddles with feedback are first: the state of the water depends on their positions.
        """
        schemes: list[Any] = [self.integrator]
        while (inner := getattr(schemes[-1], "scheme", None)) is not None:
            schemes.append(inner)
        own = {"scheme": schemes[-1], "system": Solves(self.system, getattr(self.system, "history", None))}
        own["paddle work"] = self.paddle_work
        for scheme in schemes:
            own = {f"paddle {n}": one for n, one in enumerate(getattr(scheme, "paddles", ()))} | own
            own["damping"] = getattr(scheme, "damping", None)
        parts = {name: part for name, part in own.items() if has_state(part)}
        for diagnostic in self.diagnostics:
            if has_state(getattr(diagnostic, "water", None)):
                parts["water below"] = diagnostic.water  # type: ignore[attr-defined]
        inner_diagnostics = (getattr(one, "diagnostics", ()) for one in self.diagnostics)
        return parts | named(itertools.chain(self.filters, self.diagnostics, *inner_diagnostics))

    def tree(self, *, with_solves: bool = True) -> StateTree:
        """Return the state of the run as a plain tree; collective.

        Without solves the tree has only states that survive a change of numerics. Raises ``TypeError`` for a state of
        the scheme that is not a dataclass.
        """
        return self.snapshot(with_solves=with_solves)()

    def snapshot(self, *, with_solves: bool = False) -> Callable[[], StateTree]:
        """Return a function that returns the current state as such a tree, also later; collective.

        States are values, so that the conversion can wait.
        """
        parts = {name: part for name, part in self.parts.items() if with_solves or survives(name)}
        now = {"step": self.step, "begun": self._start_recorded, "state": self.state}
        states = {name: part.state for name, part in parts.items()}
        return lambda: plain({**now, "parts": states})

    def resume(self, tree: StateTree, *, with_solves: bool = True) -> None:
        """Continue, at the next ``execute``, an equal run from its state; collective.

        Raises ``ValueError`` for an invalid tree, and ``InputError`` for a tree of other diagnostics.
        """
        self.step, self._start_recorded = typed(int, tree["step"], "step"), typed(bool, tree["begun"], "begun")
        self.state = _scheme_state(self.state, tree["state"], self.system.evaluation_type)
        if with_solves:
            restore_all(self.parts, tree["parts"], may_be_new=MAY_BE_NEW)
        else:
            restore_surviving(self.parts, tree["parts"])

    def change_numerics(self, tree: StateTree) -> None:
        """Continue, at the next ``execute``, from the end of a run with other numerics, as the start; collective."""
        self._start_recorded = True
        restore_surviving(self.parts, tree["parts"], renewed=True)


def _scheme_state(example: State, tree: StateTree, kind: type[Any]) -> State:
    """Return a state of the type of an example from its tree; raises ``ValueError`` for other types or shapes.

    Fields of type ``Any`` are None or an evaluation of the class ``kind``.
    """
    hints = {name: kind | None if hint is Any else hint for name, hint in hints_of(type(example)).items()}
    values = {name: typed(hint, tree[name], f"state.{name}") for name, hint in hints.items()}
    state, n = type(example)(**values), example.q.size
    check_like(example, state, "state")
    for one in values.values():
        if isinstance(one, kind):
            shapes = np.shape(one.z), np.shape(one.flow), np.shape(getattr(one, "eta", example.q))
            if shapes != ((2, n), (2, n), (n,)):
                raise ValueError("an evaluation of the state has another shape")
    return state


def survives(name: str) -> bool:
    """Return whether the state of a part of a run survives a change of numerics."""
    return name.partition(" ")[0] in SURVIVING


def restore_surviving(parts: Mapping[str, Any], trees: Mapping[str, Any], *, renewed: bool = False) -> None:
    """Restore the states that survive; collective.

    A stability watch retains the time since which the run is inaccurate. An energy budget retains its totals, with the
    energy that earlier filters and sponges dissipated. A search for breaking crests in a basin drops the surface of
    another mesh, and paddles with feedback drop the times of the preconditioner.

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
